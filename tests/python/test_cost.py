"""Unused features cost nothing: instructions and bytes of a contact are counted, not timed.

`dem-core/examples/cost.rs` runs one scene with each feature; valgrind counts. The figures of `cost.json` were counted with
the compiler that it names; `DEM_RECORD=1 .venv/bin/python -m pytest tests/python/test_cost.py` counts them again.
"""

import json
import os
import platform
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from conftest import built

RECORD = Path(__file__).with_name("cost.json")
FEATURES = ["frictionless", "dry", "restitution", "bonded", "elastic"]
# rows of so many disks, layers of so many spheres squared
SCENES = {"disks": ["20", "40"], "spheres": ["8", "10"], "twisting": ["8", "10"]}
# spheres whose bonds resist twist have bonds
ALL = [(grains, feature) for grains in SCENES for feature in (FEATURES if grains != "twisting" else FEATURES[3:])]


@pytest.fixture(scope="module")
def program():
    if "DEM_PROGRAMS" in os.environ:
        return Path(os.environ["DEM_PROGRAMS"]) / "examples/cost"
    return built("-p", "dem-core", "--example", "cost")["cost"]


def run(*command):
    return subprocess.run(
        [*map(str, command)], check=True, capture_output=True, text=True, env=os.environ | {"RAYON_NUM_THREADS": "1"}
    )


def counted(program, grains, feature, what, times):
    """Instructions of a whole run."""
    valgrind = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null"]
    report = run(*valgrind, program, grains, feature, *SCENES[grains], what, times).stderr
    return int(report.split("Collected :")[1].split()[0])


@pytest.fixture(scope="module")
def cost(program):
    """Bytes of a contact, and instructions of a contact in a sweep and in a step of 20 sweeps, for
    each feature."""

    def measured(of):
        grains, feature = of
        _, contacts, size, _ = map(int, run(program, grains, feature, *SCENES[grains], "sweep", 0).stdout.split())
        each = {"bytes": size}
        for what, few, many in [("sweep", 10, 60), ("step", 2, 12)]:
            spent = counted(program, grains, feature, what, many) - counted(program, grains, feature, what, few)
            each[what] = round(spent / (many - few) / contacts, 1)
        return each

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        figures = dict(zip(ALL, pool.map(measured, ALL)))
    cost = {grains: {feature: figures[of, feature] for of, feature in ALL if of == grains} for grains in SCENES}
    print(json.dumps(cost, indent=1))
    return cost


# Instructions and bytes of a contact without friction over those of a dry one, and of that over
# those of a bond. Of spheres they are smaller than required, and limited to near the counted value
# (0.316 since dry spheres take 5 % fewer instructions).
LIMITS = {"disks": [0.5, 0.6, 0.7, 0.7], "spheres": [0.32, 0.6, 0.7, 0.55]}


@pytest.mark.parametrize("grains", LIMITS)
def test_rows_that_a_contact_lacks_are_not_paid_for(cost, grains):
    smooth, dry, bonded = (cost[grains][feature] for feature in ["frictionless", "dry", "bonded"])
    shares = [less[what] / more[what] for less, more in [(smooth, dry), (dry, bonded)] for what in ["sweep", "bytes"]]
    assert all(share <= limit for share, limit in zip(shares, LIMITS[grains])), shares


def test_nothing_costs_more_than_it_did(cost):
    compiler = subprocess.run(["rustc", "--version"], check=True, capture_output=True, text=True).stdout.split()[1]
    machine = {"rustc": compiler, "machine": platform.machine()}
    if "DEM_RECORD" in os.environ:
        RECORD.write_text(json.dumps(machine | {"cost": cost}, indent=2) + "\n")
    recorded = json.loads(RECORD.read_text())
    if any(recorded[key] != machine[key] for key in machine):
        pytest.skip(f"counted with rustc {recorded['rustc']} on {recorded['machine']}: see the top of this file")
    for grains, features in recorded["cost"].items():
        for feature, figures in features.items():
            for what, figure in figures.items():
                assert cost[grains][feature][what] <= 1.02 * figure, (grains, feature, what)


# names of the rows of the first table of docs/cost.md; rows of spheres whose bonds resist twist
# name that too
NAMES = {
    "frictionless": "of {grains}, without friction",
    "dry": "dry",
    "restitution": "dry, with restitution",
    "bonded": "rigid bonds",
    "elastic": "elastic bonds",
}


def test_the_page_has_the_recorded_figures():
    recorded = json.loads(RECORD.read_text())["cost"]
    rows = []
    for grains, feature in ALL:
        name = NAMES[feature].format(grains=grains) + (" that resist twist" if grains == "twisting" else "")
        bytes_, sweep, step = (recorded[grains][feature][what] for what in ["bytes", "sweep", "step"])
        rows.append(f"| {name} | {bytes_} | {round(sweep)} | {10 * round(step / 10):,} |")
    page = (RECORD.parents[2] / "docs/cost.md").read_text()
    assert "\n".join(rows) in page, "\n".join(rows)
