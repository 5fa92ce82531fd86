"""What is altered of materials, bonds by pair, laboratory loads, and loading from break to break."""

import numpy as np

from spoil import (
    BONDED,
    G,
    add,
    broken_late,
    dry_grain,
    event,
    observed,
    other_mode,
    put,
    reaction,
    strongest_of_event,
    told,
)

# scene, what is altered, how, the check that must fail
SPOILT = [
    # several materials and bonds by pair
    ("layered", "a material", put(G + "material", lambda g: 3, lambda m: 1 - m), "materials"),
    ("listed", "a material", put(G + "material", lambda g: 3, 0), "materials"),
    ("pressed", "a mass", add(G + "mass", lambda g: 3), "masses"),
    ("layered", "an inertia", add(G + "inertia", lambda g: int(np.argmax(g.h.material))), "masses"),
    ("layered", "the density of a material", told("materials", "named", 0, "density", value=2999), "masses"),
    ("layered", "the friction of a pair", told("materials", "pairs", 0, "friction", value=0.09), "cone_or_slip"),
    ("layered", "a region", told("materials", "named", 0, "regions", value=lambda r: r[:0]), "materials"),
    (
        "layered",
        "the strength of a pair",
        told("materials", "pairs", 0, "bonds", "strength", value=6.1),
        "bonds formed",
    ),
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
    (
        "staged",
        "a velocity of a stage",
        told("stages", 1, "walls", "top", "velocity", "constant", value=0.021),
        "wall motion",
    ),
    (
        "staged",
        "a wall at rest",
        told("stages", 2, "walls", "top", value={"velocity": {"constant": 1e-9}}),
        "wall motion",
    ),
    (
        "staged",
        "a stress of a stage",
        told("stages", 3, "walls", "top", "stress", "ramp", "rate", value=1.001e6),
        "applied_force",
    ),
    ("staged", "the work at its beginning", observed("external_work", -1), "external_work"),
    # loading from break to break
    ("events", "a place", add(G + "position/value", lambda g: (5, 3, 1), 0, 1e-15), "rest"),
    ("events", "a speed", add(G + "velocity/value", lambda g: (5, 3, 1), 0, 1e-15), "rest"),
    ("events", "a kinetic energy", observed("kinetic_energy", 3, 0, 1e-15), "rest"),
    ("events", "a load", observed("load_time", 3), "applied_force"),
    ("events", "a load beyond the end", observed("load_time", 3, 0, 1.0), "load time"),
    ("events", "a reaction", reaction(strongest_of_event, 0, lambda r: 1.001 * r), "equilibrium"),
    ("events", "a moment", put("contacts/moment", lambda g: BONDED(g), lambda m: m + 1e-6), "equilibrium"),
    ("events", "a bond that breaks early", reaction(broken_late, 0, lambda r: r + 1e-2), "breaks"),
    ("events", "a bond that holds too much", reaction(BONDED, 1, lambda r: r + 50), "breaks"),
    ("events", "a force without touch", add(G + "radius", dry_grain, -1e-3), "contacts that do not touch"),
    ("events", "a rupture's force", event("rn", lambda n: n * (1 + 1e-9)), "ruptures"),
    ("events", "a rupture's moment", event("m", lambda m: m * (1 + 1e-9) + 1e-12), "ruptures"),
    ("events", "a rupture's mode", event("mode", other_mode), "mode of events"),
]
