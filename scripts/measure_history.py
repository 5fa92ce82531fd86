#!/usr/bin/env python3
"""Measures what docs/history.md says of speed and size: `.venv/bin/python scripts/measure_history.py [PART…] [--folder DIR]`.

Parts: writing, memory, large. All of them take about half an hour on two cores and 25 GB of disk. Times are wall
times of one machine: what is compared runs in turn, and the smallest of several is taken.
"""

import argparse
import json
import os
import subprocess
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import h5py

ROOT = Path(__file__).resolve().parents[1]
BEAM = ROOT / "configs/bending-force.json"
# the beam before its first break: 4,190 grains, 12,112 bonds, every step solved in a few iterations
BEAM_STEP = 1e-4


def start(folder, program, *arguments):
    command = [ROOT / "target/release" / program, *map(str, arguments)]
    return subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def finish(process):
    """Waits for a process: its greatest resident size (MB)."""
    _, status, used = os.wait4(process.pid, 0)
    if status:
        raise SystemExit(f"{process.args} failed")
    return used.ru_maxrss / 1024


def beam(folder, name, steps, every, *options):
    """Runs the beam for so many steps; wall time (s)."""
    before = time.perf_counter()
    settings = [f"time.end={steps * BEAM_STEP:.6g}", f"output.every_steps={every}", *options]
    sets = [part for setting in settings for part in ("--set", setting)]
    finish(start(folder, "dem-run", "run", BEAM, "-o", name, "-q", "--force", *sets))
    return time.perf_counter() - before


def writing(folder):
    """A frame every ten steps against none but the first and the last."""
    steps = 600
    rounds = [(beam(folder, "none.h5", steps, steps), beam(folder, "often.h5", steps, 10)) for _ in range(5)]
    none, often = (min(times) for times in zip(*rounds))
    size = (folder / "often.h5").stat().st_size / 1e6
    print(f"| beam, {steps} steps: frame every 10 steps against none | {100 * (often / none - 1):+.1f} % wall time ({often:.1f} s, {size:.0f} MB) |")


def memory(folder, frames=1_000_000):
    """Resident size while a small scene writes a frame a step."""
    scene = ROOT / "configs/two-grains.json"
    check = [ROOT / "target/release/dem-run", "check", scene, "--json"]
    step = json.loads(subprocess.run(check, capture_output=True, check=True).stdout)["step"]
    process = start(
        folder, "dem-run", "run", scene, "-o", "long.h5", "-q", "--force",
        "--set", f"time.end={frames * step:.9g}", "--set", "output.every_steps=1", "--set", "bonds.strength=1e9",
        "--set", "output.checkpoint_every=1000",
    )
    seen = []
    before = time.perf_counter()
    while process.poll() is None:
        status = Path(f"/proc/{process.pid}/status").read_text()
        seen += [int(line.split()[1]) / 1024 for line in status.splitlines() if line.startswith("VmRSS")]
        time.sleep(0.5)
    took = time.perf_counter() - before
    seen = seen[2:-1]
    with h5py.File(folder / "long.h5") as history:
        count = int(history["commit"][()])
    tenths = [seen[k * (len(seen) - 1) // 10] for k in range(1, 11)]
    print(f"| resident size over {count:,} frames of two grains, at each tenth | {', '.join(f'{size:.0f}' for size in tenths)} MB ({took:.0f} s) |")


def least(repeat, action):
    """The smallest time of several (ms)."""
    times = []
    for _ in range(repeat):
        before = time.perf_counter()
        action()
        times.append(1e3 * (time.perf_counter() - before))
    return min(times)


def large(folder, frames=16_500):
    """Reading a large file: through h5py, and what dem-post takes of it.

    The beam is at rest, so that steps cost little; it has no forces then, which `chains` refuses.
    """
    path = folder / "large.h5"
    rest = ("walls.loader.force_rate=0", 'solver.kind={"gauss_seidel":{}}', "output.checkpoint_every=1000")
    took = beam(folder, path.name, frames, 1, *rest)
    size = path.stat().st_size
    print(f"| a beam at rest, {frames:,} frames | {size / 1e9:.1f} GB in {took:.0f} s, {size / took / 1e6:.0f} MB/s |", flush=True)
    with h5py.File(path) as history:
        position, contacts = history["particles/grains/position/value"], history["contacts"]
        middle = frames // 2

        def frame():
            position[middle]
            rows = slice(int(contacts["start"][middle]), int(contacts["start"][middle] + contacts["count"][middle]))
            contacts["pair"][rows], contacts["reaction"][rows]

        def particle():
            position[:10_000, 2000]

        print(f"| h5py: positions, pairs and reactions of one frame | {least(20, frame):.1f} ms |")
        print(f"| h5py: positions of one grain over 10,000 frames | {least(5, particle):.0f} ms |", flush=True)
    for command in (["info"], ["stress-strain"], ["cracks"], ["velocities"], ["view"], ["info", "--check"]):
        before = time.perf_counter()
        resident = finish(start(folder, "dem-post", command[0], path.name, *command[1:]))
        print(f"| `dem-post {' '.join(command)}` | {time.perf_counter() - before:.1f} s, at most {resident:.0f} MB |", flush=True)


PARTS = {"writing": writing, "memory": memory, "large": large}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", metavar="PART", help=", ".join(PARTS))
    parser.add_argument("--folder", type=Path, help="where the histories go, and stay [default: one for temporary files]")
    arguments = parser.parse_args()
    unknown = set(arguments.parts) - set(PARTS)
    if unknown:
        parser.error(f"no such part: {', '.join(unknown)}")
    with TemporaryDirectory() as temporary:
        folder = arguments.folder or Path(temporary)
        folder.mkdir(exist_ok=True)
        print("| what | measured |\n|---|---|")
        for part in arguments.parts or PARTS:
            PARTS[part](folder)


if __name__ == "__main__":
    main()
