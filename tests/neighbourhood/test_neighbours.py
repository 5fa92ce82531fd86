"""The quick part of the neighbours: a few of them, right to the last number. All of them:
run.py."""

import argparse
import time

import pytest

import bases
import changes
import programs
import run
import scenes

NAMES = list(scenes.BASES) + run.QUICK


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    """Where the neighbours run."""
    return tmp_path_factory.mktemp("neighbours")


@pytest.mark.parametrize("name", NAMES)
def test_a_neighbour_is_right(name, folder):
    names = {name: scenes.neighbour(name)}
    arguments = argparse.Namespace(cpu=run.CPU)
    known = run.all_neighbours(arguments, names, folder, programs.dem_run(), time.monotonic() + run.CALL)[name]
    assert not known["wrong"], f"{known['wrong']}\nscene and history: {folder}/{known['key']}.*"
    assert not known["cut"], f"cut off after {known['cpu']:.0f} s"


# walls that close on bodies that cannot move away: rows of disks between two plates, a grain
# between two walls, a box that shrinks
def squeezed(bonded):
    """A square lattice of disks under a plate that comes down, on another."""
    scene = {
        "dimension": 2,
        "thickness": 0.01,
        "sample": {"lattice": {"square": {"diameter": 2e-3, "rows": 3, "columns": 3}}},
        "materials": bases.materials(),
        "walls": {"bottom": bases.plane([0, 1]), "top": bases.plane([0, -1]) | {"velocity": {"constant": 0.01}}},
        "time": {"step": 1e-4, "end": 0.01},
        "output": {"every_steps": 1},
    }
    return scene | ({"bonds": {"strength": 10, "gap_tolerance": 1e-3}} if bonded else {})


def oedometer(bonded):
    """Disks between fixed side walls under a plate that comes down."""
    scene = bases.disks()
    changes.side_walls(0.2)(scene)
    changes.lid("velocity")(scene)
    del scene["stop"]
    if not bonded:
        del scene["bonds"]
    return scene


@pytest.mark.parametrize(
    "scene",
    [squeezed(False), squeezed(True), oedometer(False), oedometer(True)],
    ids=["rows", "bonded rows", "oedometer", "bonded oedometer"],
)
def test_what_has_no_motion_stops_with_a_name(scene, folder):
    known = run.judged("disks", scene, folder, f"closing-{id(scene)}", programs.dem_run(), run.CPU)
    assert known["exit"] == 3 and known["named"], known["message"]
    assert not known["wrong"], known["wrong"]
