"""Warp on the processor: plain constant-strain tetrahedra.

Warp runs a kernel on the processor as one serial loop, so one core works and "atomic" additions are plain ones: adding
forces to the nodes is the faster variant. Storing them per element and gathering them took 1.4 times as long.
Optimisation level 3 instead of the default made no difference.
"""

import numpy as np
import warp as wp

import job

wp.config.log_level = wp.LOG_ERROR  # no word about a missing GPU
wp.set_module_options({"fast_math": True, "enable_backward": False})

MU = wp.constant(wp.float32(job.MU))
LAMBDA_MU = wp.constant(wp.float32(job.LAMBDA + job.MU))
DT = wp.constant(wp.float32(job.DT))
GRAVITY = wp.constant(wp.vec3(*job.GRAVITY))


@wp.kernel
def elements(
    u: wp.array(dtype=wp.vec3),
    tets: wp.array(dtype=wp.vec4i),
    all_gradients: wp.array(dtype=wp.mat33),
    volumes: wp.array(dtype=float),
    forces: wp.array(dtype=wp.vec3),
):
    e = wp.tid()
    tet = tets[e]
    gradients = all_gradients[e]
    u0 = u[tet[0]]
    edges = wp.matrix_from_cols(u[tet[1]] - u0, u[tet[2]] - u0, u[tet[3]] - u0)
    f = edges * gradients + wp.identity(n=3, dtype=float)
    a = wp.vec3(f[0, 0], f[1, 0], f[2, 0])
    b = wp.vec3(f[0, 1], f[1, 1], f[2, 1])
    c = wp.vec3(f[0, 2], f[1, 2], f[2, 2])
    bc, ca, ab = wp.cross(b, c), wp.cross(c, a), wp.cross(a, b)
    p = LAMBDA_MU * (wp.dot(a, bc) - 1.0) - MU
    stress = wp.matrix_from_cols(MU * a + p * bc, MU * b + p * ca, MU * c + p * ab)
    h = (stress * wp.transpose(gradients)) * (-volumes[e])
    h1 = wp.vec3(h[0, 0], h[1, 0], h[2, 0])
    h2 = wp.vec3(h[0, 1], h[1, 1], h[2, 1])
    h3 = wp.vec3(h[0, 2], h[1, 2], h[2, 2])
    wp.atomic_sub(forces, tet[0], h1 + h2 + h3)
    wp.atomic_add(forces, tet[1], h1)
    wp.atomic_add(forces, tet[2], h2)
    wp.atomic_add(forces, tet[3], h3)


@wp.kernel
def nodes(
    factors: wp.array(dtype=float),
    forces: wp.array(dtype=wp.vec3),
    u: wp.array(dtype=wp.vec3),
    v: wp.array(dtype=wp.vec3),
):
    n = wp.tid()
    factor = factors[n]
    if factor > 0.0:
        velocity = v[n] + factor * forces[n] + DT * GRAVITY
        v[n] = velocity
        u[n] = u[n] + DT * velocity
    forces[n] = wp.vec3()


class Peer:
    def __init__(self, block):
        count = len(block.positions)

        def array(values, dtype):
            return wp.array(values, dtype=dtype, device="cpu")

        self.u = wp.zeros(count, dtype=wp.vec3, device="cpu")
        self.v = array(block.velocities.astype(np.float32), wp.vec3)
        forces = wp.zeros(count, dtype=wp.vec3, device="cpu")
        tets = array(block.tets, wp.vec4i)
        gradients = array(block.gradients.astype(np.float32), wp.mat33)
        volumes = array(block.volumes.astype(np.float32), float)
        # Time step over mass, zero where a node is held.
        factors = array((job.DT * ~block.held / block.masses).astype(np.float32), float)
        # Recorded launches: their arguments are packed once.
        arguments = [self.u, tets, gradients, volumes, forces]
        self.elements = wp.launch(elements, len(block.tets), inputs=arguments, device="cpu", record_cmd=True)
        arguments = [factors, forces, self.u, self.v]
        self.nodes = wp.launch(nodes, count, inputs=arguments, device="cpu", record_cmd=True)

    def advance(self, steps):
        for _ in range(steps):
            self.elements.launch()
            self.nodes.launch()
        wp.synchronize()

    def state(self):
        return self.u.numpy(), self.v.numpy()


if __name__ == "__main__":
    block = job.Block(job.size_of_arguments())
    job.measure(
        block,
        Peer(block),
        name="warp, processor",
        version=wp.__version__,
        variant="forces added to the nodes",
        precision="f32",
        threads="one",
    )
