"""The contact law: cones, Signorini, Coulomb, bonds, with velocities and geometry recomputed from
positions.

A contact obeys K ∋ r̂ ⊥ ũ ∈ K* (docs/theory/contact-law.md, (2)). With D, the largest diagonal
entry of its Delassus block, its natural map is r̂ − P_K(r̂ − ũ/D), and the residual of a step is
the norm of all maps over that of the reactions or the load. So the recorded residual bounds each
map: by δ = residual × scale + rounding. Let p = P_K(r̂ − ũ/D), ũ' = ũ + D (p − r̂). Then p and ũ'
obey the law to the last bit, ‖p − r̂‖ ≤ δ and ‖ũ' − ũ‖ ≤ D δ, and what the checks allow follows:

* the distance of r̂ from K is at most δ;
* u_n ≥ −(1 + μ) D δ, since ũ'_n ≥ μ ‖ũ'_t‖; where r_n > δ also u_n ≤ (1 + μ) D δ;
* where r̂ is inside K by more than (1 + μ) δ, ũ' = 0 and ‖u‖ ≤ D δ;
* slip: μ p_n ‖ũ'_t‖ + ũ'_t·p_t = 0, so |μ r_n ‖u_t‖ + u_t·r_t| ≤ (1 + μ) δ ‖u_t‖ + 2 μ (r_n + δ) D δ.
"""

import itertools

import numpy as np

import materials
import tolerances
from arrays import norm, turning_velocity
from geometry import restitution_of, where


def project(x, mu, nu, xi, d):
    """Projections of rows `x` [M,R] on their cones K: n, t (d of them), bending (d), twist where
    there is one more."""
    t, b = x[:, 1 : 1 + d], x[:, 1 + d : 1 + 2 * d]
    w = x[:, 1 + 2 * d :]
    pulls = [(mu, norm(t)), (nu, norm(b)), (xi, norm(w))]
    # n − x_n = Σ c (‖x‖ − c n)⁺ has the largest of the roots with any set of brackets taken as
    # active
    n = np.zeros(len(x))
    for active in itertools.product((0.0, 1.0), repeat=3):
        pull = sum(a * c * size for a, (c, size) in zip(active, pulls))
        n = np.maximum(n, (x[:, 0] + pull) / (1 + sum(a * c * c for a, (c, _) in zip(active, pulls))))
    out = [n[:, None]]
    for rows, (c, size) in zip((t, b, w), pulls):
        limit = c * n
        out.append(rows * np.minimum(1.0, np.divide(limit, size, out=np.ones_like(size), where=size > limit))[:, None])
    return np.concatenate(out, 1)


class Solved:
    """The contact problem of every step as the history shows it: reactions as impulses, velocities,
    biases, D and δ."""

    def __init__(self, h, c):
        self.bonds = h.bond >= 0
        self.a = np.where(self.bonds, h.mean_diameter[h.bond], 1.0) if h.K else np.ones(h.M)
        self.twists = h.K > 0 and h.moment.shape[1] > 2
        self._coefficients(h)
        self.r = h.h * self._rows(h.rn, h.rt, h.bending / self.a[:, None], h.twist / self.a)
        self.r[~self.bonds, h.D :] = 0.0
        un, ut, turn, spin = c.after
        self.u = self._rows(un, ut, self.a[:, None] * turn, self.a * spin)
        self.u[~self.bonds, h.D :] = 0.0
        smooth = ~self.bonds & (self.mu == 0)
        self.u[smooth, 1:] = 0.0
        self.shift = h.h * np.where(self.bonds, h.strength[h.bond], 0.0) if h.K else np.zeros(h.M)
        self._blocks(h, c, smooth)
        self._bias(h, c)
        self._elastic(h)
        self._map(h, c)

    def _rows(self, n, t, b, w):
        return np.concatenate([n[:, None], t, b] + ([w[:, None]] if self.twists else []), 1)

    def _coefficients(self, h):
        pairs, walls = materials.dry_friction(h)
        other = np.where(h.on_wall, 0, h.j)
        dry = pairs[h.material[h.i], h.material[other]]
        if h.W:
            dry = np.where(h.on_wall, walls[h.material[h.i], np.where(h.on_wall, h.j - h.N, 0)], dry)
        bond = h.bond_friction[h.bond] if h.K else np.zeros(h.M)
        self.mu = np.where(self.bonds, bond, dry)
        self.nu = np.where(self.bonds, h.bond_rolling[h.bond], 0.0) if h.K else np.zeros(h.M)
        self.xi = np.where(self.bonds, h.bond_twist[h.bond], 0.0) if h.K else np.zeros(h.M)

    def _blocks(self, h, c, smooth):
        """D: the largest diagonal entry of each Delassus block (1/kg),
        docs/theory/gauss-seidel.md."""
        mi, mj, qi, qj = h.inverse_mass[h.i], h.inverse_mass[h.j], h.inverse_inertia[h.i], h.inverse_inertia[h.j]
        n, t = mi + mj, mi + mj + c.lever_i**2 * qi + c.lever_j**2 * qj
        for k in range(h.W):
            mass = h.driving.mass[h.row_step, k]
            rows = (h.j == h.N + k) & np.isfinite(mass)
            d = h.wall_direction[k]
            along = c.n[rows] @ d
            beta = norm(d - along[:, None] * c.n[rows])
            coupling = np.abs(along * beta)
            n[rows] += (along**2 + coupling) / mass[rows]
            t[rows] += (beta**2 + coupling) / mass[rows]
        some = np.maximum(n, t)
        n, t = np.where(n == 0, some, n), np.where(t == 0, some, t)
        bend = np.where(self.bonds, self.a**2 * (qi + qj), 0.0)
        self.D = np.where(smooth, n, np.maximum(np.maximum(n, t), bend))
        self.entries = np.stack([n, t, bend, bend], 1)

    def _bias(self, h, c):
        """Bias of u_n from gaps, restitution and bonds that turn. `other` is a second admissible
        value."""
        self.acts = np.ones(h.M, bool)
        before = c.before[0]
        restitution = np.where(self.bonds, 0.0, restitution_of(h, h.j))
        slow = np.abs(before) < (h.scene["materials"].get("restitution") or {}).get("threshold_speed", 0.0)
        bounce = np.where(slow, 0.0, restitution * before)
        self.pushed = pushed_before(h)
        closed, touching = (tolerances.value(name) * c.smaller for name in ("closed", "touching"))
        left = left_by_push(h, self.pushed, c.gap)
        may_touch = np.where(self.pushed, closed, touching + np.where(left <= closed, np.maximum(left, 0.0), 0.0))
        at_rest = h.h * np.abs(before) <= may_touch
        may_touch = may_touch + tolerances.rounding(c.place)
        must_touch = tolerances.value("touching") * c.smaller - tolerances.rounding(c.place)
        near = (c.gap > 0) & (c.gap <= may_touch)
        bouncy = restitution > 0
        turn = turned_around(h, c)
        rebound, none = (np.where(turn < 0, np.minimum(speed, turn), speed) for speed in (bounce, 0.0))
        self.bias = np.where(bouncy, rebound, np.where(c.gap > 0, c.gap / h.h, turn))
        self.other = np.where((near & ~bouncy) | (at_rest & bouncy), none, self.bias)
        # with restitution touching contacts act: certainly those within round-off, never those
        # beyond the limit
        self.acts = ~bouncy | (c.gap <= may_touch)
        self.idle_too = bouncy & (c.gap > must_touch) & self.acts
        self.rigid = self.bonds if h.K and h.stiffness is None else np.zeros(h.M, bool)
        if h.K:
            normal, tangential = turned(h, c)
            self.bias = np.where(self.bonds, normal, self.bias)
            self.other = np.where(self.bonds, self.bias, self.other)
            self.u[:, 1 : h.D] += np.where(self.bonds[:, None], tangential, 0.0)
        # no frame holds the last mid-step of a step in parts
        self.unknown = (self.bonds | (turn < 0)) & h.after_parts[h.row_step]

    def _elastic(self, h):
        """u + C (r − r₀) in place of u, C = 1/(k h²)."""
        self.carried = np.zeros_like(self.r)
        self.compliance = np.zeros_like(self.r)
        if not h.K or h.stiffness is None:
            return
        kn, kt, km, kw = (k[h.bond] for k in h.stiffness)
        d = h.D - 1
        rows = [kn] + [kt] * d + [km / self.a**2] * d + ([kw / self.a**2] if self.twists else [])
        with np.errstate(divide="ignore"):
            self.compliance = np.where(self.bonds[:, None], 1 / (np.stack(rows, 1) * h.h**2), 0.0)
        last = row_before(h)
        known = (last >= 0) & self.bonds
        # a bond that forms takes over the reaction of its contact
        known &= np.where(known, (h.bond[last] == h.bond) | (h.row_step == h.formed), False)
        self.carried[known] = self.r[last[known]]
        self.u = np.where(self.bonds[:, None], self.u + self.compliance * (self.r - self.carried), self.u)
        soft = self.compliance[:, [0, 1, h.D, self.compliance.shape[1] - 1]]
        stiff = (self.entries + soft)[:, : 4 if self.twists else 3].max(1)
        self.D = np.where(self.bonds, stiff, self.D)

    def _map(self, h, c):
        """Natural maps with the better of the two biases, their round-off, and δ of every row (N
        s)."""
        flow = (h.scene.get("bonds") or {}).get("flow", "associated")
        shifts = ~self.bonds | (flow == "bipotential")
        self.raw = self.u[:, 0].copy()
        best = None
        for bias in (self.bias, self.other):
            self.u[:, 0] = self.raw + bias
            found = self._natural(h, shifts)
            if best is None:
                best, chosen = found, bias
            else:
                better = (found**2).sum(1) < (best**2).sum(1)
                best, chosen = np.where(better[:, None], found, best), np.where(better, bias, chosen)
        idle = ~self.acts | (self.idle_too & (self.r[:, 0] == 0)) | self.unknown
        self.judged = ~idle
        self.bias, self.u[:, 0] = chosen, self.raw + chosen
        self.map = np.where(idle[:, None], 0.0, best)
        moving = c.speed + np.abs(self.bias) + np.where(c.gap > 0, c.place / h.h, 0.0)
        # outside the cone a map is a difference of shifted reactions; where it is zero, ũ/D may be
        # their round-off
        size = norm(self.r) + np.where(self.sticks, 0.0, self.shift)
        stored = norm(self.compliance * np.abs(self.r)) + norm(self.compliance * np.abs(self.carried))
        self.rounding = tolerances.rounding((moving + stored) / self.D + size)
        outer, _ = h.external()
        load = np.sqrt((norm(outer[:, ~h.fixed]) ** 2).sum(1) + (h.driving.force ** 2).sum(1))
        square = np.bincount(h.row_step, (self.r**2).sum(1), minlength=h.S)
        self.scale = np.maximum(np.sqrt(square), h.h * load)
        # a map that is as small as the rounding of all velocities counts as zero, in the sum over
        # all contacts
        self.rounded = np.sqrt(np.bincount(h.row_step, self.rounding**2, minlength=h.S))
        self.delta = (h.observed["solver_residual"] * self.scale + self.rounded)[h.row_step]

    def _natural(self, h, shifts):
        """r̂ − P_K(r̂ − ũ/D); inside the cone ũ/D itself, free of the rounding of the shift."""
        d = h.D - 1
        slip = self.u.copy()
        extra = (
            self.mu * norm(slip[:, 1 : 1 + d])
            + self.nu * norm(slip[:, 1 + d : 1 + 2 * d])
            + self.xi * norm(slip[:, 1 + 2 * d :])
        )
        slip[:, 0] += np.where(shifts, extra, 0.0)
        change = slip / self.D[:, None]
        shifted = self.r.copy()
        shifted[:, 0] += self.shift
        x = shifted - change
        self.sticks = (
            (x[:, 0] >= 0)
            & (norm(x[:, 1 : 1 + d]) <= self.mu * x[:, 0])
            & (norm(x[:, 1 + d : 1 + 2 * d]) <= self.nu * x[:, 0])
            & (norm(x[:, 1 + 2 * d :]) <= self.xi * x[:, 0])
        )
        return np.where(self.sticks[:, None], change, shifted - project(x, self.mu, self.nu, self.xi, d))


def taken_over(h):
    """Normal and tangential forces (N) of their contacts that the bonds took over when they formed:
    [K] and [K,D−1]."""
    normal, tangential = np.zeros(h.K), np.zeros((h.K, h.D - 1))
    number = {tuple(pair): k for k, pair in enumerate(h.bond_pair.tolist())}
    for m in np.flatnonzero((h.row_step == h.formed - 1) & ~h.on_wall):
        k = number.get((int(h.i[m]), int(h.j[m])))
        if k is not None:
            normal[k], tangential[k] = h.rn[m], h.rt[m]
    return normal, tangential


def energy_taken_over(h):
    """Energy (J) [K] of the springs of the bonds under the forces that they took over."""
    normal, tangential = taken_over(h)
    return 0.5 * (normal**2 / h.stiffness[0] + (tangential**2).sum(1) / h.stiffness[1])


def turned_around(h, c):
    """Bias (m/s) of contacts with round walls around the grains, whose normal turns as a grain moves
    along the wall [M]; zero elsewhere.

    It is that of bonds whose length is kept: with the displacement between the last two mid-steps
    at the velocities before the step."""
    out = np.zeros(h.M)
    for w in np.flatnonzero(h.wall_radius < 0) if h.W else ():
        rows = np.flatnonzero(h.j == h.N + w)
        s, i, j = h.row_step[rows], h.i[rows], h.j[rows]
        span = np.where(s > 0, h.h, 0.5 * h.h)
        now = h.mid[s, i] - h.mid[s, j]
        way = (h.body_v[s, i] - h.body_v[s, j]) * span[:, None]
        if h.wall_kind[w] == "CYLINDER":
            axis = h.wall_normal[w]
            now, way = (x - (x @ axis)[:, None] * axis for x in (now, way))
        out[rows] = -hidden_lengthening(now - way, now) / span
    return out


def row_before(h):
    """Row of the same pair in the frame before [M]; −1 where there is none."""
    bodies = h.N + h.W
    key = (h.row_step * bodies + h.i) * bodies + h.j
    if h.M == 0:
        return np.zeros(0, int)
    place = np.minimum(np.searchsorted(key, key - bodies**2), h.M - 1)
    return np.where(key[place] == key - bodies**2, place, -1)


def left_by_push(h, pushed, gap):
    """For each row the gap that the last push of its pair left (m): its gap in the step after; zero
    if the pair has not pushed while it was near."""
    left, last = np.where(pushed, gap, 0.0), row_before(h)
    # the rows are in the order of the steps
    for m in np.flatnonzero(~pushed & (last >= 0)):
        left[m] = left[last[m]]
    return left


def pushed_before(h):
    """Whether the pair of a row carried a normal force in the step before."""
    last = row_before(h)
    return (last >= 0) & (h.rn[last] > 0) if h.M else np.zeros(0, bool)


def turned(h, c):
    """Bias of bonds that turned, along the normal [M] and the tangents [M,D−1] (m/s).

    The bias of a rigid bond with friction follows from the spin of its fragment. Otherwise, and
    where its grains have different spins, the normal part follows from its length. Rigid bonds
    have none in their first step, unless their grains begin it as a rigid body, nor one within
    round-off."""
    rigid = h.stiffness is None
    longer = lengthening(h, h.row_step, h.i, h.j) / h.h
    spins = spins_of_fragments(h) if rigid else h.body_w
    along, across = arc(h, c, spins)
    friction = h.bond_friction[h.bond] > 0
    s, i, j = h.row_step, h.i, h.j
    same = (spins[s, i] == spins[s, j]).all(1)
    n = np.where(friction & rigid & same, along, longer)
    t = np.where(friction[:, None], across, 0.0)
    if rigid:
        small = h.h * np.sqrt(n**2 + (t**2).sum(1)) <= np.finfo(float).eps * h.mean_diameter[h.bond]
        way, x = h.h * (h.body_v[s, i] - h.body_v[s, j]), c.n * (c.lever_i + c.lever_j)[:, None]
        turn = h.h * spin_of_bond(c, h.body_w[s, i], h.body_w[s, j])
        off = norm(way - turning_velocity(turn, x - way / 2)) / norm(x)
        none = small | ((h.row_step <= h.formed) & ~(friction & same & (off <= 1e-6)))
        n, t = np.where(none, 0.0, n), np.where(none[:, None], 0.0, t)
    return n, t


def spin_of_bond(c, spins_i, spins_j):
    """Spin of the vector between the centres of each pair (rad/s): that of its grains, weighted by
    their distances from the contact point."""
    a, b = c.lever_i[:, None], c.lever_j[:, None]
    return (a * spins_i + b * spins_j) / (a + b)


def arc(h, c, spins):
    """(1 − cos φ) of the vector between the centres across the axis of its rotation by φ in a step,
    over the step, with sin φ = h‖ω‖: along the normal [M] and the tangents [M,D−1] (m/s)."""
    s, i, j = h.row_step, h.i, h.j
    sine = h.h * spin_of_bond(c, spins[s, i], spins[s, j])
    x = c.n * (c.lever_i + c.lever_j)[:, None]
    if h.D == 2:
        return versine_share(sine) * sine[:, 0] ** 2 * (c.lever_i + c.lever_j) / h.h, np.zeros((h.M, 1))
    out = -np.cross(sine, np.cross(sine, x)) * versine_share(sine)[:, None] / h.h
    return (out * c.n).sum(1), np.einsum("md,mkd->mk", out, h.tangents)


def versine_share(sine):
    """(1 − cos φ)/sin² φ of rotations about `sine`, whose norm is sin φ."""
    return 1 / (1 + np.sqrt(np.maximum(1 - norm(sine) ** 2, 0)))


def spins_of_fragments(h):
    """Spins of all bodies at the start of each step, those of grains that rigid bonds, those that
    break in the step included, make equal to 1e-6 rad a step by their mean [S+1,B,Q]."""
    spins = h.body_w.copy()
    for s in range(h.formed, h.S):
        i, j = h.bond_pair[h.bond_status[s] == "INTACT"].T
        equal = norm(h.body_w[s, i] - h.body_w[s, j]) * h.h <= 1e-6
        label = np.arange(h.N)
        # labels of neighbours become equal, the smallest wins
        while (label[i[equal]] != label[j[equal]]).any():
            for a, b in zip(i[equal], j[equal]):
                label[a] = label[b] = min(label[a], label[b])
        for one in np.unique(label[np.concatenate([i[equal], j[equal]])]):
            mean = h.body_w[s, : h.N][label == one].mean(0)
            near = (label == one) & (norm(h.body_w[s, : h.N] - mean) * h.h <= 1e-6)
            spins[s, : h.N][near] = mean
    return spins


def lengthening(h, s, i, j):
    """Elongation (m) of the bonds of grains `i` and `j` between the mid-steps of steps `s` − 1 and `s`
    minus their displacement along the normal of the first: ℓ' − ℓ − d_n = d_t² / (ℓ' + ℓ + d_n), with
    the displacement d.

    The normal velocity lacks it. It is corrected in step `s`."""
    last = np.where((s > 0)[:, None], h.mid[s - 1, i] - h.mid[s - 1, j], h.body_x[0, i] - h.body_x[0, j])
    return hidden_lengthening(last, h.mid[s, i] - h.mid[s, j])


def hidden_lengthening(last, now):
    """The same of vectors `last` and `now` between the centres (m)."""
    length = norm(last)
    n = last / length[:, None]
    along = ((now - last) * n).sum(1)
    across = now - last - along[:, None] * n
    return (across**2).sum(1) / (norm(now) + length + along)


def check(h, c, p, report):
    """All checks of the laws; `p` is the solved problem."""
    rows = np.flatnonzero(h.row_single)
    check_residual(h, p, report)
    check_cones(h, p, report, rows)
    dry = rows[~p.bonds[rows] & p.judged[rows]]
    check_signorini(h, p, report, dry)
    check_coulomb(h, p, report, dry)
    check_bonds(h, p, report, rows[p.bonds[rows] & p.judged[rows]])
    idle = rows[~p.bonds[rows] & ~p.acts[rows]]
    report.expect("contacts that do not touch", norm(p.r[idle]), 0.0, where(h, idle))
    check_status(h, p, report, rows)
    check_closing(h, c, p, report)
    check_frames(h, c, p, report, rows)


def check_residual(h, p, report):
    """The residual, recomputed from the natural maps of all contacts, is at most the recorded
    one."""
    total = np.sqrt(np.bincount(h.row_step, (p.map**2).sum(1), minlength=h.S))
    allowed = h.observed["solver_residual"] * p.scale + p.rounded
    report.expect(
        "residual", np.where(h.single, total, 0.0), allowed, lambda s: f"step {s + 1}: norm of the natural maps (N s)"
    )
    accept = h.scene["solver"].get("accept") or (1e-6 if h.K else 1e-4)
    accept = max(accept, h.scene["solver"]["tolerance"])
    report.expect("residual accepted", h.observed["solver_residual"], accept, lambda s: f"step {s + 1}")


def check_cones(h, p, report, rows):
    """Reactions are in their cones: Coulomb's, and the shifted ones of bonds with limits of bending
    and twist."""
    shifted = p.r[rows].copy()
    shifted[:, 0] += p.shift[rows]
    off = norm(shifted - project(shifted, p.mu[rows], p.nu[rows], p.xi[rows], h.D - 1))
    slack = p.delta[rows] + tolerances.rounding(norm(shifted))
    dry = ~p.bonds[rows]
    report.expect("cone", np.where(dry, off, 0), slack, where(h, rows))
    report.expect("cone of bonds", np.where(dry, 0, off), slack, where(h, rows))


def check_signorini(h, p, report, rows):
    """u_n + bias ≥ 0, r_n ≥ 0, one of them zero."""
    u, r, d = p.u[rows, 0], p.r[rows, 0], p.delta[rows]
    slack = (1 + p.mu[rows]) * p.D[rows] * d
    report.expect("Signorini", -u, slack, where(h, rows))
    report.expect("Signorini", -r, d, where(h, rows))
    report.expect("complementarity", np.where(r > d, u, 0.0), slack, where(h, rows))


def check_coulomb(h, p, report, rows):
    """Sticking contacts do not slip; slip is opposite to friction."""
    d, mu = p.delta[rows], p.mu[rows]
    rn, rt, ut = p.r[rows, 0], p.r[rows, 1 : h.D], p.u[rows, 1 : h.D]
    slip, size = norm(ut), norm(rt)
    sticks = (size < mu * rn - (1 + mu) * d) & (mu > 0)
    report.expect("stick", np.where(sticks, slip, 0.0), p.D[rows] * d, where(h, rows))
    off = np.abs(mu * rn * slip + (ut * rt).sum(1))
    allowed = (1 + mu) * d * slip + 2 * mu * (rn + d) * p.D[rows] * d
    report.expect("slip", np.where(mu > 0, off, 0.0), allowed + tolerances.rounding(mu * rn * slip), where(h, rows))


def check_bonds(h, p, report, rows):
    """A bond inside its cone does not move; an elastic one obeys its springs: u + C (r − r₀) =
    0."""
    r, d, k = p.r[rows], p.delta[rows], h.D - 1
    n = r[:, 0] + p.shift[rows]
    mu, nu, xi = p.mu[rows], p.nu[rows], p.xi[rows]
    inside, moves = n > d, np.abs(p.u[rows])
    groups = [(mu, slice(1, 1 + k)), (nu, slice(1 + k, 1 + 2 * k)), (xi, slice(1 + 2 * k, None))]
    for c, part in groups:
        # a bond without a limit of a row carries nothing in it, and is free to move along it
        inside &= (norm(r[:, part]) < c * n - (1 + c) * d) | (c == 0)
        moves[:, part] = np.where((c == 0)[:, None], 0.0, moves[:, part])
    name = "rigid bonds" if h.K and h.stiffness is None else "elastic bonds"
    report.expect(name, np.where(inside, norm(moves), 0.0), p.D[rows] * d, where(h, rows))


def check_status(h, p, report, rows):
    """The status is that of the reaction: nothing carried is OPEN, within the cone STICK, on it
    SLIP; bonds are BONDED."""
    status, open_ = h.status[rows], h.rn[rows] == 0
    size, limit = norm(h.rt[rows]), p.mu[rows] * h.rn[rows]
    near = np.abs(size - limit) <= 2e-9 * limit + tolerances.rounding(limit)
    told = np.where(p.bonds[rows], "BONDED", np.where(open_, "OPEN", np.where(size >= limit, "SLIP", "STICK")))
    either = near & ~p.bonds[rows] & ~open_ & np.isin(status, ["SLIP", "STICK"])
    off = (status != told) & ~either
    report.expect("status", off.astype(float), 0.0, where(h, rows))


def check_frames(h, c, p, report, rows):
    """The first tangent of a bond is that of the step before, rotated with its grains and then
    turned least to the new tangent plane."""
    last = row_before(h)
    known = p.bonds[rows] & (last[rows] >= 0) & ~h.after_parts[h.row_step[rows]]
    rows = rows[known]
    rows = rows[h.bond[last[rows]] == h.bond[rows]]
    if h.D == 2 or not len(rows):
        return
    s, i, j = h.row_step, h.i, h.j
    sine = h.h * spin_of_bond(c, h.body_w[s, i], h.body_w[s, j])[rows]
    # near a right angle the share has the root of the rounding
    share = versine_share(sine)
    sine = sine / np.maximum(norm(sine), 1.0)[:, None]
    old = h.tangents[last[rows], 0]
    across = np.cross(sine, old)
    turned = old + across + np.cross(sine, across) * share[:, None]
    flat = turned - c.n[rows] * (c.n[rows] * turned).sum(1)[:, None]
    size = norm(flat)
    off = np.where(size > 0.5, norm(h.tangents[rows, 0] - flat / size[:, None]), 0.0)
    relative = c.place / (h.radius[i] + np.where(h.on_wall, 0.0, h.body_radius[j]))
    report.expect("frames of bonds", off, tolerances.rounding(2.0 + relative)[rows], where(h, rows))


def check_closing(h, c, p, report):
    """No step closes a pair, or stretches a rigid bond, beyond its law by more than a share of its
    radius; nor does the sum over the steps."""
    intact = np.ones(h.M, bool)
    if h.K:
        intact = p.bonds & (h.bond_status[h.row_step + 1, h.bond] == "INTACT")
    # a bond that breaks at the end of the step flows in it, as its law says
    counts = p.judged & h.row_single & np.where(p.bonds, p.rigid & intact, True)
    closing = np.where(counts, -(p.raw + p.bias) * h.h / c.smaller, 0.0)
    beyond = np.where(p.bonds, np.abs(closing), closing)
    usual = 1e-6 if h.K else 1e-4
    # a coarser tolerance than the usual one loosens both in proportion
    loose = max(1.0, (h.scene["solver"].get("accept") or usual) / usual)
    report.expect("closing", beyond, loose * tolerances.value("closing"), where(h))
    bodies = h.N + h.W
    pair, total, most = h.i * bodies + h.j, np.zeros(bodies**2), np.zeros(bodies**2)
    bond = np.zeros(bodies**2, bool)
    begin = np.searchsorted(h.row_step, np.arange(h.S + 1))
    for s in range(h.S):
        rows = slice(begin[s], begin[s + 1])
        k = pair[rows]
        # contacts may open again; a broken bond starts anew
        last = np.where(bond[k] == p.bonds[rows], total[k], 0.0) + closing[rows]
        now = np.where(p.bonds[rows], last, np.maximum(last, 0.0))
        total[:], bond[:] = 0.0, False
        total[k], bond[k] = now, p.bonds[rows]
        most[k] = np.maximum(most[k], np.abs(now))
    allowed = loose * tolerances.value("closed in all")
    report.expect("closed in all", most, allowed, lambda k: f"pair {k // bodies}-{k % bodies}")
    report.figures["closed in all (radii)"] = float(most.max(initial=0.0))
