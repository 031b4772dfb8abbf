#!/usr/bin/env python3
"""Makes assets/meshes/forearm.msh: a segment of a forearm for needle insertion.

    pip install gmsh==4.15.2 && scripts/make_forearm_mesh.py [file.msh]

Unit mm. The arm lies along x, the needle enters at x = y = 0 straight down (-z); the skin has its highest point there,
at z = 0. A muscle belly 60 mm long and 45 mm x 40 mm thick, narrower towards both ends and more so towards the wrist
(+x):

    volumes   skin    outer 2 mm
              fat     next 4 mm
              muscle  the rest, without the bones
              tumour  ellipsoid 8 mm x 7 mm x 6 mm, centre 14 mm under the entry point
              vessel  4 mm thick, along the arm, 8 mm beside the path of the needle
    surfaces  bone          of the two bones, which are holes: to be held
              skin_surface  the outside
              ends          the two cuts through the arm

Dimensions are round numbers of a slender adult forearm, chosen for this mesh, not taken from a scan.
"""

import math
import sys
from pathlib import Path

import gmsh

LENGTH = 60.0
# Half widths (y) at x = -30, 0, 30 and half heights (z) alike: equal at both ends, so that the top is highest at x = 0.
HALF_WIDTHS = (21.5, 22.5, 20.0)
HALF_HEIGHTS = (19.0, 20.0, 19.0)
AXIS_Z = -20.0
SKIN, FAT = 2.0, 4.0
# Bones: y, z, radius.
BONES = ((-6.0, -25.0, 3.2), (6.0, -24.5, 3.6))
TUMOUR_CENTRE, TUMOUR_HALF_AXES = (0.0, 0.0, -14.0), (4.0, 3.5, 3.0)
VESSEL = (8.0, -14.0, 2.0)
# Edge length at the entry point and along the path of the needle, far away, and where it reaches that.
FINE, COARSE, COARSE_BEYOND = 1.5, 4.0, 20.0
# Edge length on the vessel and the bones, whose round shape needs it.
ON_VESSEL, ON_BONE = 1.7, 2.5


def belly(inset):
    """The arm without its outer `inset` mm."""
    loops = []
    for x, width, height in zip((-LENGTH / 2, 0.0, LENGTH / 2), HALF_WIDTHS, HALF_HEIGHTS):
        a, b = width - inset, height - inset
        # The larger half axis comes first; the plane of the curve is x = constant.
        curve = gmsh.model.occ.addEllipse(x, 0, AXIS_Z, a, b, zAxis=[1, 0, 0], xAxis=[0, 1, 0])
        loops.append(gmsh.model.occ.addCurveLoop([curve]))
    return gmsh.model.occ.addThruSections(loops, makeSolid=True, makeRuled=False)[0]


def cylinder(y, z, radius):
    return (3, gmsh.model.occ.addCylinder(-LENGTH / 2, y, z, LENGTH, 0, 0, radius))


def build():
    occ = gmsh.model.occ
    layers = [belly(0.0), belly(SKIN), belly(SKIN + FAT)]
    bones = [cylinder(*bone) for bone in BONES]
    tumour = (3, occ.addSphere(*TUMOUR_CENTRE, 1.0))
    occ.dilate([tumour], *TUMOUR_CENTRE, *TUMOUR_HALF_AXES)
    vessel = cylinder(*VESSEL)
    # The entry point becomes a node of the mesh.
    entry = (0, occ.addPoint(0, 0, 0))
    parts = layers + [tumour, vessel] + bones + [entry]
    _, pieces = occ.fragment(parts[:1], parts[1:])
    occ.synchronize()

    # Each piece belongs to the innermost part that it came from.
    names = ["skin", "fat", "muscle", "tumour", "vessel"] + ["bone"] * len(bones)
    owner = {}
    for name, found in zip(names, pieces):
        for dimension, tag in found:
            if dimension == 3:
                owner[tag] = name
    bone = [(3, tag) for tag, name in owner.items() if name == "bone"]
    occ.remove(bone)
    occ.synchronize()
    owner = {tag: name for tag, name in owner.items() if name != "bone"}

    for number, name in enumerate(["skin", "fat", "muscle", "tumour", "vessel"], start=1):
        gmsh.model.addPhysicalGroup(3, [tag for tag, of in owner.items() if of == name], number, name)

    surfaces = {"bone": [], "skin_surface": [], "ends": []}
    for _, tag in gmsh.model.getEntities(2):
        volumes = gmsh.model.getAdjacencies(2, tag)[0]
        if len(volumes) != 1:
            continue
        x0, _, _, x1, _, _ = gmsh.model.getBoundingBox(2, tag)
        if x1 - x0 < 1e-3:
            surfaces["ends"].append(tag)
        else:
            surfaces["skin_surface" if owner[volumes[0]] == "skin" else "bone"].append(tag)
    for number, (name, tags) in enumerate(surfaces.items(), start=11):
        gmsh.model.addPhysicalGroup(2, tags, number, name)
    return owner


def mesh():
    # Fine along the path of the needle, from the entry point to the tumour.
    size = f"{FINE} + {COARSE - FINE} * Min(1, Sqrt(x*x + y*y + Max(0, -18 - z)^2) / {COARSE_BEYOND})"
    for (y, z, radius), edge in [(VESSEL, ON_VESSEL)] + [(bone, ON_BONE) for bone in BONES]:
        size = f"Min({size}, {edge} + 0.4 * Max(0, Sqrt((y - {y})^2 + (z - {z})^2) - {radius}))"
    field = gmsh.model.mesh.field.add("MathEval")
    gmsh.model.mesh.field.setString(field, "F", size.replace("- -", "+ "))
    gmsh.model.mesh.field.setAsBackgroundMesh(field)
    for option in ("MeshSizeExtendFromBoundary", "MeshSizeFromPoints", "MeshSizeFromCurvature"):
        gmsh.option.setNumber(f"Mesh.{option}", 0)
    gmsh.option.setNumber("Mesh.Algorithm", 5)
    gmsh.option.setNumber("Mesh.Algorithm3D", 1)
    gmsh.option.setNumber("General.NumThreads", 1)
    # One sequence of random numbers: the mesh comes out the same each time.
    gmsh.option.setNumber("Mesh.RandomSeed", 1)
    # Altitude against edge is what bounds the time step: optimise with the measure that punishes slivers.
    gmsh.option.setNumber("Mesh.OptimizeThreshold", 0.5)
    gmsh.model.mesh.generate(3)
    for _ in range(3):
        gmsh.model.mesh.optimize("")
        gmsh.model.mesh.optimize("Netgen")
        gmsh.model.mesh.optimize("Relocate3D")
    gmsh.model.mesh.optimize("")


def report():
    names = {tag: gmsh.model.getPhysicalName(3, tag) for _, tag in gmsh.model.getPhysicalGroups(3)}
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    place = {tag: coordinates[3 * i : 3 * i + 3] for i, tag in enumerate(tags)}
    altitudes, shapes, used = [], [], set()
    for group, name in names.items():
        volume, count = 0.0, 0
        for entity in gmsh.model.getEntitiesForPhysicalGroup(3, group):
            _, _, nodes = gmsh.model.mesh.getElements(3, entity)
            for start in range(0, len(nodes[0]), 4):
                corners = [int(n) for n in nodes[0][start : start + 4]]
                used.update(corners)
                a, b, c, d = (place[n] for n in corners)
                def sub(p, q):
                    return [p[i] - q[i] for i in range(3)]
                def cross(p, q):
                    return [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]]
                def norm(p):
                    return math.sqrt(sum(x * x for x in p))
                six = abs(sum(x * y for x, y in zip(cross(sub(b, a), sub(c, a)), sub(d, a))))
                faces = ((a, b, c), (a, b, d), (a, c, d), (b, c, d))
                largest = max(norm(cross(sub(q, p), sub(r, p))) for p, q, r in faces)
                longest = max(norm(sub(p, q)) for p, q in ((a, b), (a, c), (a, d), (b, c), (b, d), (c, d)))
                altitudes.append(six / largest)
                shapes.append(six / largest / longest)
                volume += six / 6
                count += 1
        print(f"{name}: {count} tetrahedra, {volume:.1f} mm3")
    top = max(place[n][2] for n in used)
    print(f"{len(used)} nodes, {len(altitudes)} tetrahedra, top at z = {top:.4f} mm")
    print(f"smallest altitude {min(altitudes):.4f} mm, smallest altitude / longest edge {min(shapes):.4f}")
    for bound in (0.02, 0.1, 0.2):
        print(f"altitude / edge below {bound}: {sum(s < bound for s in shapes)}")
    for bound in (0.3, 0.5, 0.7):
        print(f"altitude below {bound} mm: {sum(a < bound for a in altitudes)}")


def main():
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent.parent / "assets/meshes/forearm.msh"
    gmsh.initialize()
    gmsh.option.setNumber("General.Verbosity", 2)
    gmsh.model.add("forearm")
    build()
    mesh()
    report()
    gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
    gmsh.option.setNumber("Mesh.Binary", 1)
    target.parent.mkdir(parents=True, exist_ok=True)
    gmsh.write(str(target))
    gmsh.finalize()
    print(f"{target}: {target.stat().st_size} bytes")


if __name__ == "__main__":
    main()
