"""Checks of motion: positions from velocities, Newton's law of every grain and wall, prescribed
motion, time."""

import numpy as np

import tolerances
from arrays import cross, norm, sums


def check(h, report):
    """All checks of this module."""
    check_time(h, report)
    check_positions(h, report)
    check_orientations(h, report)
    forces, torques = contact_sums(h)
    check_grains(h, report, forces, torques)
    check_held(h, report)
    check_walls(h, report, forces)


def of_grain(what):
    """Describes a step and a grain."""
    return lambda s, k, *_: f"step {s + 1}, grain {k}: {what}"


def of_wall(h, what):
    """Describes a step and a wall."""
    return lambda s, k, *_: f"step {s + 1}, wall {h.wall_names[k]}: {what}"


def check_time(h, report):
    """Frames and observations are those of the steps, in order; time is steps × h."""
    holds = np.array_equal(h.frame_step, np.arange(h.S + 1)) and np.array_equal(h.observed_step, np.arange(1, h.S + 1))
    report.require("time", holds, "steps of frames or observations are not in order")
    for name, time in (("frames", h.frame_time), ("observations", np.append(0.0, h.observed_time))):
        off = np.abs(time - h.times)
        report.expect("time", off, tolerances.rounding(h.times + h.h), lambda s: f"time of step {s} ({name})")


def check_positions(h, report):
    """x⁺ = x + h (v⁻ + v⁺)/2 of grains and walls."""
    way = 0.5 * h.h * (h.body_v[:-1] + h.body_v[1:])
    off = norm(h.body_x[1:] - h.body_x[:-1] - way)
    scale = norm(h.body_x[1:]) + norm(h.body_x[:-1]) + norm(way)
    single = h.single[:, None]
    report.expect(
        "positions", np.where(single, off, 0)[:, : h.N], tolerances.rounding(scale)[:, : h.N], of_grain("position (m)")
    )
    report.expect(
        "wall positions",
        np.where(single, off, 0)[:, h.N :],
        tolerances.rounding(scale)[:, h.N :],
        of_wall(h, "position (m)"),
    )


def check_orientations(h, report):
    """Orientations turn by h (ω⁻ + ω⁺)/2; quaternions are unit."""
    if not h.turns:
        return
    turn = 0.5 * h.h * (h.w[:-1] + h.w[1:])
    if h.D == 2:
        off = np.abs(h.turned[1:] - h.turned[:-1] - turn[..., 0])
        scale = np.abs(h.turned[1:]) + np.abs(h.turned[:-1]) + np.abs(turn[..., 0])
    else:
        off, scale = norm(h.turned[1:] - turned(h.turned[:-1], turn)), 1.0
        report.expect(
            "orientations", np.abs(norm(h.turned) - 1), tolerances.rounding(1.0), of_grain("norm of the quaternion")
        )
    off = np.where(h.single[:, None], off, 0.0)
    report.expect("orientations", off, tolerances.rounding(scale), of_grain("orientation"))


def turned(q, turn):
    """Quaternions w x y z after turning by rotation vectors (rad)."""
    angle = norm(turn)[..., None]
    half = np.divide(np.sin(angle / 2), angle, out=np.full(angle.shape, 0.5), where=angle > 0)
    c, p = np.cos(angle / 2)[..., 0], turn * half
    w, v = q[..., 0], q[..., 1:]
    out = np.concatenate(
        [(c * w - (p * v).sum(-1))[..., None], v * c[..., None] + p * w[..., None] + np.cross(p, v)], -1
    )
    return out / norm(out)[..., None]


def contact_sums(h):
    """Sums over contacts, step by step and body by body: forces and their sizes, torques and their
    sizes."""
    bodies = h.N + h.W
    s, i, j = h.row_step, h.i, h.j
    count = h.S * bodies
    lever_i, lever_j = h.point - h.mid[s, i], h.point - h.mid[s, j]
    torque_i, torque_j = cross(lever_i, h.force) + h.torque, -cross(lever_j, h.force) - h.torque
    torque_j[h.on_wall] = 0.0
    # the lever is a difference of positions
    reach = norm(h.mid[s, i]) + h.radius[i]
    size, turn = norm(h.force), reach * norm(h.force) + norm(h.torque)

    def both(a, b):
        return (sums(s * bodies + i, a, count) + sums(s * bodies + j, b, count)).reshape((h.S, bodies) + a.shape[1:])

    return (both(h.force, -h.force), both(size, size)), (both(torque_i, torque_j), both(turn, turn))


def check_grains(h, report, forces, torques):
    """m Δv = h ΣF and I Δω = h Σ(torques) of every free grain; a fixed one does not move."""
    outer, outer_torque = h.external()
    single, free = h.single[:, None], ~h.fixed
    dv, dw = h.v[1:] - h.v[:-1], h.w[1:] - h.w[:-1]
    (force, size), (torque, turn) = forces, torques
    off = norm(h.mass[:, None] * dv - h.h * (outer + force[:, : h.N]))
    scale = h.mass * (norm(h.v[1:]) + norm(h.v[:-1])) + h.h * (norm(outer) + size[:, : h.N])
    report.expect(
        "Newton's law", np.where(single & free, off, 0), tolerances.rounding(scale), of_grain("m Δv − h ΣF (N s)")
    )
    off = norm(h.inertia[:, None] * dw - h.h * (outer_torque + torque[:, : h.N]))
    scale = h.inertia * (norm(h.w[1:]) + norm(h.w[:-1])) + h.h * (norm(outer_torque) + turn[:, : h.N])
    # without rotation the file has no spins
    off = np.where(single & free, off, 0) if h.turns else np.zeros((h.S, h.N))
    report.expect("law of spins", off, tolerances.rounding(scale), of_grain("I Δω − h Σ(torques) (N m s)"))
    still = norm(h.v) + norm(h.w) + norm(h.x - h.x[0])
    fixed = h.fixed & (h.holder < 0)
    report.expect("fixed grains", np.where(fixed, still, 0.0), 0.0, lambda s, k: f"step {s}, fixed grain {k} moves")


def check_held(h, report):
    """Grains that a wall holds move with it and do not turn."""
    grains = np.flatnonzero(h.holder >= 0)
    wall = h.holder[grains]
    off = norm(h.v[:, grains] - h.V[:, wall]) + norm(h.w[:, grains])
    report.expect("held grains", off, 0.0, lambda s, k: f"step {s}, grain {grains[k]}: velocity beside its wall")
    off = norm(h.x[:, grains] - h.x[0, grains] - (h.X[:, wall] - h.X[0, wall]))
    way = np.cumsum(np.abs(np.diff(h.x[:, grains], axis=0, prepend=h.x[:1, grains])), 0).sum(2)
    scale = np.maximum.accumulate(norm(h.x[:, grains]) + norm(h.X[:, wall])) + way
    # each step rounds both places
    scale = scale * (1 + np.arange(h.S + 1))[:, None]
    report.expect("held grains", off, tolerances.rounding(scale), lambda s, k: f"step {s}, grain {grains[k]}: place")


def check_walls(h, report, forces):
    """Walls: a force drives m Δv·d = h (F + ΣR·d); a velocity is that of the step's end; a slide is
    prescribed across a drive; a fixed wall does not move."""
    given, d = h.driving, h.wall_direction
    force, size = (part[:, h.N :] for part in forces)
    fixed = norm(h.V) + norm(h.X - h.X[0])
    report.expect("fixed walls", np.where(given.driven, 0.0, fixed), 0.0, of_wall(h, "it moves"))
    along = np.einsum("swd,wd->sw", h.V, d)
    slide = given.speed[:, :, None] * given.across
    # the net force on a wall is a difference of forces
    kicks = np.cumsum((given.error + size) * (h.h / given.mass), 0)
    scale = norm(h.V) + np.concatenate([np.zeros((1, h.W)), kicks]) + given.speed_error * (h.times + h.h)[:, None]
    across = norm(h.V - along[:, :, None] * d - slide)
    where = of_wall(h, "velocity across its drive (m/s)")
    report.expect("wall motion", np.where(given.driven, across, 0.0), tolerances.rounding(scale), where)
    moves = given.kind == "velocity"
    off = np.where(moves, np.abs(along[1:] - given.value), 0.0)
    report.expect("wall motion", off, tolerances.rounding(given.error), of_wall(h, "velocity (m/s)"))
    first = np.abs(along[0] - given.start)
    report.expect("wall motion", first, tolerances.rounding(np.abs(given.start)), lambda k: f"wall {h.wall_names[k]}")
    pushed = given.kind == "force"
    mass = np.where(pushed, given.mass, 0.0)
    off = mass * np.diff(along, axis=0) - h.h * (given.value + np.einsum("swd,wd->sw", force, d))
    scale = mass * (np.abs(along[1:]) + np.abs(along[:-1])) + h.h * (given.error + size)
    off = np.where(h.single[:, None] & pushed, np.abs(off), 0.0)
    report.expect("wall motion", off, tolerances.rounding(scale), of_wall(h, "m Δv − h ΣF (N s)"))
    check_applied(h, report)


def check_applied(h, report):
    """The observable `applied_force`: the prescribed force, or that which keeps a velocity."""
    applied, given = h.observed.get("applied_force"), h.driving
    if applied is None:
        return
    against = -(h.observed["wall_force"] * h.wall_direction).sum(2)
    told = np.where(given.kind == "force", given.value, np.where(given.kind == "velocity", against, 0.0))
    scale = np.abs(told) + norm(h.observed["wall_force"]) + np.where(given.kind == "force", given.error, 0.0)
    # a step in parts has the mean of the forces of its parts
    off = np.where(h.single[:, None] | (given.kind != "force"), np.abs(applied - told), 0.0)
    report.expect("applied_force", off, tolerances.rounding(scale), of_wall(h, "applied_force (N)"))
