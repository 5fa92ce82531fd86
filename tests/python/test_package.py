"""The Python package: what it reads is what h5py reads, with names and units."""

import json
import os
import signal
import subprocess
import sys
import time

import dem
import h5py
import numpy
import pytest
from conftest import ROOT

COLUMN = ROOT / "configs/column.json"


@pytest.fixture(scope="module")
def raw(compression):
    with h5py.File(compression / "compression.h5") as file:
        yield file


@pytest.fixture(scope="module")
def history(compression):
    with dem.open(compression / "compression.h5") as history:
        yield history


@pytest.fixture
def program(programs, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("DEM_RUN", str(programs["dem-run"]))


def test_grains_and_walls_are_labelled(history, raw):
    positions = raw["particles/grains/position/value"]
    grains = history.grains()
    assert grains["position"].dims == ("time", "grain", "axis")
    assert grains["position"].attrs["units"] == "m" and grains["mass"].attrs["units"] == "kg"
    assert numpy.array_equal(grains["position"].values, positions[:])
    assert grains["position"].sel(axis="y")[-1, 7] == positions[-1, 7, 1]
    assert grains["velocity"].sel(time=0.2, method="nearest").attrs["units"] == "m s-1"
    walls = history.walls()
    assert list(walls["wall"].values) == history.wall_names == ["bottom", "top"]
    assert [str(walls["drive"].sel(wall=name).values) for name in ("bottom", "top")] == ["FIXED", "FORCE"]
    assert numpy.array_equal(walls["force"].sel(wall="top").values, raw["walls/force/value"][:, 1])


@pytest.mark.parametrize("frames", [slice(2, 9, 3), slice(None, None, -100), [5, 1, 5, -1], slice(0, 0)])
def test_frames_are_chosen_as_in_numpy(history, raw, frames):
    expected = raw["particles/grains/position/value"][:][frames]
    grains = history.grains(frames)
    assert numpy.array_equal(grains["position"].values, expected)
    assert numpy.array_equal(grains["time"].values, raw["particles/grains/position/time"][:][frames])


def test_no_frames_are_chosen_by_an_empty_list(history):
    grains = history.grains([])
    assert grains["position"].shape == (0, len(grains["grain"]), 2) and len(grains["time"]) == 0
    assert history.bond_status([]).shape[0] == 0


def test_a_truncated_history_is_refused(compression, tmp_path):
    content, path = (compression / "compression.h5").read_bytes(), tmp_path / "cut.h5"
    for size in (40, 600_000, len(content) - 1):
        path.write_bytes(content[:size])
        with pytest.raises(OSError, match=f"cut.h5 is truncated: it holds {size} bytes, and HDF5 recorded at least"):
            dem.open(path)
    for other in (b"", b"{}\n"):
        path.write_bytes(other)
        with pytest.raises(OSError, match="cut.h5 is not an HDF5 file"):
            dem.open(path)


def test_one_frame_has_no_time_axis(history, raw):
    grains = history.grains(-1)
    assert grains["position"].dims == ("grain", "axis") and float(grains["time"]) == history.times[-1]
    assert history.frame_at(history.times[4]) == 4
    with pytest.raises(IndexError, match="frame 99999 of a history with"):
        history.grains(99999)
    for other in (1.5, [0.5], [True, False]):
        with pytest.raises(TypeError, match="give a number, a slice, a list of numbers or a mask of all frames"):
            history.grains(other)
    with pytest.raises(ValueError, match="no frame at -1 s"):
        history.frame_at(-1)


def test_a_mask_selects_frames(history):
    late = history.times > history.times[3]
    grains = history.grains(late)
    assert grains.sizes["time"] == late.sum() and (grains["time"].values == history.times[late]).all()


def test_a_history_tells_why_its_run_ended(program):
    with dem.run(COLUMN, "a.h5", time__end=2e-3) as history:
        assert history.ending == history.summary["ending"] == "time"
    with h5py.File("a.h5", "a") as file:
        del file["ending"]
    with dem.open("a.h5") as history:
        assert history.ending is None


def test_contacts_are_a_data_frame(history, raw):
    frame = history.frames // 2
    contacts, group = history.contacts(frame), raw["contacts"]
    rows = slice(int(group["start"][frame]), int(group["start"][frame]) + int(group["count"][frame]))
    assert len(contacts) == rows.stop - rows.start > 500
    assert numpy.array_equal(contacts["force_t"], group["reaction"][rows, 1])
    assert numpy.array_equal(contacts["normal_y"], group["normal"][rows, 1])
    codes = {code: name for name, code in h5py.check_enum_dtype(group["status"].dtype).items()}
    assert contacts["status"].tolist() == [codes[code] for code in group["status"][rows]]
    assert set(contacts["status"]) <= {"OPEN", "STICK", "SLIP", "BONDED"}
    # what the grains press on the top wall is the force of the last solve on it
    top = contacts[contacts["wall"] == "top"]
    assert len(top) > 3 and (top["j"] == -2).all() and contacts["wall"].isna().sum() == (contacts["j"] >= 0).sum()
    pressed = -(top["force_n"] * top["normal_y"] + top["force_t"] * top["normal_x"]).sum()
    assert pressed == pytest.approx(float(history.walls(frame)["force"].sel(wall="top", axis="y")), rel=1e-9)
    assert contacts.attrs["units"] == {
        "point_x": "m", "point_y": "m", "force_n": "N", "force_t": "N", "moment": "N m", "gap": "m",
    }  # fmt: skip
    assert contacts.attrs["time"] == history.times[frame]
    # before the first step there are none
    assert len(history.contacts(0)) == 0


def test_bonds_and_ruptures_have_names(history, raw):
    bonds, ruptures, status = history.bonds(), history.ruptures(), history.bond_status()
    assert (bonds["strength"] == 10).all() and bonds.attrs["units"]["strength"] == "N"
    assert len(ruptures) == len(raw["events/rupture"]) > 300
    assert numpy.array_equal(ruptures["energy"], raw["events/rupture"]["energy"])
    assert ruptures.attrs["units"]["energy"] == "J"
    # the last status of a bond is the mode in which it broke
    last = status.isel(time=-1).values
    broken = ruptures.set_index("bond")["mode"].astype(str)
    assert (last != "INTACT").sum() == len(ruptures)
    assert (last[broken.index] == broken.values).all()


def test_observables_have_walls_and_routes(history, raw):
    observed = history.observables()
    load = observed["applied_force"].sel(wall="top")
    assert numpy.array_equal(load.values, raw["observables/applied_force/value"][:, 1])
    assert load.attrs["units"] == "N" and load.dims == ("time",)
    # the ramp of the scene, in the middle of each step
    middle = load["time"].values - 0.5 * history.scene["time"]["step"]
    assert load.values == pytest.approx(history.scene["walls"]["top"]["force_rate"] * middle, rel=1e-6)
    assert set(numpy.unique(observed["solver_route"])) <= {"EXTRAPOLATION", "ACTIVE_SET", "INTERIOR_POINT", "SWEEPS"}
    assert observed["stress"].sel(axis="y", other_axis="x").dims == ("time",)


def test_in_3d_there_are_two_tangents(program):
    # a sphere on a wall
    scene = {
        "dimension": 3,
        "sample": {"grains": [{"center": [0, 0, 1e-3], "radius": 1e-3}]},
        "materials": {"density": 2500, "friction": {"grain_grain": 0, "grain_wall": 0.3}},
        "walls": {"floor": {"shape": {"plane": {"normal": [0, 0, 1], "place": {"at": [0, 0, 0]}}}}},
        "gravity": [0, 0, -9.81],
        "time": {"step": 1e-4, "end": 1e-3},
        "output": {"every_steps": 1},
    }
    with dem.run(scene, "ball.h5") as history:
        contact = history.contacts().iloc[0]
        weight = 2500 * 4 / 3 * numpy.pi * 1e-9 * 9.81
        assert contact["wall"] == "floor" and contact["force_n"] == pytest.approx(weight, rel=1e-9)
        assert {"force_t1", "force_t2", "tangent_z", "point_z"} <= set(contact.index)
        assert history.grains()["orientation"].sel(quaternion="w").shape == (11, 1)
        for missing in (history.bonds, history.ruptures):
            with pytest.raises(ValueError, match="ball.h5 has no"):
                missing()
    with pytest.raises(dem.RunFailed, match="exists"):
        dem.run(scene, "ball.h5")
    dem.run(scene, "ball.h5", force=True).close()
    with pytest.raises(TypeError, match="needs output"):
        dem.run(scene)


def test_grains_have_the_names_of_their_materials(program):
    scene = {
        "dimension": 2,
        "sample": {"grains": [{"center": [x, 0], "radius": 1e-3} for x in (0, 4e-3, 8e-3)]},
        "materials": {
            "density": 2500,
            "friction": {"grain_grain": 0.3, "grain_wall": 0.3},
            "named": [
                {"name": "steel", "density": 7800, "regions": [{"half_space": {"point": [6e-3, 0], "normal": [1, 0]}}]}
            ],
        },
        "time": {"step": 1e-4, "end": 1e-3},
        "output": {"every_steps": 5},
    }
    with dem.run(scene, "two.h5") as history:
        grains = history.grains(-1)
        assert grains["material"].dims == ("grain",)
        assert grains["material"].values.tolist() == ["base", "base", "steel"]
        assert float(grains["mass"][2] / grains["mass"][0]) == pytest.approx(7800 / 2500)
    scene["materials"].pop("named")
    with dem.run(scene, "one.h5") as history:
        assert "material" not in history.grains(-1)


def test_a_run_takes_values_of_fields(program, tmp_path):
    with dem.run(COLUMN, time__end=0.01, title=None, **{"materials.density": 1000}) as history:
        assert (tmp_path / "column.h5").exists()
        assert history.scene["materials"]["density"] == 1000 and "title" not in history.scene
        assert history.summary["steps"] == history.steps[-1]
        assert history.times[-1] == pytest.approx(0.01)
    # a sample file beside the caller, for a scene without a file
    (tmp_path / "sample.csv").write_text("x,y,radius\n0,2e-3,2e-3\n")
    with dem.open("column.h5") as history:
        scene = {**history.scene, "sample": {"file": {"path": "sample.csv"}}}
    with dem.run(scene, "file.h5") as history:
        assert history.grains(0)["radius"].values.tolist() == [2e-3]
    # as a field, too, and a list of bonds; numbers may be numpy's
    (tmp_path / "two.csv").write_text("x,y,radius\n0,2e-3,2e-3\n4e-3,2e-3,2e-3\n")
    (tmp_path / "bonds.csv").write_text("i,j\n0,1\n")
    bonded = scene | {"bonds": {"strength": 5.0, "gap_tolerance": 1e-6, "list": "bonds.csv"}}
    with dem.run(bonded, "bonds.h5", sample__file__path="two.csv", seed=numpy.int64(4)) as history:
        assert len(history.bonds()) == 1 and history.scene["seed"] == 4
    with dem.run(scene, "two.h5", sample={"file": {"path": "two.csv"}}) as history:
        assert len(history.grains(0)["radius"]) == 2
    with pytest.raises(TypeError, match="set cannot be a value of a scene"):
        dem.run(scene, "no.h5", seed={1})


def test_a_wrong_scene_is_an_exception_with_the_message(program, monkeypatch):
    with pytest.raises(dem.RunFailed) as wrong:
        dem.run(COLUMN, materials__densty=5)
    assert wrong.value.code == 2 and "nearest  materials.density" in str(wrong.value)
    with pytest.warns(UserWarning, match="time.end"):
        dem.run(COLUMN, "a.h5", time__end=1.05e-3, time__step=1e-3).close()
    with pytest.raises(FileNotFoundError, match="cargo install"):
        dem.run(COLUMN, program="no-such-program")
    with pytest.raises(OSError):
        dem.open("nothing.h5")
    with h5py.File("foreign.h5", "w") as file:
        file["a"] = 1
    with pytest.raises(ValueError, match="not a history"):
        dem.open("foreign.h5")


def test_a_running_file_is_read_and_grows(programs, tmp_path):
    arguments = ["run", COLUMN, "-o", "live.h5", "--quiet", "--set", "time.end=1e4", "--set", "output.every_steps=3"]
    run = subprocess.Popen([programs["dem-run"], *map(str, arguments)], cwd=tmp_path)
    try:
        deadline, history = time.monotonic() + 60, None
        while history is None and time.monotonic() < deadline:
            try:
                history = dem.open(tmp_path / "live.h5")
            except (OSError, ValueError):
                time.sleep(0.02)
        seen = []
        while len(set(seen)) < 5 and time.monotonic() < deadline:
            seen.append(history.refresh().frames)
            if seen[-1] > 1:
                assert history.steps.tolist() == list(range(0, 3 * history.frames, 3))
                observed = history.observables()
                assert observed["step"].values.tolist() == list(range(1, 3 * history.frames - 2))
                assert history.grains()["position"].shape[0] == history.frames
                assert (history.contacts()["force_n"] >= 0).all()
        assert len(set(seen)) >= 5 and run.poll() is None
        history.close()
    finally:
        run.kill()
        run.wait()


def test_ctrl_c_ends_a_run_with_its_step(programs, tmp_path):
    # in the background of a script SIGINT is ignored, and Python leaves it so
    handler = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)"
    run = f"import dem; dem.run({str(COLUMN)!r}, 'long.h5', time__end=1e4, output__every_steps=100)"
    environment = os.environ | {"DEM_RUN": str(programs["dem-run"]), "PYTHONPATH": str(ROOT / "python")}
    command = [sys.executable, "-c", f"{handler}; {run}"]
    python = subprocess.Popen(command, cwd=tmp_path, env=environment, stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 60
    while not (tmp_path / "long.h5").exists() and time.monotonic() < deadline:
        time.sleep(0.02)
    python.send_signal(signal.SIGINT)
    assert python.wait(60) != 0
    with dem.open(tmp_path / "long.h5") as history:
        assert history.ending == "interrupted"


def test_the_versions_of_package_and_programs_agree():
    cargo, package = ((ROOT / name).read_text() for name in ("Cargo.toml", "python/pyproject.toml"))
    version = next(line for line in cargo.splitlines() if line.startswith("version = "))
    assert version in package.splitlines()
    meta = json.loads((ROOT / "codemeta.json").read_text())
    citation = (ROOT / "CITATION.cff").read_text()
    assert version == f'version = "{meta["version"]}"' and f"version: {meta['version']}\n" in citation
    assert meta["name"] in citation and all(f"- {word}\n" in citation for word in meta["keywords"])


def test_the_page_runs_as_it_stands(compression, programs, monkeypatch, capsys):
    page = (ROOT / "docs/scripting.md").read_text()
    reading, running = (block.split("```")[0] for block in page.split("```python\n")[1:])
    monkeypatch.chdir(compression)
    exec(compile(reading, "docs/scripting.md", "exec"), {})
    with h5py.File("compression.h5") as file:
        load = file["observables/applied_force/value"][:, 1].max()
    assert f"{load:.2f} N at most" in capsys.readouterr().out
    monkeypatch.setenv("DEM_RUN", str(programs["dem-run"]))
    if not (compression / "configs").exists():
        (compression / "configs").symlink_to(ROOT / "configs")
    exec(compile(running, "docs/scripting.md", "exec"), {})
    # (1/3) g sin 20° t² rolling, (1/2) g (sin 20° − 0.1 cos 20°) t² sliding, at 0.5 s
    assert capsys.readouterr().out.splitlines() == ["friction 0.2: 0.2796 m", "friction 0.1: 0.3042 m"]
