#!/usr/bin/env python3
"""Writes the sample files of tests/mesh_import: one mesh in every format that is read.

    pip install gmsh==4.15.2 meshio==5.3.5 && tests/meshes/make_samples.py

A cube of 20 mm in two layers ("lower", "upper"), coordinates in mm with few digits, so that every writer keeps them
exactly. Writers: Gmsh and meshio where they know the variant, this script elsewhere (byte orders, appended data,
parts).
"""

import base64
import random
import struct
import zlib
from pathlib import Path

import gmsh
import meshio
import numpy

FOLDER = Path(__file__).parent


def make_mesh():
    """The mesh in Gmsh: two physical volumes, two physical surfaces."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Verbosity", 2)
    gmsh.option.setNumber("General.NumThreads", 1)
    occ = gmsh.model.occ
    lower = occ.addBox(-10, -10, -20, 20, 20, 8)
    upper = occ.addBox(-10, -10, -12, 20, 20, 12)
    occ.fragment([(3, lower)], [(3, upper)])
    occ.synchronize()
    gmsh.model.addPhysicalGroup(3, [lower], 1, "lower")
    gmsh.model.addPhysicalGroup(3, [upper], 2, "upper")
    for number, (name, z) in enumerate([("floor", -20), ("top", 0)], start=11):
        found = gmsh.model.getEntitiesInBoundingBox(-11, -11, z - 1, 11, 11, z + 1, 2)
        gmsh.model.addPhysicalGroup(2, [tag for _, tag in found], number, name)
    gmsh.option.setNumber("Mesh.MeshSizeMin", 9)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 9)
    gmsh.model.mesh.generate(3)
    tags, positions, _ = gmsh.model.mesh.getNodes()
    for tag, position in zip(tags, positions.reshape(-1, 3)):
        gmsh.model.mesh.setNode(tag, [round(x, 3) + 0.0 for x in position], [])
    tags, positions, _ = gmsh.model.mesh.getNodes()
    points = positions.reshape(-1, 3)
    index = {tag: i for i, tag in enumerate(tags)}

    def elements(dimension, kind):
        cells, groups = [], []
        for _, group in gmsh.model.getPhysicalGroups(dimension):
            for entity in gmsh.model.getEntitiesForPhysicalGroup(dimension, group):
                _, nodes = gmsh.model.mesh.getElementsByType(kind, entity)
                for cell in nodes.reshape(-1, dimension + 1):
                    cells.append([index[n] for n in cell])
                    groups.append(group)
        return cells, groups

    return points, *elements(3, 4), *elements(2, 2)


def write_with_gmsh():
    for version, text in (("4.1", "41"), ("2.2", "22"), ("1", "1")):
        for binary in (0, 1) if version != "1" else (0,):
            gmsh.option.setNumber("Mesh.MshFileVersion", float(version))
            gmsh.option.setNumber("Mesh.Binary", binary)
            gmsh.write(str(FOLDER / f"cube_{text}_{'binary' if binary else 'text'}.msh"))
    gmsh.option.setNumber("Mesh.Binary", 0)
    gmsh.write(str(FOLDER / "cube_gmsh_text.vtk"))
    gmsh.write(str(FOLDER / "cube_gmsh.inp"))
    gmsh.option.setNumber("Mesh.Binary", 1)
    gmsh.write(str(FOLDER / "cube_gmsh_binary.vtk"))


def write_with_meshio(points, tets, groups):
    mesh = meshio.Mesh(points, [("tetra", numpy.array(tets))], cell_data={"region": [numpy.array(groups)]})
    for version in ("42", "51"):
        for binary in (False, True):
            name = f"cube_{version}_{'binary' if binary else 'text'}.vtk"
            meshio.vtk.write(FOLDER / name, mesh, fmt_version=f"{version[0]}.{version[1]}", binary=binary)
    meshio.write(FOLDER / "cube_text.vtu", mesh, binary=False)
    meshio.write(FOLDER / "cube_base64.vtu", mesh, binary=True, compression=None)
    meshio.write(FOLDER / "cube_zlib.vtu", mesh, binary=True, compression="zlib")
    groups = numpy.array(groups)
    sets = {name: [numpy.nonzero(groups == tag)[0]] for tag, name in ((1, "lower"), (2, "upper"))}
    mesh = meshio.Mesh(points, [("tetra", numpy.array(tets))], cell_sets=sets)
    meshio.write(FOLDER / "cube_meshio.inp", mesh, float_fmt=".17e")


def big_endian_gmsh(points, tets, groups):
    def pack(form, *values):
        return struct.pack(">" + form, *values)

    names = b'$PhysicalNames\n2\n3 1 "lower"\n3 2 "upper"\n$EndPhysicalNames\n'
    data = b"$MeshFormat\n2.2 1 8\n" + pack("i", 1) + b"\n$EndMeshFormat\n" + names
    data += b"$Nodes\n%d\n" % len(points)
    data += b"".join(pack("i3d", i + 1, *x) for i, x in enumerate(points))
    data += b"\n$EndNodes\n$Elements\n%d\n" % len(tets)
    data += pack("3i", 4, len(tets), 2)
    data += b"".join(pack("7i", i + 1, g, g, *(n + 1 for n in t)) for i, (t, g) in enumerate(zip(tets, groups)))
    (FOLDER / "cube_22_big_endian.msh").write_bytes(data + b"\n$EndElements\n")

    data = b"$MeshFormat\n4.1 1 8\n" + pack("i", 1) + b"\n$EndMeshFormat\n" + names + b"$Entities\n"
    data += pack("4Q", 0, 0, 0, 2)
    for tag in (1, 2):
        data += pack("i6dQiQ", tag, -10, -10, -20, 10, 10, 0, 1, tag, 0)
    data += b"\n$EndEntities\n$Nodes\n" + pack("4Q", 1, len(points), 1, len(points))
    # Parametric nodes: three numbers more for each.
    data += pack("3iQ", 3, 1, 1, len(points)) + b"".join(pack("Q", i + 1) for i in range(len(points)))
    data += b"".join(pack("6d", *x, 0.5, 0.5, 0.5) for x in points)
    data += b"\n$EndNodes\n$Elements\n" + pack("4Q", 2, len(tets), 1, len(tets))
    for tag in (1, 2):
        chosen = [(i, t) for i, (t, g) in enumerate(zip(tets, groups)) if g == tag]
        data += pack("3iQ", 3, tag, 4, len(chosen))
        data += b"".join(pack("5Q", i + 1, *(n + 1 for n in t)) for i, t in chosen)
    (FOLDER / "cube_41_big_endian.msh").write_bytes(data + b"\n$EndElements\n")


def vtu(name, points, tets, groups, encoding, order="<", header="I", packed=False):
    """Appended data; two pieces, which share the points on the border of the layers."""
    blob = b""

    def array(kind, name, form, values, components=1):
        nonlocal blob
        data = struct.pack(f"{order}{len(values)}{form}", *values)
        if packed:
            size = 256
            blocks = [zlib.compress(data[i : i + size]) for i in range(0, len(data), size)]
            numbers = [len(blocks), size, len(data) % size, *map(len, blocks)]
            head = struct.pack(f"{order}{len(numbers)}{header}", *numbers)
            parts = [head, b"".join(blocks)]
        else:
            parts = [struct.pack(order + header, len(data)) + data]
        offset = len(blob)
        blob += b"".join(parts) if encoding == "raw" else b"".join(base64.b64encode(p) for p in parts)
        return (
            f'<DataArray type="{kind}" Name="{name}" NumberOfComponents="{components}" format="appended" '
            f'offset="{offset}"/>\n'
        )

    compressor = ' compressor="vtkZLibDataCompressor"' if packed else ""
    byte_order = "LittleEndian" if order == "<" else "BigEndian"
    text = (
        f'<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" version="1.0" byte_order="{byte_order}" '
        f'header_type="UInt{"32" if header == "I" else "64"}"{compressor}>\n<UnstructuredGrid>\n'
    )
    for tag in (1, 2):
        cells = [t for t, g in zip(tets, groups) if g == tag]
        used = sorted({n for t in cells for n in t})
        local = {n: i for i, n in enumerate(used)}
        text += f'<Piece NumberOfPoints="{len(used)}" NumberOfCells="{len(cells)}">\n<Points>\n'
        text += array("Float64", "Points", "d", [x for n in used for x in points[n]], 3)
        text += "</Points>\n<Cells>\n"
        text += array("Int64", "connectivity", "q", [local[n] for t in cells for n in t])
        text += array("Int32", "offsets", "i", [4 * (i + 1) for i in range(len(cells))])
        text += array("UInt8", "types", "B", [10] * len(cells))
        text += '</Cells>\n<CellData Scalars="material">\n'
        text += array("Float32", "density", "f", [1.0] * len(cells))
        text += array("Int16", "material", "h", [tag] * len(cells))
        text += "</CellData>\n</Piece>\n"
    text += f'</UnstructuredGrid>\n<AppendedData encoding="{encoding}">\n_'
    (FOLDER / name).write_bytes(text.encode() + blob + b"\n</AppendedData>\n</VTKFile>\n")


def part_inp(points, tets, groups, triangles, surfaces):
    """A part with an instance; lower and upper case, comments, continued lines, ranges, sets of sets."""
    order = sorted(range(len(tets)), key=lambda i: groups[i])
    lower = groups.count(1)
    lines = ["*Heading", "** a comment", "*Part, name=Part-1", "*Node"]
    lines += [f"{10 * (i + 1):7d}, {x!r}, {y!r}, {z!r}" for i, (x, y, z) in enumerate(points.tolist())]
    lines += ["*ELEMENT,", "  type=c3d4h,", "  elset=everything"]
    for number, i in enumerate(order, start=1):
        a, b, c, d = (10 * (n + 1) for n in tets[i])
        lines += [f"{number}, {a}, {b},", f" {c}, {d}"] if number % 7 == 0 else [f"{number}, {a}, {b}, {c}, {d}"]
    lines += ["*Elset, elset=Lower, GENERATE", f" 1, {lower}, 1", "*Elset, elset=rest, generate"]
    lines += [f"{lower + 1}, {len(tets)}", '*ELSET, ELSET="upper"', "REST,"]
    for name, tag in (("floor", 11), ("top", 12)):
        nodes = sorted({10 * (n + 1) for t, s in zip(triangles, surfaces) if s == tag for n in t})
        lines += [f"*Nset, nset={name}"]
        lines += [", ".join(map(str, nodes[i : i + 16])) + "," for i in range(0, len(nodes), 16)]
    lines += ["*Solid Section, elset=upper, material=tissue", ",", "*End Part", "*Assembly, name=Assembly"]
    lines += ["*Instance, name=Part-1-1, part=Part-1", "*End Instance", "*End Assembly"]
    lines += ["*Material, name=tissue", "*Hyperelastic, mooney-rivlin", "2300., 1000., 4e-6"]
    (FOLDER / "cube_part.inp").write_text("\n".join(lines) + "\n")


def disordered(points, tets, groups):
    """Shuffled, inverted, with duplicate and unused nodes, Windows line ends."""
    shuffle = random.Random(1)
    copies = [(i, x) for i, x in enumerate(points.tolist())] * 2
    shuffle.shuffle(copies)
    ids = {}
    for number, (i, _) in enumerate(copies, start=5):
        ids.setdefault(i, []).append(number * 3)
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$Comments", "nothing in order", "$EndComments"]
    lines += ["$PhysicalNames", "2", '3 7 "lower"', '3 4 "upper"', "$EndPhysicalNames", "$Nodes", str(len(copies) + 1)]
    lines += [f"{number * 3} {x!r} {y!r} {z!r}" for number, (_, (x, y, z)) in enumerate(copies, start=5)]
    lines += ["99999 1.5 2.5 3.5", "$EndNodes", "$Elements", str(len(tets))]
    cells = list(zip(tets, groups))
    shuffle.shuffle(cells)
    for number, (tet, group) in enumerate(cells, start=100):
        nodes = [shuffle.choice(ids[n]) for n in tet]
        # Two exchanges keep the orientation, one turns it over.
        shuffle.shuffle(nodes)
        lines.append(f"{number} 4 3 {7 if group == 1 else 4} {group} 0 {' '.join(map(str, nodes))}")
    (FOLDER / "cube_disordered.msh").write_bytes("\r\n".join(lines + ["$EndElements", ""]).encode())


def main():
    points, tets, groups, triangles, surfaces = make_mesh()
    print(f"{len(points)} nodes, {len(tets)} tetrahedra, {len(triangles)} triangles")
    write_with_gmsh()
    write_with_meshio(points, tets, groups)
    big_endian_gmsh(points, tets, groups)
    vtu("cube_appended_raw.vtu", points, tets, groups, "raw")
    vtu("cube_appended_base64.vtu", points, tets, groups, "base64", header="Q")
    vtu("cube_appended_zlib_big_endian.vtu", points, tets, groups, "raw", ">", "Q", packed=True)
    vtu("cube_appended_base64_zlib.vtu", points, tets, groups, "base64", packed=True)
    part_inp(points, tets, groups, triangles, surfaces)
    disordered(points, tets, groups)
    gmsh.finalize()


if __name__ == "__main__":
    main()
