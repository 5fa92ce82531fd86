"""What the scene prescribes of each grain and each bond: materials, regions, listed bonds, limits,
scattered strengths; and the checks of masses, materials and bonds that follow from it."""

import csv

import numpy as np

import prescribed
import tolerances
from geometry import gap_and_normal
from arrays import norm

BASE = "base"


def names(scene):
    """Names of all materials, `base` first."""
    return [BASE] + [material["name"] for material in scene["materials"].get("named") or []]


def meets(region, a, b):
    """Whether the segments from `a` to `b` (arrays of points) have a point in a region."""
    (kind, given), way = next(iter(region.items())), b - a
    if kind == "half_space":
        point, normal = np.asarray(given["point"], float), np.asarray(given["normal"], float)
        return ((a - point) @ normal >= 0) | ((b - point) @ normal >= 0)
    if kind == "ball":
        from_a, square = np.asarray(given["center"], float) - a, (way * way).sum(1)
        share = np.clip(np.divide((from_a * way).sum(1), square, out=np.zeros(len(a)), where=square > 0), 0, 1)
        return norm(from_a - share[:, None] * way) <= given["radius"]
    # a box: the parts of the segment between the two sides of each axis have a point in common
    low, high = np.asarray(given["from"], float) - a, np.asarray(given["to"], float) - a
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.stack([low / way, high / way])
    flat = way == 0
    inside = (low <= 0) & (high >= 0)
    enter = np.where(flat, np.where(inside, -np.inf, np.inf), ends.min(0)).max(1)
    leave = np.where(flat, np.where(inside, np.inf, -np.inf), ends.max(0)).min(1)
    return np.maximum(enter, 0.0) <= np.minimum(leave, 1.0)


def of_grains(h):
    """Material of each grain, as a place in `names`: what the sample says, then the regions, in
    order."""
    scene, known = h.scene, names(h.scene)
    out = np.zeros(h.N, int)
    sample = scene["sample"]
    if "grains" in sample:
        out[:] = [known.index(grain.get("material") or BASE) for grain in sample["grains"]]
    elif "file" in sample:
        with open(h.folder / sample["file"]["path"], newline="") as file:
            column = [row.get("material") for row in csv.DictReader(file)]
        if column[0] is not None:
            out[:] = [known.index(name) for name in column]
    for k, material in enumerate(scene["materials"].get("named") or []):
        for region in material.get("regions") or []:
            out[meets(region, h.x[0], h.x[0])] = k + 1
    return out


def of_pair(scene, a, b):
    """What is listed for two materials, by their places."""
    known = names(scene)
    for pair in scene["materials"].get("pairs") or []:
        if sorted(pair["between"]) == sorted((known[a], known[b])):
            return pair
    return {}


def dry_friction(h):
    """Coefficients of friction of dry contacts by pair of materials, and by material and wall."""
    scene, known = h.scene, names(h.scene)
    given = scene["materials"]["friction"]
    pairs = np.full((len(known), len(known)), float(given["grain_grain"]))
    for a in range(len(known)):
        for b in range(len(known)):
            own = of_pair(scene, a, b).get("friction")
            pairs[a, b] = pairs[a, b] if own is None else own
    walls = np.full((len(known), h.W), float(given["grain_wall"]))
    for a, material in enumerate([{}] + (scene["materials"].get("named") or [])):
        if material.get("wall_friction") is not None:
            walls[a] = material["wall_friction"]
    for k, (_, wall) in enumerate(h.scene_walls):
        if wall.get("friction") is not None:
            walls[:, k] = wall["friction"]
    return pairs, walls


def listed(h):
    """The rows of the scene's list of bonds by pair; none without a list."""
    path = h.scene["bonds"].get("list")
    if path is None:
        return None
    with open(h.folder / path, newline="") as file:
        rows = list(csv.DictReader(file))
    number = lambda text: None if text is None or text.strip() == "" else float(text)
    return {
        tuple(sorted((int(row["i"]), int(row["j"])))): {
            key: number(row.get(key)) for key in ("strength", "shear", "rolling")
        }
        for row in rows
    }


class Bonds:
    """The bonds that the scene prescribes for pairs of grains `i` < `j`: strength, shear, rolling
    and twist, factor on the stiffness, whether the strength is scattered, and how."""

    def __init__(self, h, i, j):
        scene, bonds = h.scene, h.scene["bonds"]
        self.a = h.radius[i] + h.radius[j]
        self.strength, self.factor = prescribed.strength(scene, self.a), np.ones(len(i))
        friction, _ = dry_friction(h)
        mu = (
            friction[h.material[i], h.material[j]]
            if bonds.get("friction") is None
            else np.full(len(i), bonds["friction"])
        )
        limit = lambda key: mu.copy() if bonds.get(key) is None else np.full(len(i), float(bonds[key]))
        self.shear, self.rolling = limit("shear"), limit("rolling")
        self.twist = np.full(len(i), float(bonds.get("twist") or 0.0))
        self.scatter = np.full(len(i), bonds.get("scatter"), object)
        for a in range(len(names(scene))):
            for b in range(a, len(names(scene))):
                own = of_pair(scene, a, b).get("bonds")
                rows = (np.minimum(h.material[i], h.material[j]) == a) & (np.maximum(h.material[i], h.material[j]) == b)
                if own:
                    self._of_pair(scene, own, rows)
        self.scattered = np.array([scatter is not None for scatter in self.scatter], bool)
        self.rows = listed(h)
        if self.rows is not None:
            self._of_list(i, j)

    def _of_pair(self, scene, own, rows):
        self.strength[rows] = prescribed.strength(scene, self.a[rows], own)
        limits = (("shear", self.shear), ("rolling", self.rolling), ("twist", self.twist))
        for key, values in (*limits, ("stiffness_factor", self.factor)):
            if own.get(key) is not None:
                values[rows] = own[key]
        if own.get("scatter") is not None:
            self.scatter[rows] = own["scatter"]

    def _of_list(self, i, j):
        for k, pair in enumerate(zip(i.tolist(), j.tolist())):
            row = self.rows.get(pair, {})
            self.scattered[k] &= row.get("strength") is None
            for key, values in (("strength", self.strength), ("shear", self.shear), ("rolling", self.rolling)):
                if row.get(key) is not None:
                    values[k] = row[key]


def bonded_pairs(h, i, j):
    """Excess of the gap over that of a bond (m) of pairs `i` < `j`, minus infinity where the scene
    has a bond and plus infinity where it has none, whatever the gap."""
    bonds, x = h.scene["bonds"], h.x[h.formed]
    gap, _ = gap_and_normal(h, i, j, x[i], x[j])
    given = Bonds(h, i, j)
    out = gap - bonds["gap_tolerance"] * given.a
    if given.rows is not None:
        out = np.where([pair in given.rows for pair in zip(i.tolist(), j.tolist())], -np.inf, np.inf)
    for region in bonds.get("absent") or []:
        if given.rows is None:
            out[meets(region, x[i], x[j])] = np.inf
    out[(h.fixed[i] & h.fixed[j]) | (given.strength <= 0)] = np.inf
    return out


def scatter_factors(scene, scatters):
    """Factors on the strengths of bonds with these distributions, in the order of their pairs.

    The generator is PCG XSL RR 128/64 (O'Neill 2014) with the seed of the scene as initial state and
    stream 1; a number is the upper 53 bits of a draw."""
    multiplier, modulo = 0x2360ED051FC65DA44385DF649FCCF645, 1 << 128
    increment = (1 << 1) | 1
    state = ((scene["seed"] + increment) * multiplier + increment) % modulo
    generator = np.random.PCG64()
    generator.state = {
        "bit_generator": "PCG64",
        "state": {"state": state, "inc": increment},
        "has_uint32": 0,
        "uinteger": 0,
    }
    draw = np.random.Generator(generator)

    def share():
        while True:
            value = draw.random()
            if value > 0:
                return value

    out = []
    while len(out) < len(scatters):
        kind, given = next(iter(scatters[len(out)].items()))
        if kind == "weibull":
            out.append((-np.log(share())) ** (1 / given["modulus"]))
            continue
        factor = 1 + given["deviation"] * np.sqrt(-2 * np.log(share())) * np.cos(2 * np.pi * share())
        if factor > 0:
            out.append(factor)
    return np.array(out)


def check(h, report):
    """Masses and moments of inertia follow from radius, density and thickness, materials from the
    scene."""
    told = of_grains(h)
    report.expect("materials", np.abs(h.material - told), 0.0, lambda k: f"grain {k}: material {h.material[k]}")
    density = np.array(
        [h.scene["materials"]["density"]]
        + [m.get("density") or h.scene["materials"]["density"] for m in h.scene["materials"].get("named") or []]
    )[told]
    r = h.radius
    mass = density * (np.pi * r**2 * prescribed.thickness(h.scene) if h.D == 2 else 4 / 3 * np.pi * r**3)
    inertia = (0.5 if h.D == 2 else 0.4) * mass * r**2
    report.expect("masses", np.abs(h.mass - mass), tolerances.rounding(mass), lambda k: f"grain {k}: mass (kg)")
    report.expect(
        "masses", np.abs(h.inertia - inertia), tolerances.rounding(inertia), lambda k: f"grain {k}: inertia (kg m²)"
    )


def check_bonds(h, report):
    """Bonds join exactly the pairs given by the scene, with its strengths and limits."""
    i, j = np.triu_indices(h.N, 1)
    x = h.x[h.formed]
    slack = tolerances.rounding(norm(x[i]) + norm(x[j]) + h.radius[i] + h.radius[j])
    bonded = np.isin(i * h.N + j, h.bond_pair[:, 0] * h.N + h.bond_pair[:, 1])
    beyond = bonded_pairs(h, i, j)
    off = np.where(bonded, beyond, -beyond)
    report.expect("bonds formed", off, slack, lambda m: f"pair {i[m]}-{j[m]}, bonded: {bool(bonded[m])}")
    bi, bj = h.bond_pair.T
    rest, _ = gap_and_normal(h, bi, bj, x[bi], x[bj])
    given = Bonds(h, bi, bj)
    strength = given.strength.copy()
    if given.scattered.any():
        strength[given.scattered] *= scatter_factors(h.scene, given.scatter[given.scattered])
    told = {
        "rest_gap": (h.rest_gap, rest, norm(x[bi]) + norm(x[bj]) + given.a),
        "mean_diameter": (h.mean_diameter, given.a, given.a),
        "strength": (h.strength, strength, strength),
        "shear": (h.bond_friction, given.shear, given.shear),
        "rolling": (h.bond_rolling, given.rolling, given.rolling),
        "twist": (h.bond_twist, given.twist, given.twist),
    }
    for name, (found, expected, scale) in told.items():
        off = np.abs(found - expected)
        report.expect("bonds formed", off, tolerances.rounding(scale), lambda k, name=name: f"bond {k}: {name}")
    until = h.bond_status[: h.formed + 1]
    report.require("bonds formed", bool((until == "INTACT").all()), "a bond is broken before it has formed")
    check_formed(h, report)


def check_formed(h, report):
    """The bonds form after the last step before the stage with `cement`."""
    stages = h.scene.get("stages") or []
    cements = [number for number, stage in enumerate(stages) if stage.get("cement")]
    begins = [h.driving.began[number] for number in cements if number < len(h.driving.began)]
    expected = (begins + [h.S])[0] if cements else 0
    report.require("bonds formed", h.formed == expected, f"after step {h.formed}, not {expected}")
