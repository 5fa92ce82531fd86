"""VTK, pyvista and MDAnalysis read the values of the history through the companions of `dem-post
view`, VTK and a plain reader of the dumps through its copies. Older and other viewers:
scripts/test_viewers."""

import json
import shutil
import xml.etree.ElementTree

import h5py
import MDAnalysis
import numpy
import pytest
import pyvista
import vtk

MATERIALS = {"density": 2500, "friction": {"grain_grain": 0.3, "grain_wall": 0.3}}
# three grains on a floor, two of them bonded; one turns
FLAT = {
    "dimension": 2,
    "sample": {
        "grains": [
            {"center": [0, 2e-3], "radius": 2e-3},
            {"center": [4e-3, 2e-3], "radius": 2e-3},
            {"center": [2e-3, 5.5e-3], "radius": 1.5e-3, "velocity": [0.05, 0], "spin": [20]},
        ]
    },
    "materials": MATERIALS,
    "bonds": {"strength": 1e-3, "gap_tolerance": 1e-3},
    "walls": {"floor": {"shape": {"plane": {"normal": [0, 1], "place": "seated"}}}},
    "gravity": [0, -9.81],
    "time": {"step": 1e-3, "end": 0.1},
    "output": {"every_steps": 5},
}
# the same in 3D, without bonds
SPACE = FLAT | {
    "dimension": 3,
    "sample": {
        "grains": [
            {"center": [0, 0, 2e-3], "radius": 2e-3},
            {"center": [4e-3, 0, 2e-3], "radius": 2e-3},
            {"center": [2e-3, 0, 6e-3], "radius": 1.5e-3, "velocity": [0.05, 0.02, 0], "spin": [1, 2, 20]},
        ]
    },
    "walls": {"floor": {"shape": {"plane": {"normal": [0, 0, 1], "place": "seated"}}}},
    "gravity": [0, 0, -9.81],
}
del SPACE["bonds"]
# 2D again, in single precision and without reactions
SINGLE = FLAT | {"output": {"every_steps": 5, "precision": "single"}}
LESS = FLAT | {"output": {"every_steps": 5, "reactions": False}}
# nothing that could touch
BARE = {
    "dimension": 3,
    "sample": {"grains": [{"center": [0, 0, 0], "radius": 1e-3}, {"center": [0.1, 0, 0], "radius": 2e-3}]},
    "materials": MATERIALS,
    "gravity": [0, 0, -9.81],
    "time": {"step": 1e-3, "end": 0.01},
    "output": {"every_steps": 2},
}
SCENES = {"flat": FLAT, "space": SPACE, "single": SINGLE, "less": LESS, "bare": BARE}


@pytest.fixture(scope="module", params=SCENES)
def scene(request, dem_run, dem_post, tmp_path_factory):
    """A folder with run.h5, its companions in view, and its copies in vtp and dump, all moved after
    they were made."""
    made = tmp_path_factory.mktemp("made")
    (made / "scene.json").write_text(json.dumps(SCENES[request.param]))
    dem_run(made, "run", "scene.json", "-o", "run.h5", "-q")
    dem_post(made, "view", "run.h5", "-o", "view", "-q")
    dem_post(made, "view", "run.h5", "-o", "vtp", "--format", "vtp", "-q")
    dem_post(made, "view", "run.h5", "-o", "dump", "--format", "lammps", "-q")
    return shutil.move(made, tmp_path_factory.mktemp("moved") / request.param)


def padded(values):
    return numpy.pad(values, ((0, 0), (0, 3 - values.shape[1])))


def frames(history):
    last = int(history["commit"][()]) - 1
    return [0, last // 2, last]


def read(path):
    """A function that reads a frame of a companion."""
    reader = vtk.vtkHDFReader()
    assert reader.CanReadFile(str(path))
    reader.SetFileName(str(path))
    reader.UpdateInformation()

    def frame(k):
        reader.SetStep(k)
        reader.Update()
        assert reader.GetErrorCode() == 0
        return pyvista.wrap(reader.GetOutput())

    frame.times = reader.GetOutputInformation(0).Get(vtk.vtkStreamingDemandDrivenPipeline.TIME_STEPS())
    return frame


def read_list(path):
    """The same of a list of files in XML."""
    sets = xml.etree.ElementTree.parse(path).getroot().findall("Collection/DataSet")

    def frame(k):
        reader = vtk.vtkXMLPolyDataReader()
        reader.SetFileName(str(path.parent / sets[k].get("file")))
        reader.Update()
        assert reader.GetErrorCode() == 0
        return pyvista.wrap(reader.GetOutput())

    frame.times = [float(one.get("timestep")) for one in sets]
    return frame


@pytest.fixture(params=["view", "vtp"])
def opened(request, scene):
    """A function that opens the file of grains, contacts or bonds."""

    def open(kind):
        if request.param == "view":
            return read(scene / f"view/{kind}.vtkhdf")
        return read_list(scene / f"vtp/{kind}.pvd")

    open.made = lambda kind: any(scene.glob(f"{request.param}/{kind}*"))
    return open


def test_vtk_reads_grains(scene, opened):
    frame = opened("grains")
    with h5py.File(scene / "run.h5") as history:
        grains = history["particles/grains"]
        assert list(frame.times) == list(grains["position/time"])
        seen = set()
        for k in frames(history):
            mesh = frame(k)
            assert mesh.n_verts == mesh.n_points == grains["id"].size
            assert (mesh.points == padded(grains["position/value"][k])).all()
            assert (mesh["velocity"] == padded(grains["velocity/value"][k])).all()
            for name in ("radius", "id", "mass"):
                assert (mesh[name] == grains[name][:]).all()
            if "angle" in grains:
                assert (mesh["angle"] == grains["angle/value"][k]).all()
                assert (mesh["angular_velocity"][:, 2] == grains["angular_velocity/value"][k]).all()
                assert not mesh["angular_velocity"][:, :2].any()
            elif "orientation" in grains:
                assert (mesh["orientation"] == grains["orientation/value"][k]).all()
                assert (mesh["angular_velocity"] == grains["angular_velocity/value"][k]).all()
            seen.add(mesh.points.tobytes())
        assert len(seen) == 3


def test_vtk_reads_contacts(scene, opened):
    with h5py.File(scene / "run.h5") as history:
        contacts = history["contacts"]
        if contacts["pair"].size == 0:
            assert not opened.made("contacts")
            return
        frame = opened("contacts")
        walls = 0
        for k in frames(history):
            mesh = frame(k)
            rows = slice(contacts["start"][k], contacts["start"][k] + contacts["count"][k])
            assert mesh.n_lines == contacts["count"][k]
            if mesh.n_lines == 0:
                continue
            pair, point = contacts["pair"][rows], padded(contacts["point"][rows])
            centres = padded(history["particles/grains/position/value"][k])
            ends = mesh.points[mesh.lines.reshape(-1, 3)[:, 1:]]
            touching = pair[:, 1] < 0
            walls += touching.sum()
            assert (ends[:, 0] == centres[pair[:, 0]]).all()
            assert (ends[:, 1] == numpy.where(touching[:, None], point, centres[pair[:, 1]])).all()
            assert ("normal_force" in mesh.cell_data) == ("reaction" in contacts)
            if "reaction" in contacts:
                reaction = contacts["reaction"][rows]
                assert (mesh["normal_force"] == reaction[:, 0]).all()
                assert (mesh["tangential_force"] == reaction[:, 1:].reshape(mesh["tangential_force"].shape)).all()
            for name in ("gap", "status", "bond", "moment"):
                assert (name in mesh.cell_data) == (name in contacts)
                if name in contacts:
                    assert (mesh[name] == contacts[name][rows]).all()
            assert (mesh["normal"] == padded(contacts["normal"][rows])).all()
        assert walls > 0 and ("reaction" not in contacts or mesh["normal_force"].max() > 0)


def test_vtk_reads_bonds(scene, opened):
    with h5py.File(scene / "run.h5") as history:
        if "bonds" not in history:
            assert not opened.made("bonds")
            return
        frame = opened("bonds")
        bonds = history["bonds"]
        states = set()
        for k in frames(history):
            mesh = frame(k)
            assert (mesh["status"] == bonds["status/value"][k]).all()
            assert (mesh["strength"] == bonds["strength"][:]).all()
            ends = mesh.points[mesh.lines.reshape(-1, 3)[:, 1:]]
            assert (ends == padded(history["particles/grains/position/value"][k])[bonds["pair"][:]]).all()
            states.update(mesh["status"])
        # intact, then broken
        assert len(states) > 1


def dumped(path):
    """The frames of a dump: time, step, box and the rows by the names of their columns."""
    frames = []
    for text in path.read_text().split("ITEM: TIME\n")[1:]:
        parts = [part.split("\n") for part in text.rstrip("\n").split("\nITEM: ")]
        (time,), (_, step), (_, count), (_, *box), (head, *rows) = parts
        assert len(rows) == int(count)
        names = head.split()[1:]
        table = numpy.array([[float(cell) for cell in row.split()] for row in rows]).reshape(len(rows), len(names))
        box = numpy.array([[float(end) for end in ends.split()] for ends in box])
        frames.append((float(time), int(step), box, dict(zip(names, table.T))))
    return frames


def test_dumps_have_grains(scene):
    found = dumped(scene / "dump/grains.dump")
    with h5py.File(scene / "run.h5") as history:
        grains = history["particles/grains"]
        assert [time for time, *_ in found] == list(grains["position/time"])
        assert [step for _, step, *_ in found] == list(grains["position/step"])
        for k in frames(history):
            *_, box, rows = found[k]
            centres, radius = padded(grains["position/value"][k]), grains["radius"][:][:, None]
            assert (box == numpy.c_[(centres - radius).min(axis=0), (centres + radius).max(axis=0)]).all()
            assert (numpy.c_[rows["x"], rows["y"], rows["z"]] == centres).all()
            assert (numpy.c_[rows["vx"], rows["vy"], rows["vz"]] == padded(grains["velocity/value"][k])).all()
            for name in ("radius", "id", "mass"):
                assert (rows[name] == grains[name][:]).all()
            assert (rows["type"] == 1).all()
            if "angle" in grains:
                assert (rows["angle"] == grains["angle/value"][k]).all()
                assert (rows["omegaz"] == grains["angular_velocity/value"][k]).all()
            elif "orientation" in grains:
                turn = numpy.c_[rows["quatw"], rows["quati"], rows["quatj"], rows["quatk"]]
                assert (turn == grains["orientation/value"][k]).all()
                spin = numpy.c_[rows["omegax"], rows["omegay"], rows["omegaz"]]
                assert (spin == grains["angular_velocity/value"][k]).all()


def test_dumps_have_pairs(scene):
    with h5py.File(scene / "run.h5") as history:
        assert (scene / "dump/bonds.dump").exists() == ("bonds" in history)
        assert (scene / "dump/contacts.dump").exists() == (history["contacts/pair"].size > 0)
        if "bonds" in history:
            bonds, numbers = history["bonds"], set()
            found = dumped(scene / "dump/bonds.dump")
            for k in frames(history):
                holds, rows = bonds["status/value"][k] == 0, found[k][3]
                assert (numpy.c_[rows["batom1"], rows["batom2"]] == bonds["pair"][:][holds]).all()
                assert (rows["strength"] == bonds["strength"][:][holds]).all()
                numbers.add(len(rows["index"]))
            # bonds that broke are gone
            assert len(numbers) > 1
        if history["contacts/pair"].size > 0:
            contacts, seen = history["contacts"], 0
            found = dumped(scene / "dump/contacts.dump")
            for k in frames(history):
                rows = slice(contacts["start"][k], contacts["start"][k] + contacts["count"][k])
                between = contacts["pair"][rows][:, 1] >= 0
                table = found[k][3]
                assert (numpy.c_[table["patom1"], table["patom2"]] == contacts["pair"][rows][between]).all()
                assert (table["gap"] == contacts["gap"][rows][between]).all()
                assert (table["status"] == contacts["status"][rows][between]).all()
                assert ("normal_force" in table) == ("reaction" in contacts)
                if "reaction" in contacts:
                    reaction = contacts["reaction"][rows][between]
                    assert (table["normal_force"] == reaction[:, 0]).all()
                    tangential = numpy.linalg.norm(reaction[:, 1:], axis=1)
                    assert table["tangential_force"] == pytest.approx(tangential, rel=1e-14)
                seen += between.sum()
            assert seen > 0


def test_mdanalysis_reads_positions(scene):
    with h5py.File(scene / "run.h5") as history:
        grains = history["particles/grains"]
        universe = MDAnalysis.Universe.empty(grains["id"].size, trajectory=True)
        universe.load_new(str(scene / "view/grains.h5md"), convert_units=False)
        assert len(universe.trajectory) == history["commit"][()]
        for k in frames(history):
            step = universe.trajectory[k]
            assert step.time == grains["position/time"][k] and step.dimensions is None
            # MDAnalysis keeps positions in single precision
            assert (step.positions == padded(grains["position/value"][k]).astype("f4")).all()
            assert (step.velocities == padded(grains["velocity/value"][k]).astype("f4")).all()


def test_a_companion_without_its_history_is_an_error(scene, tmp_path):
    shutil.copytree(scene / "view", tmp_path / "alone/view")
    for path in (tmp_path / "alone/view").glob("*.vtkhdf"):
        reader = vtk.vtkHDFReader()
        reader.SetFileName(str(path))
        vtk.vtkObject.GlobalWarningDisplayOff()
        reader.Update()
        vtk.vtkObject.GlobalWarningDisplayOn()
        assert reader.GetOutput() is None or reader.GetOutput().GetNumberOfPoints() == 0
    universe = MDAnalysis.Universe.empty(1, trajectory=True)
    with pytest.raises(KeyError):
        universe.load_new(str(tmp_path / "alone/view/grains.h5md"), convert_units=False)
