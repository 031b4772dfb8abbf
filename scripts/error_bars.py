#!/usr/bin/env python3
"""Coverage of the error bar: does the force of cells half as wide lie in the band?

    python3 scripts/error_bars.py [--stylet target/release/stylet] [--out out/error_bars] [SCENE ...]

Runs each scene with --error-bar, and once more with half the cell edge. Runs that the folder holds are not repeated. Prints the
table of docs/error-bar.md: rows of the way in within the band, the mean band over the largest force, and the force at the deepest point.
Takes about half an hour on two cores.
"""

import argparse
import bisect
import csv
import json
import re
import subprocess
import sys
from pathlib import Path

SCENES = [
    "muscle_biopsy",
    "opening",
    "layers",
    "phantom_through",
    "target",
    "entry_45_degrees",
    "effects/flexible_needle",
    "effects/indentation",
    "validation/sphere_indentation",
    "training/hit_target",
    "training/lumbar_oblique",
    "free_hand/entry_45",
]


def run(stylet, scene, out, *more):
    """Runs a scene into a folder unless it is there; its rows on the way in and its summary."""
    if not (out / "summary.json").exists():
        command = [stylet, "run", f"scenes/{scene}.toml", "--out", str(out), "--force", *more]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            sys.exit(f"{' '.join(command)}\n{done.stderr}")
    rows, deepest = [], float("-inf")
    with open(out / "force.csv") as table:
        for row in csv.DictReader(table):
            depth, force, error = float(row["depth_m"]), float(row["axial_force_n"]), row.get("force_error_n")
            if depth > deepest:
                rows.append((depth, force, float(error) if error else None))
                deepest = depth
    return rows, json.loads((out / "summary.json").read_text())


def at(rows, depth):
    """Force of a run at a depth between its rows."""
    after = bisect.bisect_left([row[0] for row in rows], depth)
    if after == len(rows) or (after == 0 and rows[0][0] > depth):
        return None
    b = rows[after]
    a = rows[after - 1] if after else b
    share = (depth - a[0]) / (b[0] - a[0]) if b[0] > a[0] else 0.0
    return a[1] + share * (b[1] - a[1])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--stylet", default="target/release/stylet")
    parser.add_argument("--out", default="out/error_bars", type=Path)
    parser.add_argument("scenes", nargs="*", default=SCENES)
    args = parser.parse_args()
    print("| scene | cells, mm | force at the deepest point, N | with half the edge | in the band | rows in the band | mean band |")
    print("|---|---|---|---|---|---|---|")
    held = 0
    for scene in args.scenes:
        name = scene.replace("/", "_")
        text = Path(f"scenes/{scene}.toml").read_text()
        edge = float(re.search(r"^cell_size_mm\s*=\s*([\d.]+)", text, re.M).group(1))
        rows, summary = run(args.stylet, scene, args.out / name, "--error-bar")
        fine, fine_summary = run(args.stylet, scene, args.out / f"{name}_fine", "--set", f"tissue.cell_size_mm={edge / 2:g}")
        pairs = [(abs(force - at(fine, depth)), error) for depth, force, error in rows
                 if error is not None and at(fine, depth) is not None]
        inside = sum(apart <= error for apart, error in pairs) / len(pairs)
        peak = max(abs(force) for _, force, _ in rows)
        mean = sum(error for _, error in pairs) / len(pairs) / peak
        force, error = summary["force_at_max_depth_n"], summary["error_bar"]["force_error_at_max_depth_n"]
        finer = fine_summary["force_at_max_depth_n"]
        holds = abs(force - finer) <= error
        held += holds
        print(f"| `{scene}` | {edge:g} | {force:.3f} +- {error:.3f} | {finer:.3f} | {'yes' if holds else 'no'} "
              f"| {100 * inside:.0f} % | {100 * mean:.0f} % |", flush=True)
    print(f"\n{held} of {len(args.scenes)}")


if __name__ == "__main__":
    main()
