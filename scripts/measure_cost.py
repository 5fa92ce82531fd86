#!/usr/bin/env python3
"""Measures what docs/cost.md says of size: `.venv/bin/python scripts/measure_cost.py`, a few minutes and 0.9 GB.

Dry disks, 10,000 to 1,000,000, in steps of 20 sweeps with the figure docs/images/cost-size.png. Times are wall times of
one machine: differences between many steps and few, so that neither the start of the program nor the building of the
scene counts.
"""

import os
import subprocess
import time
from pathlib import Path

import matplotlib.pyplot as plt

ROOT = Path(__file__).resolve().parents[1]
COST = ROOT / "target/release/examples/cost"
SIDES = [100, 178, 316, 562, 1000]


def run(side, what, times, threads):
    """Runs the scene: wall time (s), numbers of grains and of contacts, greatest resident size (bytes)."""
    command = [COST, "disks", "dry", str(side), str(side), what, str(times)]
    before = time.perf_counter()
    out = subprocess.run(
        command, capture_output=True, text=True, check=True, env=os.environ | {"RAYON_NUM_THREADS": str(threads)}
    )
    grains, contacts, _, peak = map(int, out.stdout.split())
    return time.perf_counter() - before, grains, contacts, peak * 1024


def each(side, what, few, many, threads):
    """Time of one sweep or step (s), the best of three, and the greatest resident size (bytes)."""
    rounds = [(run(side, what, few, threads), run(side, what, many, threads)) for _ in range(3)]
    return min((b[0] - a[0]) / (many - few) for a, b in rounds), max(b[3] for _, b in rounds)


def main():
    subprocess.run(["cargo", "build", "--release", "--locked", "-p", "dem-core", "--example", "cost"], cwd=ROOT, check=True)
    rows = []
    print("| grains | contacts | sweep, 1 thread | 2 threads | step, 1 thread | 2 threads | memory |")
    print("|---|---|---|---|---|---|---|")
    for side in SIDES:
        _, grains, contacts, _ = run(side, "sweep", 0, 1)
        many = max(2, 60_000_000 // contacts)
        sweeps = [each(side, "sweep", 0, many, threads)[0] / contacts * 1e9 for threads in (1, 2)]
        many = max(3, 3_000_000 // contacts)
        steps = [each(side, "step", 1, many, threads) for threads in (1, 2)]
        size = steps[1][1] / grains
        steps = [time / contacts * 1e9 for time, _ in steps]
        rows.append((grains, sweeps, steps, size))
        cells = [f"{t:.1f} ns" for t in sweeps] + [f"{t:.0f} ns" for t in steps] + [f"{size:.0f} B a grain"]
        print(f"| {grains:,} | {contacts:,} | {' | '.join(cells)} |", flush=True)

    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    grains = [row[0] for row in rows]
    for k, threads in enumerate(["1 thread", "2 threads"]):
        left.plot(grains, [row[2][k] for row in rows], "o-", color=f"C{k}", label=f"step of 20 sweeps, {threads}")
        left.plot(grains, [20 * row[1][k] for row in rows], "o--", color=f"C{k}", label=f"its sweeps, {threads}")
    right.plot(grains, [row[3] for row in rows], "o-", color="C2")
    left.set(ylabel="time of a contact (ns)", ylim=(0, None))
    right.set(ylabel="memory of a grain, at most (bytes)", ylim=(0, None))
    for axes in (left, right):
        axes.set(xscale="log", xlabel="grains")
        axes.grid(alpha=0.3)
    left.legend(loc="lower center", bbox_to_anchor=(0.5, 1), ncols=2)
    figure.savefig(ROOT / "docs/images/cost-size.png", dpi=120)


main()
