"""Observables recomputed from frames: energy, momentum, stress, strain, forces on walls,
penetration."""

import numpy as np

import laws
import prescribed
import tolerances
from arrays import cross, norm, sums
from geometry import gap_and_normal
from rupture import energy_of_rows


def check(h, c, p, report):
    """All checks of this module."""
    check_kinetic(h, report)
    check_books(h, report, check_works(h, c, p, report))
    check_momentum(h, report)
    check_walls(h, report)
    check_stress(h, c, report)
    check_virial(h, c, report)
    check_strain(h, report)
    check_penetration(h, c, report)
    check_false_acceleration(h, report)
    check_counts(h, report)


def of_step(what):
    """Describes a step."""
    return lambda s, *_: f"step {s + 1}: {what}"


def kinetic(h):
    """Kinetic energy (J) of grains that are not fixed and of walls that a force drives, at every
    frame."""
    free = ~h.fixed
    grains = 0.5 * (h.mass * (h.v**2).sum(2) + h.inertia * (h.w**2).sum(2))[:, free].sum(1)
    # a frame counts the walls of the step that led to it
    mass = moving_mass(h)
    return grains + 0.5 * (free_square(h) * np.concatenate([mass[:1], mass])).sum(1)


def moving_mass(h):
    """Masses (kg) of the walls that a force drives [S,W]; 0 for the others."""
    mass = h.driving.mass
    return np.where(np.isfinite(mass), mass, 0.0)


def free_square(h):
    """Squared velocities of the walls [S+1,W]; of one that slides that along its drive."""
    along = np.einsum("swd,wd->sw", h.V, h.wall_direction)
    return np.where(h.driving.slides, along**2, (h.V**2).sum(2))


def check_kinetic(h, report):
    """Kinetic energy from velocities."""
    told = kinetic(h)[1:]
    report.expect(
        "kinetic_energy",
        np.abs(h.observed["kinetic_energy"] - told),
        tolerances.rounding(told),
        of_step("kinetic_energy (J)"),
    )


def works(h, c, p):
    """External work, and work of the contact rows on the bodies, of each step (J) [S], with the
    sizes of their summands."""
    mean = tuple(0.5 * (a + b) for a, b in zip(c.before, c.after))
    un, ut, turn, spin = mean
    rn, rt = h.rn * un, (h.rt * ut).sum(1)
    moment = (h.bending * turn).sum(1) + h.twist * spin
    dry, bonds = ~p.bonds, p.bonds
    parts = {
        "impact": np.where(dry, rn, 0.0),
        "friction": np.where(dry, rt, 0.0),
        "bonds": np.where(bonds, rn + rt + moment, 0.0),
    }
    # the round-off of a velocity enters the work like a velocity
    reach = c.speed + norm(h.body_v[h.row_step, h.i]) + norm(h.body_v[h.row_step, h.j])
    size = (norm(h.force) + norm(h.torque) / h.radius[h.i]) * reach if h.M else np.zeros(0)
    total = {name: -h.h * np.bincount(h.row_step, part, minlength=h.S) for name, part in parts.items()}
    sizes = h.h * np.bincount(h.row_step, size, minlength=h.S)
    outer, torque = h.external()
    free = ~h.fixed
    v, w = 0.5 * (h.v[1:] + h.v[:-1]), 0.5 * (h.w[1:] + h.w[:-1])
    total["external"] = h.h * ((outer * v).sum(2) + (torque * w).sum(2))[:, free].sum(1)
    sizes = sizes + h.h * (norm(outer) * norm(v))[:, free].sum(1)
    given, middle, against = h.driving, 0.5 * (h.V[1:] + h.V[:-1]), wall_forces(h)[0]
    along = np.einsum("swd,wd->sw", middle, h.wall_direction)
    moved = np.where(given.kind == "velocity", -(against * middle).sum(2), 0.0)
    pushed = given.force * along
    across = middle - along[:, :, None] * h.wall_direction
    slid = np.where(given.slides, -(against * across).sum(2), 0.0)
    total["external"] = total["external"] + h.h * (moved + pushed + slid).sum(1)
    sizes = sizes + h.h * (np.where(given.kind == "force", given.error, 0.0) * norm(middle)).sum(1)
    stored = brought(h)
    total["external"] = total["external"] + stored
    sizes = sizes + stored
    # a wall has kinetic energy only under a force: its new drive takes it, or gives it
    mass = moving_mass(h)
    change = np.zeros(h.S)
    change[1:] = 0.5 * ((mass[1:] - mass[:-1]) * free_square(h)[1:-1]).sum(1)
    total["external"] = total["external"] + change
    sizes = sizes + np.abs(change)
    return total, sizes


def brought(h):
    """Energy (J) [S] of the springs of the bonds that form, under the forces that they take over."""
    out = np.zeros(h.S)
    if h.K and h.stiffness is not None and h.formed < h.S:
        out[h.formed] = laws.energy_taken_over(h).sum()
    return out


def check_works(h, c, p, report):
    """The increments of the energy balance in every step, from forces and velocities of its two
    frames."""
    total, sizes = works(h, c, p)
    columns = {"external_work": "external", "dissipation_impact": "impact", "dissipation_friction": "friction"}
    elastic = "elastic_energy" in h.observed
    if "bond_remainder" in h.observed:
        columns["bond_remainder"] = "bonds"
    for name, part in columns.items():
        seen = h.observed[name]
        increment = np.diff(np.append(0.0, seen))
        off = np.where(h.single, np.abs(increment - total[part]), 0.0)
        report.expect(name, off, tolerances.rounding(sizes + np.abs(seen)), of_step(f"increment of {name} (J)"))
    if elastic:
        check_elastic(h, total["bonds"], sizes, report)
    return sizes


def check_elastic(h, losses, sizes, report):
    """Elastic energy of intact bonds, energy released by broken ones, and the remaining damping."""
    rows = np.flatnonzero(h.bond >= 0)
    rows = rows[h.bond_status[h.row_step[rows] + 1, h.bond[rows]] == "INTACT"]
    stored = np.bincount(h.row_step[rows], energy_of_rows(h, rows), minlength=h.S)
    seen = h.observed["elastic_energy"]
    report.expect("elastic_energy", np.abs(seen - stored), tolerances.rounding(stored), of_step("elastic_energy (J)"))
    freed = np.bincount(np.clip(h.events["step"].astype(int) - 1, 0, None), h.events["energy"], minlength=h.S)[: h.S]
    increment = np.diff(np.append(0.0, h.observed["fracture_energy"]))
    scale = np.abs(h.observed["fracture_energy"]) + freed
    report.expect(
        "fracture_energy",
        np.abs(increment - freed),
        tolerances.rounding(scale),
        of_step("increment of fracture_energy (J)"),
    )
    told = losses + brought(h) - np.diff(np.append(0.0, seen)) - freed
    damping = h.observed["dissipation_damping"]
    off = np.where(h.single, np.abs(np.diff(np.append(0.0, damping)) - told), 0.0)
    scale = sizes + np.abs(damping) + seen + np.append(0.0, seen[:-1]) + freed
    report.expect(
        "dissipation_damping", off, tolerances.rounding(scale), of_step("increment of dissipation_damping (J)")
    )


def check_books(h, report, sizes):
    """work = change of kinetic energy + dissipated and stored energy + remainder, and the remainder
    is round-off.

    `sizes` are the sums of the absolute values of what the works of each step are summed from (J)."""
    o, zero = h.observed, np.zeros(h.S)
    start = kinetic(h)[0]
    lost = ["dissipation_impact", "dissipation_friction", "bond_remainder", "dissipation_damping", "fracture_energy"]
    terms = [o["external_work"], start - o["kinetic_energy"], -o.get("elastic_energy", zero)] + [
        -o.get(name, zero) for name in lost
    ]
    left = sum(terms)
    size = np.cumsum(sum(np.abs(np.diff(np.append(t[:1] * 0, t))) for t in terms)) + start
    allowed = tolerances.value("books") * size + tolerances.rounding(np.cumsum(sizes + kicks(h)))
    report.expect(
        "energy_remainder",
        np.abs(o["energy_remainder"] - left),
        allowed,
        of_step("energy_remainder (J) against the other entries"),
    )
    report.expect("energy_remainder", np.abs(o["energy_remainder"]), allowed, of_step("energy_remainder (J)"))


def kicks(h):
    """Σ (h Σ|f|)²/m over bodies (J) [S]: scale of the round-off of kinetic energies, since
    velocities are differences of impulses."""
    bodies = h.N + h.W
    size = norm(h.force)
    total = sum(np.bincount(h.row_step * bodies + k, size, minlength=h.S * bodies) for k in (h.i, h.j)).reshape(
        h.S, bodies
    )
    outer, _ = h.external()
    total = h.h * (total + np.concatenate([norm(outer), np.abs(h.driving.force)], 1))
    grains = np.broadcast_to(h.inverse_mass[: h.N], (h.S, h.N))
    inverse = np.concatenate([grains, 1 / h.driving.mass], 1)
    return (total**2 * inverse).sum(1)


def check_momentum(h, report):
    """Linear and angular momentum of the grains that are not fixed."""
    free = ~h.fixed
    p = (h.mass[:, None] * h.v)[1:, free]
    report.expect(
        "momentum", norm(h.observed["momentum"] - p.sum(1)), tolerances.rounding(norm(p).sum(1)), of_step("momentum")
    )
    spin = h.inertia[:, None] * h.w
    angular = (cross(h.x, h.mass[:, None] * h.v) + spin)[1:, free]
    size = (norm(h.x) * h.mass * norm(h.v) + norm(spin))[1:, free].sum(1)
    report.expect(
        "angular_momentum",
        norm(h.observed["angular_momentum"] - angular.sum(1)),
        tolerances.rounding(size),
        of_step("angular momentum"),
    )


def wall_forces(h):
    """Forces of the grains on the walls (N) [S,W,D] by contacts, and on the grains that
    they hold, and the sums of the sizes [S,W]."""
    force, size = np.zeros((h.S * h.W, h.D)), np.zeros(h.S * h.W)
    holder = np.append(h.holder, np.full(h.W, -1))
    # the wall of a contact, and those that hold its grains
    second = np.where(h.on_wall, h.j - h.N, holder[h.j]) if h.M else h.j
    for wall, sign in ((holder[h.i], 1.0), (second, -1.0)):
        rows = np.flatnonzero(wall >= 0)
        index = h.row_step[rows] * h.W + wall[rows]
        force += sums(index, sign * h.force[rows], h.S * h.W)
        size += sums(index, norm(h.force[rows]), h.S * h.W)
    return force.reshape(h.S, h.W, h.D), size.reshape(h.S, h.W)


def check_walls(h, report):
    """Forces on walls from contacts, in frames and observables; their places."""
    if h.W == 0:
        return
    force, size = wall_forces(h)
    describe = lambda s, k: f"step {s + 1}, wall {h.wall_names[k]} (N)"
    # of a step in parts a frame has the contacts of the last part, and the mean force of all parts
    off = np.where(h.single[:, None], norm(h.observed["wall_force"] - force), 0.0)
    report.expect("wall_force", off, tolerances.rounding(size), describe)
    off = norm(h.wall_frame_force[1:] - h.observed["wall_force"])
    report.expect("force of walls in frames", off, tolerances.rounding(size), describe)
    report.expect("wall_position", norm(h.observed["wall_position"] - h.X[1:]), 0.0, describe)
    at_limit = h.observed.get("wall_force_at_limit")
    if at_limit is not None:
        broke = np.zeros(h.S, bool)
        if h.K:
            broke[np.clip(h.events["step"].astype(int) - 1, 0, h.S - 1)] = True
        still = (h.single & ~broke)[:, None]
        off = np.where(still, norm(at_limit - force), 0.0)
        report.expect("wall_force_at_limit", off, tolerances.rounding(size), describe)


def reference_volume(h):
    """Volume (m³) of the box around the sample at time zero."""
    low, high = (h.x[0] - h.radius[:, None]).min(0), (h.x[0] + h.radius[:, None]).max(0)
    return float(np.prod(high - low)) * prescribed.thickness(h.scene)


def membrane_moment(h):
    """What the pushes of a membrane add to the stress times the volume (N m) [S,D,D]."""
    return 0.0 if h.membrane is None else h.membrane.moment


def forces_on_grains(h):
    """Forces of contacts on the grains (N) [S,N,D]."""
    i, j, s = h.i, h.j, h.row_step
    into = sums(s * h.N + i, h.force, h.S * h.N)
    grains = ~h.on_wall
    into -= sums((s * h.N + j)[grains], h.force[grains], h.S * h.N)
    return into.reshape(h.S, h.N, h.D)


def branches_of_grips(h):
    """From the wall that holds a grain to its centre (m) [S,N,D]; zero for other grains."""
    branch = np.zeros((h.S, h.N, h.D))
    for k in np.flatnonzero(h.holder >= 0):
        wall = h.N + h.holder[k]
        bodies = np.full(h.S, k), np.full(h.S, wall)
        gap, normal = gap_and_normal(h, *bodies, h.mid[:, k], h.mid[:, wall])
        branch[:, k] = normal * (h.radius[k] + 0.5 * gap)[:, None]
    return branch


def check_stress(h, c, report):
    """Love and Weber: Σ ℓ ⊗ f over contacts; ℓ joins the centres, at a wall the contact point to
    the centre. A wall exerts the opposite of the contacts on a grain that it holds."""
    single = h.row_single
    branch = c.n * (c.lever_i + c.lever_j)[:, None]
    tensor = branch[:, :, None] * h.force[:, None, :]
    volume = reference_volume(h)
    grips = -np.einsum("sna,snb->sab", branches_of_grips(h), forces_on_grains(h))
    total = (sums(h.row_step, tensor, h.S) + grips + membrane_moment(h)) / volume
    size = sums(h.row_step, np.where(single, (c.lever_i + c.lever_j + c.place) * norm(h.force), 0.0), h.S) / volume
    off = np.abs(h.observed["stress"] - total).max((1, 2), initial=0.0)
    report.expect("stress", np.where(h.single, off, 0.0), tolerances.rounding(size), of_step("stress (Pa)"))


def check_virial(h, c, report):
    """V σ = Σ x_g ⊗ (m a − F) − Σ p ⊗ f over wall contacts: the stress against forces at the walls
    and accelerations."""
    outer, _ = h.external()
    moved = h.mass[:, None] * (h.v[1:] - h.v[:-1]) / h.h - outer
    moved = np.where(h.fixed[:, None], forces_on_grains(h), moved)
    # what holds a grain acts where its wall touches it
    middle = h.mid[:, : h.N] - branches_of_grips(h)
    bodies = np.einsum("sna,snb->sab", middle, moved)
    rows = np.flatnonzero(h.on_wall)
    walls = sums(h.row_step[rows], h.point[rows][:, :, None] * h.force[rows][:, None, :], h.S)
    total = (bodies - walls + membrane_moment(h)) / reference_volume(h)
    forces = sums(h.row_step, norm(h.force) * c.place, h.S)
    size = forces + (norm(middle) * (h.mass * (norm(h.v[1:]) + norm(h.v[:-1])) / h.h + norm(outer))).sum(1)
    off = np.abs(h.observed["stress"] - total).max((1, 2), initial=0.0)
    allowed = tolerances.rounding(size) / reference_volume(h)
    report.expect(
        "stress against walls", np.where(h.single, off, 0.0), allowed, of_step("stress by walls and accelerations (Pa)")
    )


def fitted_strain(h):
    """Displacement gradients [S,D,D] of the affine motion that fits that of all grains since time
    zero best."""
    x = h.x[0] - h.x[0].mean(0)
    moved = h.x[1:] - h.x[0]
    moved = moved - moved.mean(1, keepdims=True)
    # across a direction in which the grains have no extent there is no strain
    inverse = np.linalg.pinv(x, rcond=1e-6)
    size = (norm(h.x[1:]) + norm(h.x[0])).max(1) * np.linalg.norm(inverse, 2) * np.sqrt(h.N)
    return np.einsum("snr,cn->src", moved, inverse), size * np.linalg.norm(x, 2) * np.linalg.norm(inverse, 2)


def check_strain(h, report):
    """The strain is the affine fit to the grains' displacements."""
    told, size = fitted_strain(h)
    off = np.abs(h.observed["strain"] - told).max((1, 2), initial=0.0)
    report.expect("strain", off, tolerances.rounding(size), of_step("strain"))


def check_penetration(h, c, report):
    """Penetration is the deepest overlap of contacts that are not bonds."""
    depth = np.where(h.bond >= 0, 0.0, np.maximum(-c.gap, 0.0))
    deepest = np.zeros(h.S)
    np.maximum.at(deepest, h.row_step, depth)
    scale = np.zeros(h.S)
    np.maximum.at(scale, h.row_step, c.place)
    off = np.where(h.single, np.abs(h.observed["penetration"] - deepest), 0.0)
    report.expect("penetration", off, tolerances.rounding(scale), of_step("penetration (m)"))
    report.figures["deepest overlap (mean radii)"] = float(deepest.max(initial=0) / h.radius.mean())


def check_false_acceleration(h, report):
    """The false acceleration is the inertial force of the grains over the norm of all loads on the
    sample."""
    if "false_acceleration" not in h.observed:
        return
    free = ~h.fixed
    inertial = (h.mass[None, :, None] * np.diff(h.v, axis=0) / h.h)[:, free]
    applied = (h.external()[0][:, free] ** 2).sum((1, 2)) + (h.driving.force ** 2).sum(1)
    if h.W:
        seen = h.observed["wall_force"]
        kept = np.where(h.driving.kind == "velocity", (seen * h.wall_direction).sum(2), 0.0)
        applied = applied + (kept**2).sum(1) + ((seen * h.driving.across).sum(2) ** 2).sum(1)
    ratio = np.sqrt((inertial**2).sum((1, 2))) / np.sqrt(np.where(applied > 0, applied, 1.0))
    expected = np.where(applied > 0, ratio, 0.0)
    off = np.where(h.single, np.abs(h.observed["false_acceleration"] - expected), 0.0)
    # velocities of frames are differences of larger ones
    speed = np.sqrt((h.mass[None, :, None] ** 2 * (h.v[1:] ** 2 + h.v[:-1] ** 2))[:, free].sum((1, 2))) / h.h
    scale = expected + np.where(applied > 0, speed / np.sqrt(np.where(applied > 0, applied, 1.0)), 0.0)
    report.expect("false_acceleration", off, tolerances.rounding(scale), of_step("false_acceleration"))


def check_counts(h, report):
    """Counts of work are whole and not negative; processor time does not decrease."""
    for name in (
        "solver_iterations",
        "solver_newton_iterations",
        "solver_factorisations",
        "solver_rejected",
        "substeps",
    ):
        if name in h.observed:
            value = h.observed[name]
            off = np.abs(value - np.round(value)) + np.maximum(-value, 0.0)
            report.expect("counts", off, 0.0, of_step(name))
    report.expect("counts", -np.diff(np.append(0.0, h.observed["cpu_time"])), 0.0, of_step("cpu_time (s)"))
    sweeps = h.observed["solver_iterations"] - h.observed["solver_newton_iterations"]
    report.expect("counts", -sweeps, 0.0, of_step("sweeps"))
    if h.route is not None:
        made = np.where(h.route == "EXTRAPOLATION", h.observed["solver_newton_iterations"], 0)
        report.expect("counts", made, 0.0, of_step("iterations of an extrapolated step"))
