"""VTK, pyvista and MDAnalysis read the values of the history through the companions of `dem-post
view`."""

import json
import shutil

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
    """A folder with run.h5 and its companions in view, both moved after they were made."""
    made = tmp_path_factory.mktemp("made")
    (made / "scene.json").write_text(json.dumps(SCENES[request.param]))
    dem_run(made, "run", "scene.json", "-o", "run.h5", "-q")
    dem_post(made, "view", "run.h5", "-o", "view", "-q")
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


def test_vtk_reads_grains(scene):
    frame = read(scene / "view/grains.vtkhdf")
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


def test_vtk_reads_contacts(scene):
    with h5py.File(scene / "run.h5") as history:
        contacts = history["contacts"]
        if contacts["pair"].size == 0:
            assert not (scene / "view/contacts.vtkhdf").exists()
            return
        frame = read(scene / "view/contacts.vtkhdf")
        walls = 0
        for k in frames(history):
            mesh = frame(k)
            rows = slice(contacts["start"][k], contacts["start"][k] + contacts["count"][k])
            assert mesh.n_lines == contacts["count"][k]
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


def test_vtk_reads_bonds(scene):
    with h5py.File(scene / "run.h5") as history:
        if "bonds" not in history:
            assert not (scene / "view/bonds.vtkhdf").exists()
            return
        frame = read(scene / "view/bonds.vtkhdf")
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
