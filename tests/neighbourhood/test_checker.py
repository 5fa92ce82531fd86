"""The checker finds errors: one number of a good history is altered, and the check of this number
must fail."""

import copy
import json
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

OUTPUT = {"every_steps": 1}
DRY = {"density": 2500, "friction": {"grain_grain": 0.3, "grain_wall": 0.2}}


def pressed(**changes):
    """A few cemented disks of several sizes under a plate, until most bonds are broken; side walls
    are far away."""
    scene = {
        "dimension": 2,
        "seed": 3,
        "thickness": 0.01,
        "sample": {
            "random": {
                "count": 24,
                "diameter": {"uniform": {"min": 2e-3, "max": 4e-3}},
                "width": 0.012,
                "preparation": {"compaction": {"solid_fraction": 0.7}},
            }
        },
        "materials": DRY,
        "bonds": {"strength": 10, "gap_tolerance": 1e-3},
        "gravity": [0, -9.81],
        "walls": {
            "bottom": {"shape": {"plane": {"normal": [0, 1], "place": "seated"}}},
            "top": {"shape": {"plane": {"normal": [0, -1], "place": "seated"}}, "mass": "sample", "force_rate": 5000},
        },
        "time": {"step": 1e-4, "end": 0.012},
        "output": OUTPUT,
    }
    return scene | changes


def beam():
    """A small beam with elastic bonds under a wall that moves."""
    seat = lambda x, y, up: {"circle": {"center": [x, y], "radius": 0.004, "seated": [0, up]}}
    return {
        "dimension": 2,
        "thickness": 1,
        "sample": {"lattice": {"hexagonal": {"diameter": 4e-3, "rows": 2, "columns": 9}}},
        "materials": DRY,
        "bonds": {
            "strength": 100,
            "gap_tolerance": 1e-6,
            "stiffness": {"young": {"modulus": 1e8, "poisson_ratio": 0.2}},
        },
        "walls": {
            "left": {"shape": seat(0.006, -0.1, 1)},
            "right": {"shape": seat(0.03, -0.1, 1)},
            "loader": {"shape": seat(0.018, 0.1, -1), "direction": [0, -1], "velocity": {"ramp": {"rate": 0.5}}},
        },
        "time": {"step": 1e-4, "end": 0.02},
        "output": OUTPUT,
        "stop": {"broken_fraction": 0.15},
    }


def arm():
    """configs/bent-arm.json with a frame at every step: spheres, a fixed one, a load, twist."""
    centres = [[0, 0, 0], [4, 0, 0], [8, 0, 0], [12, 0, 0], [12, 4, 0], [12, 8, 0], [12, 12, 0]]
    return {
        "dimension": 3,
        "sample": {"grains": [{"center": [1e-3 * x for x in c], "radius": 2e-3} for c in centres]},
        "materials": DRY,
        "bonds": {"strength": 100, "gap_tolerance": 1e-3, "twist": 0.1},
        "grains": {"fixed": [0], "loads": [{"grain": 6, "force": [0, 0, 1], "time": {"ramp": {"rate": 1000}}}]},
        "time": {"step": 1e-4, "end": 0.006},
        "solver": {"tolerance": 1e-10},
        "output": OUTPUT,
    }


def bouncing():
    """Three disks that fall on a floor and bounce."""
    grains = [
        {"center": [0, 1.002e-3], "radius": 1e-3, "velocity": [0.05, 0]},
        {"center": [1e-4, 3.1e-3], "radius": 1e-3},
        {"center": [3e-3, 1.5e-3], "radius": 1e-3, "spin": [50.0]},
    ]
    return {
        "dimension": 2,
        "thickness": 0.01,
        "sample": {"grains": grains},
        "gravity": [0, -9.81],
        "materials": DRY | {"restitution": {"grain_grain": 0.5, "grain_wall": 0.5}},
        "walls": {"floor": {"shape": {"plane": {"normal": [0, 1], "place": {"at": [0, 0]}}}}},
        "time": {"step": 1e-4, "end": 0.03},
        "output": OUTPUT,
    }


def side(sign, **drive):
    """A side wall."""
    return {"shape": {"plane": {"normal": [sign, 0], "place": "seated"}}, "mass": "sample"} | drive


def layered():
    """`pressed` with two materials, a notch, bonds of scattered strength."""
    scene = pressed()
    scene["bonds"] |= {
        "scatter": {"weibull": {"modulus": 8}},
        "absent": [{"box": {"from": [0.004, -1], "to": [0.004, 0.008]}}],
    }
    upper = {
        "name": "upper",
        "density": 3000,
        "wall_friction": 0.4,
        "regions": [{"half_space": {"point": [0, 0.009], "normal": [0.2, 1]}}],
    }
    own = {"strength": 6, "shear": 0.2, "rolling": 0.1}
    pairs = [{"between": ["upper", "base"], "friction": 0.1, "bonds": own}]
    scene["materials"] = DRY | {"named": [upper], "pairs": pairs}
    return scene


def listed():
    """Two rows of three disks under a plate, from files: materials of the grains, and their bonds."""
    r = 1e-3
    rows = [f"{2 * r * (k % 3)},{r + 2 * r * (k // 3)},{r},{'upper' if k > 2 else 'base'}" for k in range(6)]
    bonds = ["0,1,4,,", "1,2,,,", "4,3,,0.2,", "4,5,,,0.1", "0,3,,,", "1,4,9,0.5,0.4", "2,5,,,"]
    scene = pressed()
    del scene["gravity"]
    scene["sample"] = {"file": {"path": "grains.csv"}}
    scene["bonds"] |= {"list": "bonds.csv", "scatter": {"normal": {"deviation": 0.2}}}
    scene["materials"] = DRY | {
        "named": [{"name": "upper"}],
        "pairs": [{"between": ["upper", "upper"], "bonds": {"strength": 3}}],
    }
    # off the middle, so that the bonds of the rows are loaded
    scene["walls"]["top"] |= {"shape": {"circle": {"center": [1.5 * r, 1], "radius": r, "seated": [0, -1]}}}
    scene["walls"]["top"] |= {"direction": [0, -1]}
    scene["time"]["end"] = 0.01
    texts = {"grains.csv": ["x,y,radius,material", *rows], "bonds.csv": ["i,j,strength,shear,rolling", *bonds]}
    return scene | {"files": {name: "\n".join(lines) + "\n" for name, lines in texts.items()}}


def confined():
    """`pressed` with elastic bonds between walls with a stress, under a lid that comes down until its
    load drops."""
    scene = pressed()
    del scene["gravity"]
    scene["bonds"] |= {"stiffness": {"young": {"modulus": 1e8, "poisson_ratio": 0.2}}, "gap_tolerance": 0.01}
    stress = {"table": [[0, 0], [2e-3, 2e4]]}
    scene["walls"] |= {"left": side(1, stress=stress), "right": side(-1, stress=stress)}
    scene["walls"]["top"] = {"shape": scene["walls"]["top"]["shape"]}
    scene["walls"]["top"] |= {"velocity": {"table": [[2e-3, 0], [4e-3, 0.05]]}}
    scene["time"]["end"] = 0.03
    return scene | {"load_wall": "top", "stop": {"load_drop": 0.6}}


def sheared():
    """Three rows of disks on a wall that holds the lowest one, under a lid with a stress that
    slides."""
    scene = beam()
    scene["sample"]["lattice"]["hexagonal"] |= {"rows": 3, "columns": 6}
    scene["bonds"] |= {"strength": 10, "stiffness": {"young": {"modulus": 1e7, "poisson_ratio": 0.2}}}
    lid = {"friction": 3, "mass": "sample", "stress": {"table": [[0, 0], [2e-3, 1000]]}}
    lid["slide"] = {"direction": [1, 0], "velocity": {"table": [[2e-3, 0], [4e-3, 0.02]]}}
    scene["walls"] = {
        "bottom": {"shape": {"plane": {"normal": [0, 1], "place": "seated"}}, "grip": 1e-3},
        "lid": {"shape": {"plane": {"normal": [0, -1], "place": "seated"}}} | lid,
    }
    return scene


def staged():
    """`pressed` under a plate with stages: a force, a velocity until bonds break, at rest, a
    stress."""
    scene = pressed()
    top = scene["walls"]["top"]
    del top["force_rate"]
    scene["stages"] = [
        {"name": "seat", "duration": 2e-3, "walls": {"top": {"force": {"ramp": {"rate": 5000}}}}},
        {"name": "press", "until": {"broken_fraction": 0.1}, "walls": {"top": {"velocity": {"constant": 0.02}}}},
        {"name": "hold", "duration": 1e-3, "walls": {"top": {}}},
        {"name": "load", "duration": 2e-3, "walls": {"top": {"stress": {"ramp": {"rate": 1e6}}}}},
    ]
    scene["time"]["end"] = 0.02
    return scene


def from_break_to_break():
    """`pressed` without weight, from break to break."""
    scene = pressed(rupture="next_event")
    del scene["gravity"]
    scene["time"]["end"] = 0.02
    return scene


SCENES = {
    "layered": layered,
    "listed": listed,
    "confined": confined,
    "sheared": sheared,
    "staged": staged,
    "events": from_break_to_break,
    "pressed": pressed,
    "late": lambda: pressed(rupture="end_of_step"),
    "beam": beam,
    "arm": arm,
    "bouncing": bouncing,
}


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

# scene, what is altered, how, the check that must fail
SPOILT = (
    [
        ("pressed", "a frame's time", add("contacts/time", lambda g: 30), "time"),
        ("pressed", "an observation's time", add("observables/time", lambda g: 30), "time"),
        ("pressed", "a position", add(G + "position/value", lambda g: (50, 3, 1)), "positions"),
        ("pressed", "the last position", add(G + "position/value", lambda g: (-1, 0, 0), 1e-9), "positions"),
        ("pressed", "a velocity", add(G + "velocity/value", component(any_row, 0)), "Newton's law"),
        ("arm", "a velocity in space", add(G + "velocity/value", lambda g: (-1, 6, 2)), "Newton's law"),
        ("pressed", "a spin", add(G + "angular_velocity/value", grain_of(SLIPS)), "law of spins"),
        ("arm", "a spin in space", add(G + "angular_velocity/value", lambda g: (-1, 6, 0), 1e-4), "law of spins"),
        ("pressed", "an angle", add(G + "angle/value", lambda g: (-1, 3), 1e-6, 1e-9), "orientations"),
        ("arm", "a quaternion", add(G + "orientation/value", lambda g: (-1, 6, 1), 0, 1e-9), "orientations"),
        ("arm", "a fixed grain", add(G + "velocity/value", lambda g: (20, 0, 0), 0, 1e-12), "fixed grains"),
        ("pressed", "a fixed wall", add("walls/position/value", lambda g: (20, 0, 1), 1e-12, 1e-15), "fixed walls"),
        (
            "pressed",
            "a driven wall's velocity",
            add("walls/velocity/value", lambda g: (-1, 1, 1), absolute=1e-9),
            "wall motion",
        ),
        (
            "beam",
            "the speed of a wall that moves as prescribed",
            add("walls/velocity/value", lambda g: (30, 1, 1)),
            "wall motion",
        ),
        ("pressed", "a driven wall's place", add("walls/position/value", lambda g: (-1, 1, 1)), "wall positions"),
        ("pressed", "the prescribed force", observed("applied_force"), "applied_force"),
        (
            "beam",
            "the force of a wall that moves as prescribed",
            observed("applied_force", relative=0.0, absolute=1e-3),
            "wall_force_or_applied",
        ),
        ("pressed", "a pair", put("contacts/pair", lambda g: (any_row(g), 0), lambda i: i - 1 if i else i + 1), "gap"),
        (
            "pressed",
            "the order of pairs",
            put("contacts/pair", lambda g: (int(np.argmax(g.h.i)), 0), 0),
            "contacts sorted",
        ),
        ("pressed", "a gap", add("contacts/gap", any_row, 0, 1e-12), "gap"),
        ("pressed", "a normal", add("contacts/normal", lambda g: (any_row(g), 0), 1e-9, 1e-9), "normal"),
        ("pressed", "a point", add("contacts/point", lambda g: (any_row(g), 1), 0, 1e-12), "point"),
        ("arm", "a tangent", add("contacts/tangent", lambda g: (BONDED(g), 2), 0, 1e-9), "tangent"),
        (
            "pressed",
            "a velocity towards grains that are no neighbours yet",
            put(G + "velocity/value", lambda g: (60, 5, 0), 20.0),
            "pairs left out",
        ),
        (
            "pressed",
            "a velocity that leads through others",
            put(G + "velocity/value", lambda g: (60, 5, 0), 1e3),
            "crossing",
        ),
        (
            "pressed",
            "a residual that is not as small",
            put("observables/solver_residual/value", lambda g: worst(g), 0.0),
            "residual",
        ),
        (
            "pressed",
            "a residual beyond acceptance",
            put("observables/solver_residual/value", lambda g: 40, 1e-3),
            "residual accepted",
        ),
        (
            "pressed",
            "a normal reaction of a dry contact",
            put("contacts/reaction", lambda g: (STICKS(g), 0), lambda r: -r),
            "cone",
        ),
        (
            "pressed",
            "a pull between dry grains",
            put("contacts/reaction", lambda g: (STICKS(g), 0), lambda r: -r),
            "Signorini",
        ),
        (
            "pressed",
            "a tangential reaction",
            put("contacts/reaction", lambda g: (SLIPS(g), 1), lambda r: 1.01 * r),
            "cone",
        ),
        (
            "pressed",
            "a friction that pushes along",
            put("contacts/reaction", lambda g: (SLIPS(g), 1), lambda r: -r),
            "slip",
        ),
        (
            "pressed",
            "a reaction that a contact lacks",
            put("contacts/reaction", lambda g: (STICKS(g), 0), lambda r: 1.001 * r),
            "Newton's law",
        ),
        (
            "pressed",
            "a contact that parts and pushes",
            add(G + "velocity/value", component(on_wall, 1), 0, 1e-3),
            "complementarity",
        ),
        (
            "pressed",
            "a contact that closes",
            add(G + "velocity/value", component(on_wall, 1), 0, -1e-3),
            "closing_or_signorini",
        ),
        ("pressed", "a contact that closes far", add(G + "velocity/value", component(any_row, 1), 0, -0.1), "closing"),
        (
            "pressed",
            "a contact that closes farther",
            add(G + "velocity/value", component(any_row, 1), 0, -0.5),
            "closed in all",
        ),
        (
            "pressed",
            "a spin where contacts stick",
            add(G + "angular_velocity/value", grain_of(STICKS), 0, 0.5),
            "stick",
        ),
        (
            "pressed",
            "a spin where bonds hold",
            add(G + "angular_velocity/value", grain_of(BONDED), 0, 1.0),
            "rigid bonds",
        ),
        (
            "beam",
            "a spin where springs hold",
            add(G + "angular_velocity/value", grain_of(BONDED), 0, 0.01),
            "elastic bonds",
        ),
        (
            "beam",
            "a force of a spring",
            put("contacts/reaction", lambda g: (BONDED(g), 1), lambda r: 1.001 * r + 1e-3),
            "elastic bonds",
        ),
        (
            "bouncing",
            "a reaction of what does not touch",
            put("contacts/reaction", lambda g: (apart(g), 0), 1e-4),
            "contacts that do not touch",
        ),
        (
            "bouncing",
            "a velocity after a bounce",
            add(G + "velocity/value", component(any_row, 1)),
            "Signorini_or_complementarity",
        ),
        ("pressed", "a contact's status", put("contacts/status", STICKS, 0), "status"),
        ("pressed", "a bond's moment", put("contacts/moment", BONDED, lambda m: m + 1.0), "cone of bonds"),
        ("pressed", "a moment a little off", put("contacts/moment", BONDED, lambda m: m + 1e-9), "law of spins"),
        (
            "arm",
            "a twisting moment",
            put("contacts/moment", lambda g: (BONDED(g), 2), lambda m: m + 1e-7),
            "law of spins",
        ),
        (
            "pressed",
            "the bond of a contact",
            put("contacts/bond", BONDED, lambda b: b - 1 if b else b + 1),
            "contacts of bonds",
        ),
        ("pressed", "a bond's rest gap", add("bonds/rest_gap", lambda g: 3, 0, 1e-12), "bonds formed"),
        ("pressed", "a bond's strength", add("bonds/strength", lambda g: 3), "bonds formed"),
        ("pressed", "a bond's pair", put("bonds/pair", lambda g: (3, 1), lambda j: j - 1), "bonds formed"),
        (
            "pressed",
            "a place that stretches a bond",
            add(G + "position/value", lambda g: (20, int(g.h.bond_pair[5, 0]), 0), 0, 1e-4),
            "length of rigid bonds",
        ),
        (
            "beam",
            "a place that stretches a spring",
            add(G + "position/value", component(BONDED, 0), 0, 1e-4),
            "length of elastic bonds",
        ),
        (
            "pressed",
            "an intact bond beyond its limit",
            put("contacts/reaction", lambda g: (BONDED(g), 1), lambda r: 1e3),
            "intact bonds within limits",
        ),
        (
            "pressed",
            "an intact bond pulled too much",
            put("contacts/reaction", lambda g: (BONDED(g), 0), lambda r: -11.0),
            "intact bonds within limits",
        ),
        (
            "late",
            "a bond that broke within its limit",
            put("contacts/reaction", lambda g: (broken_late(g), slice(0, 2)), lambda r: r * [1, 0] + [10, 0]),
            "only bonds at their limit break",
        ),
        (
            "pressed",
            "a broken bond's status",
            put("bonds/status/value", lambda g: (-1, int(np.argmax(g.h.bond_status[-1] != "INTACT"))), 0),
            "statuses are those of events",
        ),
        (
            "pressed",
            "an intact bond's status",
            put("bonds/status/value", lambda g: (-1, int(np.argmax(g.h.bond_status[-1] == "INTACT"))), 1),
            "statuses are those of events",
        ),
        ("pressed", "the number of broken bonds", observed("bonds_broken", -1, 0, 1), "bonds_broken"),
        ("pressed", "an event's bond", event("bond", lambda b: b + 1), "statuses are those of events"),
        (
            "pressed",
            "a bond that breaks twice",
            lambda file, g: event("bond", lambda b: file["events/rupture"][0]["bond"])(file, g),
            "each bond breaks once",
        ),
        ("pressed", "an event's grain", event("i", lambda i: i + 1), "events"),
        ("pressed", "an event's time", event("time", lambda t: t * (1 + 1e-9)), "events"),
        ("pressed", "an event's place", event("y", lambda y: y + 1e-12), "events"),
        ("pressed", "an event's energy", event("energy", lambda e: e + 1e-12), "events"),
        ("beam", "an elastic event's energy", event("energy", lambda e: e * (1 + 1e-9)), "fracture_energy"),
        ("pressed", "an event's normal force", event("rn", lambda n: n + 0.1), "events at their limit"),
        ("pressed", "an event beyond its cone", event("rn", lambda n: n - 1.0), "events in their cone"),
        ("pressed", "an event's tangential force", event("rt", lambda t: 0.9 * t), "rt_or_mode"),
        ("pressed", "an event's mode", event("mode", other_mode), "mode of events"),
        ("pressed", "an event's round", event("round", lambda r: r + 7), "order of events"),
        ("late", "an event's round", event("round", lambda r: r + 1), "order of events"),
        ("arm", "an event's moment", event("m", lambda m: m + 1.0), "events in their cone"),
    ]
    + [
        ("pressed", name, observed(name, -1), name)
        for name in (
            "kinetic_energy",
            "external_work",
            "dissipation_impact",
            "dissipation_friction",
            "momentum",
            "stress",
            "wall_force",
        )
    ]
    + [
        ("pressed", "the bond remainder", observed("bond_remainder", -1, 1e-5, 1e-15), "bond_remainder"),
        ("pressed", "the energy remainder", observed("energy_remainder", -1, 0, 1e-10), "energy_remainder"),
        ("pressed", "angular momentum", observed("angular_momentum", -1), "angular_momentum"),
        ("pressed", "the strain", observed("strain", -1), "strain"),
        ("pressed", "the penetration", observed("penetration", -1, 0, 1e-10), "penetration"),
        ("pressed", "a wall's place as observed", observed("wall_position", -1, 1e-12), "wall_position"),
        (
            "pressed",
            "a wall's force in a frame",
            put("walls/force/value", lambda g: (-1, 0, 1), lambda f: f * (1 + 1e-9)),
            "force of walls in frames",
        ),
        (
            "pressed",
            "a force on a wall",
            put("contacts/reaction", lambda g: (on_wall(g), 0), lambda r: r * (1 + 1e-6)),
            "stress against walls",
        ),
        (
            "pressed",
            "the force at the limit where nothing broke",
            observed("wall_force_at_limit", 20),
            "wall_force_at_limit",
        ),
        ("pressed", "the elongation", observed("bond_elongation", -1, 1e-5, 1e-12), "bond_elongation"),
        ("pressed", "half a part", observed("substeps", -1, 0, 0.5), "counts"),
        ("pressed", "half an iteration", observed("solver_iterations", -1, 0, 0.5), "counts"),
        (
            "pressed",
            "a solved step that is said to be extrapolated",
            put("observables/solver_route/value", lambda g: int(np.argmax(newton_of(g) > 0)), 0),
            "counts",
        ),
        ("pressed", "the false acceleration", observed("false_acceleration", 40, 1e-6, 1e-9), "false_acceleration"),
        ("bouncing", "the false acceleration in free fall", observed("false_acceleration", 2), "false_acceleration"),
        ("pressed", "time that runs back", observed("cpu_time", 60, -0.9), "counts"),
        ("beam", "elastic energy", observed("elastic_energy", 20), "elastic_energy"),
        ("beam", "damping", observed("dissipation_damping", -1), "dissipation_damping"),
        ("beam", "fracture energy", observed("fracture_energy", -1), "fracture_energy"),
        # several materials and bonds by pair
        ("layered", "a material", put(G + "material", lambda g: 3, lambda m: 1 - m), "materials"),
        ("listed", "a material", put(G + "material", lambda g: 3, 0), "materials"),
        ("pressed", "a mass", add(G + "mass", lambda g: 3), "masses"),
        ("layered", "an inertia", add(G + "inertia", lambda g: int(np.argmax(g.h.material))), "masses"),
        ("layered", "the density of a material", told("materials", "named", 0, "density", value=2999), "masses"),
        ("layered", "the friction of a pair", told("materials", "pairs", 0, "friction", value=0.09), "cone_or_slip"),
        ("layered", "a region", told("materials", "named", 0, "regions", value=lambda r: r[:0]), "materials"),
        ("layered", "the strength of a pair", told("materials", "pairs", 0, "bonds", "strength", value=6.1), "bonds formed"),
        ("layered", "a limit of a pair", told("materials", "pairs", 0, "bonds", "shear", value=0.21), "bonds formed"),
        ("layered", "a notch", told("bonds", "absent", value=lambda r: r[:0]), "bonds formed"),
        ("layered", "a scattered strength", add("bonds/strength", lambda g: 3), "bonds formed"),
        ("layered", "a rolling limit", add("bonds/rolling", lambda g: 3), "bonds formed"),
        ("layered", "the seed of the strengths", told("seed", value=4), "bonds formed"),
        ("listed", "a listed strength", add("bonds/strength", lambda g: 0), "bonds formed"),
        ("listed", "a listed limit", add("bonds/friction", lambda g: 4), "bonds formed"),
        ("listed", "a bond of the list", put("bonds/pair", lambda g: (0, 1), 2), "bonds formed"),
        # laboratory loads
        ("confined", "a stress", told("walls", "left", "stress", "table", 1, 1, value=2e4 * (1 + 1e-6)), "applied_force"),
        ("confined", "a wall that confines", add("walls/velocity/value", lambda g: (-1, 1, 0), 1e-6), "wall motion"),
        ("sheared", "a slide", told("walls", "lid", "slide", "velocity", "table", 1, 1, value=0.0201), "wall motion"),
        ("sheared", "a wall that slides", add("walls/velocity/value", lambda g: (-1, 1, 0), 1e-9), "wall motion"),
        ("sheared", "a grain that is held", add(G + "velocity/value", lambda g: (20, 2, 0), 0, 1e-12), "held grains"),
        ("sheared", "a place of one", add(G + "position/value", lambda g: (20, 2, 0), 0, 1e-12), "held grains"),
        ("sheared", "a force on one", observed("wall_force", 20, 1e-9), "wall_force"),
        ("sheared", "the work of a slide", observed("external_work", -1), "external_work"),
        ("staged", "a duration", told("stages", 0, "duration", value=1.9e-3), "wall motion"),
        ("staged", "a condition of a stage", told("stages", 1, "until", "broken_fraction", value=0.9), "wall motion"),
        ("staged", "a velocity of a stage", told("stages", 1, "walls", "top", "velocity", "constant", value=0.021), "wall motion"),
        ("staged", "a wall at rest", told("stages", 2, "walls", "top", value={"velocity": {"constant": 1e-9}}), "wall motion"),
        ("staged", "a stress of a stage", told("stages", 3, "walls", "top", "stress", "ramp", "rate", value=1.001e6), "applied_force"),
        ("staged", "the work at its beginning", observed("external_work", -1), "external_work"),
        # loading from break to break
        ("events", "a place", add(G + "position/value", lambda g: (5, 3, 1), 0, 1e-15), "rest"),
        ("events", "a speed", add(G + "velocity/value", lambda g: (5, 3, 1), 0, 1e-15), "rest"),
        ("events", "a kinetic energy", observed("kinetic_energy", 3, 0, 1e-15), "rest"),
        ("events", "a load", observed("load_time", 3), "applied_force"),
        ("events", "a load beyond the end", observed("load_time", 3, 0, 1.0), "load time"),
        ("events", "a reaction", put("contacts/reaction", lambda g: (strongest_of_event(g), 0), lambda r: 1.001 * r), "equilibrium"),
        ("events", "a moment", put("contacts/moment", lambda g: BONDED(g), lambda m: m + 1e-6), "equilibrium"),
        ("events", "a bond that breaks early", put("contacts/reaction", lambda g: (broken_late(g), 0), lambda r: r + 1e-2), "breaks"),
        ("events", "a bond that holds too much", put("contacts/reaction", lambda g: (BONDED(g), 1), lambda r: r + 50), "breaks"),
        ("events", "a force without touch", add(G + "radius", dry_grain, -1e-3), "contacts that do not touch"),
        ("events", "a rupture's force", event("rn", lambda n: n * (1 + 1e-9)), "ruptures"),
        ("events", "a rupture's moment", event("m", lambda m: m * (1 + 1e-9) + 1e-12), "ruptures"),
        ("events", "a rupture's mode", event("mode", other_mode), "mode of events"),
        ("pressed", "a number that is none", put(G + "velocity/value", lambda g: (40, 1, 0), np.nan), "finite numbers"),
    ]
)

# where one of two checks must fail
EITHER = {
    "wall_force_or_applied": {"applied_force"},
    "closing_or_signorini": {"Signorini"},
    "Signorini_or_complementarity": {"Signorini", "complementarity"},
    "cone_or_slip": {"cone", "slip", "stick"},
    "rt_or_mode": {"events at their limit", "mode of events"},
}


def newton_of(good):
    """Newton iterations of each step."""
    return good.h.observed["solver_newton_iterations"]


def worst(good):
    """The step of the largest residual."""
    return int(np.argmax(good.h.observed["solver_residual"]))


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
    # a whole step after the parts
    with h5py.File(path, "r+") as file:
        place = file["particles/grains/position/value"]
        place[12] = place[12] + np.where(np.arange(5) == 1, 5e-4, 0.0)[:, None] * [1.0, 0.0]
    expected = "length of elastic bonds" if stiffness else "length of rigid bonds"
    assert expected in check(path, told).wrong
