"""Numba: plain constant-strain tetrahedra as parallel loops, the hand-written baseline.

Structures of arrays, so that LLVM makes vectors of the loop over the elements; every element stores the forces on its
four corners, every node gathers them. With arrays of structures the loop over the elements took twice as long; storing
forces in the order in which the nodes read them made it slower than that saved.

Second argument: while threads of OpenMP wait they spin (active, the default), or sleep (passive). Spinning ones are up
to 1.8 times as fast on an idle machine and up to 30 times as slow on a busy one.
"""

import os
import sys

POLICY = sys.argv[2] if len(sys.argv) > 2 else "active"
os.environ["OMP_WAIT_POLICY"] = POLICY  # read when Numba loads OpenMP

import numba
import numpy as np
from numba import njit, prange

import job

MU, LAMBDA_MU = np.float32(job.MU), np.float32(job.LAMBDA + job.MU)
DT, DRIFT = np.float32(job.DT), np.float32(job.DT * job.GRAVITY[2])
ZERO, ONE = np.float32(0.0), np.float32(1.0)
OPTIONS = {"fastmath": True, "error_model": "numpy"}


@njit(inline="always")
def cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(inline="always")
def blend(p, a, q, b, r, c):
    """p a + q b + r c"""
    return p * a[0] + q * b[0] + r * c[0], p * a[1] + q * b[1] + r * c[1], p * a[2] + q * b[2] + r * c[2]


@njit(parallel=True, **OPTIONS)
def elements(t0, t1, t2, t3, g11, g12, g13, g21, g22, g23, g31, g32, g33, volumes, ux, uy, uz, forces):
    for e in prange(len(volumes)):
        n0, n1, n2, n3 = t0[e], t1[e], t2[e], t3[e]
        x, y, z = ux[n0], uy[n0], uz[n0]
        d1 = (ux[n1] - x, uy[n1] - y, uz[n1] - z)
        d2 = (ux[n2] - x, uy[n2] - y, uz[n2] - z)
        d3 = (ux[n3] - x, uy[n3] - y, uz[n3] - z)
        # Columns of the deformation gradient.
        a = blend(g11[e], d1, g21[e], d2, g31[e], d3)
        b = blend(g12[e], d1, g22[e], d2, g32[e], d3)
        c = blend(g13[e], d1, g23[e], d2, g33[e], d3)
        a, b, c = (a[0] + ONE, a[1], a[2]), (b[0], b[1] + ONE, b[2]), (c[0], c[1], c[2] + ONE)
        bc, ca, ab = cross(b, c), cross(c, a), cross(a, b)
        j = a[0] * bc[0] + a[1] * bc[1] + a[2] * bc[2]
        p = -volumes[e] * (LAMBDA_MU * (j - ONE) - MU)
        m = -volumes[e] * MU
        # Columns of the stress times the volume.
        a, b, c = blend(m, a, p, bc, ZERO, a), blend(m, b, p, ca, ZERO, b), blend(m, c, p, ab, ZERO, c)
        h1 = blend(g11[e], a, g12[e], b, g13[e], c)
        h2 = blend(g21[e], a, g22[e], b, g23[e], c)
        h3 = blend(g31[e], a, g32[e], b, g33[e], c)
        for i in range(3):
            forces[i, e] = -h1[i] - h2[i] - h3[i]
        forces[3, e], forces[4, e], forces[5, e] = h1
        forces[6, e], forces[7, e], forces[8, e] = h2
        forces[9, e], forces[10, e], forces[11, e] = h3


@njit(parallel=True, **OPTIONS)
def nodes(starts, places, factors, forces, ux, uy, uz, vx, vy, vz):
    for n in prange(len(factors)):
        factor = factors[n]
        if factor > ZERO:
            x, y, z = ZERO, ZERO, ZERO
            for k in range(starts[n], starts[n + 1]):
                e, row = places[k] >> 2, 3 * (places[k] & 3)
                x += forces[row, e]
                y += forces[row + 1, e]
                z += forces[row + 2, e]
            vx[n] += factor * x
            vy[n] += factor * y
            vz[n] += factor * z + DRIFT
            ux[n] += DT * vx[n]
            uy[n] += DT * vy[n]
            uz[n] += DT * vz[n]


class Peer:
    def __init__(self, block):
        def columns(values, dtype=np.float32):
            return [np.ascontiguousarray(c, dtype) for c in np.reshape(values, (len(values), -1)).T]

        self.u = columns(np.zeros_like(block.positions))
        self.v = columns(block.velocities)
        self.constants = columns(block.tets, np.int32) + columns(block.gradients) + columns(block.volumes)
        self.forces = np.zeros((12, len(block.tets)), np.float32)
        # Time step over mass, zero where a node is held.
        factors = (job.DT * ~block.held / block.masses).astype(np.float32)
        self.gathering = (*block.corners_of_nodes(), factors)

    def advance(self, steps):
        for _ in range(steps):
            elements(*self.constants, *self.u, self.forces)
            nodes(*self.gathering, self.forces, *self.u, *self.v)

    def state(self):
        return np.stack(self.u, axis=-1), np.stack(self.v, axis=-1)


if __name__ == "__main__":
    block = job.Block(job.size_of_arguments())
    job.measure(
        block,
        Peer(block),
        name=f"numba, {POLICY}",
        version=numba.__version__,
        variant="parallel loops, forces stored, then gathered",
        precision="f32",
        threads="all",
    )
