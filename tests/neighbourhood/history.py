"""A history with a frame at every step, as arrays.

Bodies are grains, then walls. `step` s leads from frame s to frame s + 1; rows of contacts are
concatenated, and `row_step` is the step of each. SI units throughout.
"""

import json
from pathlib import Path

import h5py
import numpy as np

import materials
import prescribed
from drives import Driving
from geometry import gap_and_normal
from membrane import Membrane


class Unfit(Exception):
    """A history that cannot be checked: not every step has its frame, or something is missing."""


class History:
    """All of a history that the checks read.

    N grains, W walls, B bodies (N + W), S steps, M rows of contacts, D dimensions, Q components of
    a spin (1 or 3).
    """

    def __init__(self, path):
        self.folder = Path(path).parent
        with h5py.File(path, "r") as file:
            self.version = int(file["parameters"].attrs["schema_version"])
            self.packed = file["parameters"].attrs.get("solid_fraction")
            self.scene = json.loads(file["parameters/scene"][()])
            self._frames(file)
            self._grains(file["particles/grains"])
            self._walls(file.get("walls"))
            self._rows(file["contacts"])
            self._bonds(file)
            self.observed = {
                name: group["value"][: self.S] for name, group in file["observables"].items() if "value" in group
            }
            # the method that solved each step; not recorded before version 4
            route = file.get("observables/solver_route/value")
            self.route = None if route is None else np.array(enum_names(route, self.S))
            self.observed_step = file["observables/step"][: self.S]
            self.observed_time = file["observables/time"][: self.S]
        self._bodies()

    def _frames(self, file):
        frames = int(file["commit"][()])
        self.frame_step = file["contacts/step"][:frames]
        self.frame_time = file["contacts/time"][:frames]
        if frames < 1 or not np.array_equal(self.frame_step, np.arange(frames)):
            raise Unfit("the history does not have a frame at every step (output.every_steps: 1)")
        self.S, self.D, self.h = frames - 1, self.scene["dimension"], self.scene["time"]["step"]
        self.Q = 1 if self.D == 2 else 3

    def _grains(self, group):
        self.radius, self.mass, self.inertia = (group[name][:] for name in ("radius", "mass", "inertia"))
        self.N = len(self.radius)
        frames = self.S + 1
        self.x, self.v = group["position/value"][:frames], group["velocity/value"][:frames]
        self.turns = "angular_velocity" in group
        spins = group["angular_velocity/value"][:frames] if self.turns else np.zeros((frames, self.N, self.Q))
        self.w = spins.reshape(frames, self.N, self.Q)
        self.turned = None
        if self.turns:
            self.turned = group["angle/value"][:frames] if self.D == 2 else group["orientation/value"][:frames]
        self.material = group["material"][:].astype(int) if "material" in group else np.zeros(self.N, int)
        self.fixed = np.zeros(self.N, bool)
        self.fixed[(self.scene.get("grains") or {}).get("fixed", [])] = True

    def _walls(self, group):
        self.scene_walls = prescribed.walls(self.scene)
        self.W, frames = len(self.scene_walls), self.S + 1
        self.wall_names = [name for name, _ in self.scene_walls]
        if self.W == 0:
            self.X = self.V = self.wall_frame_force = np.zeros((frames, 0, self.D))
            self.wall_normal, self.wall_radius = np.zeros((0, self.D)), np.zeros(0)
            self.wall_kind = self.wall_sides = []
            return
        names = list(group["name"].asstr()[:])
        if names != self.wall_names:
            raise Unfit(f"the walls are {names}, those of the scene {self.wall_names}")
        self.X, self.V = group["position/value"][:frames], group["velocity/value"][:frames]
        self.wall_frame_force = group["force/value"][:frames]
        self.wall_normal, self.wall_radius = group["normal"][:], group["radius"][:]
        self.wall_kind = enum_names(group["kind"])
        self.wall_sides = [plate_sides(group, w) if kind == "PLATE" else [] for w, kind in enumerate(self.wall_kind)]

    def _rows(self, group):
        start, count = group["start"][: self.S + 1].astype(int), group["count"][: self.S + 1].astype(int)
        if count[0] != 0 or not np.array_equal(start[1:], np.cumsum(count)[:-1]):
            raise Unfit("rows of contacts do not stand behind each other")
        self.M = int(count.sum())
        self.row_step = np.repeat(np.arange(self.S + 1), count) - 1
        pair = group["pair"][: self.M].astype(int)
        self.i, self.j = pair[:, 0], np.where(pair[:, 1] < 0, self.N - 1 - pair[:, 1], pair[:, 1])
        if self.M and (self.i.min() < 0 or self.i.max() >= self.N or self.j.max() >= self.N + self.W):
            raise Unfit("a contact refers to a body that does not exist")
        self.on_wall = pair[:, 1] < 0
        self.point, self.normal, self.gap = (group[k][: self.M] for k in ("point", "normal", "gap"))
        reaction = group["reaction"][: self.M]
        self.rn, self.rt = reaction[:, 0], reaction[:, 1:]
        self.status = np.array(enum_names(group["status"], self.M))
        self.bond = group["bond"][: self.M] if "bond" in group else np.full(self.M, -1)
        self._frame_of_rows(group)

    def _frame_of_rows(self, group):
        n = self.normal
        if self.D == 2:
            self.tangents = np.stack([-n[:, 1], n[:, 0]], 1)[:, None, :]
            moment = group["moment"][: self.M] if "moment" in group else np.zeros(self.M)
            self.moment = moment.reshape(self.M, 1)
            self.torque = self.moment
            self.bending, self.twist = self.moment, np.zeros(self.M)
        else:
            first = group["tangent"][: self.M] if "tangent" in group else np.zeros((self.M, 3))
            self.tangents = np.stack([first, np.cross(n, first)], 1)
            self.moment = group["moment"][: self.M] if "moment" in group else np.zeros((self.M, 2))
            self.bending = self.moment[:, :2]
            self.twist = self.moment[:, 2] if self.moment.shape[1] > 2 else np.zeros(self.M)
            self.torque = np.einsum("mk,mkd->md", self.bending, self.tangents) + self.twist[:, None] * n
        if self.rt.shape[1] == 0:
            self.rt = np.zeros((self.M, self.D - 1))
        self.force_t = np.einsum("mk,mkd->md", self.rt, self.tangents)
        self.force = self.rn[:, None] * n + self.force_t

    def _bonds(self, file):
        self.bonded = "bonds" in file
        # the step after which the bonds formed
        self.events, self.formed = None, 0
        if not self.bonded:
            self.K = 0
            return
        group = file["bonds"]
        if "formed" in group:
            formed = int(group["formed"][0])
            self.formed = formed if formed >= 0 else self.S
        self.bond_pair = group["pair"][:].astype(int)
        self.rest_gap, self.strength, self.bond_friction, self.mean_diameter = (
            group[k][:] for k in ("rest_gap", "strength", "friction", "mean_diameter")
        )
        self.bond_rolling = group["rolling"][:] if "rolling" in group else self.bond_friction
        self.K = len(self.strength)
        self.bond_status = np.array(enum_names(group["status/value"], self.S + 1)).reshape(self.S + 1, self.K)
        twist = float(self.scene["bonds"].get("twist") or 0.0)
        self.bond_twist = group["twist"][:] if "twist" in group else np.full(self.K, twist)
        self.stiffness = prescribed.stiffness(self.scene, self.mean_diameter)
        if self.stiffness is not None:
            factor = materials.Bonds(self, *self.bond_pair.T).factor
            self.stiffness = [factor * spring for spring in self.stiffness]
        kept = int(file["commit_rows/events"][self.S]) if "commit_rows/events" in file else None
        self.events = file["events/rupture"][:kept]
        modes = h5py.check_enum_dtype(file["events/rupture"].dtype["mode"])
        by_number = {number: name for name, number in modes.items()}
        self.event_mode = np.array([by_number.get(int(m), f"unknown {m}") for m in self.events["mode"]], dtype=object)

    def _bodies(self):
        scene, W = self.scene, self.W
        self.times = self.h * np.arange(self.S + 1)
        # the time at which the load functions give the loads of a step, and at which velocities are prescribed
        self.load_times = self.times[:-1] + 0.5 * self.h
        self.quasi_static = scene.get("rupture") == "next_event"
        if self.quasi_static:
            self.load_times = self.observed["load_time"]
        self.wall_direction = np.array([prescribed.direction(scene, name, w) for name, w in self.scene_walls]).reshape(
            W, self.D
        )
        self._holding()
        still = np.zeros((self.S + 1, W, self.Q))
        self.body_x, self.body_v = np.concatenate([self.x, self.X], 1), np.concatenate([self.v, self.V], 1)
        self.body_w = np.concatenate([self.w, still], 1)
        # positions at mid-step, where contacts are solved
        self.mid = self.body_x[:-1] + 0.5 * self.h * self.body_v[:-1]
        self.inverse_mass = np.concatenate([np.where(self.fixed, 0.0, 1 / self.mass), np.zeros(W)])
        self.inverse_inertia = np.concatenate([np.where(self.fixed, 0.0, 1 / self.inertia), np.zeros(W)])
        self.body_radius = np.concatenate([self.radius, np.zeros(W)])
        self.gravity = np.asarray(scene.get("gravity") or np.zeros(self.D), float)
        self._parts()
        self.driving = Driving(self)
        self.membrane = Membrane(self) if self.scene.get("membrane") else None
        # bodies that no contact moves
        self.immovable = np.concatenate([self.fixed, ~np.isfinite(self.driving.mass).any(0)])

    def _holding(self):
        """The wall that holds each grain [N], −1 for none: the first one within its grip at time
        zero."""
        self.holder = np.full(self.N, -1)
        for k, (_, wall) in enumerate(self.scene_walls):
            if wall.get("grip") is None:
                continue
            all_grains = np.arange(self.N)
            place = np.broadcast_to(self.X[0, k], (self.N, self.D))
            gap, _ = gap_and_normal(self, all_grains, np.full(self.N, self.N + k), self.x[0], place)
            taken = (gap <= wall["grip"]) & ~self.fixed
            self.holder[taken], self.fixed = k, self.fixed | taken

    def _parts(self):
        """Steps made whole, not in parts: only for them do the frames before and after determine
        the problem that was solved."""
        if "substeps" in self.observed:
            self.single = self.observed["substeps"] == 1
        else:
            self.single = self.observed["solver_rejected"] == 0
        self.row_single = self.single[self.row_step]
        # steps after a step in parts: the mid-step before them is in no frame
        self.after_parts = np.append(False, ~self.single[:-1])[: self.S]

    def external(self):
        """Prescribed forces (N) [S,N,D] and torques (N m) [S,N,Q] on the grains at the middle of
        each step."""
        force = np.broadcast_to(self.mass[:, None] * self.gravity, (self.S, self.N, self.D)).copy()
        torque = np.zeros((self.S, self.N, self.Q))
        for load in (self.scene.get("grains") or {}).get("loads", []):
            factor = prescribed.at(load.get("time") or {"constant": 1.0}, self.load_times)[:, None]
            force[:, load["grain"]] += factor * np.asarray(load.get("force") or np.zeros(self.D), float)
            torque[:, load["grain"]] += factor * np.asarray(load.get("torque") or np.zeros(self.Q), float)
        if self.membrane is not None:
            force += self.membrane.force
        return force, torque


def plate_sides(group, w):
    """Unit vectors along the sides of the plate `w`, each with the length of the side (m)."""
    side = group["side"][w]
    sides = [(side, group["length"][w])]
    return sides if len(side) == 2 else sides + [(np.cross(group["normal"][w], side), group["width"][w])]


def enum_names(dataset, count=None):
    """The names of an array of enumerated values."""
    numbers = h5py.check_enum_dtype(dataset.dtype)
    names = {number: name for name, number in numbers.items()}
    values = dataset[:] if count is None else dataset[:count]
    table = np.array([names.get(k, f"unknown {k}") for k in range(256)], dtype=object)
    return table[values]
