"""The axes of the datasets of a history have names: HDF5 dimension scales, as HDF5's own functions see them."""

import json

import h5py
import pytest
from conftest import ROOT
from test_view import FLAT

# groups whose datasets have names for each axis
NAMED = ("particles", "walls", "contacts", "bonds", "observables", "materials")


@pytest.fixture(scope="module")
def histories(dem_run, tmp_path_factory):
    folder = tmp_path_factory.mktemp("axes")
    (folder / "flat.json").write_text(json.dumps(FLAT))
    dem_run(folder, "run", "flat.json", "-o", "flat.h5", "-q")
    bonded = ["--set", 'bonds={"strength": 0.01, "gap_tolerance": 1e-3}']
    dem_run(folder, "run", ROOT / "tests/problems/scenes/cube.json", "-o", "space.h5", "-q", *bonded)
    return {2: folder / "flat.h5", 3: folder / "space.h5"}


@pytest.mark.parametrize("dimension", [2, 3])
def test_each_axis_has_a_scale_of_its_length(histories, dimension):
    with h5py.File(histories[dimension]) as history:
        axes = {}

        def visit(name, item):
            if not isinstance(item, h5py.Dataset) or not name.startswith(NAMED):
                return
            if h5py.h5ds.is_scale(item.id):
                assert name.endswith("/time")
                return
            axes[name] = []
            for k, axis in enumerate(item.dims):
                (scale,) = axis.values()
                # HDF5 checks both directions
                assert h5py.h5ds.is_scale(scale.id) and h5py.h5ds.is_attached(item.id, scale.id, k)
                short = scale.name.split("/")[-1]
                assert h5py.h5ds.get_scale_name(scale.id).decode().startswith("time" if short == "time" else "This is a netCDF")
                # the scale of contacts has no length of its own
                assert scale.shape == ((0,) if short == "contact" else (item.shape[k],))
                axes[name].append(short)

        history.visititems(visit)
        sizes = {name: dataset.id.get_storage_size() for name, dataset in history.items() if isinstance(dataset, h5py.Dataset)}
        times = history["particles/grains/position/time"], history["observables/time"]
        assert history["contacts/gap"].dims[0].values()[0].id == history["contact"].id
        assert history["walls/force/value"].dims[0].values()[0] == times[0]
        assert history["observables/wall_force/value"].dims[0].values()[0] == times[1]
    # names without values take no room
    assert {name for name, size in sizes.items() if size} == {"commit", "ending"}
    expected = {
        "particles/grains/radius": ["grain"],
        "particles/grains/position/value": ["time", "grain", "axis"],
        "walls/normal": ["wall", "axis"],
        "contacts/pair": ["contact", "body"],
        "contacts/reaction": ["contact", "force_component"],
        "contacts/moment": ["contact", "moment_component"][: dimension - 1],
        "bonds/status/value": ["time", "bond"],
        "observables/stress/value": ["time", "axis", "other_axis"],
        "observables/angular_momentum/value": ["time", "spin_axis"],
        "observables/applied_force/value": ["time", "wall"],
        "observables/solver_route/value": ["time"],
    }
    assert {name: axes[name] for name in expected} == expected
    assert len(axes) > 40
