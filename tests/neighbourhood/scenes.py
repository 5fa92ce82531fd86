"""Small scenes and changes of them: the neighbours of the shipped scenes.

A *base* is a scene that runs in a second or two. A *change* alters one thing of a base, a *pair*
two. The same seed gives the same neighbours. All scenes are dictionaries in SI units; `transformed`
turns, mirrors, shifts or rescales one with its sample.
"""

import copy
import random

import numpy as np

DENSITY = 2500
COHESION = 10.0


def plane(normal):
    """A plane against the sample."""
    return {"shape": {"plane": {"normal": list(normal), "place": "seated"}}}


def materials(friction=0.3, wall=0.2):
    """Those of the shipped scenes."""
    return {"density": DENSITY, "friction": {"grain_grain": friction, "grain_wall": wall}}


def up(dimension, sign=1.0):
    """The vertical direction."""
    return [0.0] * (dimension - 1) + [sign]


def packing(count, diameters, fraction, **box):
    """A random packing between walls."""
    low, high = diameters
    return {
        "random": {
            "count": count,
            "diameter": {"uniform": {"min": low, "max": high}},
            **box,
            "preparation": {"compaction": {"solid_fraction": fraction}},
        }
    }


def compression(dimension, sample, rate, step, end):
    """A cemented sample on a plate, under another with a force that grows."""
    return {
        "dimension": dimension,
        "seed": 1,
        "thickness": 1.0,
        "sample": sample,
        "materials": materials(),
        "bonds": {"strength": COHESION, "gap_tolerance": 1e-3},
        "walls": {
            "bottom": plane(up(dimension)),
            "top": plane(up(dimension, -1.0)) | {"mass": "sample", "force_rate": rate},
        },
        "time": {"step": step, "end": end},
        "output": {"every_steps": 1},
        "stop": {"wall_travel": {"wall": "top", "fraction_of_height": 0.005, "after": "first_break"}},
    }


def disks():
    """100 cemented disks compressed."""
    return compression(2, packing(100, (1e-3, 4e-3), 0.79, width=0.019), 2000.0, 1e-4, 0.04)


def spheres():
    """100 cemented spheres compressed."""
    scene = compression(3, packing(100, (2e-3, 3.5e-3), 0.5, width=0.011, depth=0.011), 2e4, 1e-4, 0.012)
    del scene["thickness"]
    scene["stop"]["wall_travel"]["fraction_of_height"] = 0.002
    return scene


def beam():
    """A beam of three rows on two supports, under a round wall with a force that grows."""
    seat = lambda x, y, to: {"shape": {"circle": {"center": [x, y], "radius": 0.01, "seated": [0.0, to]}}}
    return {
        "dimension": 2,
        "thickness": 1.0,
        "sample": {"lattice": {"hexagonal": {"diameter": 4e-3, "rows": 3, "columns": 21}}},
        "materials": materials(),
        "bonds": {"strength": 100.0, "gap_tolerance": 1e-6},
        "walls": {
            "left": seat(0.01, -0.1, 1.0),
            "right": seat(0.07, -0.1, 1.0),
            "top": seat(0.04, 0.1, -1.0) | {"direction": [0.0, -1.0], "mass": "sample", "force_rate": 8000.0},
        },
        "time": {"step": 1e-4, "end": 0.025},
        "output": {"every_steps": 1},
        "stop": {"wall_travel": {"wall": "top", "fraction_of_height": 0.05, "after": "first_break"}},
    }


def heap():
    """A dry heap of 80 disks that spreads on a floor."""
    return {
        "dimension": 2,
        "seed": 2,
        "thickness": 0.01,
        "sample": packing(80, (2e-3, 4e-3), 0.76, width=0.02),
        "materials": materials(0.5, 0.5),
        "walls": {"bottom": plane(up(2))},
        "gravity": [0.0, -9.81],
        "time": {"step": 2e-4, "end": 0.05},
        "output": {"every_steps": 1},
    }


def elastic():
    """60 disks with elastic bonds compressed."""
    scene = compression(2, packing(60, (2e-3, 4e-3), 0.76, width=0.018), 3000.0, 1e-4, 0.04)
    scene["bonds"]["stiffness"] = {"young": {"modulus": 1e8, "poisson_ratio": 0.2}}
    return scene


def small(count=60):
    """A small random packing of disks."""
    return packing(count, (2e-3, 4e-3), 0.78, width=0.016)


def sides(dimension, drive):
    """Walls at all sides with the same drive."""
    out = {}
    for axis, names in enumerate((("left", "right"), ("front", "back"))[: dimension - 1]):
        for name, sign in zip(names, (1.0, -1.0)):
            normal = [0.0] * dimension
            normal[axis] = sign
            out[f"side_{name}"] = plane(normal) | copy.deepcopy(drive)
    return out


def confining(stress):
    """A drive by a stress that grows within 5 ms (Pa)."""
    return {"mass": "sample", "stress": {"table": [[0.0, 0.0], [0.005, stress]]}}


def biaxial():
    """60 disks with elastic bonds between side walls that press on them with a stress, under a lid
    that comes down until its load drops."""
    scene = elastic()
    scene["sample"], scene["time"] = small(), {"step": 1e-4, "end": 0.04}
    scene["bonds"] |= {"gap_tolerance": 0.01, "stiffness": {"young": {"modulus": 1e7, "poisson_ratio": 0.2}}}
    scene["walls"] |= sides(2, confining(400.0))
    scene["walls"]["top"] = plane(up(2, -1.0)) | {"velocity": {"table": [[0.005, 0.0], [0.01, 0.02]]}}
    return scene | {"load_wall": "top", "stop": {"load_drop": 0.5}}


def block():
    """60 cemented spheres between four walls with a stress and one that comes down."""
    scene = biaxial()
    del scene["thickness"]
    scene |= {"dimension": 3, "sample": packing(60, (2e-3, 3.5e-3), 0.49, width=0.009, depth=0.009)}
    scene["walls"] = {"bottom": plane(up(3))} | sides(3, confining(4e4))
    scene["walls"]["top"] = plane(up(3, -1.0)) | {"velocity": {"table": [[0.005, 0.0], [0.01, 0.02]]}}
    scene["bonds"]["stiffness"]["young"]["modulus"] = 2e8
    scene["time"]["end"] = 0.025
    return scene


def shear():
    """Four rows of cemented disks on a wall that holds the lowest one, under a lid that a stress
    presses on them and that slides."""
    lid = {"friction": 5.0, "mass": "sample", "stress": {"table": [[0.0, 0.0], [0.002, 1000.0]]}}
    lid["slide"] = {"direction": [1.0, 0.0], "velocity": {"table": [[0.002, 0.0], [0.004, 0.02]]}}
    return {
        "dimension": 2,
        "seed": 4,
        "thickness": 1.0,
        "sample": {"lattice": {"hexagonal": {"diameter": 4e-3, "rows": 4, "columns": 10}}},
        "materials": materials(),
        "bonds": {
            "strength": 20.0,
            "gap_tolerance": 1e-6,
            "scatter": {"weibull": {"modulus": 10.0}},
            "stiffness": {"young": {"modulus": 1e7, "poisson_ratio": 0.2}},
        },
        "walls": {"bottom": plane(up(2)) | {"grip": 1e-3}, "top": plane(up(2, -1.0)) | lid},
        "time": {"step": 1e-4, "end": 0.03},
        "output": {"every_steps": 1},
    }


def tension():
    """60 disks with bonds of scattered strength between two walls that hold the outermost grains and
    move apart, until the load drops."""
    scene = elastic()
    scene["sample"], scene["time"] = small(), {"step": 1e-4, "end": 0.06}
    scene["bonds"] |= {"gap_tolerance": 0.02, "scatter": {"normal": {"deviation": 0.3}}}
    scene["bonds"]["stiffness"]["young"]["modulus"] = 1e7
    scene["walls"]["bottom"]["grip"] = 3e-3
    pulled = {"grip": 3e-3, "direction": up(2), "velocity": {"table": [[0.0, 0.0], [0.01, 2e-3]]}}
    scene["walls"]["top"] = plane(up(2, -1.0)) | pulled
    return scene | {"stop": {"load_drop": 0.2}}


def interface():
    """60 cemented disks compressed: a layer of another material, a weak interface, a notch."""
    scene = compression(2, small(), 2000.0, 1e-4, 0.03)
    layers(scene)
    notch(scene)
    return scene


def staged():
    """60 cemented disks under a lid with stages: a force, a velocity until bonds break, a constant
    force."""
    scene = compression(2, small(), 2000.0, 1e-4, 0.03)
    del scene["stop"]
    in_stages(scene)
    return scene


def events():
    """60 cemented disks compressed from break to break."""
    scene = compression(2, small(), 2000.0, 1e-4, 0.04)
    next_event(scene)
    return scene


BASES = {
    "disks": disks,
    "spheres": spheres,
    "beam": beam,
    "heap": heap,
    "elastic": elastic,
    "biaxial": biaxial,
    "block": block,
    "shear": shear,
    "tension": tension,
    "interface": interface,
    "staged": staged,
    "events": events,
}


# changes: each takes a scene and alters it; an `Inapplicable` leaves the neighbour out


class Inapplicable(Exception):
    """The base lacks the property that the change alters."""


def needs(holds):
    """Leaves a neighbour out where the base lacks something."""
    if not holds:
        raise Inapplicable


def gravity(*direction):
    """Gravity in this direction of the plane, in 3D of x and z."""

    def change(scene):
        g = [9.81 * direction[0]] + [0.0] * (scene["dimension"] - 2) + [9.81 * direction[1]]
        needs(scene.get("gravity") != g)
        scene["gravity"] = g

    return change


def side_walls(friction):
    """Fixed walls at all sides."""

    def change(scene):
        for axis, names in enumerate((("left", "right"), ("front", "back"))[: scene["dimension"] - 1]):
            for name, sign in zip(names, (1.0, -1.0)):
                normal = [0.0] * scene["dimension"]
                normal[axis] = sign
                # the supports of a beam have these names
                scene["walls"][f"side_{name}"] = plane(normal) | {"friction": friction}

    return change


def confined(scene):
    """Walls at both sides that a constant force presses on the sample."""
    force = 0.5 * (scene["bonds"]["strength"] if scene.get("bonds") else 0.1)
    needs("top" in scene["walls"] or not scene.get("bonds"))
    for name, sign in (("side_left", 1.0), ("side_right", -1.0)):
        normal = [sign] + [0.0] * (scene["dimension"] - 1)
        scene["walls"][name] = plane(normal) | {"mass": "sample", "force": {"constant": force}}


def confined_by_stress(scene):
    """Walls at all sides that press on the sample with a stress."""
    needs("top" in scene["walls"] or not scene.get("bonds"))
    needs("side_left" not in scene["walls"] and scene["walls"].get("left", {}).get("shape", {}).get("circle") is None)
    stress = 200.0 if scene["dimension"] == 2 else 2e4
    stress *= (scene.get("bonds") or {"strength": 0.1 * COHESION}).get("strength", COHESION) / COHESION
    if not scene.get("bonds"):
        stress *= 1.0 / scene.get("thickness", 1.0)
    driven = any({"force", "force_rate", "velocity", "stress"} & set(wall) for wall in scene["walls"].values())
    scene["walls"] |= sides(scene["dimension"], confining(stress))
    scene["load_wall"] = "top" if driven else "side_left"


def lid(drive):
    """Another drive of the wall on top, or a wall on top with it."""

    def change(scene):
        top = scene["walls"].get("top") or plane(up(scene["dimension"], -1.0))
        needs(drive not in ("stress", "slide") or "plane" in top["shape"])
        for old in ("force", "force_rate", "velocity", "stress", "slide", "grip", "direction", "mass"):
            if not (old == "direction" and "plane" not in top["shape"]):
                top.pop(old, None)
        scene.pop("stages", None)
        load = 50.0 if scene.get("bonds") else 1.0
        if scene["dimension"] == 3:
            load *= 5
        if scene.get("bonds", {}).get("strength", COHESION) != COHESION:
            load *= scene["bonds"]["strength"] / COHESION
        drives = {
            "force": {"mass": "sample", "force": {"constant": load}},
            "ramp": {"mass": "sample", "force": {"ramp": {"rate": 100 * load, "start": 1e-3}}},
            "table": {
                "mass": "sample",
                "force": {"table": [[0.0, 0.0], [0.005, load], [0.01, 0.2 * load], [0.02, 2 * load]]},
            },
            "velocity": {"velocity": {"constant": 0.02}},
            "velocity ramp": {"velocity": {"ramp": {"rate": 2.0}}},
            "stress": {"mass": "sample", "stress": {"ramp": {"rate": 5e3 * load}}},
            "slide": {
                "mass": "sample",
                "force": {"constant": load},
                "slide": {"direction": [1.0] + [0.0] * (scene["dimension"] - 1), "velocity": {"ramp": {"rate": 1.0}}},
            },
            "that drops": {"velocity": {"constant": 0.02}},
        }
        scene["walls"]["top"] = top | drives[drive]
        stop = scene.get("stop") or {}
        stop.pop("load_drop", None)
        if drive == "that drops":
            needs(scene.get("bonds"))
            scene["load_wall"], scene["stop"] = "top", {"load_drop": 0.7}

    return change


def layers(scene):
    """Two materials, the upper one denser; their interface is weak in shear and slips easily."""
    low, high = box_of(scene)
    border = low + 0.55 * (high - low)
    halves = {"half_space": {"point": border.tolist(), "normal": up(scene["dimension"])}}
    upper = {"name": "upper", "density": 1.3 * DENSITY, "wall_friction": 0.4, "regions": [halves]}
    pairs = [{"between": ["upper", "base"], "friction": 0.1}, {"between": ["upper", "upper"], "friction": 0.6}]
    if scene.get("bonds"):
        strength = scene["bonds"]["strength"]
        pairs[0]["bonds"] = {"strength": 0.6 * strength, "shear": 0.2, "rolling": 0.15}
        pairs[1]["bonds"] = {"strength": 2 * strength}
        if "stiffness" in scene["bonds"]:
            pairs[0]["bonds"]["stiffness_factor"] = 0.5
    scene["materials"] |= {"named": [upper], "pairs": pairs}


def inclusion(scene):
    """A ball in a box of a third material; it is bonded weakly to the box, and not to the base."""
    low, high = box_of(scene)
    middle, size = low + 0.45 * (high - low), 0.3 * float((high - low).min())
    box = {"box": {"from": (middle - size).tolist(), "to": (middle + size).tolist()}}
    ball = {"ball": {"center": middle.tolist(), "radius": size}}
    named = [{"name": "shell", "regions": [box]}, {"name": "core", "density": 2 * DENSITY, "regions": [ball]}]
    pairs = [{"between": ["core", "shell"], "friction": 0.7}]
    if scene.get("bonds"):
        strength = scene["bonds"]["strength"]
        pairs[0]["bonds"] = {"strength": 0.3 * strength, "rolling": 0.1}
        pairs += [{"between": ["core", "base"], "bonds": {"strength": 0.0}}]
    scene["materials"] |= {"named": named, "pairs": pairs}


def notch(scene):
    """A cut from below, as thin as a line, and a ball without bonds."""
    needs(scene.get("bonds"))
    low, high = box_of(scene)
    cut, end = low - 1.0, high + 1.0
    cut[0] = end[0] = low[0] + 0.5 * (high - low)[0]
    end[-1] = low[-1] + 0.4 * (high - low)[-1]
    center = low + [0.3, 0.5, 0.8][-len(low) :] * (high - low)
    ball = {"center": center.tolist(), "radius": 0.15 * float((high - low).min())}
    scene["bonds"]["absent"] = [{"box": {"from": cut.tolist(), "to": end.tolist()}}, {"ball": ball}]


def box_of(scene):
    """Lowest and highest corner of a sample of this kind (m), roughly."""
    sample, flat = scene["sample"], scene["dimension"] - 1
    if "lattice" in sample:
        given = sample["lattice"]["hexagonal"]
        return np.zeros(2), given["diameter"] * np.array([given["columns"] - 0.5, 0.87 * given["rows"]])
    given = sample["random"]
    diameter = 0.5 * sum(given["diameter"]["uniform"].values())
    fraction = given["preparation"]["compaction"]["solid_fraction"]
    sides = [given["width"], given.get("depth")][:flat]
    size = np.pi * diameter**2 / 4 if flat == 1 else np.pi * diameter**3 / 6
    return np.zeros(flat + 1), np.array(sides + [given["count"] * size / fraction / np.prod(sides)])


def gripped(scene):
    """The floor holds the grains near it."""
    needs("grip" not in scene["walls"].get("bottom", {"grip": 0}))
    scene["walls"]["bottom"]["grip"] = 1.5e-3


def in_stages(scene):
    """Stages of the wall on top: a force, a velocity until a share of the bonds is broken or the
    wall has moved, held, a constant force."""
    top = scene["walls"].get("top")
    needs(top and "plane" in top["shape"] and not top.get("grip") and not top.get("slide"))
    load, end = 20.0 if scene["dimension"] == 2 else 100.0, scene["time"]["end"]
    load *= (scene.get("bonds") or {}).get("strength", COHESION) / COHESION
    for old in ("force", "force_rate", "velocity", "stress"):
        top.pop(old, None)
    top["mass"] = "sample"
    scene.pop("stop", None)
    until = {"wall_travel": {"wall": "top", "fraction_of_height": 0.004}}
    if scene.get("bonds"):
        until["broken_fraction"] = 0.1
    scene["load_wall"] = "top"
    scene["stages"] = [
        {"name": "seat", "duration": 0.2 * end, "walls": {"top": {"force": {"ramp": {"rate": 5 * load / end}}}}},
        {"name": "compress", "duration": 0.4 * end, "until": until, "walls": {"top": {"velocity": {"constant": 0.02}}}},
        {"name": "hold", "duration": 0.1 * end, "walls": {"top": {}}},
        {"name": "confine", "duration": 0.1 * end, "walls": {"top": {"stress": {"constant": 200.0}}}},
        {"name": "unload", "duration": 0.1 * end, "walls": {"top": {"force": {"constant": 0.1 * load}}}},
    ]


def next_event(scene):
    """Loading from break to break, of prescribed loads and rigid bonds."""
    needs(scene.get("bonds") and "stiffness" not in scene["bonds"] and "stages" not in scene)
    needs(not any({"velocity", "slide"} & set(wall) for wall in scene["walls"].values()))
    scene["rupture"] = "next_event"
    scene.pop("stop", None)


def restitution(e):
    """The same coefficient for all pairs."""

    def change(scene):
        scene["materials"]["restitution"] = {"grain_grain": e, "grain_wall": e}

    return change


def friction(mu):
    """The same coefficient for all pairs; walls keep their own."""

    def change(scene):
        scene["materials"]["friction"] = {"grain_grain": mu, "grain_wall": mu}

    return change


def cohesion(strength):
    """Another strength, and loads in proportion."""

    def change(scene):
        needs(scene.get("bonds"))
        factor = strength / scene["bonds"]["strength"]
        scene["bonds"]["strength"] = strength
        drives = list(scene["walls"].values())
        drives += [drive for stage in scene.get("stages", []) for drive in stage["walls"].values()]
        for drive in drives:
            if "force_rate" in drive:
                drive["force_rate"] *= factor
            for kind in ("force", "stress"):
                if kind in drive:
                    drive[kind] = scaled(drive[kind], factor)
        for pair in scene["materials"].get("pairs", []):
            if "strength" in pair.get("bonds", {}):
                pair["bonds"]["strength"] *= factor
        if "stiffness" in scene["bonds"]:
            scene["bonds"]["stiffness"]["young"]["modulus"] *= factor

    return change


def scaled(function, factor, time=1.0):
    """A function of time, its values times a factor and its times times another."""
    if "constant" in function:
        return {"constant": function["constant"] * factor}
    if "ramp" in function:
        ramp = function["ramp"]
        return {"ramp": {"rate": ramp["rate"] * factor / time, "start": ramp.get("start", 0.0) * time}}
    return {"table": [[t * time, v * factor] for t, v in function["table"]]}


def bonds(**fields):
    """Other fields of the bonds."""

    def change(scene):
        needs(scene.get("bonds"))
        needs("twist" not in fields or scene["dimension"] == 3)
        scene["bonds"] |= fields

    return change


def stress(scene):
    """Strength as a stress: bonds of different strength."""
    needs(scene.get("bonds"))
    strength = scene["bonds"].pop("strength")
    width = 2.5e-3
    scene["bonds"]["stress"] = strength / (
        width * scene.get("thickness", 1.0) if scene["dimension"] == 2 else np.pi * width**2 / 4
    )


def rupture(rule):
    """Another rule of rupture."""

    def change(scene):
        needs(scene.get("bonds") and scene.get("rupture") != "next_event")
        scene["rupture"] = rule

    return change


def springs(scene):
    """Elastic bonds, or other springs."""
    needs(scene.get("bonds") and scene.get("rupture") != "next_event")
    stiffness = 1e6 * scene["bonds"].get("strength", COHESION) / COHESION
    scene["bonds"]["stiffness"] = {
        "springs": {
            "normal": stiffness,
            "tangential": 0.4 * stiffness,
            "rolling": stiffness * 1e-6,
            "twist": stiffness * 1e-6,
        }
    }
    if scene["dimension"] == 2 or "twist" not in scene["bonds"]:
        del scene["bonds"]["stiffness"]["springs"]["twist"]


def step(factor):
    """Another time step; a short one for a shorter time."""

    def change(scene):
        scene["time"]["step"] *= factor
        if factor < 1:
            scene["time"]["end"] *= 0.3
            for wall in scene["walls"].values():
                for name in ("force_rate",):
                    if name in wall:
                        wall[name] /= 0.3
            for stage in scene.get("stages", []):
                stage["duration"] *= 0.3

    return change


def as_file(turn=0.0, mirror=False, permute=None, units=None, shift=None):
    """The sample from a file, turned, mirrored, in another order, in other units."""

    def change(scene):
        scene["as file"] = {"turn": turn, "mirror": mirror, "permute": permute, "units": units, "shift": shift}

    return change


def as_list(scene):
    """The bonds from a list, some with limits of their own."""
    needs(scene.get("bonds") and not scene["bonds"].get("absent"))
    scene["as list"] = True


def with_materials(scene):
    """The sample from a file with a column of materials."""
    layers(scene)
    del scene["materials"]["named"][0]["regions"]
    as_file()(scene)
    scene["as file"]["materials"] = ["base", "upper", "upper"]


# name: (kind, change); of a pair both are of different kinds
CHANGES = {
    "gravity": ("gravity", gravity(0.0, -1.0)),
    "gravity aside": ("gravity", gravity(0.6, -0.8)),
    "no gravity": ("gravity", lambda scene: (needs(scene.get("gravity")), scene.pop("gravity"))),
    "smooth side walls": ("sides", side_walls(0.0)),
    "rough side walls": ("sides", side_walls(0.5)),
    "confined": ("sides", confined),
    "confined by stress": ("sides", confined_by_stress),
    "lid force": ("lid", lid("force")),
    "lid ramp": ("lid", lid("ramp")),
    "lid table": ("lid", lid("table")),
    "lid velocity": ("lid", lid("velocity")),
    "lid velocity ramp": ("lid", lid("velocity ramp")),
    "lid stress": ("lid", lid("stress")),
    "lid slide": ("lid", lid("slide")),
    "lid that drops": ("lid", lid("that drops")),
    "stages": ("lid", in_stages),
    "gripped": ("grip", gripped),
    "layers": ("materials", layers),
    "inclusion": ("materials", inclusion),
    "notch": ("notch", notch),
    "list": ("notch", as_list),
    "restitution 0.001": ("restitution", restitution(0.001)),
    "restitution 0.5": ("restitution", restitution(0.5)),
    **{f"friction {mu}": ("friction", friction(mu)) for mu in (0.0, 0.05, 0.8, 1.5)},
    **{f"cohesion {c:g}": ("cohesion", cohesion(c)) for c in (1e-3, 0.1, 1e2, 1e4)},
    "strength as stress": ("cohesion", stress),
    "bipotential": ("flow", bonds(flow="bipotential")),
    "associated": ("flow", bonds(flow="associated")),
    "smooth bonds": ("bond friction", bonds(friction=0.0)),
    "rough bonds": ("bond friction", bonds(friction=0.9)),
    "weak in bending": ("bond friction", bonds(shear=0.6, rolling=0.125)),
    "weak in shear": ("bond friction", bonds(shear=0.1, rolling=0.5)),
    "bonds that roll": ("bond friction", bonds(rolling=0.0)),
    "bonds that shear": ("bond friction", bonds(shear=0.0)),
    "Weibull bonds": ("scatter", bonds(scatter={"weibull": {"modulus": 5.0}})),
    "normal bonds": ("scatter", bonds(scatter={"normal": {"deviation": 0.2}})),
    "cascade worst": ("rupture", rupture("cascade_worst")),
    "end of step": ("rupture", rupture("end_of_step")),
    "next event": ("rupture", next_event),
    "twist": ("twist", bonds(twist=0.2)),
    "springs": ("springs", springs),
    "step x 10": ("step", step(10.0)),
    "step / 10": ("step", step(0.1)),
    "file": ("file", as_file()),
    "file with materials": ("file", with_materials),
    "mirrored": ("file", as_file(mirror=True)),
    "turned by 0.3": ("file", as_file(turn=0.3)),
    "turned by 90°": ("file", as_file(turn=np.pi / 2)),
    "permuted": ("file", as_file(permute=7)),
    "other units": ("file", as_file(units=(1e3, 1e3, 1e3))),
    "shifted": ("file", as_file(shift=0.1)),
}


def neighbours(seed):
    """Neighbours by name: the bases, each single change of each, and pairs of changes drawn with
    the seed."""
    out = {}
    for base in BASES:
        out[base] = neighbour(base)
        for name in CHANGES:
            put(out, base, [name])
    draw = random.Random(seed)
    names, wanted = sorted(CHANGES), len(out) + PAIRS
    while len(out) < wanted:
        base, pair = draw.choice(sorted(BASES)), sorted(draw.sample(names, 2))
        if CHANGES[pair[0]][0] != CHANGES[pair[1]][0]:
            put(out, base, pair)
    return out


# pairs of changes that a seed draws
PAIRS = 140


def put(out, base, names):
    """Adds a neighbour, where its changes apply."""
    name = ", ".join([base] + names)
    try:
        out[name] = neighbour(name)
    except Inapplicable:
        pass


def neighbour(name):
    """The neighbour of this name: a base and its changes, in an order in which each change finds
    the values that it scales."""
    base, *names = name.split(", ")
    scene = BASES[base]()
    # loads and springs follow the strength, which `stress` then takes away
    rank = lambda name: (
        0
        if CHANGES[name][0] == "cohesion" and name != "strength as stress"
        else 2 if name == "strength as stress" else 1
    )
    for name in sorted(names, key=rank):
        CHANGES[name][1](scene)
    stop = scene.get("stop") or {}
    top = scene["walls"].get("top", {})
    if stop.get("wall_travel") and not is_driven(scene, top):
        del scene["stop"]
    elif stop.get("load_drop") and "velocity" not in top:
        del scene["stop"]
    if not is_driven(scene, top):
        scene.pop("load_wall", None)
    needs(is_possible(scene))
    return scene


DRIVES = ("force", "force_rate", "velocity", "stress")


def is_driven(scene, top):
    """Whether the wall on top has a drive, its own or that of a stage."""
    return bool(scene.get("stages")) or any(key in top for key in DRIVES)


def is_possible(scene):
    """Whether the changes of a pair go together."""
    walls, way = scene["walls"].values(), scene.get("as file") or {}
    moves = any({"velocity", "slide"} & set(wall) for wall in walls) or "stages" in scene
    if scene.get("rupture") == "next_event" and (moves or "stiffness" in scene["bonds"]):
        return False
    aslant = way.get("turn") not in (None, 0.0, np.pi / 2)
    stages = [drive for stage in scene.get("stages", []) for drive in stage["walls"].values()]
    stressed = any("stress" in drive for drive in [*walls, *stages])
    boxes = any("box" in region for region in regions_of(scene))
    return not (aslant and (stressed or boxes))


def regions_of(scene):
    """All regions of a scene."""
    named = [region for material in scene["materials"].get("named", []) for region in material.get("regions", [])]
    return named + (scene.get("bonds") or {}).get("absent", [])


def base_of(name):
    """The base of a neighbour."""
    return name.split(", ")[0]


def moves_walls(scene):
    """Whether a wall moves at a prescribed velocity."""
    stages = [drive for stage in scene.get("stages", []) for drive in stage["walls"].values()]
    # a stage without a drive holds the wall
    held = any(not drive for drive in stages)
    return held or any("velocity" in drive for drive in [*scene["walls"].values(), *stages])


def may_have_no_motion(scene):
    """Whether nothing can move out of the way of a closing wall: walls on all sides, or bonds."""
    sides = any(name.startswith("side_") for name in scene["walls"])
    return moves_walls(scene) and (sides or bool(scene.get("bonds")))


class Transform:
    """How a scene is turned about the vertical plane (rad), mirrored, shifted (m), in an order
    drawn with the seed `permute`, and with units `units` times smaller (length, mass, time)."""

    def __init__(self, dimension, turn=0.0, mirror=False, permute=None, units=None, shift=None):
        self.length, self.mass, self.time = units or (1.0, 1.0, 1.0)
        self.force = self.mass * self.length / self.time**2
        self.permute, self.move = permute, np.full(dimension, shift or 0.0)
        c, s = (0.0, 1.0) if np.isclose(turn, np.pi / 2) else (np.cos(turn), np.sin(turn))
        # vertical is the last axis
        plane_of_turn = np.ix_([0, dimension - 1], [0, dimension - 1])
        self.R = np.eye(dimension)
        self.R[plane_of_turn] = [[c, -s], [s, c]]
        if mirror:
            self.R = self.R @ np.diag([-1.0] + [1.0] * (dimension - 1))

    def place(self, x):
        """Of a point (m)."""
        return (self.length * (self.R @ np.asarray(x, float) + self.move)).tolist()

    def along(self, x, unit=1.0):
        """Of a vector in a unit."""
        return (unit * (self.R @ np.asarray(x, float))).tolist()

    def points(self, points):
        """Of grains: rows of centre and radius, and their former numbers."""
        order = np.arange(len(points))
        if self.permute is not None:
            order = np.random.default_rng(self.permute).permutation(len(points))
        points = np.asarray(points, float)[order]
        return np.column_stack([[self.place(x) for x in points[:, :-1]], self.length * points[:, -1]]), order

    def wall(self, wall):
        """Alters a wall of a scene."""
        for shape in wall["shape"].values():
            for key, how in (
                ("normal", self.along),
                ("axis", self.along),
                ("center", self.place),
                ("seated", self.along),
            ):
                if isinstance(shape.get(key), list):
                    shape[key] = how(shape[key])
            if isinstance(shape.get("place"), dict):
                shape["place"]["at"] = self.place(shape["place"]["at"])
            if "radius" in shape:
                shape["radius"] *= self.length
        if "direction" in wall:
            wall["direction"] = self.along(wall["direction"])
        if "grip" in wall:
            wall["grip"] *= self.length
        if "slide" in wall:
            slide = wall["slide"]
            slide["direction"] = self.along(slide["direction"])
            slide["velocity"] = scaled(slide["velocity"], self.length / self.time, self.time)
        self.drive(wall)

    def drive(self, wall):
        """Alters the drive of a wall, or that of a stage."""
        if "force_rate" in wall:
            wall["force_rate"] *= self.force / self.time
        pressure = self.force / self.length**2
        for drive, unit in (("force", self.force), ("velocity", self.length / self.time), ("stress", pressure)):
            if drive in wall:
                wall[drive] = scaled(wall[drive], unit, self.time)

    def region(self, region):
        """Alters a region. A box stays one where axes turn into axes."""
        for kind, shape in region.items():
            if kind == "box":
                ends = np.array([self.place(shape["from"]), self.place(shape["to"])])
                shape["from"], shape["to"] = ends.min(0).tolist(), ends.max(0).tolist()
                continue
            for key, how in (("point", self.place), ("normal", self.along), ("center", self.place)):
                if key in shape:
                    shape[key] = how(shape[key])
            if "radius" in shape:
                shape["radius"] *= self.length

    def bonds(self, fields):
        """Alters the bonds of a scene, or those of a pair of materials."""
        for key, unit in (("strength", self.force), ("stress", self.force / self.length**2)):
            if key in fields:
                fields[key] *= unit
        stiffness = fields.get("stiffness", {})
        for key in stiffness.get("springs", {}):
            stiffness["springs"][key] *= (
                self.force / self.length if key in ("normal", "tangential") else self.force * self.length
            )
        if "young" in stiffness:
            stiffness["young"]["modulus"] *= self.force / self.length**2


def transformed(scene, points, **way):
    """The scene and its sample, rows of centre and radius, transformed by `Transform`.

    Returns the scene without its sample, the points, and a dictionary: the matrix `R` that turned it, the
    `order` in which the grains stand now, and the units of `force` and `length`."""
    scene = copy.deepcopy({key: value for key, value in scene.items() if not key.startswith("as ")})
    how = Transform(scene["dimension"], **way)
    points, order = how.points(points)
    for wall in scene["walls"].values():
        how.wall(wall)
    if "gravity" in scene:
        scene["gravity"] = how.along(scene["gravity"], how.length / how.time**2)
    for region in regions_of(scene):
        how.region(region)
    for material in [scene["materials"], *scene["materials"].get("named", [])]:
        if "density" in material:
            material["density"] *= how.mass / how.length**3
    for pair in scene["materials"].get("pairs", []):
        how.bonds(pair.get("bonds", {}))
    for stage in scene.get("stages", []):
        if "duration" in stage:
            stage["duration"] *= how.time
        for drive in stage["walls"].values():
            how.drive(drive)
    if "thickness" in scene:
        scene["thickness"] *= how.length
    scene["time"] = {key: value * how.time for key, value in scene["time"].items()}
    how.bonds(scene.get("bonds") or {})
    return scene, points, {"R": how.R, "order": order, "force": how.force, "length": how.length}
