"""Geometry and relative velocities of contacts at mid-step, recomputed from positions and radii;
and the checks of it."""

import numpy as np

import tolerances
from arrays import norm, turning_velocity


def gap_and_normal(h, i, j, xi, xj):
    """Gap (m) and unit normal from j to i, of grains `i` at `xi` and bodies `j` at `xj` (arrays of
    one length)."""
    apart = xi - xj
    normal, gap = np.zeros(apart.shape), np.zeros(len(apart))
    grains = j < h.N
    distance = norm(apart[grains])
    normal[grains] = apart[grains] / distance[:, None]
    gap[grains] = distance - h.radius[i[grains]] - h.radius[j[grains]]
    for w in range(h.W):
        rows = j == h.N + w
        if not rows.any():
            continue
        offset, radius = apart[rows], h.radius[i[rows]]
        if h.wall_kind[w] == "PLANE":
            normal[rows] = h.wall_normal[w]
            gap[rows] = offset @ h.wall_normal[w] - radius
            continue
        if h.wall_kind[w] == "PLATE":
            # the nearest point of the plate, side by side
            nearest = np.zeros(offset.shape)
            for side, length in h.wall_sides[w]:
                nearest += np.clip(offset @ side, -0.5 * length, 0.5 * length)[:, None] * side
            beside = offset - nearest
            distance = norm(beside)
            normal[rows], gap[rows] = beside / distance[:, None], distance - radius
            continue
        if h.wall_kind[w] == "CYLINDER":
            axis = h.wall_normal[w]
            offset = offset - (offset @ axis)[:, None] * axis
        distance = norm(offset)
        inside = h.wall_radius[w] < 0
        outward = offset / distance[:, None]
        normal[rows] = -outward if inside else outward
        reach = abs(h.wall_radius[w])
        gap[rows] = (reach - distance if inside else distance - reach) - radius
    return gap, normal


class Contacts:
    """Geometry of the rows of contacts at mid-step. Rows are n, t (one or two), bending (likewise),
    twist; moments are divided by a."""

    def __init__(self, h):
        s, i, j = h.row_step, h.i, h.j
        xi, xj = h.mid[s, i], h.mid[s, j]
        self.gap, self.n = gap_and_normal(h, i, j, xi, xj)
        self.lever_i = h.radius[i] + 0.5 * self.gap
        self.lever_j = np.where(h.on_wall, 0.0, h.body_radius[j] + 0.5 * self.gap)
        self.point = xi - self.n * self.lever_i[:, None]
        # round-off of a gap: that of the positions whose difference it is
        self.place = norm(xi) + norm(xj) + h.radius[i] + np.abs(np.append(h.body_radius, 0)[j])
        self.smaller = smaller_radius(h, i, j)
        self.before = self.relative(h, h.body_v[s, i], h.body_v[s, j], h.body_w[s, i], h.body_w[s, j])
        self.after = self.relative(h, h.body_v[s + 1, i], h.body_v[s + 1, j], h.body_w[s + 1, i], h.body_w[s + 1, j])
        self.speed = (
            norm(h.body_v[s + 1, i])
            + norm(h.body_v[s + 1, j])
            + self.lever_i * norm(h.body_w[s + 1, i])
            + self.lever_j * norm(h.body_w[s + 1, j])
        )

    def relative(self, h, vi, vj, wi, wj):
        """u_n [M], u_t [M,D-1], Δω along the axes of the moments: bending [M,1 or 2] and twist [M]
        (m/s, rad/s)."""
        at_i = vi + turning_velocity(wi, -self.n * self.lever_i[:, None])
        at_j = vj + turning_velocity(wj, self.n * self.lever_j[:, None])
        u, turn = at_i - at_j, wi - wj
        # the normal part from the centres alone: rotation about them does not close a gap
        un = ((vi - vj) * self.n).sum(1)
        ut = np.einsum("md,mkd->mk", u, h.tangents)
        if h.D == 2:
            return un, ut, turn, np.zeros(len(un))
        return un, ut, np.einsum("md,mkd->mk", turn, h.tangents), (turn * self.n).sum(1)


def smaller_radius(h, i, j):
    """Radius (m) of the smaller body of a pair; that of the grain at a plane."""
    walls = np.where(h.wall_radius == 0, np.inf, np.abs(h.wall_radius))
    return np.minimum(h.radius[i], np.concatenate([h.radius, walls])[j])


def where(h, rows=None):
    """Describes a row of contacts."""

    def describe(m, *_):
        row = m if rows is None else rows[m]
        other = h.wall_names[h.j[row] - h.N] if h.on_wall[row] else str(h.j[row])
        return f"step {h.row_step[row] + 1}, contact {h.i[row]}-{other}"

    return describe


def check(h, c, report):
    """Rows of contacts are sorted pairs with the geometry of mid-step."""
    order = (h.row_step * (h.N + h.W) + h.i) * (h.N + h.W) + h.j
    report.require(
        "contacts sorted", bool(np.all(np.diff(order) > 0)), "pairs of a frame are not sorted, or twice there"
    )
    report.require("contacts sorted", bool(np.all(h.i < h.j)), "a pair does not begin with the smaller number")
    rows = np.flatnonzero(h.row_single)
    describe, r = where(h, rows), tolerances.rounding
    report.expect("gap", np.abs(h.gap - c.gap)[rows], r(c.place)[rows], describe)
    relative = c.place / (h.radius[h.i] + np.where(h.on_wall, 0.0, h.body_radius[h.j]))
    report.expect("normal", norm(h.normal - c.n)[rows], r(relative)[rows], describe)
    report.expect("point", norm(h.point - c.point)[rows], r(c.place + c.lever_i * relative)[rows], describe)
    if h.D == 3 and (h.rt != 0).any():
        first = h.tangents[:, 0]
        used = np.flatnonzero(norm(h.rt) > 0)
        report.expect("tangent", np.abs(norm(first) - 1)[used], r(1.0), where(h, used))
        report.expect("tangent", np.abs((first * h.normal).sum(1))[used], r(1.0), where(h, used))


def check_left_out(h, c, report):
    """Pairs that are not among the contacts do not close; with restitution those that touch are
    among them."""
    report.margins.setdefault("pairs left out", 0.0)
    bodies = h.N + h.W
    i, j = np.triu_indices(bodies, 1)
    keep = (i < h.N) & ~(h.immovable[i] & h.immovable[j])
    i, j = i[keep], j[keep]
    present = np.unique((h.row_step * bodies + h.i) * bodies + h.j)
    for begin in range(0, h.S, 32):
        steps = np.arange(begin, min(begin + 32, h.S))
        near_i, near_j = near_pairs(h, i, j, steps)
        for s in steps[h.single[steps]]:
            out = ~np.isin((s * bodies + near_i) * bodies + near_j, present, assume_unique=True)
            left_out_of_step(h, report, s, near_i[out], near_j[out])


def near_pairs(h, i, j, steps):
    """The pairs, of these, that may touch within the steps."""
    path = norm(h.mid[steps] - h.mid[steps[0]]).max(0) + h.h * norm(h.body_v[steps + 1]).max(0)
    gap, _ = gap_and_normal(h, i, j, h.mid[steps[0], i], h.mid[steps[0], j])
    near = gap <= path[i] + path[j] + 1e-6 * h.radius[i]
    return i[near], j[near]


def left_out_of_step(h, report, s, i, j):
    """The same for one step."""
    if len(i) == 0:
        return
    xi, xj = h.mid[s, i], h.mid[s, j]
    gap, n = gap_and_normal(h, i, j, xi, xj)
    v = h.body_v[s + 1]
    closing = -((v[i] - v[j]) * n).sum(1) * h.h
    restitution = restitution_of(h, j)
    slack = tolerances.rounding(norm(xi) + norm(xj) + h.radius[i] + h.h * (norm(v[i]) + norm(v[j])))

    def describe(m):
        other = h.wall_names[j[m] - h.N] if j[m] >= h.N else j[m]
        return f"step {s + 1}, pair {i[m]}-{other} is no contact, its gap (m) after the step would be negative"

    # with restitution only touching pairs act
    touching = tolerances.value("touching") * smaller_radius(h, i, j)
    report.expect("pairs left out", np.where(restitution == 0, closing - gap, -np.inf), slack, describe)
    bounces = (restitution > 0) & (closing > 0)
    report.expect("pairs left out", np.where(bounces, touching - gap, -np.inf), slack, describe)


def restitution_of(h, j):
    """Coefficient of restitution of pairs with bodies `j`."""
    given = h.scene["materials"].get("restitution") or {}
    return np.where(j >= h.N, given.get("grain_wall", 0.0), given.get("grain_grain", 0.0))


def check_crossing(h, report):
    """Within half a step no pair overlaps by more than half the smaller radius, or passes
    through."""
    report.margins.setdefault("crossing", 0.0)
    bodies = h.N + h.W
    i, j = np.triu_indices(bodies, 1)
    keep = (i < h.N) & ~(h.immovable[i] & h.immovable[j])
    i, j = i[keep], j[keep]
    smallest = h.radius.min() if h.N else 0.0
    speed = norm(h.body_v).max(1) if bodies else np.zeros(h.S + 1)
    for s in np.flatnonzero(
        h.single & (h.h * np.maximum(speed[:-1], speed[1:]) > tolerances.value("crossing") * smallest)
    ):
        for begin, end in ((h.body_x[s], h.mid[s]), (h.mid[s], h.body_x[s + 1])):
            depth = -smallest_gap(h, i, j, begin, end)
            before = np.maximum(-gap_and_normal(h, i, j, begin[i], begin[j])[0], 0.0)
            limit = tolerances.value("crossing") * smaller_radius(h, i, j)
            report.expect("crossing", depth - before, limit, lambda m: f"step {s + 1}, pair {i[m]}-{j[m]}")


def smallest_gap(h, i, j, begin, end):
    """Smallest gaps (m) of pairs on the straight way of all bodies from `begin` to `end`."""
    x, way = begin[i] - begin[j], (end - begin)[i] - (end - begin)[j]
    square = (way * way).sum(1)
    at = np.clip(np.divide(-(x * way).sum(1), square, out=np.zeros(len(i)), where=square > 0), 0.0, 1.0)
    round_bodies = np.concatenate(
        [np.ones(h.N, bool), np.array([k not in ("PLANE", "PLATE") for k in h.wall_kind], bool)]
    )[j]
    ends = [
        gap_and_normal(h, i, j, (begin + t * (end - begin))[i], (begin + t * (end - begin))[j])[0] for t in (0.0, 1.0)
    ]
    nearest = gap_and_normal(h, i, j, x + at[:, None] * way, np.zeros_like(x))[0]
    least = np.where(round_bodies, np.minimum(np.minimum(*ends), nearest), np.minimum(*ends))
    plates = np.isin(j, [h.N + w for w in range(h.W) if h.wall_kind[w] == "PLATE"])
    if plates.any():
        # at points of the way: no less than the smallest gap
        i, j, x, way = i[plates], j[plates], x[plates], way[plates]
        points = [gap_and_normal(h, i, j, x + t * way, np.zeros_like(x))[0] for t in np.linspace(0, 1, 65)]
        least[plates] = np.min(points, 0)
    return least
