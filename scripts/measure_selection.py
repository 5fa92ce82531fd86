#!/usr/bin/env python3
"""How near the reactions of the interior-point method are to those of least energy: `measure_selection.py PROBLEM.hdf5…`.

The problems are those of `tests/examples/problems.rs`. Needs numpy, scipy, h5py and clarabel. A rigid network carries its load
in many ways, and the method selects the reactions of least energy E = Σ (r − a)²/ρ, where a is the anchor: the last reactions,
those of the bonds without their self-stress. Two references are found with an interior-point method of convex optimisation:

least  The minimum of E over the reactions with the net impulses on the bodies, and so the velocities, of the solution:
       { r : H r = H r*, r in its cones and complementary to u* }, a convex set. The energy of r* is never less.
limit  Dry contacts that slip do not minimise anything. What the method approximates is the limit ε → 0 of Coulomb's law with
       u + ε (r − a)/ρ in place of u. With v = (r − a)/ρ + Hᵀλ, where λ are the multipliers of H r = H r*, that is Coulomb's law
       for (r, v) where u* = 0, and v_n ≥ 0 ⊥ r_n where a contact slips. The slip of v is frozen, the convex problem solved, the
       slip updated, until neither changes. Without dry contacts the two references are one.

With --gaps it is also measured whether the reactions satisfy that law: the part of (r − a)/ρ at contacts that stick inside
their cones that no motion Hᵀλ of the bodies takes away, over (r − a)/ρ there ("strain"), and the same with the free velocities over
ε in addition, ε that of κ = 1e7 ("gaps"). Only the gaps that dry contacts had before the step are not a motion of the bodies.

Printed for each problem: the excess of E over the least one, over E; the same of Σ r²/ρ over itself; the difference of E to the
limit, over E, and the distance to it, √(Σ (r − r_limit)²/ρ / E); residuals of the solution and of both references.
"""

import argparse
from types import SimpleNamespace

import clarabel
import h5py
import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

# velocity, over W and the norm of all reactions, from which a contact moves: ten times the tolerance of the solver
MOVES = 1e-7
# eigenvalue of W, over the largest entry, that is none
RANK = 1e-11
# stiffness of the metric over the inverse of the mean normal entry of W, as in solver/interior/selection.rs
KAPPA = 1e7
# rounds of the frozen slip, and the change at which they end
ROUNDS, SETTLED = 60, 1e-4


def read(path):
    """The problem in a file, over the rows that its contacts have, and in a unit in which reactions are of order one."""
    with h5py.File(path) as file:
        local, ours = file["fclib_local"], file["cohesive_dem"]
        size, vectors, w = int(np.ravel(local["spacedim"])[0]), local["vectors"], local["W"]
        if "solution" not in file:
            return None
        whole = sp.csc_matrix((w["x"][:], w["i"][:], w["p"][:]), shape=(len(vectors["q"]),) * 2)
        q, r = vectors["q"][:], file["solution/r"][:]
        guess = file["guesses/1/r"][:] if "guesses" in file else None
        mu = vectors["mu"][:]
        nu, xi = (vectors[name][:] if name in vectors else 0 * mu for name in ("mu_r", "mu_t"))
        bonded, shift, applied = ours["associated"][:] == 1, ours["shift"][:], ours["applied"][0]
        metric, last, work = ours["metric"][:], bool(ours["last"][0]), int(ours["work"][0])
    tangents = {2: 1, 3: 1 if "mu_r" in vectors_of(path) else 2, 5: 2, 6: 2}[size]
    bends = min(tangents, size - 1 - tangents)
    kinds = [0] + [1] * tangents + [2] * bends + [3] * (size - 1 - tangents - bends)
    slopes = np.stack([np.ones_like(mu), mu, nu, xi])
    has = (whole.diagonal().reshape(-1, size) > 0) & (slopes[kinds].T > 0)
    kept = np.flatnonzero(has.ravel())
    of = kept // size
    p = SimpleNamespace(path=path, work=work, bonded=bonded, slopes=slopes, applied=applied)
    p.kind, p.of, p.contacts = np.array(kinds)[kept % size], of, len(mu)
    p.W = whole[kept][:, kept].tocsc()
    p.largest = whole.diagonal().reshape(-1, size).max(1)
    p.unit = np.sqrt((r**2).sum() / p.contacts)
    p.shift = np.where(p.kind == 0, shift[of], 0) / p.unit
    p.q, p.r = q[kept] / p.unit, r[kept] / p.unit
    p.soft = metric[kept] / metric[::size].mean()
    p.rows = [np.flatnonzero(of == c) for c in range(p.contacts)] if p.contacts < 200 else np.split(
        np.arange(len(of)), np.searchsorted(of, np.arange(1, p.contacts))
    )
    last_r = np.zeros_like(p.r) if guess is None or not last else guess[kept] / p.unit - p.shift
    p.anchor = without_self_stress(p, last_r)
    p.size = max(np.linalg.norm(p.r - p.shift), applied / p.unit)
    return p


def vectors_of(path):
    with h5py.File(path) as file:
        return list(file["fclib_local/vectors"])


def root(matrix):
    """L with the matrix = L Lᵀ, and as many rows that span all others."""
    dense = np.asfortranarray(matrix.toarray())
    factor, pivots, rank, _ = la.lapack.dpstrf(dense, lower=1, tol=RANK * dense.diagonal().max(), overwrite_a=1)
    lower = np.tril(factor)[:, :rank]
    out = np.empty_like(lower)
    out[pivots - 1] = lower
    return out, pivots[:rank] - 1


def without_self_stress(p, r):
    """The same net impulses on the bodies with the least energy, for the bonds."""
    bonds = np.flatnonzero(p.bonded[p.of] & (p.slopes[0][p.of] > 0))
    if not len(bonds) or not r[bonds].any():
        return r
    lower, _ = root(p.W[bonds][:, bonds])
    stiff = lower / p.soft[bonds][:, None]
    out = r.copy()
    out[bonds] = stiff @ la.solve(lower.T @ stiff, lower.T @ r[bonds], assume_a="pos")
    return out


def energy(p, r):
    return (p.soft * (r - p.shift - p.anchor) ** 2).sum()


def groups(p, c):
    """Slope and rows of each group of a contact."""
    rows = p.rows[c]
    return [(p.slopes[k][c], rows[p.kind[rows] == k]) for k in (1, 2, 3) if (p.kind[rows] == k).any()]


def residual(p, r):
    """The natural map of all contacts over the reactions without their shift; of each convex contact by its optimality."""
    u, total = p.W @ r + p.q, 0.0
    for c in range(p.contacts):
        rows, list_ = p.rows[c], groups(p, c)
        n, un = rows[0], u[rows[0]]
        un += 0 if p.bonded[c] else sum(slope * la.norm(u[g]) for slope, g in list_)
        x = r[rows] - np.concatenate([[un], u[rows[1:]]]) / p.largest[c]
        total += ((project(x, [(s, g - n) for s, g in list_]) - r[rows]) ** 2).sum()
    return np.sqrt(total) / p.size


def project(x, list_):
    """Onto { ‖x_g‖ ≤ slope · x_0 for all groups }: x_0 is the zero of an increasing function."""
    norms = [(slope, la.norm(x[g])) for slope, g in list_]
    high = max([x[0], 0.0]) + sum(slope * norm for slope, norm in norms)
    rise = lambda n: n - x[0] - sum(slope * max(norm - slope * n, 0) for slope, norm in norms)
    if rise(0.0) >= 0:
        return 0 * x
    # piecewise linear: between the breaks it is exact
    ends = sorted({0.0, high} | {norm / slope for slope, norm in norms if norm / slope < high})
    for low, end in zip(ends, ends[1:]):
        if rise(end) >= 0:
            n = low - rise(low) * (end - low) / (rise(end) - rise(low))
            break
    else:
        n = x[0]
    out = x.copy()
    out[0] = n
    for slope, g in list_:
        norm = la.norm(x[g])
        out[g] *= min(1, slope * n / norm) if norm > 0 else 0
    return out


class Referee:
    """Reactions of least energy with the velocities of the solution."""

    def __init__(self, p, moves):
        self.p, self.still, self.slipping = p, [], []
        self.lower, self.basis = root(p.W)
        u = p.W @ p.r + p.q
        self.balance = p.W[self.basis]
        blocks, kinds, bounds = [self.balance], [clarabel.ZeroConeT(len(self.basis))], [self.balance @ p.r]
        equal, cones = [], []
        for c in range(p.contacts):
            n, list_ = p.rows[c][0], groups(p, c)
            moving = moves * p.size * p.largest[c]
            opening = u[n] - (sum(s * la.norm(u[g]) for s, g in list_) if p.bonded[c] else 0)
            if opening > moving:
                equal += [[(row, 1.0)] for row in p.rows[c]]
                continue
            cones.append([[(n, -1.0)]])
            for slope, g in list_:
                speed = la.norm(u[g])
                if speed > moving:
                    equal += [[(row, 1.0), (n, slope * u[row] / speed)] for row in g]
                    self.slipping += [(n, slope, g, u[g] / speed)] * (not p.bonded[c])
                else:
                    cones.append([[(n, -slope)]] + [[(row, -1.0)] for row in g])
                    self.still += [(n, slope, g)] * (not p.bonded[c])
        for lists, cone in [(equal, clarabel.ZeroConeT)] + [(x, clarabel.SecondOrderConeT) for x in cones]:
            if lists:
                blocks.append(lists)
                bounds.append(np.zeros(len(lists)))
                kinds.append(cone(len(lists)) if len(lists) > 1 or cone is clarabel.ZeroConeT else clarabel.NonnegativeConeT(1))
        entries = [entry for block in blocks[1:] for entry in block]
        rows = [k for k, entry in enumerate(entries) for _ in entry]
        columns, values = zip(*[pair for entry in entries for pair in entry])
        rest = sp.csc_matrix((values, (rows, columns)), shape=(len(entries), len(p.r)))
        self.A, self.b, self.cones = sp.vstack([self.balance, rest]).tocsc(), np.concatenate(bounds), kinds

    def solve(self, linear):
        """Reactions, and v = (r − a)/ρ + Hᵀλ, for this linear term besides the energy."""
        p, settings = self.p, clarabel.DefaultSettings()
        settings.verbose, settings.max_iter = False, 200
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-11
        costs = linear - p.soft * (p.anchor + p.shift)
        found = clarabel.DefaultSolver(sp.diags(p.soft).tocsc(), costs, self.A, self.b, self.cones, settings).solve()
        if not np.isfinite(found.x).all() or found.r_prim > 1e-7:
            raise RuntimeError(f"{p.path}: {found.status}")
        r, z = np.array(found.x), np.array(found.z)
        return r, p.soft * (r - p.anchor - p.shift) + self.balance.T @ z[: len(self.basis)]

    def slip(self, v):
        """The linear term that makes of an associated law Coulomb's at the slip of v."""
        linear = np.zeros_like(self.p.r)
        for n, slope, g in self.still:
            linear[n] += slope * la.norm(v[g])
        for n, slope, g, along in self.slipping:
            linear[n] += slope * along @ v[g]
        return linear

    def limit(self, v):
        """From v on, the slip frozen: reactions, and the last change of them."""
        scale, last, linear, share = energy(self.p, self.p.r), None, 0.0, 1.0
        change = before = np.inf
        for _ in range(ROUNDS):
            linear = (1 - share) * linear + share * self.slip(v)
            r, v = self.solve(linear)
            if last is not None:
                before, change = change, np.sqrt((self.p.soft * (r - last) ** 2).sum() / scale)
                share = max(0.5 * share, 0.1) if change > 0.9 * before else share
            last = r
            if change <= SETTLED * share:
                break
        return last, change


def strain(p, lower):
    """What is no motion of the bodies in (r − a)/ρ where contacts stick, without and with the gaps, over it."""
    soft, rows = p.soft * (p.r - p.shift - p.anchor), []
    epsilon = np.mean([p.W[own[0], own[0]] for own in p.rows]) / KAPPA
    for c, own in enumerate(p.rows):
        r = p.r[own[0]]
        rubs = any(slope * r - la.norm(p.r[g]) < 1e-5 * r for slope, g in groups(p, c))
        if r > 1e-6 and not (rubs and p.bonded[c]):
            rows += list(own[:1] if rubs else own)
    def left(x):
        return la.norm(x[rows] + lower[rows] @ la.lstsq(lower[rows], -x[rows], lapack_driver="gelsy")[0])
    return left(soft) / la.norm(soft[rows]), left(soft + p.q / epsilon) / la.norm(soft[rows])


def measured(path, moves, gaps):
    """The line of one problem as numbers; none without a solution."""
    p = read(path)
    if p is None:
        return None
    referee, own = Referee(p, moves), energy(p, p.r)
    least, v = referee.solve(np.zeros_like(p.r))
    limit, change = (least, 0.0) if not referee.still and not referee.slipping else referee.limit(v)
    excess = own - energy(p, least)
    whole = (p.soft * (p.r - p.shift) ** 2).sum()
    found = dict(zip(("strain", "gaps"), strain(p, referee.lower))) if gaps else {}
    return found | {
        "dry": int((~p.bonded).sum()),
        "slip": len(referee.slipping),
        "E share": own / whole,
        "excess": excess / own,
        "of all": excess / whole,
        "limit": (own - energy(p, limit)) / own,
        "apart": np.sqrt((p.soft * (p.r - limit) ** 2).sum() / own),
        "change": change,
        "res": residual(p, p.r),
        "res least": residual(p, least),
        "res limit": residual(p, limit),
        "work": p.work,
    }


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("problems", nargs="+")
    arguments.add_argument("--moves", type=float, default=MOVES, help="velocity from which a contact moves, over W and ‖r‖")
    arguments.add_argument("--gaps", action="store_true", help="whether the reactions satisfy the law of the limit: some seconds more")
    given, lines = arguments.parse_args(), []
    for path in given.problems:
        try:
            line = measured(path, given.moves, given.gaps)
        except RuntimeError as error:
            print(f"no reference: {error}")
            continue
        if line is None:
            print(f"{path}: no solution")
            continue
        if not lines:
            print(" ".join(f"{name:>9}" for name in line))
        print(" ".join(f"{x:9.2e}" if isinstance(x, float) else f"{x:9d}" for x in line.values()), path, flush=True)
        lines.append(line)
    for name in lines[0] if lines else []:
        values = np.abs([line[name] for line in lines])
        print(f"{name:>9}: median {np.median(values):.2e}, nine in ten {np.quantile(values, 0.9):.2e}, worst {values.max():.2e}")


if __name__ == "__main__":
    main()
