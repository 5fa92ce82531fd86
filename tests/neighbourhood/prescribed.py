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


def drive(wall):
    """Kind of drive of a wall of the scene and its function of time: ("force", f), ("velocity", f)
    or ("fixed", None)."""
    if wall.get("force_rate") is not None:
        return "force", {"ramp": {"rate": wall["force_rate"]}}
    for kind in ("force", "velocity"):
        if wall.get(kind) is not None:
            return kind, wall[kind]
    return "fixed", None


def direction(wall, dimension):
    """Unit direction of the drive of a wall of the scene; zero where it is fixed."""
    if drive(wall)[0] == "fixed":
        return np.zeros(dimension)
    along = wall.get("direction") or wall["shape"]["plane"]["normal"]
    return np.asarray(along, float) / np.linalg.norm(along)


def wall_mass(wall, grains):
    """Mass (kg) of a wall that is driven by a force; infinite for another."""
    if drive(wall)[0] != "force":
        return np.inf
    mass = wall.get("mass", "sample")
    return float(mass["kg"]) if isinstance(mass, dict) else float(np.sum(grains))


def wall_friction(scene):
    """Coefficients of friction of the walls, in the order of their names."""
    common = scene["materials"]["friction"]["grain_wall"]
    given = [wall.get("friction") for _, wall in walls(scene)]
    return np.array([common if mu is None else mu for mu in given], float)


def walls(scene):
    """Walls of a scene by name, in the order of the history."""
    return sorted((scene.get("walls") or {}).items())


def strength(scene, mean_diameter):
    """Tensile strength (N) of bonds of these mean diameters (m)."""
    bonds = scene["bonds"]
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
