"""docs/history.md describes the content of a history, and its examples work as described.

Of a section with several examples the last one is run here; the others are files of docs/examples,
see test_examples.
"""

import re
import subprocess
import sys

import h5py
import numpy
import pytest
from conftest import ROOT

PAGE = (ROOT / "docs/history.md").read_text(encoding="utf-8")
SECTIONS = [section.split("\n", 1) for section in PAGE.split("\n## ")[1:]]
EXAMPLES = [(name, text) for name, body in SECTIONS for text in re.findall(r"^```python\n(.*?)^```", body, re.M | re.S)]


@pytest.fixture(scope="module")
def folder(compression, dem_post):
    dem_post(compression, "view", "compression.h5", "-q")
    return compression


def run(name, folder):
    text = dict(EXAMPLES)[name]
    answer = subprocess.run([sys.executable, "-c", text], cwd=folder, stdout=subprocess.PIPE, text=True)
    assert answer.returncode == 0
    return answer.stdout.splitlines()


def numbers(line):
    return [float(number) for number in re.findall(r"-?\d+(?:\.\d+)?", line)]


def test_every_example_is_run():
    assert sorted(dict(EXAMPLES)) == ["MDAnalysis", "ParaView and pyvista", "h5py", "pandas"]
    assert PAGE.count("```python") == len(EXAMPLES)


def test_h5py(folder):
    first, second = run("h5py", folder)
    with h5py.File(folder / "compression.h5") as history:
        contacts, count = history["contacts"], int(history["contacts/count"][-1])
        pair, force = contacts["pair"][-count:], contacts["reaction"][-count:, 0]
    assert numbers(first) == [count, (pair[:, 1] < 0).sum(), (force < 0).sum()]
    assert numbers(second)[0] == pytest.approx(force.max(), abs=1e-4)
    assert numbers(second)[1:] in pair[force == force.max()].tolist()


def test_pandas(folder):
    lines = run("pandas", folder)
    assert lines[0].split() == ["time", "load"]
    with h5py.File(folder / "compression.h5") as history:
        first = history["events/rupture"]["step"][0]
        load = history["observables/applied_force/value"][list(history["observables/step"]).index(first)]
    assert float(lines[3].split()[2]) in load.round(2)


def test_pyvista(folder):
    first, second = run("ParaView and pyvista", folder)
    with h5py.File(folder / "compression.h5") as history:
        grains = history["particles/grains"]
        height = (grains["position/value"][100, :, 1] + grains["radius"][:]).max()
        assert numbers(first)[0] == grains["id"].size
        # the balls are polyhedra
        assert numbers(first)[1] == pytest.approx(height, abs=1e-4)
        status = history["bonds/status/value"][-1]
    assert numbers(second) == [(status == 0).sum(), status.size]


def test_mdanalysis(folder):
    lines = run("MDAnalysis", folder)
    with h5py.File(folder / "compression.h5") as history:
        grains = history["particles/grains"]
        times, heights, mass = grains["position/time"][::100], grains["position/value"][::100, :, 1], grains["mass"][:]
    centres = heights @ mass / mass.sum()
    assert numpy.allclose([numbers(line) for line in lines], numpy.c_[times, centres], rtol=0, atol=1e-6)


# the type in the file as the page writes it
TYPES = {"f": "f64", "O": "text", "V": "compound"}


def type_of(dtype):
    if h5py.check_enum_dtype(dtype):
        return "enum"
    return TYPES.get(dtype.kind, f"{dtype.kind}{8 * dtype.itemsize}")


def extents(row, size):
    """The shapes that a row of the page allows."""
    shapes = re.findall(r"\[([A-Z0-9,]+)\]", row) or [""]
    return [tuple(size[n] if n in size else int(n) for n in shape.split(",") if n) for shape in shapes]


@pytest.fixture(scope="module")
def space(dem_run, tmp_path_factory):
    folder = tmp_path_factory.mktemp("space")
    bonded = ["--set", 'bonds={"strength": 0.01, "gap_tolerance": 1e-3}']
    plate = '{"normal": [0, 0, -1], "center": [0, 0, 1], "size": [0.01, 0.02], "side": [1, 0, 0]}'
    plate = ["--set", f'walls.lid={{"shape": {{"plate": {plate}}}}}']
    twist = ["--set", 'materials.pairs=[{"between": ["base", "base"], "bonds": {"twist": 0.1}}]']
    dem_run(folder, "run", ROOT / "tests/problems/scenes/cube.json", "-o", "space.h5", "-q", *bonded, *plate, *twist)
    return folder / "space.h5"


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_page_tells_every_dataset(folder, space, dimension):
    rows = {}
    for line in PAGE.splitlines():
        cells = [cell.strip() for cell in line.split("|")[1:-1]]
        for place in re.findall(r"`([\w/]+)`", cells[0]) if cells else []:
            rows[place] = cells[1:]
    seen = set()

    def visit(name, item):
        if not isinstance(item, h5py.Dataset) or name == "parameters/scene":
            return
        if name.startswith("observables/"):
            name = name.split("/")[1]
            if name in ("step", "time") or not item.name.endswith("/value"):
                return
            unit, (shape,) = rows[name][0], extents(rows[name][-1].split(" in 2D")[0], size)
            seen.add(name)
            kind = "enum" if rows[name][-1].startswith("enum") else "f64"
            assert type_of(item.dtype) == kind and (item.shape[1:] == shape or dimension == 3)
        else:
            if name.endswith(("/step", "/time")) and not name.startswith("contacts"):
                return
            place = "/" + name.removesuffix("/value")
            kind, unit = rows[place][:2]
            seen.add(place)
            assert kind.split()[0] == type_of(item.dtype), name
            assert item.shape in extents(kind, size), name
        assert item.attrs.get("unit", "") == unit, name

    with h5py.File(folder / "compression.h5" if dimension == 2 else space) as history:
        lists = {"N": "particles/grains/id", "W": "walls/name", "B": "bonds/pair", "M": "contacts/pair"}
        lists |= {"T": "contacts/start", "S": "observables/step", "E": "events/rupture"}
        size = {"D": dimension} | {letter: history[place].shape[0] for letter, place in lists.items()}
        assert all(size[letter] > 0 for letter in "TNWBMS")
        slots = {"R0": "reals_0", "C0": "counts_0", "R1": "reals_1", "C1": "counts_1"}
        size |= {letter: len(history["checkpoint"][name]) for letter, name in slots.items()}
        history.visititems(visit)
        # hard links are visited once
        for name in history["contacts"]:
            seen.add(f"/contacts/{name}")
        flat = {"/particles/grains/orientation", "/contacts/tangent", "/quaternion", "/moment_component"}
        # and the scene in 2D has no plate and no pair of materials
        flat |= {"/walls/side", "/walls/length", "/walls/width", "/bonds/twist"}
        absent = {2: flat, 3: {"/particles/grains/angle"}}[dimension]
        # these scenes have one coefficient for shear and rolling
        absent |= {"/bonds/rolling"}
        # and one material
        absent |= {"/particles/grains/material", "/materials/name", "/material"}
        # and bonds from the start
        absent |= {"/bonds/formed", "/stage"}
        elastic = {"elastic_energy", "dissipation_damping", "fracture_energy"}
        places = {place for place in rows if place.startswith("/")}
        assert places - seen == absent
        assert set(history["observables"]) - {"step", "time"} <= set(rows) - elastic
