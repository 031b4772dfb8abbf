#!/usr/bin/env python3
"""Measures the job of job.py in other programs, in turn with `stylet bench`, and prints tables in Markdown.

    pip install -r scripts/peers/requirements.txt
    python scripts/peers/run.py --stylet target/release/stylet [--rounds 2] [--only taichi,warp] [--sizes 20k]

In every round each peer runs once per size in a process of its own and `stylet bench` once per engine; of each figure
the best round counts. Two rounds of everything take about 15 minutes on two cores. A peer that is not installed, fails
or moves wrongly is listed as not measured.

What is compared: tetrahedra per second of wall time, where a hexahedron counts as six tetrahedra.
"""

import argparse
import datetime
import json
import os
import platform
import subprocess
import sys
from pathlib import Path

import job

FOLDER = Path(__file__).resolve().parent
PEERS = {
    "numpy": ["peer_numpy.py"],
    "numba": ["peer_numba.py", "active"],
    "numba-passive": ["peer_numba.py", "passive"],
    "taichi": ["peer_taichi.py", "cpu"],
    "taichi-vulkan": ["peer_taichi.py", "vulkan"],
    "warp": ["peer_warp.py"],
    "newton": ["peer_newton.py"],
    "mujoco": ["peer_mujoco.py"],
}
ENGINES = ("cpu", "gpu", "cpu64")
# Cells of the bare block of `stylet bench`; the size 122k is the same block.
CELLS = 20_384
TETS_PER_HEXAHEDRON = 6
TETRAHEDRA = "tet4 with averaged pressure, 20 k tets, per tet-step"
# Of the motion after job.CHECK_STEPS steps; other laws with the same moduli differ by up to half a percent.
LARGEST_ERROR = 0.01
# Energy (kinetic, elastic, gravity) at the end over that at the start: more is unstable, less has been damped.
ENERGY = (0.95, 1.05)


class Failure(Exception):
    """Why something was not measured."""


def cores():
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()


def output_of(command, seconds):
    # Nothing is written into the source tree.
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
    try:
        done = subprocess.run(command, check=False, capture_output=True, text=True, timeout=seconds, env=environment)
    except subprocess.TimeoutExpired:
        raise Failure(f"took longer than {seconds} s") from None
    except OSError as error:
        raise Failure(str(error)) from None
    if done.returncode != 0:
        lines = done.stderr.strip().splitlines() or [f"exit code {done.returncode}"]
        missing = lines[-1].startswith("ModuleNotFoundError")
        raise Failure(("not installed: " if missing else "") + lines[-1])
    return done.stdout


def run_peer(name, size, seconds):
    script, *variant = PEERS[name]
    output = output_of([sys.executable, str(FOLDER / script), size, *variant], seconds)
    # Some packages greet on standard output before.
    lines = [line for line in output.splitlines() if line.startswith('{"name"')]
    if not lines:
        raise Failure("no result")
    result = json.loads(lines[-1])
    check = result["check"]
    if not check["finite"]:
        raise Failure("positions are not finite")
    if not check["error"] <= LARGEST_ERROR:
        raise Failure(f"wrong motion, {100.0 * check['error']:.1f} % off")
    if not ENERGY[0] < check["energy"] < ENERGY[1]:
        raise Failure(f"energy at the end {check['energy']:.2g} of that at the start")
    return result


def run_stylet(program, engine, seconds):
    """Figures of one engine: tetrahedra per second of wall time, processor ns per tetrahedron and step."""
    command = [program, "bench", "--json", "--max-cells", "25000", "--engine", engine]
    try:
        report = json.loads(output_of(command, seconds))
        rows = {r["needle"]: r for r in report["rows"] if r["cells"] == CELLS}
        bare, needle = rows[False], rows[True]
        goal = next(g for g in report["goals"] if g["what"] == TETRAHEDRA)
    except (ValueError, KeyError, StopIteration):
        raise Failure(f"`stylet bench` of another form: no row of {CELLS} cells or no line of tetrahedra") from None
    # On a software adapter the line of the tetrahedra is processor time: at best all cores shared it.
    software = goal["unit"] == "cpu-ns"
    note = ", at best" if software else ""
    where = f"`{engine}` ({report['adapter']})"

    def hexahedra(what, row):
        cpu = row["cpu_ns_per_cell_step"]
        return {
            "what": f"Stylet, {CELLS:,} hexahedra{what}, {where}",
            "rate": TETS_PER_HEXAHEDRON / row["wall_ns_per_cell_step"] * 1e9,
            "cpu": cpu / TETS_PER_HEXAHEDRON if cpu else None,
        }

    return {
        "hexahedra": hexahedra("", bare),
        "needle": hexahedra(" with a needle going in", needle),
        "tetrahedra": {
            "what": f"Stylet, 20 k tetrahedra with averaged pressure, {where}{note}",
            "rate": (cores() if software else 1) / goal["measured"] * 1e9,
            "cpu": goal["measured"] if software else None,
        },
    }


def least(a, b):
    return min((v for v in (a, b) if v is not None), default=None)


def better_peer(old, new):
    if old is None:
        return new
    fastest = min(old, new, key=lambda r: r["wall_s_per_step"])
    return {**fastest, "cpu_s_per_step": least(old["cpu_s_per_step"], new["cpu_s_per_step"])}


def better_stylet(old, new):
    if old is None:
        return new
    return {
        kind: {**best, "rate": max(old[kind]["rate"], best["rate"]), "cpu": least(old[kind]["cpu"], best["cpu"])}
        for kind, best in new.items()
    }


class Results:
    def __init__(self):
        self.best, self.failures = {}, {}

    def take(self, key, better, run, *arguments):
        print(" ".join(key), file=sys.stderr, flush=True)
        try:
            self.best[key] = better(self.best.get(key), run(*arguments))
        except Failure as failure:
            self.failures[key] = str(failure)
            print(f"  not measured: {failure}", file=sys.stderr)


def measure(options):
    results, loads = Results(), []
    for _ in range(options.rounds):
        if hasattr(os, "getloadavg"):
            loads.append(os.getloadavg()[0])
        for size in options.sizes:
            for name in options.only:
                results.take((name, size), better_peer, run_peer, name, size, options.timeout)
        for engine in ENGINES if options.stylet else ():
            results.take(("stylet", engine), better_stylet, run_stylet, options.stylet, engine, options.timeout)
    return results, loads


def line(*cells):
    return "| " + " | ".join(cells) + " |"


def number(value, digits=3):
    """With three digits, so that rates of very different size can stand below each other."""
    if value is None:
        return "-"
    return f"{value:.0f}" if value >= 10 ** (digits - 1) else f"{value:.{digits}g}"


def references(results):
    """The rates that peers are compared with: title of the column, tetrahedra per second."""
    engines = {engine: best for (name, engine), best in results.best.items() if name == "stylet"}

    def hexahedra(engine):
        return engines[engine]["hexahedra"]["rate"] if engine in engines else None

    return (
        ("Stylet hexahedra, `cpu`, against it", hexahedra("cpu")),
        ("Stylet hexahedra, `gpu`, against it", hexahedra("gpu")),
        (
            "Stylet tetrahedra, fastest engine, against it",
            max((e["tetrahedra"]["rate"] for e in engines.values()), default=None),
        ),
    )


def rates(results):
    columns = references(results)

    def row(what, rate, cpu, used):
        ratios = [number(reference / rate) if reference else "-" for _, reference in columns]
        return line(what, number(rate / 1e6), number(cpu), used, *ratios)

    titles = [
        "what",
        "M tetrahedra/s",
        "processor ns per tetrahedron and step",
        "cores",
        *(title for title, _ in columns),
    ]
    yield line(*titles)
    yield line(*["---"] * len(titles))
    for key, best in results.best.items():
        if key[0] == "stylet":
            continue
        count = best["tet_equivalents"]
        rate, cpu = count / best["wall_s_per_step"], 1e9 * best["cpu_s_per_step"] / count
        what = f"{best['name']} {best['version']}, {count:,} tetrahedra, {best['precision']}"
        yield row(what, rate, cpu, best["threads"])
    for (name, _), best in results.best.items():
        if name == "stylet":
            for figure in best.values():
                yield row(figure["what"], figure["rate"], figure["cpu"], "all")
    for key, why in results.failures.items():
        if key not in results.best:
            yield line(" ".join(key), f"not measured: {why}", *["-"] * (len(titles) - 2))


def checks(results):
    yield line(
        "peer",
        "size",
        "variant",
        f"top face after {1e3 * job.CHECK_STEPS * job.DT:g} ms, x and z [mm]",
        "off the reference",
        "energy, end / start",
    )
    yield line(*["---"] * 6)
    for (name, size), best in results.best.items():
        if name == "stylet":
            continue
        check = best["check"]
        motion = f"{check['top_mm'][0]:.4f}, {check['top_mm'][2]:.4f}"
        energy = f"{check['energy']:.4f} after {best['steps']} steps"
        yield line(best["name"], size, best["variant"], motion, f"{100.0 * check['error']:.4f} %", energy)


def machine():
    name = platform.processor() or platform.machine()
    try:
        text = Path("/proc/cpuinfo").read_text()
        name = next(s.split(":")[1].strip() for s in text.splitlines() if s.startswith("model name"))
    except (OSError, StopIteration):
        pass
    return f"{cores()} cores, {name}, {platform.system()}, Python {platform.python_version()}"


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--stylet", help="the program; without it only peers are measured")
    parser.add_argument("--rounds", type=int, default=2, help="default: 2")
    parser.add_argument("--only", help=f"peers, with commas between: {','.join(PEERS)}")
    parser.add_argument("--sizes", help=f"sizes, with commas between: {','.join(job.SIZES)}")
    parser.add_argument("--timeout", type=float, default=600.0, help="seconds for one peer or engine, default: 600")
    options = parser.parse_args()
    for name, known in (("only", PEERS), ("sizes", job.SIZES)):
        given = getattr(options, name)
        chosen = given.split(",") if given else list(known)
        if wrong := [c for c in chosen if c not in known]:
            parser.error(f"--{name}: unknown: {', '.join(wrong)}")
        setattr(options, name, chosen)
    return options


def main():
    options = arguments()
    results, loads = measure(options)
    print(f"{machine()}, {datetime.date.today()}, best of {options.rounds} rounds.", end="")
    if loads:
        # Threads that wait for each other lose most where other programs run.
        print(f" Load average before each round: {', '.join(f'{v:.1f}' for v in loads)}.", end="")
    print("\n")
    print("\n".join(rates(results)))
    print()
    print("\n".join(checks(results)))
    if partly := [f"{' '.join(k)} ({why})" for k, why in results.failures.items() if k in results.best]:
        print(f"\nFailed in some rounds: {'; '.join(partly)}.")


if __name__ == "__main__":
    main()
