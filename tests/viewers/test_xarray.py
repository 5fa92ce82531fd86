"""xarray opens the groups of a history by itself: axes have names, and arrays their values."""

import dem
import numpy
import pandas
import pytest
import xarray

# axes of some arrays
NAMED = {
    "particles/grains": {"radius": ["grain"]},
    "particles/grains/position": {"value": ["time", "grain", "axis"], "step": ["time"]},
    "particles/grains/velocity": {"value": ["time", "grain", "axis"]},
    "walls": {"radius": ["wall"], "normal": ["wall", "axis"]},
    "walls/force": {"value": ["time", "wall", "axis"]},
    "contacts": {
        "pair": ["contact", "body"],
        "normal": ["contact", "axis"],
        "reaction": ["contact", "force_component"],
        "gap": ["contact"],
        "start": ["time"],
    },
    "bonds": {"pair": ["bond", "body"], "strength": ["bond"]},
    "bonds/status": {"value": ["time", "bond"]},
    "observables/kinetic_energy": {"value": ["time"]},
    "observables/stress": {"value": ["time", "axis", "other_axis"]},
    "observables/angular_momentum": {"value": ["time", "spin_axis"]},
    "observables/wall_force": {"value": ["time", "wall", "axis"]},
    "observables/applied_force": {"value": ["time", "wall"]},
    "observables/solver_route": {"value": ["time"]},
}


@pytest.mark.parametrize("engine", ["h5netcdf", "netcdf4"])
def test_groups_have_named_dimensions(case, engine):
    for place, arrays in NAMED.items():
        if place not in case.history:
            assert place.startswith("bonds") and case.name == "loose"
            continue
        with xarray.open_dataset(case.path, group=place, engine=engine) as group:
            assert not [name for name in group.dims if "phony" in name]
            for name, axes in arrays.items():
                assert list(group[name].dims) == axes
                assert (group[name].values == case[f"{place}/{name}"][:]).all()
            if "time" in group.dims:
                times = case[f"{place}/time"][:]
                assert (group["time"].values == times).all()
                assert group.sel(time=times[3]).sizes.get("time") is None


@pytest.mark.parametrize("engine", ["h5netcdf", "netcdf4"])
def test_every_array_has_named_axes(case, engine):
    with xarray.open_datatree(case.path, engine=engine) as tree:
        named = 0
        for group in tree.groups:
            if group.split("/")[1] in ("particles", "walls", "contacts", "bonds", "observables", "materials"):
                for array in tree[group].dataset.variables.values():
                    assert not [axis for axis in array.dims if "phony" in axis], group
                    named += array.ndim > 0
        assert named > 60


def test_the_package_agrees(case):
    history = dem.open(case.path)
    with xarray.open_dataset(case.path, group="particles/grains/position", engine="h5netcdf") as group:
        assert (history.grains()["position"].values == group["value"].values).all()
    contacts = history.contacts()
    assert isinstance(contacts, pandas.DataFrame)
    rows = case.contacts(case.frames - 1)
    assert numpy.array_equal(contacts["force_n"], case["contacts/reaction"][rows][:, 0])
