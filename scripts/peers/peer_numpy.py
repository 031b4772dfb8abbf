"""NumPy in double precision: the reference of the checks, and what whole-array Python costs."""

import numpy as np

import job


class Peer:
    def __init__(self, block):
        self.block = block
        free = ~block.held
        self.factor = job.DT * free / block.masses
        self.drift = job.DT * free[:, None] * np.array(job.GRAVITY)
        self.u = np.zeros_like(block.positions)
        self.v = block.velocities.copy()

    def forces(self):
        block = self.block
        f, cofactors, j = block.deformation(self.u)
        pressure = (job.LAMBDA + job.MU) * (j - 1.0) - job.MU
        stress = job.MU * f + pressure[:, None, None] * cofactors
        # Columns: forces on corners 1 to 3.
        h = -block.volumes[:, None, None] * (stress @ block.gradients.transpose(0, 2, 1))
        on_corners = np.concatenate([-h.sum(axis=2)[:, :, None], h], axis=2)
        nodes, count = block.tets.ravel(), len(self.u)
        return np.stack([np.bincount(nodes, on_corners[:, i].ravel(), count) for i in range(3)], axis=-1)

    def advance(self, steps):
        for _ in range(steps):
            self.v += self.factor[:, None] * self.forces() + self.drift
            self.v[self.block.held] = 0.0
            self.u += job.DT * self.v

    def state(self):
        return self.u, self.v


if __name__ == "__main__":
    block = job.Block(job.size_of_arguments())
    job.measure(
        block,
        Peer(block),
        name="numpy",
        version=np.__version__,
        variant="whole arrays, bincount",
        precision="f64",
        threads="one",
    )
