#!/usr/bin/env python3
"""Measures what docs/cost.md says of spheres: `.venv/bin/python scripts/measure_spheres.py`, forty minutes and 1 GB.

Cemented cylinders of 500 to 10,000 spheres, the scene cylinder-compression at other sizes, with each solver over the
first steps, in which nothing breaks: CPU time of a step, memory, and what was reached. Draws docs/images/cost-spheres.png.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import h5py
import matplotlib.pyplot as plt
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
RUN = ROOT / "target/release/dem-run"
SCENE = ROOT / "configs/cylinder-compression.json"
COUNTS = [int(n) for n in sys.argv[1:]] or [500, 1000, 2000, 5000, 10000]
# steps left out, which look for the first reactions, and those measured; sweeps of Gauss-Seidel that one may take
FIRST, STEPS, SWEEPS = 3, 10, 20_000
SOLVERS = {
    "Newton, 1e-8": [],
    "Newton, elastic bonds, 1e-8": ['bonds.stiffness={"young":{"modulus":1e10,"poisson_ratio":0.2}}'],
} | {
    f"Gauss–Seidel, {tolerance}": [
        'solver.kind={"gauss_seidel":{"max_sweeps":%d}}' % SWEEPS,
        f"solver.tolerance={tolerance}",
        "solver.accept=1",
    ]
    for tolerance in ("1e-4", "1e-6")
}


def run(values, *options):
    """Runs the scene with these values: greatest resident size (bytes)."""
    command = [RUN, "run", SCENE, "--quiet", "--force", *options]
    for value in values:
        command += ["--set", value]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    if status != 0:
        sys.exit(f"failed: {' '.join(map(str, command))}")
    return usage.ru_maxrss * 1024


def measured(values, history):
    """Median CPU time of a step (s), peak memory (bytes), worst residual, number of contacts."""
    last = FIRST + STEPS
    memory = run([*values, "time.step=1e-4", f"time.end={last * 1e-4}", "output.every_steps=1000"], "-o", history, "--threads", "1")
    with h5py.File(history) as f:
        of = lambda name: f[f"observables/{name}/value"][:]
        times = np.diff(of("cpu_time"))[FIRST:]
        contacts = int(f["contacts/count"][-1])
        return np.median(times), memory, of("solver_residual")[FIRST:].max(), contacts


def draw(rows):
    """The figure, of the name of each solver and its rows: spheres, time of a step (s), memory (bytes)."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    for k, (name, points) in enumerate(rows.items()):
        count, seconds, memory = zip(*points)
        left.plot(count, seconds, "o-", color=f"C{k}", label=name)
        right.plot(count, np.array(memory) / 1e6, "o-", color=f"C{k}", label=name)
    left.set(ylabel="CPU time of a step (s)", yscale="log")
    right.set(ylabel="memory at the peak (MB)", ylim=(0, None))
    for axes in (left, right):
        axes.set(xscale="log", xlabel="spheres")
        counts = sorted({count for points in rows.values() for count, *_ in points})
        axes.set_xticks(counts, [f"{n:,}" for n in counts])
        axes.minorticks_off()
        axes.grid(alpha=0.3)
    left.legend(loc="lower center", bbox_to_anchor=(0.5, 1), ncols=2)
    figure.savefig(ROOT / "docs/images/cost-spheres.png", dpi=120)


def main():
    subprocess.run(["cargo", "build", "--release", "--locked", "-p", "dem-run"], cwd=ROOT, check=True)
    rows = {name: [] for name in SOLVERS}
    print("| spheres | contacts | " + " | ".join(f"{name}: time of a step, memory, worst residual" for name in SOLVERS) + " |")
    print("|---" * (2 + len(SOLVERS)) + "|")
    with tempfile.TemporaryDirectory() as folder:
        for count in COUNTS:
            sample, history = f"{folder}/sample.csv", f"{folder}/history.h5"
            width = 0.04 * (count / 5000) ** (1 / 3)
            packing = [
                f"sample.random.count={count}",
                f"sample.random.width={width}",
                # a narrow cylinder packs looser
                "sample.random.preparation.compaction.solid_fraction=0.5",
                "time.step=1e-4",
                "time.end=1e-4",
            ]
            run(packing, "-o", history, "--write-sample", sample)
            cells, contacts = [], 0
            for name, values in SOLVERS.items():
                grains = f"sample={json.dumps({'file': {'path': sample}})}"
                seconds, memory, residual, contacts = measured([grains, *values], history)
                rows[name].append((count, seconds, memory))
                cells.append(f"{seconds:.3g} s, {memory / 1e6:.0f} MB, {residual:.0e}")
            print(f"| {count:,} | {contacts:,} | {' | '.join(cells)} |", flush=True)
    draw(rows)


if __name__ == "__main__":
    main()
