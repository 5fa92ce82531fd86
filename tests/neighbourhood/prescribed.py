"""What a scene prescribes: functions of time, drives, loads, strengths and stiffnesses, from the
scene in the history."""

import numpy as np


def at(function, times):
    """Values of a function of time of the scene at `times` (s), an array."""
    times = np.asarray(times, float)
    if "constant" in function:
        return np.full(times.shape, float(function["constant"]))
    if "ramp" in function:
        ramp = function["ramp"]
        return ramp["rate"] * np.maximum(times - ramp.get("start", 0.0), 0.0)
    knots = np.asarray(function["table"], float)
    return np.interp(times, knots[:, 0], knots[:, 1])


def steepness(function):
    """Largest slope of a function of time (1/s)."""
    if "constant" in function:
        return 0.0
    if "ramp" in function:
        return abs(function["ramp"]["rate"])
    knots = np.asarray(function["table"], float)
    return float(np.abs(np.diff(knots[:, 1]) / np.diff(knots[:, 0])).max(initial=0.0))


def drive(wall):
    """Kind of drive of a wall of the scene and its function of time: ("force", f), ("stress", f),
    ("velocity", f) or ("fixed", None)."""
    if wall.get("force_rate") is not None:
        return "force", {"ramp": {"rate": wall["force_rate"]}}
    for kind in ("force", "velocity", "stress"):
        if wall.get(kind) is not None:
            return kind, wall[kind]
    return "fixed", None


def stage_drive(given):
    """The same of the drive that a stage gives; nothing holds the wall."""
    kind, function = drive(given)
    return ("velocity", {"constant": 0.0}) if kind == "fixed" else (kind, function)


def first_drives(scene):
    """The drives at time zero, in the order of the walls. A wall that only later stages drive is
    held until then."""
    stages = scene.get("stages") or []
    out = []
    for name, wall in walls(scene):
        given = [stage["walls"][name] for stage in stages if name in (stage.get("walls") or {})]
        kind, function = drive(wall)
        if stages and name in (stages[0].get("walls") or {}):
            kind, function = stage_drive(given[0])
        elif kind == "fixed" and given:
            kind, function = stage_drive({})
        out.append((kind, function))
    return out


def is_driven(scene, name, wall):
    """Whether the wall, or a stage of the scene, has a drive for it."""
    staged = any(name in (stage.get("walls") or {}) for stage in scene.get("stages") or [])
    return staged or drive(wall)[0] != "fixed"


def direction(scene, name, wall):
    """Unit direction of the drive of a wall of the scene; zero where it is fixed."""
    if not is_driven(scene, name, wall):
        return np.zeros(scene["dimension"])
    flat = wall["shape"].get("plane") or wall["shape"].get("plate")
    along = wall.get("direction") or flat["normal"]
    return np.asarray(along, float) / np.linalg.norm(along)


def slide(wall, along):
    """Unit direction of the slide of a wall, perpendicular to its drive `along`, and its velocity,
    a function of time; none for a wall without one."""
    given = wall.get("slide")
    if given is None:
        return None
    across = np.asarray(given["direction"], float)
    across = across / np.linalg.norm(across)
    across = across - along * (across @ along)
    return across / np.linalg.norm(across), given["velocity"]


def wall_mass(wall, grains):
    """Mass (kg) that a wall has while a force drives it."""
    mass = wall.get("mass") or "sample"
    return float(mass["kg"]) if isinstance(mass, dict) else float(np.sum(grains))


def walls(scene):
    """Walls of a scene by name, in the order of the history."""
    return sorted((scene.get("walls") or {}).items())


def strength(scene, mean_diameter, given=None):
    """Tensile strength (N) of bonds of these mean diameters (m); `given` are the values of their
    pair of materials."""
    given = given or {}
    bonds = given if {"strength", "stress"} & {key for key in given if given[key] is not None} else scene["bonds"]
    if bonds.get("strength") is not None:
        return np.full(mean_diameter.shape, float(bonds["strength"]))
    section = mean_diameter * thickness(scene) if scene["dimension"] == 2 else np.pi * mean_diameter**2 / 4
    return (bonds.get("stress") or 0.0) * section


def thickness(scene):
    """Thickness of the sample (m) in 2D, 1 in 3D."""
    given = scene.get("thickness")
    return 1.0 if given is None or scene["dimension"] == 3 else float(given)


def stiffness(scene, a):
    """Stiffness of bonds of mean diameter `a` (m): normal and tangential (N/m), bending and twist
    (N m); none if rigid.

    A bar as long as it is wide: E A/a, G A/a, E I/a and, round, G 2I/a
    (docs/theory/elastic-bonds.md).
    """
    given = (scene.get("bonds") or {}).get("stiffness")
    if given is None:
        return None
    one = np.ones_like(a)
    if "springs" in given:
        springs = given["springs"]
        return [springs[k] * one for k in ("normal", "tangential", "rolling")] + [(springs.get("twist") or 0.0) * one]
    young, nu = given["young"]["modulus"], given["young"]["poisson_ratio"]
    if scene["dimension"] == 2:
        area, second_moment = a * thickness(scene), thickness(scene) * a**3 / 12
    else:
        area, second_moment = np.pi * a**2 / 4, np.pi * a**4 / 64
    shear = young / (2 * (1 + nu))
    return [young * area / a, shear * area / a, young * second_moment / a, shear * 2 * second_moment / a]
