"""Small scenes on whose histories the checker is tried: together they use every field that it
checks."""

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
    """configs/bent-arm.json with a frame at every step: spheres, a fixed one, a load, twist, which is
    another at the bend, between two materials."""
    centres = [[0, 0, 0], [4, 0, 0], [8, 0, 0], [12, 0, 0], [12, 4, 0], [12, 8, 0], [12, 12, 0]]
    grains = [{"center": [1e-3 * x for x in c], "radius": 2e-3} for c in centres]
    for grain in grains[4:]:
        grain["material"] = "upper"
    pairs = [{"between": ["upper", "base"], "bonds": {"twist": 0.05}}]
    return {
        "dimension": 3,
        "sample": {"grains": grains},
        "materials": DRY | {"named": [{"name": "upper"}], "pairs": pairs},
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
    own = {"strength": 6, "shear": 0.2, "rolling": 0.1, "scatter": {"normal": {"deviation": 0.2}}}
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


def cemented():
    """`pressed` between walls with a stress, cemented by a stage with elastic bonds, then pressed until
    bonds break."""
    scene = pressed()
    stress = {"stress": {"table": [[0, 0], [2e-3, 2e4]]}}
    scene["bonds"] |= {"gap_tolerance": 0.01, "stiffness": {"young": {"modulus": 1e8, "poisson_ratio": 0.2}}}
    scene["walls"] |= {"left": side(1), "right": side(-1)}
    del scene["walls"]["top"]["force_rate"]
    scene["stages"] = [
        {"name": "consolidate", "duration": 4e-3, "walls": {"left": stress, "right": stress, "top": stress}},
        {"name": "cement", "duration": 1e-3, "cement": True},
        {"name": "press", "duration": 5e-3, "walls": {"top": {"velocity": {"constant": 0.05}}}},
    ]
    scene["time"]["end"] = 0.01
    return scene


def cemented_rigid():
    """`cemented` with rigid bonds of scattered strength and a notch."""
    scene = cemented()
    del scene["bonds"]["stiffness"]
    scene["bonds"] |= {
        "scatter": {"weibull": {"modulus": 8}},
        "absent": [{"box": {"from": [0.004, -1], "to": [0.004, 0.008]}}],
    }
    return scene


def from_break_to_break():
    """`pressed` without weight, from break to break."""
    scene = pressed(rupture="next_event")
    del scene["gravity"]
    scene["time"]["end"] = 0.02
    return scene


def wrapped():
    """`pressed` in a membrane, whose pressure a stage lowers, between the floor and a lid that comes
    down."""
    scene = pressed()
    del scene["gravity"]
    scene["sample"]["random"]["preparation"]["compaction"]["solid_fraction"] = 0.77
    scene["bonds"] |= {"gap_tolerance": 0.02, "stiffness": {"young": {"modulus": 1e8, "poisson_ratio": 0.2}}}
    scene["walls"]["top"] = {"shape": scene["walls"]["top"]["shape"]}
    scene["membrane"] = {"pressure": {"table": [[0, 0], [2e-3, 2e4]]}, "between": ["bottom", "top"]}
    scene["stages"] = [
        {"name": "confine", "duration": 2e-3},
        {"name": "press", "duration": 4e-3, "walls": {"top": {"velocity": {"constant": 0.05}}}},
        {"name": "release", "duration": 4e-3, "membrane_pressure": {"table": [[0, 2e4], [2e-3, 5e3]]}},
    ]
    return scene


def enclosed():
    """Two rows of disks in a membrane all around, and one that flies into them."""
    r = 1e-3
    scene = pressed()
    del scene["gravity"], scene["walls"]
    places = [[2 * r * (k % 3), 2 * r * (k // 3)] for k in range(6)] + [[20 * r, 0]]
    scene["sample"] = {"grains": [{"center": place, "radius": r} for place in places]}
    scene["bonds"] |= {"strength": 0.5}
    scene["sample"]["grains"][6]["velocity"] = [-5, 0.1]
    scene["membrane"] = {"pressure": {"ramp": {"rate": 1e6}}, "disk_radius": 1.2e-3}
    return scene


SCENES = {
    "wrapped": wrapped,
    "enclosed": enclosed,
    "layered": layered,
    "listed": listed,
    "confined": confined,
    "sheared": sheared,
    "staged": staged,
    "cemented": cemented,
    "cemented rigid": cemented_rigid,
    "events": from_break_to_break,
    "pressed": pressed,
    "late": lambda: pressed(rupture="end_of_step"),
    "beam": beam,
    "arm": arm,
    "bouncing": bouncing,
}
