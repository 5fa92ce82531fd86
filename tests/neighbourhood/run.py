#!/usr/bin/env python3
"""Runs the neighbours of the shipped scenes and checks each of them; continues where an earlier
call stopped.

    .venv/bin/python tests/neighbourhood/run.py [--seed N] [--folder DIR] [--page FILE.md] [--only TEXT] [--quick]

The result of each neighbour is stored in the folder under a digest of its scene, the program and
the checker. So an interrupted call can be continued, and a change repeats only the neighbours that
it affects. Histories of wrong neighbours stay in the folder. Exit code: 0 all right, 1 something is
wrong, 3 the time is up and neighbours are left.
"""

import argparse
import hashlib
import json
import re
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

import bases
import programs
import scenes
import tolerances
from check import check
from history import Unfit
from transform import transformed

# most processor time of a neighbour (s): then it is asked to stop, and killed after another GRACE
CPU, GRACE = 60.0, 30.0
# time of a call (s)
CALL = 2 * 3600.0
# neighbours of the quick part: the bases, and these
QUICK = [
    "disks, restitution 0.001",
    "disks, restitution 0.5, turned by 0.3",
    "disks, lid velocity",
    "disks, friction 0.0",
    "disks, cohesion 10000",
    "disks, end of step",
    "disks, cascade worst",
    "disks, weak in bending",
    "spheres, twist",
    "spheres, bonds that roll",
    "spheres, permuted",
    "beam, lid velocity ramp",
    "beam, mirrored",
    "heap, rough side walls",
    "heap, restitution 0.5",
    "heap, lid ramp",
    "heap, other units",
    "elastic, gravity",
    "elastic, Weibull bonds",
    "elastic, turned by 90°",
    "elastic, end of step",
    "elastic, confined",
    "elastic, lid slide",
    "elastic, confined by stress",
    "disks, list",
    "disks, file with materials",
    "disks, stages",
    "disks, cemented in a stage",
    "spheres, inclusion",
    "beam, next event",
    "events, bonds that roll",
    "heap, gripped",
]


def digest(*parts):
    """A short digest of texts and bytes."""
    out = hashlib.sha256()
    for part in parts:
        out.update(part if isinstance(part, bytes) else part.encode())
    return out.hexdigest()[:16]


def sources():
    """Source of checker and generator, for the digest."""
    here = Path(__file__).parent
    return "".join(
        (here / name).read_text()
        for name in sorted(p.name for p in here.glob("*.py") if not p.name.startswith("test_"))
    )


def sample_of(base, folder, program):
    """The grains of a base (a function) as rows of centre and radius: prepared once for each
    sample."""
    plain = base()
    key = digest(json.dumps([plain["dimension"], plain.get("seed"), plain["sample"]]))
    path = folder / f"sample-{key}.csv"
    if not path.exists():
        plain |= {"walls": {}, "time": {"step": 1e-9, "end": 1e-9}}
        for name in ("stop", "stages", "load_wall", "rupture", "bonds"):
            plain.pop(name, None)
        plain["materials"] = bases.materials()
        (folder / f"sample-{key}.json").write_text(json.dumps(plain))
        command = [
            program,
            "run",
            f"sample-{key}.json",
            "-o",
            f"sample-{key}.h5",
            "--force",
            "--quiet",
            "--threads",
            "1",
        ]
        subprocess.run(command + ["--write-sample", path.name], cwd=folder, check=True, stdout=subprocess.DEVNULL)
    return np.loadtxt(path, delimiter=",", skiprows=1)


def write_sample(scene, points, path, materials=None):
    """Writes grains (rows of centre and radius) to a file, from which the scene then takes them;
    `materials` are given to them in turns."""
    header = ",".join(("x", "y", "z")[: scene["dimension"]] + ("radius",))
    rows = [",".join(map(repr, map(float, row))) for row in points]
    if materials:
        header += ",material"
        rows = [f"{row},{materials[k % len(materials)]}" for k, row in enumerate(rows)]
    path.write_text("\n".join([header, *rows]) + "\n")
    scene["sample"] = {"file": {"path": path.name}}


def write_bonds(scene, points, path):
    """Writes the bonds of grains (rows of centre and radius) to a list: all pairs within half the gap
    tolerance, some of them with limits of their own."""
    centre, radius = points[:, :-1], points[:, -1]
    i, j = np.triu_indices(len(points), 1)
    gap = np.linalg.norm(centre[i] - centre[j], axis=1) - radius[i] - radius[j]
    near = gap <= 0.5 * scene["bonds"]["gap_tolerance"] * (radius[i] + radius[j])
    strength = scene["bonds"].get("strength")
    own = lambda k, period, value: repr(value) if value is not None and k % period == 0 else ""
    rows = [
        f"{a},{b},{own(k, 3, strength and 1.4 * strength)},{own(k, 4, 0.2)},{own(k, 5, 0.1)}"
        for k, (a, b) in enumerate(zip(i[near], j[near]))
    ]
    path.write_text("\n".join(["i,j,strength,shear,rolling", *rows]) + "\n")
    scene["bonds"]["list"] = path.name


def written(scene, base, folder, key, program):
    """Writes the scene, and its sample and bonds where they come from files."""
    way, listed = dict(scene.get("as file") or {}), scene.get("as list")
    scene = {name: value for name, value in scene.items() if not name.startswith("as ")}
    if way or listed:
        points = sample_of(scenes.BASES[base], folder, program)
    if way:
        materials = way.pop("materials", None)
        scene, points, _ = transformed(scene, points, **way)
        write_sample(scene, points, folder / f"{key}.csv", materials)
    if listed:
        write_bonds(scene, points, folder / f"{key}.bonds.csv")
    (folder / f"{key}.json").write_text(json.dumps(scene, indent=1))


def processor_time(pid):
    """Processor time of a process (s)."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / 100.0


def execute(folder, key, program, limit):
    """Runs a scene that is written: exit code, what it printed, whether it was cut, processor time
    (s)."""
    command = [program, "run", f"{key}.json", "-o", f"{key}.h5", "--force", "--quiet", "--json", "--threads", "1"]
    hard = lambda: resource.setrlimit(resource.RLIMIT_CPU, (int(limit + GRACE), int(limit + GRACE)))
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    cut = False
    with open(folder / f"{key}.out", "w+") as out, open(folder / f"{key}.err", "w+") as err:
        child = subprocess.Popen(command, cwd=folder, stdout=out, stderr=err, preexec_fn=hard)
        while child.poll() is None:
            try:
                child.wait(0.2)
            except subprocess.TimeoutExpired:
                if not cut and processor_time(child.pid) > limit:
                    cut = True
                    child.send_signal(signal.SIGTERM)
        out.seek(0), err.seek(0)
        printed, complaint = out.read(), err.read()
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return child.returncode, printed, complaint, cut, cpu


def judged(name, scene, folder, key, program, limit):
    """Runs and checks a neighbour; returns its result in the stored form."""
    written(scene, scenes.base_of(name), folder, key, program)
    code, printed, complaint, cut, cpu = execute(folder, key, program, limit)
    known = {
        "name": name,
        "key": key,
        "exit": code,
        "cut": cut,
        "cpu": cpu,
        "wrong": {},
        "steps": 0,
        "message": complaint.strip()[:600],
    }
    told = json.loads(printed) if printed.strip().startswith("{") else None
    expected = {0, 3, 130} if cut else {0, 3}
    if code not in expected:
        known["wrong"]["exit code"] = [f"{code}: {complaint.strip()[:300]}"]
    if code == 3:
        known["named"] = bool(re.search(r"grains? \d+", complaint)) and bool(
            re.search(r"(body|wall|grains?) \S+", complaint)
        )
    if told is None and not cut:
        return known
    try:
        report = check(folder / f"{key}.h5", told)
    except (Unfit, OSError) as reason:
        known["wrong"]["history"] = [str(reason)]
        return known
    known["wrong"] |= report.violations
    known["counts"], known["margins"] = report.counts, report.margins
    figures = report.figures
    known["steps"] = int(figures["steps"])
    known["missed"] = figures.get("steps that missed the tolerance", 0)
    known["parts"] = figures.get("steps in parts, not checked as one solve", 0)
    if told:
        known["cpu of steps"] = told["cpu_time"]
        known["broken"] = sum(told["broken"])
    known["figures"] = {k: v for k, v in figures.items() if isinstance(v, float)}
    if not known["wrong"]:
        for suffix in ("h5", "out", "err", "csv", "bonds.csv", "json"):
            (folder / f"{key}.{suffix}").unlink(missing_ok=True)
    return known


def told_rightly(known, scene):
    """Errors in the message of a run that stopped: it must name the squeezed bodies, and a claim
    that no motion exists must be true."""
    if known["exit"] != 3:
        return None
    first = (known["message"].splitlines() or ["no message"])[0]
    if "no motion" in first and not scenes.moves_walls(scene):
        # bodies that no wall pushes at a prescribed velocity can stay in place
        return ["no wall moves at a prescribed velocity, and it says: " + first]
    if scenes.may_have_no_motion(scene) and not known.get("named"):
        return ["it stopped without the names of who is squeezed: " + first]
    return None


def all_neighbours(arguments, names, folder, program, until):
    """Results of the neighbours, from the folder or new; incomplete if the time is up."""
    ours = sources()
    binary = program.read_bytes()
    out = {}
    for count, (name, scene) in enumerate(names.items()):
        key = digest(json.dumps(scene, sort_keys=True), scenes.base_of(name), binary, ours)
        kept = folder / f"{key}.known.json"
        if kept.exists():
            out[name] = json.loads(kept.read_text())
            continue
        if time.monotonic() > until:
            continue
        known = judged(name, scene, folder, key, program, arguments.cpu)
        reason = told_rightly(known, scene)
        if reason:
            known["wrong"]["why it stopped"] = reason
        kept.write_text(json.dumps(known))
        out[name] = known
        print(f"{count + 1}/{len(names)} {name}: {verdict(known)} ({known['cpu']:.1f} s)", flush=True)
    return out


def verdict(known):
    """The result in words."""
    if known["wrong"]:
        return "WRONG: " + ", ".join(sorted(known["wrong"]))
    return "right" + (", cut off" if known["cut"] else "") + (", stopped" if known["exit"] == 3 else "")


def per_step(known):
    """Processor time of a step (s)."""
    return known["cpu"] / known["steps"] if known["steps"] else float("nan")


PAGE = """\
# Neighbours of the shipped scenes

Each row is a small scene, one or two changes away from a base. It is run, and its history is checked step by step by a
program that implements the theory independently of the code ([tests/neighbourhood](../tests/neighbourhood)). *Wrong*
means that a check failed; steps that missed the solver's tolerance are counted. This page is written by

```sh
.venv/bin/python tests/neighbourhood/run.py --seed {seed} --page docs/neighbourhood.md
```

which continues where an earlier call stopped.

**{found} neighbours of {all} with seed {seed}: {right} right, {wrong} wrong.** {cut} were cut off after {cpu:g} s of
processor time and checked up to there; {stopped} stopped because a step was not solved (exit code 3), {named} of them
with the names of the bodies.

A run that stopped counts as right if its history is right, if it names the squeezed bodies, and if it reports that no
motion exists only where a wall moves at a prescribed velocity.

## What is checked

{checks}

A step in parts has one frame for all its parts, so only the checks that do not need the parts apply to it.

```text
{tolerances}
```

## All of them

*CPU* is processor time a step over that of the base; *missed* is the share of steps that missed the tolerance, *parts*
that of steps made in parts.

| neighbour | verdict | steps | CPU | missed | parts | ended |
|---|---|---|---|---|---|---|
{rows}
"""


def page(found, names, seed, cpu):
    """The page: how many, what is checked, a row each."""
    stopped = [known for known in found.values() if known["exit"] == 3]
    wrong = sum(bool(known["wrong"]) for known in found.values())
    return PAGE.format(
        seed=seed,
        found=len(found),
        all=len(names),
        right=len(found) - wrong,
        wrong=wrong,
        cut=sum(known["cut"] for known in found.values()),
        cpu=cpu,
        stopped=len(stopped),
        named=sum(bool(known.get("named")) for known in stopped),
        checks="\n".join(checks(found)),
        tolerances="\n".join(tolerances.lines()),
        rows="\n".join(row(name, known, found.get(scenes.base_of(name))) for name, known in found.items()),
    )


def row(name, known, base):
    """The row of a neighbour; `base` is the result of its base."""
    cost = per_step(known) / per_step(base) if base else float("nan")
    ended = "cut off" if known["cut"] else {0: "", 3: "stopped"}.get(known["exit"], f"exit code {known['exit']}")
    result = "right" if not known["wrong"] else "**wrong**: " + ", ".join(sorted(known["wrong"]))
    share = lambda key: f"{100 * known.get(key, 0) / max(known['steps'], 1):.3g} %" if known.get(key) else "0"
    ratio = "–" if np.isnan(cost) else f"{cost:.2g}"
    cells = [name, result, known["steps"], ratio, share("missed"), share("parts"), ended]
    return "| " + " | ".join(map(str, cells)) + " |"


def checks(found):
    """The checks, each with the largest value over its tolerance among the right neighbours."""
    names, most = {}, {}
    for known in found.values():
        for check_name, margin in known.get("margins", {}).items():
            names[check_name] = names.get(check_name, 0) + (check_name in known["wrong"])
            if check_name not in known["wrong"]:
                most[check_name] = max(most.get(check_name, 0.0), margin)
    rows = ["| check | failed in | largest value over its tolerance where right |", "|---|---|---|"]
    return rows + [f"| {name} | {names[name]} | {most.get(name, 0.0):.2g} |" for name in sorted(names)]


def main():
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--folder", type=Path, default=programs.ROOT / "target" / "neighbourhood")
    parser.add_argument("--page", type=Path)
    parser.add_argument("--only", help="only neighbours whose name has this in it")
    parser.add_argument("--quick", action="store_true", help="only those that scripts/test runs")
    parser.add_argument("--cpu", type=float, default=CPU, help="processor time of a neighbour (s)")
    parser.add_argument("--time", type=float, default=CALL, help="time of this call (s)")
    arguments = parser.parse_args()
    folder = arguments.folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    quick = lambda: {name: scenes.neighbour(name) for name in list(scenes.BASES) + QUICK}
    names = quick() if arguments.quick else scenes.neighbours(arguments.seed)
    if arguments.only:
        names = {name: scene for name, scene in names.items() if arguments.only in name}
    found = all_neighbours(arguments, names, folder, programs.dem_run(), time.monotonic() + arguments.time)
    if arguments.page:
        arguments.page.write_text(page(found, names, arguments.seed, arguments.cpu))
    wrong = {name: known for name, known in found.items() if known["wrong"]}
    for name, known in wrong.items():
        for check_name, examples in known["wrong"].items():
            print(f"{name}: {check_name}: {examples[0] if examples else ''}")
    print(f"{len(found)} of {len(names)} neighbours: {len(found) - len(wrong)} right, {len(wrong)} wrong")
    sys.exit(1 if wrong else 3 if len(found) < len(names) else 0)


if __name__ == "__main__":
    main()
