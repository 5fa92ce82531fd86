"""Small scenes and changes of them: the neighbours of the shipped scenes.

A *base* is a scene that runs in a second or two. A *change* alters one thing of a base, a *pair*
two. The same seed gives the same neighbours. All scenes are dictionaries in SI units.
"""

import random

import numpy as np

from bases import (
    beam,
    biaxial,
    block,
    compression,
    disks,
    drum,
    elastic,
    heap,
    opening,
    pipe,
    punch,
    shear,
    small,
    spheres,
    tension,
    wrapped,
)
from changes import CHANGES, Inapplicable, in_stages, layers, needs, next_event, notch
from transform import regions_of


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
    "wrapped": wrapped,
    "events": events,
    "opening": opening,
    "drum": drum,
    "pipe": pipe,
    "punch": punch,
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
    if "as list" in scene and any("grip" in wall for wall in walls):
        # grains that are held form no bond with each other, and a list names them
        return False
    aslant = way.get("turn") not in (None, 0.0, np.pi / 2)
    stages = [drive for stage in scene.get("stages", []) for drive in stage["walls"].values()]
    stressed = any("stress" in drive for drive in [*walls, *stages])
    boxes = any("box" in region for region in regions_of(scene))
    return not (aslant and (stressed or boxes))


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
