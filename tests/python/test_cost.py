"""What a scene does not use costs nothing: instructions and bytes of a contact, counted, not timed.

`dem-core/examples/cost.rs` runs one scene with each feature; valgrind counts. The figures of `cost.json` were counted with
the compiler that it names; `DEM_RECORD=1 .venv/bin/python -m pytest tests/python/test_cost.py` counts them anew.
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
ROWS, COLUMNS = "20", "40"


@pytest.fixture(scope="module")
def program():
    if "DEM_PROGRAMS" in os.environ:
        return Path(os.environ["DEM_PROGRAMS"]) / "examples/cost"
    return built("-p", "dem-core", "--example", "cost")["cost"]


def run(*command):
    return subprocess.run(
        [*map(str, command)], check=True, capture_output=True, text=True, env=os.environ | {"RAYON_NUM_THREADS": "1"}
    )


def counted(program, feature, what, times):
    """Instructions of a whole run."""
    valgrind = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null"]
    report = run(*valgrind, program, feature, ROWS, COLUMNS, what, times).stderr
    return int(report.split("Collected :")[1].split()[0])


@pytest.fixture(scope="module")
def cost(program):
    """For each feature: bytes of a contact, and instructions of a contact in a sweep and in a step of 20 sweeps."""

    def measured(feature):
        _, contacts, size, _ = map(int, run(program, feature, ROWS, COLUMNS, "sweep", 0).stdout.split())
        each = {"bytes": size}
        for what, few, many in [("sweep", 10, 60), ("step", 2, 12)]:
            spent = counted(program, feature, what, many) - counted(program, feature, what, few)
            each[what] = round(spent / (many - few) / contacts, 1)
        return each

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        cost = dict(zip(FEATURES, pool.map(measured, FEATURES)))
    print(json.dumps(cost, indent=1))
    return cost


def test_rows_that_a_contact_lacks_are_not_paid_for(cost):
    smooth, dry, bonded = (cost[feature] for feature in ["frictionless", "dry", "bonded"])
    assert smooth["sweep"] <= 0.5 * dry["sweep"]
    assert smooth["bytes"] <= 0.6 * dry["bytes"]
    assert dry["sweep"] <= 0.7 * bonded["sweep"]
    assert dry["bytes"] <= 0.7 * bonded["bytes"]


def test_nothing_costs_more_than_it_did(cost):
    compiler = subprocess.run(["rustc", "--version"], check=True, capture_output=True, text=True).stdout.split()[1]
    machine = {"rustc": compiler, "machine": platform.machine()}
    if "DEM_RECORD" in os.environ:
        RECORD.write_text(json.dumps(machine | {"cost": cost}, indent=2) + "\n")
    recorded = json.loads(RECORD.read_text())
    if any(recorded[key] != machine[key] for key in machine):
        pytest.skip(f"counted with rustc {recorded['rustc']} on {recorded['machine']}: see the top of this file")
    for feature, figures in recorded["cost"].items():
        for what, figure in figures.items():
            assert cost[feature][what] <= 1.02 * figure, (feature, what)
