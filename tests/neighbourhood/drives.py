"""How each wall is driven in each step: the scene's drives and those of its stages, the sections on
which stresses act, slides, and when conditions that end a run or a stage hold."""

import numpy as np

import prescribed

# consecutive steps whose load is below the share of the peak
DROP_STEPS = 10


class Driving:
    """The drives of all walls, step by step.

    `kind` [S,W]: "fixed", "velocity" or "force"; `value` [S,W]: velocity at the end of the step (m/s), or
    force at the middle (N), with `error`, the size of what it is computed from; `mass` [S,W] (kg) of a
    wall under a force, infinite for others; `force` [S,W]: the forces (N), 0 for others. `start` [W]:
    speeds at time zero (m/s). Of slides `across` [W,D], zero for none, and `speed` [S+1,W]. `began`: step after
    which each stage began; `ended`: that after which the last one ended, if it did."""

    def __init__(self, h):
        shape = (h.S, h.W)
        self.driven = np.array([prescribed.is_driven(h.scene, *pair) for pair in h.scene_walls], bool)
        self.kind = np.full(shape, "fixed", dtype=object)
        self.value, self.error, self.mass = np.zeros(shape), np.zeros(shape), np.full(shape, np.inf)
        self.start = np.zeros(h.W)
        self.began, self.ended = [0], None
        self._slides(h)
        self._fill(h)
        self.force = np.where(self.kind == "force", self.value, 0.0)

    def _slides(self, h):
        self.across, self.speed = np.zeros((h.W, h.D)), np.zeros((h.S + 1, h.W))
        self.speed_error = np.zeros(h.W)
        for k, (_, wall) in enumerate(h.scene_walls):
            given = prescribed.slide(wall, h.wall_direction[k])
            if given:
                self.across[k], self.speed[:, k] = given[0], prescribed.at(given[1], h.times)
                self.speed_error[k] = prescribed.steepness(given[1])
        self.slides = (self.across != 0).any(1)

    def _fill(self, h):
        stages = h.scene.get("stages") or []
        drives = [(kind, function, 0) for kind, function in prescribed.first_drives(h.scene)]
        for k, (kind, function, _) in enumerate(drives):
            self.start[k] = prescribed.at(function, [0.0])[0] if kind == "velocity" else 0.0
        for number in range(max(len(stages), 1)):
            begin = self.began[number]
            for k, drive in enumerate(drives):
                self._drive(h, k, begin, *drive)
            if not stages:
                return
            end = self._end(h, stages[number], begin)
            if end is None:
                return
            if number + 1 == len(stages):
                self.ended = end
                return
            self.began.append(end)
            for k, (name, _) in enumerate(h.scene_walls):
                if name in (stages[number + 1].get("walls") or {}):
                    drives[k] = prescribed.stage_drive(stages[number + 1]["walls"][name]) + (end,)

    def _drive(self, h, k, begin, kind, function, origin):
        """Enters the drive of a wall from the step `begin` on; its times count from the step
        `origin`."""
        rows, start = slice(begin, None), origin * h.h
        self.kind[rows, k] = "force" if kind == "stress" else kind
        self.mass[rows, k] = np.inf
        if kind == "fixed":
            return
        if kind == "velocity":
            times = h.times[1:][rows]
            self.value[rows, k] = prescribed.at(function, times - start)
        else:
            times = h.load_times[rows]
            self.value[rows, k] = prescribed.at(function, times - start)
            self.mass[rows, k] = prescribed.wall_mass(h.scene_walls[k][1], h.mass)
        self.error[rows, k] = np.abs(self.value[rows, k]) + prescribed.steepness(function) * (times + h.h)
        if kind == "stress":
            area, size = sections(h, k)
            self.value[rows, k] *= area[rows]
            self.error[rows, k] *= size[rows]

    def _end(self, h, stage, begin):
        """The step after which a stage ended that began after the step `begin`; none if it did
        not."""
        over = np.zeros(h.S, bool)
        for held in conditions(h, stage.get("until") or {}, begin, self.load).values():
            over |= held
        if stage.get("duration") is not None:
            last = begin + max(int(np.floor(stage["duration"] / h.h + 0.5)), 1) - 1
            over[last:] = True
        over[:begin] = False
        return int(np.argmax(over)) + 1 if over.any() else None

    def load(self, h, k):
        """Load (N) of the driven wall `k` in every step: the prescribed force, or its force on the
        grains before a bond broke."""
        at_limit = h.observed.get("wall_force_at_limit", h.observed["wall_force"])
        # a step in parts has the mean of the loads of its parts
        given = np.where(h.single, self.value[:, k], h.observed["applied_force"][:, k])
        return np.where(self.kind[:, k] == "force", given, -at_limit[:, k] @ h.wall_direction[k])


def sections(h, k):
    """Section (m²) of the sample across the normal of the plane wall `k` at the middle of every step,
    of a plate the part that it covers, and the size of what it is computed from."""
    across = int(np.argmax(np.abs(h.wall_normal[k])))
    for w in range(h.W):
        inside = h.wall_kind[w] == "CYLINDER" and h.wall_radius[w] < 0
        if inside and h.wall_kind[k] != "PLATE" and int(np.argmax(np.abs(h.wall_normal[w]))) == across:
            area = np.full(h.S, np.pi * h.wall_radius[w] ** 2)
            return area, area
    area = size = np.full(h.S, prescribed.thickness(h.scene))
    for axis in set(range(h.D)) - {across}:
        low, high = extent(h, axis)
        for side, length in h.wall_sides[k]:
            if abs(side[axis]) == 1:
                middle = h.mid[:, h.N + k, axis]
                low, high = np.maximum(low, middle - 0.5 * length), np.minimum(high, middle + 0.5 * length)
        area, size = area * np.maximum(high - low, 0.0), size * (np.abs(high) + np.abs(low))
    return area, size


def extent(h, axis):
    """Ends (m) of the sample along an axis at the middle of every step: the innermost planes that
    face each other, else the grains."""
    planes = [w for w in range(h.W) if h.wall_kind[w] == "PLANE" and abs(h.wall_normal[w, axis]) == 1]
    places = {sign: [h.mid[:, h.N + w, axis] for w in planes if h.wall_normal[w, axis] == sign] for sign in (1, -1)}
    if places[1] and places[-1]:
        return np.max(places[1], 0), np.min(places[-1], 0)
    grains = h.mid[:, : h.N, axis]
    return (grains - h.radius).min(1), (grains + h.radius).max(1)


def load_wall(scene):
    """Name of the wall that loads the sample; none if several are driven and none is named."""
    driven = [name for name, wall in prescribed.walls(scene) if prescribed.is_driven(scene, name, wall)]
    travel = (scene.get("stop") or {}).get("wall_travel") or {}
    named = [name for name in (scene.get("load_wall"), travel.get("wall")) if name in driven]
    return (named + (driven if len(driven) == 1 else []) + [None])[0]


def conditions(h, stop, begin, load):
    """Whether each condition of `stop` holds after each step [S], counted from the step `begin` on;
    `load(h, k)` is the load of a wall."""
    out = {}
    after = np.arange(h.S) >= begin
    broken = h.observed["bonds_broken"] if h.K else np.zeros(h.S)
    if stop.get("broken_fraction") is not None and h.K:
        out["broken_fraction"] = after & (broken >= stop["broken_fraction"] * h.K)
    travel = stop.get("wall_travel")
    if travel:
        k = h.wall_names.index(travel["wall"])
        d = h.wall_direction[k]
        reach = lambda sign: (sign * (h.x[begin] @ d) + h.radius).max()
        distance = travel["fraction_of_height"] * (reach(1) + reach(-1))
        origin = begin
        if travel.get("after", "start") != "start":
            # the frame of the first break
            first = int(np.argmax(broken > 0)) + 1 if (broken > 0).any() else h.S
            origin = max(begin, first)
        way = np.abs((h.X[1:, k] - h.X[origin, k]) @ d)
        out["wall_travel"] = after & (way >= distance * (1 - 1e-12)) & (np.arange(h.S) >= origin)
    if stop.get("load_drop") is not None:
        out["load_drop"] = after & dropped(h, stop["load_drop"], begin, load)
    return out


def dropped(h, share, begin, load):
    """Whether the load has been below a share of its peak in ten consecutive steps. The peak counts
    from the first break on, that step included."""
    size = np.abs(load(h, h.wall_names.index(load_wall(h.scene))))
    broken = h.observed["bonds_broken"] if h.K else np.zeros(h.S)
    counts = (broken > 0) & (np.arange(h.S) >= begin)
    peak = np.maximum.accumulate(np.where(counts, size, 0.0))
    below, out, row = counts & (size < share * peak), np.zeros(h.S, bool), 0
    for s in range(h.S):
        row = row + 1 if below[s] else 0
        out[s] = row >= DROP_STEPS
    return out
