"""Small scenes that run in a second or two: the bases of all neighbours, and what they are made
of. All are dictionaries in SI units."""

import copy

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


def plate(normal, center, size, seated=False):
    """A plate of the plane."""
    return {"shape": {"plate": {"normal": normal, "center": center, "size": [size], "seated": seated}}}


def opening():
    """A dry heap of 80 disks that falls through an opening between two plates."""
    scene = heap()
    scene["walls"] = {
        "bottom": plate(up(2), [-0.0065, 0.0], 0.027),
        "shelf": plate(up(2), [0.0265, 0.0], 0.027),
    }
    return scene


def drum():
    """A dry heap of 50 disks that falls on the inside of a drum and swings there."""
    scene = heap() | {"sample": packing(50, (2e-3, 4e-3), 0.76, width=0.02)}
    scene["walls"] = {"bottom": {"shape": {"circle": {"center": [0.012, 0.014], "radius": 0.019, "inside": True}}}}
    scene["time"]["end"] = 0.1
    return scene


def pipe():
    """40 dry spheres that fall on the inside of a lying pipe, above its axis and beside it."""
    scene = heap()
    del scene["thickness"]
    shape = {"cylinder": {"axis": [1.0, 0.0, 0.0], "center": [0.0, 0.005, 0.007], "radius": 0.0115, "inside": True}}
    scene |= {"dimension": 3, "sample": packing(40, (2e-3, 3.5e-3), 0.45, width=0.008, depth=0.008)}
    return scene | {"gravity": [0.0, 0.0, -9.81], "walls": {"bottom": {"shape": shape}}}


def punch():
    """60 cemented disks under a plate that is narrower than they are, with a force that grows."""
    scene = compression(2, small(), 2000.0, 1e-4, 0.03)
    scene["walls"]["top"] |= plate(up(2, -1.0), [0.008, 0.1], 0.007, True)
    return scene


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


def wrapped():
    """60 disks with elastic bonds in a membrane, between a floor and a lid that comes down until its
    load drops."""
    scene = biaxial()
    scene["walls"] = {name: wall for name, wall in scene["walls"].items() if not name.startswith("side_")}
    pressure = {"table": [[0.0, 0.0], [0.005, 400.0]]}
    return scene | {"membrane": {"pressure": pressure, "between": ["bottom", "top"]}}


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
    return scene | {"load_wall": "top", "stop": {"load_drop": 0.2}}


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
