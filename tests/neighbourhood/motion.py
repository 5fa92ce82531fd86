"""Checks of motion: positions from velocities, Newton's law of every grain and wall, prescribed
motion, time."""

import numpy as np

import prescribed
import tolerances
from history import cross, norm, sums


def check(h, report):
    """All checks of this module."""
    check_time(h, report)
    check_positions(h, report)
    check_orientations(h, report)
    forces, torques = contact_sums(h)
    check_grains(h, report, forces, torques)
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
    report.expect("fixed grains", np.where(h.fixed, still, 0.0), 0.0, lambda s, k: f"step {s}, fixed grain {k} moves")


def check_walls(h, report, forces):
    """Walls: a force drives m Δv·d = h (F + ΣR·d); a velocity is that of the step's end; a fixed
    one does not move."""
    drive = h.wall_drive_force()
    force, size = (part[:, h.N :] for part in forces)
    for k, (kind, function) in enumerate(h.drives):
        d, v = h.wall_direction[k], h.V[:, k]
        along, across = v @ d, norm(v - (v @ d)[:, None] * d)

        def describe(s, k=k):
            return f"step {s + 1}, wall {h.wall_names[k]}"

        if kind == "fixed":
            moved = norm(v) + norm(h.X[:, k] - h.X[0, k])
            report.expect("fixed walls", moved, 0.0, describe)
            continue
        # the net force on a wall is a difference of forces
        given = np.append(0.0, np.abs(drive[:, k]) + size[:, k]) * (h.h / h.wall_mass[k])
        report.expect("wall motion", across, tolerances.rounding(norm(v) + np.cumsum(given)), describe)
        if kind == "velocity":
            told = prescribed.at(function, h.times)
            report.expect(
                "wall motion", np.abs(along - told), tolerances.rounding(np.abs(told) + slope(function, h)), describe
            )
            continue
        off = h.wall_mass[k] * np.diff(along) - h.h * (drive[:, k] + force[:, k] @ d)
        scale = h.wall_mass[k] * (np.abs(along[1:]) + np.abs(along[:-1])) + h.h * (np.abs(drive[:, k]) + size[:, k])
        report.expect("wall motion", np.where(h.single, np.abs(off), 0.0), tolerances.rounding(scale), describe)
    applied = h.observed.get("applied_force")
    if applied is not None:
        against = -(h.observed["wall_force"] * h.wall_direction).sum(2)
        kinds = np.array([kind for kind, _ in h.drives])
        told = np.where(kinds == "force", drive, np.where(kinds == "velocity", against, 0.0))
        scale = np.abs(told) + norm(h.observed["wall_force"])
        # a step in parts has the force of its last part
        off = np.where(h.single[:, None] | (kinds != "force"), np.abs(applied - told), 0.0)
        report.expect("applied_force", off, tolerances.rounding(scale), of_wall(h, "applied_force (N)"))


def slope(function, h):
    """Change of a function of time due to the round-off of time, over that round-off."""
    if "ramp" in function:
        return np.abs(function["ramp"]["rate"]) * (h.times + abs(function["ramp"].get("start", 0.0)))
    return 0.0
