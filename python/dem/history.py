"""A history as labelled arrays and data frames."""

import json
import os

import h5py
import numpy as np
import pandas as pd
import xarray as xr

AXES = ["x", "y", "z"]

# dimensions of a value after the time, where there are any
OBSERVABLES = {
    "momentum": ("axis",),
    "angular_momentum": ("spin_axis",),
    "stress": ("axis", "other_axis"),
    "strain": ("axis", "other_axis"),
    "wall_position": ("wall", "axis"),
    "wall_force": ("wall", "axis"),
    "wall_force_at_limit": ("wall", "axis"),
    "applied_force": ("wall",),
    "wall_load": ("wall",),
}
RUPTURE_UNITS = {
    "time": "s", "x": "m", "y": "m", "z": "m", "rn": "N", "rt": "N", "m": "N m", "twist": "N m", "energy": "J",
}  # fmt: skip


class History:
    """A history of `dem-run`.

    A frame is a number from 0, or from the end if negative; `frames` of a method is a number, a
    slice, a list of numbers or a mask of all frames, and None for all. Values of large histories are
    read when they are asked for, so choose frames where there are many.
    """

    def __init__(self, path):
        self.path = os.fspath(path)
        self._open()
        if "commit" not in self._file or "particles/grains" not in self._file:
            self._file.close()
            raise ValueError(f"{self.path} is not a history of dem-run: it has no /commit or no /particles/grains")
        parameters = self._file["parameters"]
        self.scene = json.loads(parameters["scene"].asstr()[()])
        self.parameters = {name: _plain(value) for name, value in parameters.attrs.items()}
        self.dimension = int(self.scene["dimension"])
        self.summary = None
        self.frames = int(self._file["commit"][()])

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def __repr__(self):
        grains = self._file["particles/grains/id"].shape[0] if self._file else "?"
        return f"<History {self.path}: {self.frames} frames, {grains} grains, {self.dimension}D>"

    def close(self):
        """Closes the file."""
        self._file.close()

    def refresh(self):
        """Takes in what a running program has written since; returns the history."""
        # not dataset by dataset: where a closed file was opened with swmr, HDF5 2.0 reads wrong values
        # after a refresh
        self._file.close()
        self._open()
        self.frames = int(self._file["commit"][()])
        return self

    def _open(self):
        _check_superblock(self.path)
        try:
            self._file = h5py.File(self.path, "r")
        except FileNotFoundError:
            raise
        except OSError:
            # being written, or left open by a kill
            self._file = h5py.File(self.path, "r", swmr=True)

    @property
    def ending(self):
        """Why the run ended, as `ending` of its summary (`"time"`, `"no_convergence"` …).

        None if it has not ended, was killed, or the program that wrote the history did not record it.
        """
        if "ending" not in self._file:
            return None
        data = self._file["ending"]
        ending = str(_names(data.dtype, [data[()]])[0])
        return None if ending == "OPEN" else ending.lower()

    @property
    def times(self):
        """Times of the frames (s)."""
        return self._read("particles/grains/position/time")

    @property
    def steps(self):
        """Numbers of the steps of the frames."""
        return self._read("particles/grains/position/step")

    @property
    def wall_names(self):
        """Names of the walls, in the order of the arrays."""
        return list(self._file["walls/name"].asstr()[:]) if "walls" in self._file else []

    def frame_at(self, time):
        """The number of the frame nearest to a time (s)."""
        times = self.times
        if not len(times) or not times[0] <= time <= times[-1]:
            span = f"from {times[0]} s to {times[-1]} s" if len(times) else "no frame yet"
            raise ValueError(f"no frame at {time} s: the history has {span}")
        return int(np.abs(times - time).argmin())

    def grains(self, frames=None):
        """Positions, velocities and turns of the grains: dimensions time, grain and axis.

        Where there are several materials, `material` names that of each grain.
        """
        group = self._file["particles/grains"]
        fixed = {name: (("grain",), group[name][:], _units(group[name])) for name in ("radius", "mass", "inertia")}
        if "material" in group:
            names = self._file["materials/name"].asstr()[:].astype(str)
            fixed["material"] = (("grain",), names[group["material"][:]])
        trailing = {
            "position": ("grain", "axis"),
            "velocity": ("grain", "axis"),
            "angular_velocity": ("grain", "axis")[: 1 if self.dimension == 2 else 2],
            "angle": ("grain",),
            "orientation": ("grain", "quaternion"),
        }
        coordinates = {"grain": group["id"][:]}
        if "orientation" in group:
            coordinates["quaternion"] = ["w", "x", "y", "z"]
        return self._over_frames("particles/grains", trailing, fixed, coordinates, frames)

    def walls(self, frames=None):
        """Positions, velocities and forces of the walls: dimensions time, wall and axis."""
        if "walls" not in self._file:
            raise ValueError(f"{self.path} has no walls")
        group = self._file["walls"]
        dimensions = dict.fromkeys(("kind", "drive", "radius", "length", "width"), ("wall",))
        dimensions |= dict.fromkeys(("normal", "direction", "side"), ("wall", "axis"))
        given = {name: kept for name, kept in dimensions.items() if name in group}
        fixed = {name: (kept, _named(group[name]), _units(group[name])) for name, kept in given.items()}
        trailing = dict.fromkeys(("position", "velocity", "force"), ("wall", "axis"))
        return self._over_frames("walls", trailing, fixed, {"wall": self.wall_names}, frames)

    def bonds(self):
        """The bonds as a data frame: their grains i, j, strengths and geometry at rest."""
        group = self._group("bonds")
        pair = group["pair"][:]
        columns, units = {"i": pair[:, 0], "j": pair[:, 1]}, {}
        for name in ("rest_gap", "strength", "friction", "rolling", "twist", "mean_diameter"):
            if name in group:
                columns[name] = group[name][:]
                units |= _unit_of(name, group[name])
        return _frame(columns, units, index="bond")

    def bond_status(self, frames=None):
        """INTACT, or the mode in which a bond broke: dimensions time and bond.

        If a stage forms the bonds, INTACT has no meaning up to the step in `/bonds/formed`.
        """
        self._group("bonds")
        return self._over_frames("bonds", {"status": ("bond",)}, {}, {}, frames)["status"]

    def ruptures(self):
        """The broken bonds as a data frame, in the order in which they broke."""
        self._group("events")
        events = self._file["events/rupture"]
        rows = self._rows(events, "events")
        table = pd.DataFrame({name: rows[name] for name in rows.dtype.names if name != "pad"})
        table["mode"] = pd.Categorical(_names(events.dtype["mode"], rows["mode"]))
        table.attrs["units"] = {name: unit for name, unit in RUPTURE_UNITS.items() if name in table}
        return table

    def contacts(self, frame=-1):
        """The contacts of a frame as a data frame.

        `i` and `j` are grains; a contact with a wall has the name of the wall in `wall` and j < 0;
        without a wall `wall.isna()` holds. The normal points from j to i. Forces are those of j on
        i, along the normal (pressing is positive) and the tangents.
        """
        group, frame = self._group("contacts"), self._number(frame)
        start, count = int(group["start"][frame]), int(group["count"][frame])

        def rows(name):
            return group[name][start : start + count]

        pair = rows("pair")
        names = np.array(self.wall_names + [None], dtype=object)
        columns = {"i": pair[:, 0], "j": pair[:, 1], "wall": names[np.where(pair[:, 1] < 0, -1 - pair[:, 1], -1)]}
        units, tangents = {}, ["t"] if self.dimension == 2 else ["t1", "t2"]
        # a moment about the normal comes last
        parts = {
            "point": AXES, "normal": AXES, "tangent": AXES, "reaction": ["n", *tangents],
            "moment": ["t1", "t2", "n"],
        }  # fmt: skip
        for name, ends in parts.items():
            if name not in group:
                continue
            values, shown = rows(name), "force" if name == "reaction" else name
            several = values.ndim > 1
            for k in range(values.shape[1] if several else 1):
                column = f"{shown}_{ends[k]}" if several else shown
                columns[column] = values[:, k] if several else values
                units |= _unit_of(column, group[name])
        columns["gap"], units["gap"] = rows("gap"), "m"
        columns["status"] = pd.Categorical(_names(group["status"].dtype, rows("status")))
        if "bond" in group:
            columns["bond"] = rows("bond")
        table = _frame(columns, units)
        table.attrs |= {"time": float(self.times[frame]), "step": int(self.steps[frame])}
        return table

    def observables(self):
        """What is observed at every step: dimension time, and those of the value."""
        group = self._file["observables"]
        time, step = (self._rows(group[name], "steps") for name in ("time", "step"))
        gaps = np.flatnonzero(np.diff(step) != 1)
        if len(gaps):
            raise ValueError(f"{self.path} is damaged: step {step[gaps[0] + 1]} follows step {step[gaps[0]]}")
        variables = {}
        for name in group:
            if name in ("time", "step"):
                continue
            data = group[name]["value"]
            values = self._rows(data, "steps")
            dimensions = OBSERVABLES.get(name, tuple(f"{name}_{k}" for k in range(values.ndim - 1)))
            variables[name] = (("time", *dimensions), _named(data, values), _units(data))
        dataset = xr.Dataset(variables, coords={"time": ("time", time, {"units": "s"}), "step": ("time", step)})
        used = {"axis": AXES[: self.dimension], "other_axis": AXES[: self.dimension], "wall": self.wall_names}
        return dataset.assign_coords({name: names for name, names in used.items() if name in dataset.dims})

    def _group(self, name):
        if name not in self._file:
            raise ValueError(f"{self.path} has no {name}")
        return self._file[name]

    def _number(self, frame):
        if not isinstance(frame, (int, np.integer)) or isinstance(frame, bool):
            raise TypeError(f"frame {frame!r}: give the number of a frame")
        number = frame + self.frames if frame < 0 else frame
        if not 0 <= number < self.frames:
            raise IndexError(f"frame {frame} of a history with {self.frames} frames")
        return number

    def _read(self, place, frames=None):
        """Complete rows of a dataset with a row a frame."""
        data = self._file[place]
        if isinstance(frames, (int, np.integer)):
            return data[self._number(frames)]
        if frames is None or isinstance(frames, slice):
            first, end, stride = (frames or slice(None)).indices(self.frames)
            if stride > 0:
                return data[first:end:stride]
            frames = range(first, end, stride)
        chosen = np.asarray(frames)
        if chosen.dtype == bool and chosen.shape == (self.frames,):
            chosen = np.flatnonzero(chosen)
        if chosen.ndim != 1 or chosen.size and not np.issubdtype(chosen.dtype, np.integer):
            raise TypeError(f"frames {frames!r}: give a number, a slice, a list of numbers or a mask of all frames")
        # h5py wants increasing numbers, each once
        numbers = np.array([self._number(frame) for frame in chosen], dtype=int)
        numbers, back = np.unique(numbers, return_inverse=True)
        return data[numbers][back]

    def _rows(self, data, counted):
        """Complete rows of a dataset whose rows are counted at each frame."""
        counts = self._read(f"commit_rows/{counted}")
        return data[: int(counts[-1]) if len(counts) else 0]

    def _over_frames(self, place, trailing, fixed, coordinates, frames):
        group, head = self._file[place], () if isinstance(frames, (int, np.integer)) else ("time",)
        variables = dict(fixed)
        for name, dimensions in trailing.items():
            if name in group:
                data = group[name]["value"]
                values = _named(data, self._read(data.name, frames))
                variables[name] = ((*head, *dimensions), values, _units(data))
        time, step = (self._read(f"particles/grains/position/{name}", frames) for name in ("time", "step"))
        dataset = xr.Dataset(variables, coords={"time": (head, time, {"units": "s"}), "step": (head, step)})
        if "axis" in dataset.dims:
            coordinates = {**coordinates, "axis": AXES[: self.dimension]}
        return dataset.assign_coords(coordinates)


def _check_superblock(path):
    """Raises OSError for files that are not HDF5 and for truncated files.

    HDF5 may read a truncated file without end.
    """
    with open(path, "rb") as file:
        head = file.read(48)
        # after the superblock: the file of a running program grows
        size = os.fstat(file.fileno()).st_size
    signature = b"\x89HDF\r\n\x1a\n"
    if not head or head[:8] != signature[: len(head)]:
        raise OSError(f"{path} is not an HDF5 file: give the .h5 file that `dem-run run` wrote")
    expected = 48
    if len(head) == 48:
        # dem-run writes only version 3, with addresses of 8 bytes; HDF5 checks the others
        expected = int.from_bytes(head[28:36], "little") if (head[8], head[9]) == (3, 8) else 0
    if size < expected:
        raise OSError(
            f"{path} is truncated: it holds {size} bytes, and HDF5 recorded at least {expected}. "
            "Copy it again, or run the scene again"
        )


def _names(dtype, values):
    """The names of the codes of an enumeration."""
    codes = h5py.check_enum_dtype(dtype)
    table = np.full(max(codes.values()) + 1, "", dtype=object)
    for name, code in codes.items():
        table[code] = name
    return table[np.asarray(values, dtype=int)].astype(str)


def _named(data, values=None):
    """Values, those of an enumeration as names."""
    values = data[:] if values is None else values
    return values if h5py.check_enum_dtype(data.dtype) is None else _names(data.dtype, values)


def _units(data):
    return _unit_of("units", data)


def _unit_of(column, data):
    return {column: _plain(data.attrs["unit"])} if "unit" in data.attrs else {}


def _plain(value):
    if isinstance(value, bytes):
        return value.decode()
    return value.item() if isinstance(value, np.generic) else value


def _frame(columns, units, index=None):
    table = pd.DataFrame(columns)
    table.index.name = index
    table.attrs["units"] = units
    return table
