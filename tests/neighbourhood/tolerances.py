"""Every tolerance of the checker, in one place. A tolerance without a unit is relative to the scale
that its text names.

Two scales recur. *Rounding*: `ROUNDING` units in the last place of the absolute values of all summands.
*Solver*: the residual that the history records for the step, times the norm of the reactions or of the
load, whichever is larger; the distances of a contact from its law follow from it (`laws.py` derives them),
and nothing is added but rounding.
"""

import sys

EPSILON = sys.float_info.epsilon

# name: (value, what it is relative to)
TABLE = {
    "rounding": (64.0, "units in the last place of the sum of the absolute values of all summands"),
    "books": (1e-12, "sum of the absolute values of all entries of the energy balance up to the step"),
    "touching": (
        1e-9,
        "gap over the radius below which a contact touches: it may count as 0 (docs/theory/time-stepping.md)",
    ),
    "closed": (1e-6, "the same where the pair pushed in the step before; of later gaps, what its last push left counts"),
    "limit": (
        1e-7,
        "distance to its limit, relative, at which a bond counts as being at it (docs/theory/contact-law.md)",
    ),
    "closing": (
        1e-4,
        "way that a step closes a pair, or stretches a rigid bond, beyond its law, over the smaller radius",
    ),
    "closed in all": (1e-3, "the same summed over the run"),
    "crossing": (0.5, "overlap, over the smaller radius, that half a step may add"),
    "rigid length": (
        1e-3,
        "change of the length of an intact rigid bond, over the smaller radius, beside the chord of its turn in a step",
    ),
    "elastic length": (
        1e-5,
        "length of an intact elastic bond beside that of its force and its turn, over the length",
    ),
    "printed": (0.5, "units in the last digit of a number in the summary's text"),
}


def value(name):
    """The tolerance of this name."""
    return TABLE[name][0]


def rounding(scale):
    """The tolerance of a sum whose summands have absolute values of this sum."""
    return TABLE["rounding"][0] * EPSILON * scale


def lines():
    """The table as lines of text."""
    width = max(map(len, TABLE))
    return [f"{name:{width}}  {tolerance:<7g}  {scale}" for name, (tolerance, scale) in TABLE.items()]
