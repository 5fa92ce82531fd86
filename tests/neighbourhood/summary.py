"""Every number of a run's summary, as JSON and as text, recomputed from its history."""

import re

import numpy as np

import drives
import laws
import prescribed
import tolerances
from balance import fitted_strain

STRAINS = (1e-4, 1e-3)
BROKEN_SHARE = 0.05
MODES = ("TENSION", "SHEAR", "ROLLING", "TWIST")
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")


def twists(scene):
    """Whether some bonds resist twist: all, or those of a pair of materials."""
    pairs = [(pair.get("bonds") or {}).get("twist") for pair in scene["materials"].get("pairs") or []]
    return scene["bonds"].get("twist") is not None or any(twist is not None and twist > 0 for twist in pairs)


def check(h, report, told, text=None):
    """The summary `told` (from --json), and `text` (without it) where there is one."""
    expected = recomputed(h, told)
    for name, value in expected.items():
        compare(report, "summary", name, told.get(name), value)
    unknown = sorted(set(told) - set(expected) - {"history", "cpu_time", "preparation_time", "ending"})
    report.require("summary", not unknown, f"keys that the checker does not know: {', '.join(unknown)}")
    check_ending(h, report, told)
    last = float(h.observed["cpu_time"][-1]) if h.S else 0.0
    report.require(
        "summary", told["cpu_time"] >= last, f"cpu_time {told['cpu_time']} is less than that of the last step, {last}"
    )
    began = told.get("preparation_time")
    first = float(h.observed["cpu_time"][0]) if h.S else told["cpu_time"]
    report.require(
        "summary",
        began is None or 0 <= began <= first,
        f"preparation_time {began} is more than cpu_time of the first step, {first}",
    )
    if text is not None:
        check_text(h, report, told, text)


def compare(report, check, name, found, expected):
    """`found` is `expected`: the same structure, numbers within rounding or within a pair of
    bounds."""
    if isinstance(expected, dict):
        report.require(
            check, isinstance(found, dict) and set(found) == set(expected), f"{name} is {found}, expected {expected}"
        )
        for key in expected if isinstance(found, dict) else ():
            compare(report, check, f"{name}.{key}", found.get(key), expected[key])
    elif isinstance(expected, list):
        report.require(
            check, isinstance(found, list) and len(found) == len(expected), f"{name} is {found}, expected {expected}"
        )
        for k, value in enumerate(expected if isinstance(found, list) else ()):
            compare(report, check, f"{name}[{k}]", found[k] if k < len(found) else None, value)
    elif isinstance(expected, tuple):
        low, high = expected
        report.require(
            check, found is not None and low <= found <= high, f"{name} is {found}, expected {low} to {high}"
        )
    elif isinstance(expected, float) and isinstance(found, (int, float)) and not isinstance(found, bool):
        slack = tolerances.rounding(abs(expected))
        report.require(check, abs(found - expected) <= slack, f"{name} is {found!r}, recomputed {expected!r}")
    else:
        report.require(check, found == expected, f"{name} is {found!r}, recomputed {expected!r}")


def recomputed(h, told):
    """The expected summary; pairs of numbers are bounds."""
    o = h.observed
    last = lambda name: float(o[name][-1]) if h.S and name in o else 0.0
    modes = list(h.event_mode) if h.K else []
    residual, tolerance = o["solver_residual"], h.scene["solver"]["tolerance"]
    beyond = int((residual > tolerance).sum())
    kind = h.scene["solver"]["kind"]
    newton = next(iter(kind.values())) if "gauss_seidel" not in kind else {}
    unsettled = (o["solver_load_error"] > newton.get("load_tolerance", np.inf)) & (o["solver_newton_iterations"] > 0)
    unsettled = int(((residual > tolerance) | unsettled).sum())
    rejected = int(o["solver_rejected"].sum())
    failed = told.get("ending") == "no_convergence"
    newton_iterations = int(o["solver_newton_iterations"].sum())
    out = {
        "steps": h.S,
        "time": float(h.frame_time[-1]),
        "grains": h.N,
        "bonds": h.K,
        "tolerance": float(tolerance),
        "elastic": bool(h.K and h.stiffness is not None),
        "twists": h.D == 3 and h.scene.get("bonds") is not None and twists(h.scene),
        "broken": [modes.count(mode) for mode in MODES],
        "worst_residual": float(residual.max(initial=0.0)),
        # before version 4 of histories, steps counted too whose load error missed its own tolerance
        "missed_tolerance": beyond if h.route is not None else (beyond, max(unsettled, beyond)),
        "rejected": (rejected, rejected + 1) if failed else rejected,
        "penetration": float(o["penetration"].max(initial=0.0)),
        "mean_diameter": float(2 * h.radius.mean()),
        "external_work": last("external_work") + of_a_stage_after_the_end(h),
        "energy_remainder": last("energy_remainder"),
        "bond_remainder": last("bond_remainder"),
        "work": {
            "newton_iterations": newton_iterations,
            "factorisations": int(o["solver_factorisations"].sum()),
            "sweeps": int(o["solver_iterations"].sum()) - newton_iterations,
        },
        "solid_fraction": None if h.packed is None else float(h.packed),
    }
    if h.route is not None:
        out |= of_solves(o, h.route, newton)
    if h.quasi_static:
        out["load_time"] = last("load_time")
    if "bond_elongation" in told:
        out["bond_elongation"] = float(o["bond_elongation"].max(initial=0.0)) if "bond_elongation" in o else 0.0
    out.update(loads(h, told))
    return out


def of_a_stage_after_the_end(h):
    """External work (J) of a stage that begins after the last step: it takes kinetic energy from walls
    that lose their force, and brings the energy of the bonds that form."""
    if h.S not in h.driving.began[1:]:
        return 0.0
    walls = h.scene["stages"][h.driving.began.index(h.S)].get("walls") or {}
    lost = [name in walls and not {"force", "stress"} & set(walls[name]) for name in h.wall_names]
    mass, along = h.driving.mass[-1], (h.V[-1] * h.wall_direction).sum(1)
    taken = 0.5 * (np.where(np.isfinite(mass) & lost, mass, 0.0) * along**2).sum()
    forms = h.K > 0 and h.stiffness is not None and h.formed == h.S
    return float((laws.energy_taken_over(h).sum() if forms else 0.0) - taken)


def of_solves(o, route, newton):
    """Solved steps, and load errors, of a solver with the settings `newton`; there are none of
    Gauss–Seidel."""
    error = o["solver_load_error"][~np.isnan(o["solver_load_error"])]
    tolerance = newton.get("load_tolerance")
    return {
        "solved_steps": int((route != "EXTRAPOLATION").sum()),
        "load_tolerance": None if tolerance is None else float(tolerance),
        "worst_load_error": float(error.max()) if len(error) else None,
        "missed_load_tolerance": int((error > (np.inf if tolerance is None else tolerance)).sum()),
    }


def loads(h, told):
    """The loads of driven walls in the form of the summary."""
    driven = np.flatnonzero(h.driving.driven)
    walls = {h.wall_names[k]: wall_loads(h, k, "driven_walls" in told) for k in driven}
    none = {"first_break": None, "collapse": [None, None], "early": [False, False], "broken_share": None}
    if "driven_walls" not in told:
        first = next(iter(walls.values()), {"failure": none})
        return {"failure": first["failure"]}
    chosen = drives.load_wall(h.scene)
    of_chosen = walls.get(chosen, {"failure": none, "peak_load": None, "peak_displacement": None})
    return {
        "load_wall": chosen if chosen in walls else None,
        "failure": of_chosen["failure"],
        "peak_load": of_chosen["peak_load"],
        "peak_displacement": of_chosen["peak_displacement"],
        "driven_walls": [{"wall": name, **values} for name, values in walls.items()],
        "splitting": None,
    }


def wall_loads(h, k, new):
    """First break, collapse, 5 % broken and peak of one wall."""
    load, d = h.driving.load(h, k), h.wall_direction[k]
    strain = np.abs(np.einsum("a,sab,b->s", d, fitted_strain(h)[0], d)) if h.S else np.zeros(0)
    broken = h.observed["bonds_broken"] if h.K else np.zeros(h.S)
    first = lambda holds: int(np.argmax(holds)) if holds.any() else None
    value = lambda s: None if s is None else float(load[s])
    elastic = bool(h.K and h.stiffness is not None)
    collapse, early = [None, None], [False, False]
    for n, limit in enumerate(STRAINS):
        s = first(strain > limit)
        if s is None:
            continue
        collapse[n], early[n] = (float(load[s - 1]) if s else 0.0), bool(broken[s] == 0)
        if new and (collapse[n] == 0 or (elastic and early[n])):
            collapse[n] = None
    share = first(broken >= BROKEN_SHARE * h.K) if h.K else None
    failure = {
        "first_break": value(first(broken > 0)),
        "collapse": collapse,
        "early": early,
        "broken_share": value(share),
    }
    out = {"failure": failure}
    if new:
        peak = int(np.argmax(np.abs(load))) if h.S else None
        told = peak is not None and (may_fall(h, k) or elastic) and load[peak] != 0
        out["peak_load"] = float(load[peak]) if told else None
        out["peak_displacement"] = float((h.X[peak + 1, k] - h.X[0, k]) @ d) if told else None
    return out


def may_fall(h, k):
    """Whether the load of a wall may fall by itself: a velocity drives it, at any time, or the load
    follows events."""
    stages = h.scene.get("stages") or []
    name, wall = h.scene_walls[k]
    given = [prescribed.stage_drive(s["walls"][name]) for s in stages if name in (s.get("walls") or {})]
    kinds = {kind for kind, _ in given + [prescribed.drive(wall)]}
    return "velocity" in kinds or h.quasi_static


def check_ending(h, report, told):
    """Why the run ended: at its time, with its last stage, or at the first step in which a condition
    of the scene holds."""
    ending = told["ending"]
    holds = drives.conditions(h, h.scene.get("stop") or {}, 0, h.driving.load)
    for name, held in holds.items():
        report.require("ending", not held[:-1].any(), f"{name} held before the last step, and the run went on")
    if ending in ("broken_fraction", "wall_travel", "load_drop"):
        report.require(
            "ending",
            ending in holds and h.S > 0 and bool(holds[ending][-1]),
            f"{ending} does not hold in the last step",
        )
    ended = h.driving.ended
    report.require("ending", ended is None or ended == h.S, f"the last stage ended after step {ended}")
    if ending == "stages":
        report.require("ending", ended == h.S, "the last stage did not end with the run")
    end = h.scene["time"]["end"]
    if ending == "time":
        report.require("ending", abs(h.frame_time[-1] - end) < h.h, f"ended at {h.frame_time[-1]} s, not {end} s")
    if ending == "no_break":
        last = float(h.load_times[-1]) if h.S else 0.0
        report.require("ending", h.quasi_static and last >= end, f"ended at the loads of {last} s, not {end} s")
    if ending == "no_equilibrium":
        report.require("ending", h.quasi_static, "the bodies move, and the run ended for want of an equilibrium")


def text_lines(h, told):
    """The numbers that each line of the text shows, by its label; nothing for a line without
    one."""
    f, K = told["failure"], told["bonds"]
    new = "solved_steps" in told
    per_step = lambda n: n / max(told["solved_steps" if new else "steps"], 1)
    work = told["work"]
    ended = [told["steps"], told["load_time"]] if h.quasi_static else [told["time"], told["steps"]]
    lines = [("ended", ended)]
    lines.append(
        ("sample", [told["grains"]] + ([told["solid_fraction"]] if told["solid_fraction"] is not None else []))
    )
    counts = [told["broken"][k] for k in range(4 if told["twists"] else 3)]
    if K:
        lines.append(("bonds", [K, sum(counts), 100.0 * sum(counts) / K] + counts))
    if h.S:
        took = [per_step(work[k]) for k in ("newton_iterations", "factorisations", "sweeps") if work[k] > 0]
        lines.append(("solver", took + ([told["solved_steps"], told["steps"]] if new and took else [])))
        lines.append(
            ("accuracy", [told["worst_residual"], told["tolerance"], told["missed_tolerance"], told["rejected"]])
        )
        if told.get("worst_load_error") is not None:
            numbers = [told["worst_load_error"], told["load_tolerance"], told["missed_load_tolerance"]]
            lines.append(("load error", numbers))
        lines.append(("penetration", [told["penetration"], told["penetration"] / told["mean_diameter"]]))
        lines.append(("external work", [told["external_work"]]))
        lines.append(("energy remainder", [told["energy_remainder"]]))
        if K and not told["elastic"]:
            lines.append(("bond remainder", [told["bond_remainder"]]))
        if K and "bond_elongation" in told:
            lines.append(("bond elongation", [told["bond_elongation"]]))
    return lines, load_lines(h, told, f)


def load_lines(h, told, failure):
    """The numbers of the lines of loads, of the wall that loads the sample."""
    lines = []
    if "driven_walls" in told and told["load_wall"] is None and told["driven_walls"]:
        lines = [(f"wall {wall['wall']}"[:16], line_of_wall(told, wall)) for wall in told["driven_walls"]]
        return [line for line in lines if line[1]]
    if told["bonds"] and h.driving.driven.any():
        lines.append(("first break", [failure["first_break"]]))
        lines += [
            ("collapse load", [load, strain]) for load, strain in zip(failure["collapse"], STRAINS) if load is not None
        ]
        lines.append(("5 % broken", [failure["broken_share"]]))
    if told.get("peak_load") is not None:
        lines.append(("peak load", [told["peak_load"], told["peak_displacement"]]))
    return lines


def line_of_wall(told, wall):
    """The numbers of the line of one of several driven walls; dashes are skipped."""
    numbers, failure = [], wall["failure"]
    if told["bonds"]:
        numbers += [failure["first_break"]]
        for load, strain in zip(failure["collapse"], STRAINS):
            numbers += [load, strain]
        numbers += [5, failure["broken_share"]]
    if wall.get("peak_load") is not None:
        numbers += [wall["peak_load"], wall["peak_displacement"]]
    return numbers


def check_text(h, report, told, text):
    """Every number of the text is that of the JSON, as far as it is printed."""
    lines, of_loads = text_lines(h, told)
    by_label = {}
    for line in text.splitlines():
        if not line.strip() or line.startswith("look at it"):
            break
        by_label.setdefault(line[:17].strip(), []).append(line[17:])
    for label, numbers in lines + of_loads:
        rest = by_label.get(label, [])
        report.require("summary's text", bool(rest), f"there is no line {label!r}")
        if rest:
            match_line(report, label, rest.pop(0), numbers)


def match_line(report, label, rest, numbers):
    """The numbers of a line, in order, to the digits that it prints. Names of walls are no
    numbers."""
    plain = re.sub(r"\(?\bwall [\w-]+\)?", "", rest)
    found = [m.group() for m in NUMBER.finditer(plain)]
    for number in numbers:
        if number is None:
            report.require(
                "summary's text", "none" in plain or "–" in plain, f"{label!r} says {rest.strip()!r}, expected none"
            )
            continue
        if not found:
            report.require("summary's text", False, f"{label!r} says {rest.strip()!r}, {number} is missing")
            return
        printed = found.pop(0)
        mantissa, _, power = printed.lower().partition("e")
        unit = 10.0 ** (-(len(mantissa.partition(".")[2])) + int(power or 0))
        # trailing zeros are left out
        off = abs(float(printed) - number)
        allowed = tolerances.value("printed") * unit * (1 + 1e-9) + tolerances.rounding(abs(number))
        report.require("summary's text", off <= allowed, f"{label!r} prints {printed}, it is {number!r}")
