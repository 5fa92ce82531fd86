"""Loading to the next event (docs/theory/time-stepping.md): every step is an equilibrium of bodies
that do not move, in which no intact bond is beyond its strength, and those that break are at it."""

import numpy as np

import balance
import geometry
import laws
import materials
import motion
import rupture
import tolerances
from arrays import norm


def check(h, c, p, report):
    """All checks of such a history."""
    motion.check_time(h, report)
    check_rest(h, report)
    check_loads(h, report)
    geometry.check(h, c, report)
    check_equilibrium(h, report)
    # bonds may be at their limit: `breaks`
    laws.check_cones(h, p, report, np.flatnonzero(~p.bonds))
    check_gaps(h, c, p, report)
    laws.check_status(h, p, report, np.arange(h.M))
    accept = max(h.scene["solver"].get("accept") or 1e-6, h.scene["solver"]["tolerance"])
    report.expect("residual accepted", h.observed["solver_residual"], accept, lambda s: f"event {s + 1}")
    if h.K:
        materials.check_bonds(h, report)
        check_breaks(h, report)
        rupture.check_statuses(h, report)
        rupture.check_events(h, c, p, report)
        check_recorded(h, report)
        rupture.check_order_of_events(h, report)
    balance.check_walls(h, report)
    balance.check_stress(h, c, report)
    balance.check_counts(h, report)


def check_rest(h, report):
    """Nothing moves, and nothing does work."""
    moved = [h.body_x[1:] - h.body_x[0], h.body_v, h.body_w]
    for what in moved:
        report.expect("rest", norm(what), 0.0, lambda s, k: f"event {s}, body {k} moves")
    for name in ("kinetic_energy", "external_work", "dissipation_impact", "dissipation_friction"):
        report.expect("rest", np.abs(h.observed[name]), 0.0, lambda s, name=name: f"event {s + 1}: {name}")


def check_loads(h, report):
    """The loads are those of a time between zero and the end of the scene's loads."""
    end = h.scene["time"]["end"]
    beyond = np.maximum(-h.load_times, h.load_times - end)
    report.expect("load time", beyond, tolerances.rounding(end), lambda s: f"event {s + 1}: load_time (s)")
    motion.check_applied(h, report)


def check_equilibrium(h, report):
    """Forces and torques on every body that is free to move are in equilibrium, within the tolerance
    of the load error over the loads or the reactions of the last event."""
    (force, _), (torque, _) = motion.contact_sums(h)
    outer, outer_torque = h.external()
    free = ~h.fixed
    net = (norm(outer + force[:, : h.N]) ** 2)[:, free].sum(1)
    # a torque counts as a force at the radius of gyration
    gyration = np.sqrt(h.inertia / h.mass)
    net += ((norm(outer_torque + torque[:, : h.N]) / gyration) ** 2)[:, free].sum(1)
    given = h.driving
    along = np.einsum("swd,wd->sw", force[:, h.N :], h.wall_direction)
    net += (np.where(given.kind == "force", given.value + along, 0.0) ** 2).sum(1)
    loads = (outer[:, free] ** 2).sum((1, 2)) + (given.force**2).sum(1)
    square = np.bincount(h.row_step, h.rn**2 + (h.rt**2).sum(1), minlength=h.S)
    scale = np.sqrt(np.maximum(loads, np.append(0.0, square[:-1])[: h.S]))
    kind = next(iter(h.scene["solver"]["kind"].values()))
    tolerance = kind.get("load_tolerance") or h.scene["solver"]["tolerance"]
    report.expect("equilibrium", np.sqrt(net), tolerance * scale, lambda s: f"event {s + 1}: net force (N)")


def check_gaps(h, c, p, report):
    """Dry contacts that do not touch carry nothing, and those that do push."""
    open_ = ~p.bonds & (c.gap > tolerances.value("closed") * c.smaller + tolerances.rounding(c.place))
    carried = np.where(open_, norm(p.r), 0.0)
    report.expect("contacts that do not touch", carried, p.delta, geometry.where(h))
    report.expect("Signorini", np.where(p.bonds, 0.0, -p.r[:, 0]), p.delta, geometry.where(h))


def required(h):
    """Over its strength, the strength that the bond of each row needs to bear its reaction; 0 for dry
    contacts."""
    out, rows = np.zeros(h.M), np.flatnonzero(h.bond >= 0)
    if len(rows):
        _, ratio, _, _ = rupture.failure_of_rows(h, rows)
        out[rows] = (ratio - h.rn[rows]) / h.strength[h.bond[rows]]
    return out


def check_breaks(h, report):
    """No intact bond needs more than its strength, and those that break need just this. Only
    where the loads of time zero are too much, or reactions jump, does one need more: then it is the one that needs
    most."""
    share, limit = required(h), tolerances.value("limit")
    breaks = (h.bond >= 0) & (h.bond_status[h.row_step + 1, h.bond] != "INTACT") if h.K else np.zeros(h.M, bool)
    most = np.full(h.S, -np.inf)
    np.maximum.at(most, h.row_step[h.bond >= 0], share[h.bond >= 0])
    some = np.zeros(h.S, bool)
    some[h.row_step[breaks]] = True
    slack = limit + tolerances.rounding(1.0 + np.abs(share))
    where = geometry.where(h)
    report.expect("breaks", np.where(breaks, most[h.row_step] - share, -np.inf), 2 * slack, where)
    report.expect("breaks", np.where(breaks, 1.0 - share, -np.inf), slack, where)
    left = (h.bond >= 0) & ~breaks
    # in the last step of a run no bond need break
    beyond = np.where(left & (~some | (most <= 1 + limit))[h.row_step], share - 1.0, -np.inf)
    report.expect("breaks", beyond, slack, where)
    jumps = some & (most > 1 + limit + tolerances.rounding(2.0)) & (h.load_times > 0)
    report.figures["events in which reactions jump"] = int(jumps.sum())
    idle = np.flatnonzero(~some[:-1])
    report.require("breaks", len(idle) == 0, f"no bond breaks in event {idle[:1] + 1}, which is not the last")


def check_recorded(h, report):
    """Forces and mode of every rupture are those of its contact."""
    e = h.events
    report.margins.setdefault("ruptures", 0.0)
    row_of = {(int(s), int(b)): m for m, (s, b) in enumerate(zip(h.row_step, h.bond)) if b >= 0}
    rows = [row_of.get((int(step) - 1, int(bond)), -1) for step, bond in zip(e["step"], e["bond"])]
    report.require("ruptures", min(rows, default=0) >= 0, "a rupture has no contact in its frame")
    if min(rows, default=0) < 0 or not len(e):
        return
    m = np.array(rows)
    told = {"rn": h.rn[m], "rt": norm(h.rt)[m], "m": norm(h.bending)[m]}
    if "twist" in e.dtype.names and h.moment.shape[1] > 2:
        told["twist"] = np.abs(h.twist[m])
    size = norm(h.force)[m] + norm(h.torque)[m]
    for name, value in told.items():
        off = np.abs(np.abs(e[name]) - np.abs(value))
        report.expect("ruptures", off, tolerances.rounding(size), lambda k, name=name: f"rupture {k}: {name}")
    n, _, _, ratios = rupture.failure_of_rows(h, m)
    # at the limit of a row, unless the bond is pulled with hardly any force across
    names = np.array(["SHEAR", "ROLLING", "TWIST"], dtype=object)
    nearest = ratios >= ratios.max(0) * (1 - 1e-9)
    named = np.array([bool(nearest[:, k][names == mode].any()) for k, mode in enumerate(h.event_mode)])
    eps = tolerances.value("limit")
    tension = (h.event_mode == "TENSION") & (n <= 2 * eps * h.strength[h.bond[m]])
    report.expect("mode of events", (~(named | tension)).astype(float), 0.0, lambda k: f"rupture {k}")
