"""Taichi: plain constant-strain tetrahedra, on the processor or on Vulkan (second argument).

Every element stores the forces on its four corners, every node gathers them. Adding them atomically to the nodes took
1.6 times as long on the processor (20 k tetrahedra) and about the same on llvmpipe. Structures of arrays instead of
arrays of structures, other block sizes and ten steps unrolled into one kernel made no difference or were slower.
"""

import sys

import numpy as np
import taichi as ti

import job

BACKEND = sys.argv[2] if len(sys.argv) > 2 else "cpu"
ti.init(arch=getattr(ti, BACKEND), default_fp=ti.f32, fast_math=True, offline_cache=False, log_level=ti.ERROR)
if ti.lang.impl.current_cfg().arch != getattr(ti, BACKEND):
    sys.exit(f"no backend {BACKEND}")  # Taichi falls back to the processor

MU, LAMBDA_MU, DT = job.MU, job.LAMBDA + job.MU, job.DT


@ti.data_oriented
class Peer:
    def __init__(self, block):
        nodes, tets = len(block.positions), len(block.tets)
        starts, places = block.corners_of_nodes()
        self.u = ti.Vector.field(3, ti.f32, shape=nodes)
        self.v = ti.Vector.field(3, ti.f32, shape=nodes)
        self.forces = ti.Vector.field(3, ti.f32, shape=4 * tets)
        self.tets = ti.Vector.field(4, ti.i32, shape=tets)
        self.gradients = ti.Matrix.field(3, 3, ti.f32, shape=tets)
        self.volumes = ti.field(ti.f32, shape=tets)
        # Time step over mass, zero where a node is held.
        self.factors = ti.field(ti.f32, shape=nodes)
        self.starts = ti.field(ti.i32, shape=nodes + 1)
        self.places = ti.field(ti.i32, shape=4 * tets)
        self.v.from_numpy(block.velocities.astype(np.float32))
        self.tets.from_numpy(block.tets)
        self.gradients.from_numpy(block.gradients.astype(np.float32))
        self.volumes.from_numpy(block.volumes.astype(np.float32))
        self.factors.from_numpy((DT * ~block.held / block.masses).astype(np.float32))
        self.starts.from_numpy(starts)
        self.places.from_numpy(places)

    @ti.kernel
    def elements(self):
        for e in self.tets:
            tet, gradients = self.tets[e], self.gradients[e]
            u = self.u[tet[0]]
            edges = ti.Matrix.cols([self.u[tet[1]] - u, self.u[tet[2]] - u, self.u[tet[3]] - u])
            f = edges @ gradients + ti.Matrix.identity(ti.f32, 3)
            a, b, c = f @ ti.Vector([1, 0, 0]), f @ ti.Vector([0, 1, 0]), f @ ti.Vector([0, 0, 1])
            bc, ca, ab = b.cross(c), c.cross(a), a.cross(b)
            p = LAMBDA_MU * (a.dot(bc) - 1.0) - MU
            stress = ti.Matrix.cols([MU * a + p * bc, MU * b + p * ca, MU * c + p * ab])
            h = -self.volumes[e] * (stress @ gradients.transpose())
            first = ti.Vector([0.0, 0.0, 0.0])
            for i in ti.static(range(3)):
                force = ti.Vector([h[0, i], h[1, i], h[2, i]])
                self.forces[4 * e + 1 + i] = force
                first -= force
            self.forces[4 * e] = first

    @ti.kernel
    def nodes(self):
        for n in self.u:
            factor = self.factors[n]
            if factor > 0.0:
                force = ti.Vector([0.0, 0.0, 0.0])
                for k in range(self.starts[n], self.starts[n + 1]):
                    force += self.forces[self.places[k]]
                v = self.v[n] + factor * force + DT * ti.Vector(job.GRAVITY)
                self.v[n] = v
                self.u[n] += DT * v

    def advance(self, steps):
        for _ in range(steps):
            self.elements()
            self.nodes()
        ti.sync()

    def state(self):
        return self.u.to_numpy(), self.v.to_numpy()


if __name__ == "__main__":
    block = job.Block(job.size_of_arguments())
    job.measure(
        block,
        Peer(block),
        name=f"taichi, {BACKEND}",
        version=".".join(map(str, ti.__version__)),
        variant="forces stored, then gathered",
        precision="f32",
        threads="all",
    )
