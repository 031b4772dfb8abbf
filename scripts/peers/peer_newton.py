"""Newton: a soft body of the same tetrahedra with SolverSemiImplicit (symplectic Euler, forces added atomically).

Its law is the neo-Hookean of Smith, de Goes and Kim (Stable Neo-Hookean Flesh Simulation, ACM Transactions on Graphics
37, 2018) without its damping. That paper says which parameters give which Lame moduli.

Particles and tetrahedra are added one by one: `add_soft_mesh` would add surface triangles as well, whose forces are
zero here but cost time. Particles without radius do not collide. Two steps are recorded as a graph and launched again
and again, as Newton's examples do; that saves about 8 % here.
"""

import newton
import numpy as np
import warp as wp

import job

MU = 4.0 / 3.0 * job.MU
LAMBDA = job.LAMBDA + 5.0 / 6.0 * job.MU


class Peer:
    def __init__(self, block):
        self.block = block
        builder = newton.ModelBuilder(gravity=job.GRAVITY)
        # A particle without mass is held.
        masses = np.where(block.held, 0.0, block.masses)
        count = len(masses)
        builder.add_particles(block.positions.tolist(), block.velocities.tolist(), masses.tolist(), [0.0] * count)
        for tet in block.tets.tolist():
            builder.add_tetrahedron(*tet, k_mu=MU, k_lambda=LAMBDA, k_damp=0.0)
        self.model = builder.finalize(device="cpu")
        self.solver = newton.solvers.SolverSemiImplicit(self.model, enable_tri_contact=False)
        self.now, self.next = self.model.state(), self.model.state()
        self.control = self.model.control()
        self.step_twice()  # kernels must be loaded before they are recorded
        self.now.assign(self.model.state())
        with wp.ScopedCapture(device="cpu") as capture:
            self.step_twice()
        self.graph = capture.graph

    def step_twice(self):
        for _ in range(2):
            self.now.clear_forces()
            self.solver.step(self.now, self.next, self.control, None, job.DT)
            self.now, self.next = self.next, self.now

    def advance(self, steps):
        if steps % 2 != 0:
            raise ValueError("the graph has two steps")
        for _ in range(steps // 2):
            wp.capture_launch(self.graph)
        wp.synchronize()

    def state(self):
        positions = self.now.particle_q.numpy().astype(np.float64)
        return positions - self.block.positions, self.now.particle_qd.numpy()


if __name__ == "__main__":
    wp.config.log_level = wp.LOG_ERROR  # no word about a missing GPU
    # Nothing is differentiated here.
    wp.config.enable_backward = False
    block = job.Block(job.size_of_arguments())
    job.measure(
        block,
        Peer(block),
        name="newton",
        version=f"{newton.__version__} on Warp {wp.__version__}",
        variant="SolverSemiImplicit, processor",
        precision="f32",
        threads="one",
    )
