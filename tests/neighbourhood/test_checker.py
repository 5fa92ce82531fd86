"""The checker finds errors: one number of a good history is altered, and the check of this number
must fail."""

import copy
import re
import shutil

import h5py
import numpy as np
import pytest

import programs
import summary
from check import check
from history import History
from report import Report
from small_scenes import OUTPUT, SCENES
from spoil import Good
from spoilt import EITHER, SPOILT


class Runs(dict):
    """Good runs by the name of their scene, each made when it is first asked for."""

    def __init__(self, folder):
        super().__init__()
        self.folder = folder

    def __missing__(self, name):
        scene = SCENES[name]()
        for file, text in scene.pop("files", {}).items():
            (self.folder / file).write_text(text)
        self[name] = Good(*programs.run(scene, self.folder, name, text=True))
        return self[name]


@pytest.fixture(scope="session")
def good(tmp_path_factory):
    """Good runs."""
    return Runs(tmp_path_factory.mktemp("good"))


@pytest.mark.parametrize("name", SCENES)
def test_a_good_history_is_right(good, name):
    g = good[name]
    report = check(g.path, g.told, g.text)
    assert not report.wrong, "\n".join(report.lines())
    if g.h.K:
        assert len(g.h.events), "the scene is to break bonds"


@pytest.mark.parametrize("scene, what, spoil, expected", SPOILT, ids=[f"{s}: {w}" for s, w, _, _ in SPOILT])
def test_a_spoilt_number_is_found(good, tmp_path, scene, what, spoil, expected):
    path = tmp_path / "spoilt.h5"
    shutil.copy(good[scene].path, path)
    for table in good[scene].path.parent.glob("*.csv"):
        shutil.copy(table, tmp_path)
    with h5py.File(path, "r+") as file:
        spoil(file, good[scene])
    wrong = set(check(path).wrong)
    assert wrong & EITHER.get(
        expected, {expected}
    ), f"{what} was altered, {expected} found nothing; found: {sorted(wrong)}"


def numbers(value, path=()):
    """The places of all numbers in a summary."""
    if isinstance(value, dict):
        return [p for key, inner in value.items() for p in numbers(inner, path + (key,))]
    if isinstance(value, list):
        return [p for k, inner in enumerate(value) for p in numbers(inner, path + (k,))]
    return [path] if isinstance(value, (int, float)) and not isinstance(value, bool) else []


def wrong_in_summary(good, told, text=None):
    """Whether the checks of the summary alone fail."""
    report = Report()
    summary.check(good.h, report, told, text)
    return set(report.wrong)


@pytest.mark.parametrize("scene", SCENES)
def test_every_number_of_a_summary_is_checked(good, scene):
    g = good[scene]
    for path in numbers(g.told):
        told = copy.deepcopy(g.told)
        place = told
        for key in path[:-1]:
            place = place[key]
        old = place[path[-1]]
        place[path[-1]] = old + 1 if isinstance(old, int) else old * (1 + 1e-9) + 1e-12
        if path == ("cpu_time",):
            place[path[-1]] = 0.0
        if path == ("preparation_time",):
            place[path[-1]] = 1e6
        assert "summary" in wrong_in_summary(g, told), f"{path} was altered from {old} to {place[path[-1]]}"


def test_an_ending_that_is_none_is_found(good):
    told = good["beam"].told
    assert told["ending"] == "broken_fraction"
    assert "ending" in wrong_in_summary(good["beam"], told | {"ending": "time"})


@pytest.mark.parametrize("scene", SCENES)
def test_every_number_of_a_summary_in_words_is_checked(good, scene):
    g = good[scene]
    end = g.text.index("CPU time")
    lines = list(
        re.finditer(
            r"(?<=[ (])(\d+\.?\d*)(e-?\d+)?(?= N|\)| J| m|,| s | steps| grains| %| Newton| fact| sweeps)", g.text[:end]
        )
    )
    assert len(lines) > 5
    for match in lines:
        digits, power = match.group(1), match.group(2) or ""
        other = digits[:-1] + str((int(digits[-1]) + 4) % 10)
        text = g.text[: match.start()] + other + power + g.text[match.end() :]
        context = g.text[g.text.rfind("\n", 0, match.start()) + 1 : g.text.find("\n", match.start())]
        if "strain" in context and power:
            continue
        assert "summary's text" in wrong_in_summary(
            g, g.told, text
        ), f"{match.group()} became {other}{power} in {context!r}"


def test_every_check_has_a_history_that_it_fails(good):
    names = set()
    for name in SCENES:
        names |= set(check(good[name].path, good[name].told, good[name].text).margins)
    spoilt = {expected for _, _, _, expected in SPOILT if expected not in EITHER} | set().union(*EITHER.values())
    spoilt |= {"summary", "summary's text", "ending"}
    assert names <= spoilt, f"nothing is spoilt for {sorted(names - spoilt)}"


def stopped(stiffness, friction):
    """Two bonded disks that a force of one step makes turn, by 0.1 rad a step, until two fixed ones
    stop them; a fast one that bounces off a wall makes the fifth step in parts."""
    r, h = 1e-2, 1e-3
    # bodies that turn with them have half as much inertia again
    force = (1.5 if friction else 1.0) * 2500 * np.pi * r**2 * 0.1 * r / h**2
    pulse = {"table": [[0.0, 1.0], [h, 1.0], [1.01 * h, 0.0]]}
    grains = [
        {"center": [-r, 0], "radius": r},
        {"center": [r, 0], "radius": r},
        {"center": [-r, -2.45 * r], "radius": r},
        {"center": [r, 2.45 * r], "radius": r},
        {"center": [100 * r, 0], "radius": r, "velocity": [6 * r / h, 0]},
    ]
    bonds = {"strength": 2e4, "gap_tolerance": 1e-3, "friction": friction}
    if stiffness:
        bonds["stiffness"] = {"young": {"modulus": stiffness, "poisson_ratio": 0.2}}
    return {
        "dimension": 2,
        "thickness": 1,
        "sample": {"grains": grains},
        "grains": {
            "fixed": [2, 3],
            "loads": [{"grain": k, "force": [0, f], "time": pulse} for k, f in enumerate([-force, force])],
        },
        "materials": {
            "density": 2500,
            "friction": {"grain_grain": 0.0, "grain_wall": 0.0},
            "restitution": {"grain_grain": 0.0, "grain_wall": 0.5},
        },
        "bonds": bonds,
        "walls": {"side": {"shape": {"plane": {"normal": [-1, 0], "place": {"at": [129.2 * r, 0]}}}}},
        "time": {"step": h, "end": 0.016},
        "output": OUTPUT,
    }


@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize("stiffness", [None, 1e8])
def test_lengths_are_judged_where_frames_tell_them(tmp_path, stiffness, friction):
    path, told, _ = programs.run(stopped(stiffness, friction), tmp_path)
    h = History(path)
    assert (~h.single).sum() == 1 and h.K == 1
    assert not check(path, told).wrong
    # a whole step after the parts; of springs a tenth of what the turn added to the length before
    with h5py.File(path, "r+") as file:
        place = file["particles/grains/position/value"]
        shift = 1e-5 if stiffness else 5e-4
        place[12] = place[12] + np.where(np.arange(5) == 1, shift, 0.0)[:, None] * [1.0, 0.0]
    expected = "length of elastic bonds" if stiffness else "length of rigid bonds"
    assert expected in check(path, told).wrong
