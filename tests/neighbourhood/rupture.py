"""Bonds: how they form, their lengths, and that they break where equation (5) says and nowhere
else."""

import numpy as np

import laws
import materials
import tolerances
from arrays import norm
from geometry import gap_and_normal, where


def check(h, c, p, report):
    """All checks of this module; nothing without bonds."""
    if not h.K:
        return
    materials.check_bonds(h, report)
    check_lengths(h, p, report)
    check_intact(h, p, report)
    check_statuses(h, report)
    check_events(h, c, p, report)
    check_limits_of_events(h, report)
    check_order_of_events(h, report)


def check_lengths(h, p, report):
    """An intact rigid bond keeps its length; an elastic one is as long as its force says. At
    mid-step, where bonds act.

    A rigid bond that turns by θ in a step is longer at mid-step by the chord, θ²/2 of its length.
    The next step corrects half of the elongation along the tangent (docs/theory/time-stepping.md,
    bonds that turn), so it does not accumulate.

    An elastic bond lengthens from mid-step s − 1 to mid-step s by h u_n of step s − 1, and by e_s,
    which its turn hides from the normal velocity (`laws.lengthening`). The law of step s − 1,
    h u_n + e_{s−1} = −(f_{s−1} − f_{s−2})/k, corrects the hidden part of the mid-step before. The
    sum over all steps from rest, where e and f are zero, is ℓ_s − ℓ_0 = −f_{s−1}/k + e_s: however the
    turn changes from step to step, e_s alone is added to the elongation by the force. Solver errors
    in the law, which `elastic bonds` bounds in each step, accumulate in the length over the run.
    Length and force of a bond that forms in a stage count from its first mid-step and from the force
    that it took over.

    No frame holds the mid-steps of a step in parts, and the first whole step after it corrects the
    change of the step length: lengths are checked at the mid-steps of whole steps that follow whole
    ones.
    """
    bi, bj = h.bond_pair.T
    longer, tangential = np.zeros((h.S, h.K)), np.zeros((h.S, h.K))
    for s in range(h.S):
        gap, n = gap_and_normal(h, bi, bj, h.mid[s, bi], h.mid[s, bj])
        longer[s] = gap - h.rest_gap
        u = h.v[s + 1, bi] - h.v[s + 1, bj]
        tangential[s] = norm(u - (u * n).sum(1)[:, None] * n)
    length = h.mean_diameter + h.rest_gap
    # intact when the step began
    intact = (h.bond_status[:-1] == "INTACT") & (np.arange(h.S) >= h.formed)[:, None]
    judged = intact & (h.single & ~h.after_parts)[:, None]
    # no frame holds the first mid-step of bonds that form in a step in parts
    judged &= h.formed in (0, h.S) or h.single[h.formed]
    report.figures["largest change of the length of an intact bond (m)"] = float(
        np.abs(np.where(intact, longer, 0)).max(initial=0)
    )
    # a bond that forms in a stage, between grains that move, is longer at its first mid-step
    first = longer[h.formed].copy() if 0 < h.formed < h.S else np.zeros(h.K)
    if h.stiffness is None:
        chord = 0.5 * (h.h * np.vstack([tangential[:1], tangential[:-1]])) ** 2 / length
        chord = np.maximum.accumulate(chord, 0) if h.S else chord
        smaller = np.minimum(h.radius[bi], h.radius[bj])
        describe = lambda s, b: f"step {s + 1}, bond {b}: change of length (m)"
        off = np.where(judged, np.abs(longer - first), 0.0)
        report.expect("length of rigid bonds", off, tolerances.value("rigid length") * smaller + chord, describe)
    else:
        # the force of a bond after a step follows its length at the next mid-step
        rows = np.flatnonzero((h.bond >= 0) & (h.row_step + 1 < h.S))
        s, b = h.row_step[rows] + 1, h.bond[rows]
        hidden = laws.lengthening(h, s, bi[b], bj[b])
        if 0 < h.formed < h.S:
            first -= laws.lengthening(h, np.full(h.K, h.formed), bi, bj)
        at_rest = laws.taken_over(h)[0]
        off = np.abs(longer[s, b] - first[b] + (h.rn[rows] - at_rest[b]) / h.stiffness[0][b] - hidden)
        missed = np.zeros((h.S, h.K))
        known = np.flatnonzero(p.bonds & p.judged & h.row_single)
        missed[h.row_step[known], h.bond[known]] = h.h * np.abs(p.u[known, 0])
        allowed = tolerances.value("elastic length") * length[b] + np.cumsum(missed, 0)[s - 1, b]
        report.expect("length of elastic bonds", np.where(judged[s, b], off, 0.0), allowed, where(h, rows))
    check_elongation(h, longer, report)


def check_elongation(h, longer, report):
    """The observable `bond_elongation`, where the history has it."""
    if "bond_elongation" not in h.observed:
        return
    left = (h.bond_status[1:] == "INTACT") & (np.arange(h.S) >= h.formed)[:, None]
    told = np.abs(np.where(left, longer, 0.0)).max(1, initial=0.0)
    scale = norm(h.x).max(initial=0) * 2 + h.mean_diameter.max()
    off = np.where(h.single, np.abs(told - h.observed["bond_elongation"]), 0.0)
    report.expect("bond_elongation", off, tolerances.rounding(scale), lambda s: f"step {s + 1}: bond_elongation (m)")


def failure(n, t, b, w, strength, mu, nu, a, xi):
    """Distance to rupture of reactions (N, N m): r̂_n, and the largest of ‖r_t‖/μ, ‖m‖/(ν a),
    |τ|/(ξ a) with its mode."""
    over = lambda size, c: np.divide(size, c, out=np.zeros_like(size), where=c > 0)
    ratios = np.stack([over(t, mu), over(b, nu * a), over(w, xi * a)])
    return n + strength, ratios.max(0), np.array(["SHEAR", "ROLLING", "TWIST"])[ratios.argmax(0)], ratios


def failure_of_rows(h, rows):
    """The same of these rows of bonds."""
    b = h.bond[rows]
    return failure(
        h.rn[rows],
        norm(h.rt[rows]),
        norm(h.bending[rows]),
        np.abs(h.twist[rows]),
        h.strength[b],
        h.bond_friction[b],
        h.bond_rolling[b],
        h.mean_diameter[b],
        h.bond_twist[b],
    )


def check_intact(h, p, report):
    """After a step no intact bond is at its limit; with `end_of_step` exactly the bonds at their
    limit break."""
    rows = np.flatnonzero(h.bond >= 0)
    b, s = h.bond[rows], h.row_step[rows]
    n, ratio, _, _ = failure_of_rows(h, rows)
    eps = tolerances.value("limit")
    slack = tolerances.rounding(np.abs(h.rn[rows]) + h.strength[b] + ratio)
    # positive where the bond is at its limit
    over = np.maximum(eps * h.strength[b] - n, ratio - (1 - eps) * n)
    over = np.where((n > eps * h.strength[b]) & (ratio == 0), -np.inf, over)
    intact = h.bond_status[s + 1, b] == "INTACT"
    report.expect("intact bonds within limits", np.where(intact, over, -np.inf), slack, where(h, rows))
    if h.scene.get("rupture") == "end_of_step":
        broke_now = ~intact & (h.bond_status[s, b] == "INTACT")
        report.expect("only bonds at their limit break", np.where(broke_now, -over, -np.inf), slack, where(h, rows))


def check_statuses(h, report):
    """Statuses, events and contacts agree: a bond breaks once, at its event, and has bonded
    contacts only before."""
    broke_at = np.full(h.K, h.S + 1)
    mode = np.full(h.K, "INTACT", dtype=object)
    for event, name in zip(h.events, h.event_mode):
        bond = int(event["bond"])
        report.require(
            "each bond breaks once",
            0 <= bond < h.K and broke_at[bond] > h.S,
            f"an event names bond {bond}, again or not there",
        )
        if 0 <= bond < h.K:
            broke_at[bond], mode[bond] = int(event["step"]), name
    step = np.arange(h.S + 1)[:, None]
    told = np.where(step < broke_at, "INTACT", np.broadcast_to(mode, (h.S + 1, h.K)))
    off = (told != h.bond_status).astype(float)
    report.expect(
        "statuses are those of events",
        off,
        0.0,
        lambda s, b: f"step {s}, bond {b} is {h.bond_status[s, b]}, told {told[s, b]}",
    )
    broken = h.observed["bonds_broken"]
    count = (np.arange(1, h.S + 1)[:, None] >= broke_at).sum(1)
    report.expect("bonds_broken", np.abs(broken - count), 0.0, lambda s: f"step {s + 1}: bonds_broken")
    # one row for each intact bond, and for each bond that breaks at the end of the step
    late = 1 if h.scene.get("rupture") in ("end_of_step", "next_event") else 0
    rows = np.flatnonzero(h.bond >= 0)
    steps = np.arange(1, h.S + 1)[:, None]
    held = (steps > h.formed) & (steps < broke_at + late)
    seen = np.zeros((h.S, h.K), int)
    np.add.at(seen, (h.row_step[rows], h.bond[rows]), 1)
    # the last part of a step in parts has fewer bonds
    off = np.where(h.single[:, None] | (late == 0), np.abs(seen - held), 0)
    report.expect("contacts of bonds", off, 0.0, lambda s, b: f"step {s + 1}, bond {b}: {seen[s, b]} contacts")
    pairs = (h.bond_pair[h.bond[rows]] != np.stack([h.i, h.j], 1)[rows]).any(1)
    report.expect("contacts of bonds", pairs.astype(float), 0.0, where(h, rows))


def check_events(h, c, p, report):
    """Pair, time, place and energy of every event."""
    e = h.events
    if len(e) == 0:
        report.margins.setdefault("events", 0.0)
        return
    b, step = e["bond"].astype(int), e["step"].astype(int)
    inside = (b >= 0) & (b < h.K) & (step >= 1) & (step <= h.S)
    report.require("events", bool(inside.all()), "an event refers to a bond or a step that does not exist")
    if not inside.all():
        return
    report.require(
        "events",
        np.array_equal(h.bond_pair[b], np.stack([e["i"], e["j"]], 1)),
        "an event does not name the grains of its bond",
    )
    report.expect(
        "events",
        np.abs(e["time"] - h.times[step]),
        tolerances.rounding(h.times[step]),
        lambda k: f"event {k}: time (s)",
    )
    i, j = h.bond_pair[b].T
    xi, xj = h.mid[step - 1, i], h.mid[step - 1, j]
    gap, n = gap_and_normal(h, i, j, xi, xj)
    point = xi - n * (h.radius[i] + 0.5 * gap)[:, None]
    told = np.stack([e[k] for k in "xyz"], 1)
    point = np.concatenate([point, np.zeros((len(e), 3 - h.D))], 1)
    single = h.single[step - 1]
    off = np.where(single, norm(told - point), 0.0)
    # round-off of a normal: that of positions over the distance, times the lever
    scale = 2 * (norm(xi) + norm(xj) + h.radius[i])
    report.expect("events", off, tolerances.rounding(scale), lambda k: f"event {k}: place (m)")
    energy, size = stored_energy(h, b, step)
    off = np.where(single, np.abs(e["energy"] - energy), 0.0)
    report.expect("events", off, tolerances.rounding(size), lambda k: f"event {k}: energy (J)")


def stored_energy(h, b, step):
    """½ Σ f²/k of bonds `b` that broke in steps `step`: their energy at its start, or at its end with
    `end_of_step`; in their first step the energy that they took over."""
    if h.stiffness is None:
        return np.zeros(len(b)), np.zeros(len(b))
    late = h.scene.get("rupture") == "end_of_step"
    rows = np.flatnonzero(h.bond >= 0)
    row_of = {(int(h.row_step[m]), int(h.bond[m])): m for m in rows[np.isin(h.bond[rows], b)]}
    out = laws.energy_taken_over(h)[b]
    for k, (bond, s) in enumerate(zip(b, step - 1 if late else step - 2)):
        m = row_of.get((int(s), int(bond)))
        if m is not None:
            out[k] = energy_of_rows(h, np.array([m]))[0]
    return out, out


def energy_of_rows(h, rows):
    """½ Σ f²/k (J) of these rows of elastic bonds."""
    b = h.bond[rows]
    kn, kt, km, kw = (k[b] for k in h.stiffness)
    sums = h.rn[rows] ** 2 / kn + (h.rt[rows] ** 2).sum(1) / kt + (h.bending[rows] ** 2).sum(1) / km
    if h.moment.shape[1] > 2:
        sums = sums + np.divide(h.twist[rows] ** 2, kw, out=np.zeros(len(rows)), where=kw > 0)
    return 0.5 * sums


def check_limits_of_events(h, report):
    """Every event is at its limit, in its cone, and named by the row that is nearest to its
    limit."""
    e = h.events
    if len(e) == 0:
        return
    b = np.clip(e["bond"].astype(int), 0, h.K - 1)
    eps, strength = tolerances.value("limit"), h.strength[b]
    two_columns = "twist" in e.dtype.names
    twist = np.abs(e["twist"]) if two_columns else np.zeros(len(e))
    # before version 3 `m` is the norm of bending and twist together: weaker bounds on both
    mixed = h.moment.shape[1] > 2 and not two_columns
    mu, nu, xi = h.bond_friction[b], h.bond_rolling[b], h.bond_twist[b]
    n, ratio, mode, ratios = failure(e["rn"], e["rt"], e["m"], twist, strength, mu, nu, h.mean_diameter[b], xi)
    slack = tolerances.rounding(np.abs(e["rn"]) + strength + ratio)
    describe = lambda k: f"event {k} ({h.event_mode[k]}) at step {e['step'][k]}, bond {e['bond'][k]}"
    tension = n <= eps * strength + slack
    if mixed:
        # ‖(m, τ)‖ is between the smaller limit and the root of the sum of both squares
        moments = ~np.isin(h.event_mode, ["SHEAR", "TENSION"])
        least, most = min(h.bond_friction[b].min(), xi.min()), np.hypot(h.bond_friction[b], xi)
        of_moment = e["m"] / h.mean_diameter[b]
        report.expect("events in their cone", np.where(moments, of_moment - most * n, 0.0), slack, describe)
        ratio, mode = np.where(moments, of_moment / least, ratios[0]), h.event_mode
    short = np.where(h.event_mode == "TENSION", n - eps * strength, (1 - eps) * n - ratio)
    report.expect("events at their limit", short, slack, describe)
    accepted = h.scene["solver"].get("accept") or 1e-6
    # reactions lie in their cones within the solver's tolerance
    judged = (h.event_mode != "TENSION") & ~(moments if mixed else np.zeros(len(e), bool))
    beyond = np.maximum(-n, np.where(judged, ratio - n, 0.0))
    size = largest_reaction(h)[np.clip(e["step"].astype(int) - 1, 0, max(h.S - 1, 0))] + np.abs(e["rn"])
    report.expect("events in their cone", beyond, accepted * size + slack, describe)
    expected = np.where(tension & (h.event_mode == "TENSION"), "TENSION", mode)
    tied = np.zeros(len(e), bool)
    for row, name in enumerate(("SHEAR", "ROLLING", "TWIST")):
        nearly = (1 - eps) * ratios.max(0)
        # the first of those that are nearly equal
        earlier = (ratios[:row] >= nearly + slack).any(0) & (not mixed)
        tied |= (h.event_mode == name) & (ratios[row] >= nearly - slack) & ~earlier
        expected = np.where((h.event_mode == name) & earlier, "an earlier one", expected)
    off = (
        (expected != h.event_mode) & ~tied & ~(tension & (ratio >= (1 - eps) * n - slack) & (h.event_mode == "TENSION"))
    )
    off |= tension & (n <= eps * strength - slack) & (h.event_mode != "TENSION")
    report.expect("mode of events", off.astype(float), 0.0, describe)


def largest_reaction(h):
    """Norm of all reactions (N) of each step or of the one before, whichever is larger: the scale
    of residuals."""
    square = np.bincount(h.row_step, h.rn**2 + (h.rt**2).sum(1), minlength=h.S)
    outer, _ = h.external()
    load = np.sqrt((outer**2).sum((1, 2)) + (h.driving.force ** 2).sum(1))
    size = np.maximum(np.sqrt(square), load)
    return np.maximum(size, np.append(0.0, size[:-1]))


def check_order_of_events(h, report):
    """Events are ordered by step and round; the rounds of a step count from 0 without gaps; within
    a round the order is that of the rule."""
    e = h.events
    report.margins.setdefault("order of events", 0.0)
    steps = e["step"].astype(int)
    report.require("order of events", bool((np.diff(steps) >= 0).all()), "events are not in the order of steps")
    rule = h.scene.get("rupture", "cascade")
    for s in np.unique(steps):
        part = e[steps == s]
        rounds = part["round"].astype(int)
        good = rounds[0] == 0 and bool(np.isin(np.diff(rounds), (0, 1)).all())
        single = 1 <= s <= h.S and h.single[s - 1]
        if rule == "end_of_step" and single:
            good &= rounds[-1] == 0
        if rule == "cascade_worst":
            good &= len(np.unique(rounds)) == len(rounds)
        pairs = part["i"].astype(int) * h.N + part["j"]
        same = np.diff(rounds) == 0
        good &= bool((np.diff(pairs)[same] > 0).all())
        report.require("order of events", bool(good), f"step {s}: rounds {rounds.tolist()[:12]}")
