"""Changes of small scenes: each takes a scene and alters one thing of it."""

import numpy as np

from bases import COHESION, DENSITY, box_of, confining, plane, sides, up
from transform import scaled


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
        needs(drive not in ("stress", "slide") or {"plane", "plate"} & set(top["shape"]))
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
    needs("named" not in scene["materials"])
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
    needs("named" not in scene["materials"])
    low, high = box_of(scene)
    middle, size = low + 0.45 * (high - low), 0.3 * float((high - low).min())
    box = {"box": {"from": (middle - size).tolist(), "to": (middle + size).tolist()}}
    ball = {"ball": {"center": middle.tolist(), "radius": 0.8 * size}}
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


def gripped(scene):
    """The floor holds the grains near it."""
    needs("grip" not in scene["walls"].get("bottom", {"grip": 0}))
    scene["walls"]["bottom"]["grip"] = 1.5e-3


def in_stages(scene):
    """Stages of the wall on top: a force, a velocity until a share of the bonds is broken or the
    wall has moved, held, a constant force."""
    top = scene["walls"].get("top")
    needs(top and {"plane", "plate"} & set(top["shape"]) and not top.get("grip") and not top.get("slide"))
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
    if scene.get("membrane"):
        scene["stages"][3]["membrane_pressure"] = {"constant": 200.0}


def cemented_in_a_stage(scene):
    """The stages of `in_stages`; bonds form at the beginning of the second."""
    needs(scene.get("bonds") and "as list" not in scene)
    in_stages(scene)
    scene["stages"][1]["cement"] = True


def wide_disk(scene):
    """A membrane that a larger disk rolls out."""
    needs(scene.get("membrane"))
    scene["membrane"]["disk_radius"] = 2.5e-3


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
                if "force_rate" in wall:
                    wall["force_rate"] /= 0.3
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
    needs(not any(stage.get("cement") for stage in scene.get("stages", [])))
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
    "cemented in a stage": ("lid", cemented_in_a_stage),
    "gripped": ("grip", gripped),
    "wide disk": ("membrane", wide_disk),
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
