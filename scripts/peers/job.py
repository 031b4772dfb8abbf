"""The job that every peer does, and how it is timed and checked.

A block of tissue, edges of 0.8 mm, every cell split into six tetrahedra as `stylet bench` splits its own
(src/mesh/tets.rs). The bottom face is held. At the start every node moves sideways, faster the higher it is, and
gravity acts: no part of the block is ever at rest, where products of small numbers would be denormal and slow. Steps
are explicit (symplectic Euler) with lumped masses. There is no damping and no contact.

Stylet's law is Mooney-Rivlin. Peers that let the user write the law take the cheapest one with the same moduli, a
neo-Hookean without logarithm:

    W = mu/2 (tr F^T F - 3) - mu (J - 1) + (lambda + mu)/2 (J - 1)^2
    P = mu F + ((lambda + mu) (J - 1) - mu) cof F

Its linearisation is Hooke's law with mu and lambda. Strains stay below a few percent, so peers with another law with
the same moduli must find nearly the same motion, and all must keep the energy.
"""

import json
import math
import sys
import time

import numpy as np

EDGE = 0.8e-3  # [m]
YOUNG, POISSON, DENSITY = 60e3, 0.45, 1060.0  # [Pa], -, [kg/m^3]
MU = YOUNG / (2.0 * (1.0 + POISSON))
LAMBDA = YOUNG * POISSON / ((1.0 + POISSON) * (1.0 - 2.0 * POISSON))
GRAVITY = (0.0, 0.0, -9.81)  # [m/s^2]
TOP_SPEED = 0.1  # sideways, at the start [m/s]
DT = 1e-5  # [s], below half of the largest stable step

# Cells along x, y, z. 20 k: the tetrahedra of `stylet bench`. 122 k: its block of 20,384 hexahedra.
SIZES = {"20k": (15, 15, 15), "122k": (28, 28, 26)}

# Motion of the top face after CHECK_STEPS steps, mean of its nodes [mm], by peer_numpy.py in double precision.
CHECK_STEPS = 300
REFERENCE = {"20k": (0.206288, -0.000553, -0.020688), "122k": (0.232454, 0.000055, -0.038451)}

# As in `stylet bench`: every figure is the smallest of three rounds of at least 0.8 s.
ROUNDS, ROUND_SECONDS = 3, 0.8

# The paths along the edges of a cell from its lowest to its highest corner: one tetrahedron each.
PATHS = ((0, 1, 2), (1, 2, 0), (2, 0, 1), (0, 2, 1), (2, 1, 0), (1, 0, 2))


class Block:
    """Nodes, tetrahedra and all that is constant of them, in double precision."""

    def __init__(self, size):
        self.size = size
        nx, ny, nz = self.cells = SIZES[size]
        z, y, x = np.meshgrid(np.arange(nz + 1), np.arange(ny + 1), np.arange(nx + 1), indexing="ij")
        self.positions = EDGE * np.stack([x, y, z], axis=-1).reshape(-1, 3).astype(np.float64)
        self.height = nz * EDGE
        self.tets = self._split()
        self.held = self.positions[:, 2] < 0.5 * EDGE
        self.top = self.positions[:, 2] > self.height - 0.5 * EDGE
        self.velocities = np.zeros_like(self.positions)
        self.velocities[:, 0] = TOP_SPEED * self.positions[:, 2] / self.height
        a, b, c, d = (self.positions[self.tets[:, i]] for i in range(4))
        edges = np.stack([b - a, c - a, d - a], axis=-1)
        self.volumes = np.linalg.det(edges) / 6.0
        # Rows: the gradients of the shape functions of corners 1 to 3; that of corner 0 is minus their sum.
        self.gradients = np.linalg.inv(edges)
        share = np.repeat(DENSITY * self.volumes / 4.0, 4)
        self.masses = np.bincount(self.tets.ravel(), share, len(self.positions))

    def _split(self):
        nx, ny, nz = self.cells
        stride = np.array([1, nx + 1, (nx + 1) * (ny + 1)])
        z, y, x = np.meshgrid(np.arange(nz), np.arange(ny), np.arange(nx), indexing="ij")
        first = (x * stride[0] + y * stride[1] + z * stride[2]).ravel()
        tets = []
        for number, path in enumerate(PATHS):
            corners = [first]
            for axis in path:
                corners.append(corners[-1] + stride[axis])
            if number >= 3:  # odd permutations would have negative volume
                corners[1], corners[2] = corners[2], corners[1]
            tets.append(np.stack(corners, axis=-1))
        # The six of a cell stay together: neighbours in memory share nodes.
        return np.stack(tets, axis=1).reshape(-1, 4).astype(np.int32)

    def corners_of_nodes(self):
        """For gathering: the places `4 tet + corner` of node n are `places[starts[n]:starts[n + 1]]`."""
        nodes = self.tets.ravel()
        places = np.argsort(nodes, kind="stable").astype(np.int32)
        starts = np.zeros(len(self.positions) + 1, np.int32)
        starts[1:] = np.cumsum(np.bincount(nodes, minlength=len(self.positions)))
        return starts, places

    def deformation(self, displacements):
        """Deformation gradients, their cofactors and determinants."""
        corners = displacements[self.tets]
        # Columns: displacements of corners 1 to 3 relative to corner 0.
        edges = (corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1)
        f = edges @ self.gradients + np.eye(3)
        a, b, c = f[:, :, 0], f[:, :, 1], f[:, :, 2]
        cofactors = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=-1)
        return f, cofactors, np.einsum("ei,ei->e", a, cofactors[:, :, 0])

    def energy(self, displacements, velocities):
        """Kinetic and elastic energy and that of gravity."""
        f, _, j = self.deformation(displacements)
        first = np.einsum("eij,eij->e", f, f)
        density = 0.5 * MU * (first - 3.0) - MU * (j - 1.0) + 0.5 * (LAMBDA + MU) * (j - 1.0) ** 2
        kinetic = 0.5 * np.sum(self.masses[:, None] * velocities**2)
        weight = self.masses @ (displacements @ np.array(GRAVITY))
        return float(kinetic + density @ self.volumes - weight)


def measure(block, peer, *, name, version, variant, precision, threads):
    """Times `peer` and prints one line of JSON.

    A peer has `advance(steps)`, which returns when the steps are done, and `state()`: displacements and velocities of
    the nodes in the order of the block.
    """
    begin = time.perf_counter()
    peer.advance(CHECK_STEPS)  # compiles as well
    check = _check_motion(block, *peer.state())
    started = time.perf_counter() - begin
    chunk = _steps_per_chunk(peer)
    wall, cpu, steps = math.inf, math.inf, 0
    for _ in range(ROUNDS):
        count = 0
        begin, cpu_begin = time.perf_counter(), time.process_time()
        while time.perf_counter() - begin < ROUND_SECONDS:
            peer.advance(chunk)
            count += chunk
        wall = min(wall, (time.perf_counter() - begin) / count)
        cpu = min(cpu, (time.process_time() - cpu_begin) / count)
        steps += count
    check.update(_check_end(block, *peer.state()))
    line = {
        "name": name,
        "version": version,
        "variant": variant,
        "precision": precision,
        "threads": threads,
        "elements": len(block.tets),
        "tet_equivalents": len(block.tets),
        "steps": steps,
        "first_steps_s": started,
        "wall_s_per_step": wall,
        "cpu_s_per_step": cpu,
        "check": check,
    }
    print(json.dumps(line))


def _steps_per_chunk(peer):
    """Steps of about a tenth of a round, at most 100 (the frames of `stylet bench`); even, see peer_newton.py."""
    begin = time.perf_counter()
    peer.advance(4)
    return max(2, min(100, 2 * int(0.05 * ROUND_SECONDS * 4.0 / (time.perf_counter() - begin))))


def _check_motion(block, displacements, velocities):
    motion = 1e3 * np.asarray(displacements, np.float64)[block.top].mean(axis=0)
    reference = np.array(REFERENCE[block.size])
    return {
        "top_mm": motion.tolist(),
        "error": float(np.linalg.norm(motion - reference) / np.linalg.norm(reference)),
    }


def _check_end(block, displacements, velocities):
    u, v = np.asarray(displacements, np.float64), np.asarray(velocities, np.float64)
    finite = bool(np.isfinite(u).all() and np.isfinite(v).all())
    start = block.energy(np.zeros_like(block.positions), block.velocities)
    return {"finite": finite, "energy": block.energy(u, v) / start if finite else None}


def size_of_arguments():
    """The size that the command line names, the small one without."""
    size = sys.argv[1] if len(sys.argv) > 1 else "20k"
    if size not in SIZES:
        sys.exit(f"unknown size {size}: one of {', '.join(SIZES)}")
    return size
