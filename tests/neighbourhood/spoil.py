"""Ways to alter one number of a history, and places in a good history to do it."""

import json

import numpy as np

from history import History


class Good:
    """A good run, and places in it that can be altered."""

    def __init__(self, path, told, text):
        self.path, self.told, self.text = path, told, text
        self.h = History(path)

    def row(self, holds):
        """A row of contacts for which `holds` (an array) is true: the one with the largest
        reaction."""
        return int(np.argmax(np.where(holds, np.abs(self.h.rn) + 1e-300, -1.0)))

    def slipping(self):
        """A row that slips under a force."""
        return self.row(self.h.status == "SLIP")

    def sticking(self):
        """A dry row that sticks under a force."""
        return self.row(self.h.status == "STICK")

    def bonded(self):
        """A row of an intact bond."""
        h = self.h
        return self.row((h.bond >= 0) & (h.bond_status[h.row_step + 1, h.bond] == "INTACT"))


def add(name, at, relative=1e-5, absolute=0.0):
    """Alters one number of a dataset: `at(good)` is its index."""

    def spoil(file, good):
        index = at(good)
        value = file[name][index]
        file[name][index] = value * (1 + relative) + absolute

    return spoil


def put(name, at, value):
    """Replaces one number of a dataset."""

    def spoil(file, good):
        file[name][at(good)] = value(file[name][at(good)]) if callable(value) else value

    return spoil


def reaction(pick, rows, value):
    """Replaces components of the reaction of a contact: `pick(good)` is its row."""
    return put("contacts/reaction", lambda good: (pick(good), rows), value)


def reverse_frame(pick):
    """Reverses the tangents of a contact, and the components of its reaction along them."""

    def spoil(file, good):
        row = pick(good)
        file["contacts/tangent"][row] = -file["contacts/tangent"][row]
        for name, part in (("reaction", slice(1, 3)), ("moment", slice(0, 2))):
            file[f"contacts/{name}"][row, part] = -file[f"contacts/{name}"][row, part]

    return spoil


def event(column, value):
    """Alters one column of one rupture, the second where there are several."""

    def spoil(file, good):
        events = file["events/rupture"]
        k = min(1, len(events) - 1)
        row = events[k]
        row[column] = value(row[column])
        events[k] = row

    return spoil


def observed(name, step=40, relative=1e-5, absolute=0.0):
    """Alters an observable in one step."""

    def spoil(file, good):
        data = file[f"observables/{name}/value"]
        row = np.array(data[step], float)
        row.flat[-1] = row.flat[-1] * (1 + relative) + absolute
        data[step] = row

    return spoil


def told(*place, value):
    """Alters a value of the scene in the history."""

    def spoil(file, good):
        scene = json.loads(file["parameters/scene"][()])
        inner = scene
        for key in place[:-1]:
            inner = inner[key]
        inner[place[-1]] = value(inner[place[-1]]) if callable(value) else value
        text = json.dumps(scene)
        del file["parameters/scene"]
        file["parameters/scene"] = text

    return spoil


def strongest_of_event(good):
    """The row of the largest force between grains in the last step."""
    h = good.h
    return good.row((h.row_step == h.S - 2) & ~h.on_wall)


G = "particles/grains/"
step_of = lambda pick: lambda good: int(good.h.row_step[pick(good)]) + 1
grain_of = lambda pick: lambda good: (int(good.h.row_step[pick(good)]) + 1, int(good.h.i[pick(good)]))
component = lambda pick, k: lambda good: grain_of(pick)(good) + (k,)
SLIPS, STICKS, BONDED = Good.slipping, Good.sticking, Good.bonded
any_row = lambda good: good.row(good.h.rn > 0)
on_wall = lambda good: good.row(good.h.on_wall & (good.h.rn > 0))


def broken_late(good):
    """A row of a bond that broke at the end of that step."""
    h = good.h
    return good.row((h.bond >= 0) & (h.bond_status[h.row_step + 1, h.bond] != "INTACT"))


def dry_grain(good):
    """A grain of a dry contact under a force."""
    return int(good.h.i[good.row(good.h.bond < 0)])


def apart(good):
    """A row with restitution that does not touch."""
    return int(np.flatnonzero((good.h.rn == 0) & (good.h.gap > 1e-5 * 1e-3))[0])


other_mode = lambda mode: 1 if mode != 1 else 2


def newton_of(good):
    """Newton iterations of each step."""
    return good.h.observed["solver_newton_iterations"]


def worst(good):
    """The step of the largest residual."""
    return int(np.argmax(good.h.observed["solver_residual"]))
