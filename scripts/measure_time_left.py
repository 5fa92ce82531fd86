#!/usr/bin/env python3
"""How right the time left is that `dem-run run` prints, at 25, 50 and 75 % of runs of the shipped scenes.

    scripts/measure_time_left.py [--programs target/release] [--folder figures/time-left] [SCENE ...]

Runs each scene with `--progress json` and keeps its lines, so that a second call measures what is missing. Prints a
table in Markdown: what the last line until then says was left, and in parentheses what was left, from the same run. A
figure is right if it is within a factor of 2; ≤ is right if no more was left; `if it holds` is a condition, so it is
neither.
"""

import argparse
import json
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
MOMENTS = (0.25, 0.5, 0.75)
# share of the steps' time from which on a step is long
LONG = 0.05


def lines_of(scene, programs, folder):
    """The lines of progress of a run, from an earlier call if it was made."""
    path = folder / f"{scene}.jsonl"
    if not path.exists():
        part = path.with_suffix(".part")
        command = [programs / "dem-run", "run", ROOT / f"configs/{scene}.json", "--progress", "json", "--force"]
        with part.open("wb") as errors:
            subprocess.run([*command, "-o", folder / f"{scene}.h5"], stdout=subprocess.DEVNULL, stderr=errors, check=True)
        part.rename(path)
        (folder / f"{scene}.h5").unlink()
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def steps_of(lines):
    """When the steps began and ended (s), and the lines between."""
    began = max((line["elapsed_s"] for line in lines if line["event"] == "phase"), default=0.0)
    timed = [line for line in lines if line["event"] in ("step", "cascade")]
    return began, timed[-1]["elapsed_s"], timed


def told(lines, moment):
    """The last line until this share of the steps' time, and the time that was left after it (s)."""
    began, end, timed = steps_of(lines)
    now = began + moment * (end - began)
    before = [line for line in timed[:-1] if line["elapsed_s"] <= now]
    # a figure stands while the next step breaks bonds, unless that takes long
    recent = [line for line in before if line["event"] == "step" and line["elapsed_s"] > now - LONG * (end - began)]
    line = (recent or before or [None])[-1]
    return line and (line, end - line["elapsed_s"])


def cell(found):
    """What was told, for the table, and whether it is right; None if nothing was told."""
    if found is None:
        return "no line", None
    line, left = found
    if line["event"] == "cascade":
        return f"in a step ({left:.0f})", None
    figure, kind = line["left_s"], line["left_is"]
    if figure is None:
        return f"? ({left:.0f})", None
    if kind == "if_it_holds":
        return f"{figure:.0f} if it holds ({left:.0f})", None
    if kind == "at_most":
        return f"≤ {figure:.0f} ({left:.0f})", left <= figure
    return f"{figure:.0f} ({left:.0f})", 0.5 <= figure / left <= 2


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--programs", type=pathlib.Path, default=ROOT / "target/release")
    arguments.add_argument("--folder", type=pathlib.Path, default=ROOT / "figures/time-left")
    arguments.add_argument("scenes", nargs="*", metavar="SCENE")
    options = arguments.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    shipped = sorted(path.stem for path in (ROOT / "configs").glob("*.json") if not path.stem.startswith("sweep-"))
    counts, told_at_all, wrong = {True: 0, False: 0, None: 0}, 0, []
    print("| scene | steps took (s) | at 25 % | at 50 % | at 75 % |\n|---|---|---|---|---|")
    for scene in options.scenes or shipped:
        lines = lines_of(scene, options.programs, options.folder)
        began, end, _ = steps_of(lines)
        cells = [cell(told(lines, moment)) for moment in MOMENTS]
        for text, right in cells:
            counts[right] += 1
        if any(right is not None for _, right in cells):
            told_at_all += 1
            if any(right is False for _, right in cells):
                wrong.append(scene)
        marked = [text + {True: "", False: " **wrong**", None: ""}[right] for text, right in cells]
        print(f"| `{scene}` | {end - began:.1f} | {' | '.join(marked)} |", flush=True)
    print(f"\n{counts[True]} right, {counts[False]} wrong, {counts[None]} without a figure;", end=" ")
    print(f"{told_at_all - len(wrong)} of {told_at_all} scenes with figures have right ones only")
    return 0


if __name__ == "__main__":
    sys.exit(main())
