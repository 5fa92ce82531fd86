"""The pressure of a membrane on the free surface of a sample, found by another way than the program's.

All places where a rolling disk touches two bodies and overlaps no third one are listed first. They
are joined to the way of the disk then: on a body it rolls clockwise to the next of these places."""

import numpy as np

import prescribed
import tolerances
from arrays import norm

FIRST, SECOND = -1, -2
# of the radius of the disk: an overlap that rounding leaves
ROUNDING = 1e-9


class Membrane:
    """Pressures (Pa) [S], forces on the grains (N) [S,N,2], what they add to the stress times the
    volume (N m) [S,2,2], enclosed areas (m²) [S], and whether a surface was found [S]."""

    def __init__(self, h):
        self.pressure, self.steep = pressures(h)
        self.force, self.moment = np.zeros((h.S, h.N, 2)), np.zeros((h.S, 2, 2))
        self.area, self.found = np.zeros(h.S), np.zeros(h.S, bool)
        given = h.scene["membrane"]
        disk = given.get("disk_radius") or 1.5 * h.radius.mean()
        between = given.get("between")
        for s in range(h.S):
            if not h.single[s]:
                continue
            sides = [Side(h, s, disk, between, sign) for sign in ((1, -1) if between else (1,))]
            ways = [side.way() for side in sides]
            self.found[s] = all(way is not None for way in ways)
            if self.found[s]:
                for side, way in zip(sides, ways):
                    self._load(h, s, side, way)

    def _load(self, h, s, side, way):
        thickness = prescribed.thickness(h.scene)
        points = [side.point(way, k) for k in range(len(way))]
        closed = way[0] >= 0
        pairs = list(zip(range(len(way)), range(1, len(way)))) + ([(len(way) - 1, 0)] if closed else [])
        push = np.zeros((len(way), 2))
        for a, b in pairs:
            (pa, qa), (pb, qb) = points[a], points[b]
            # the foot of a plate is below or above its neighbour
            start, end = (pa if way[a] >= 0 else qa(pb)), (pb if way[b] >= 0 else qb(pa))
            line = end - start
            share = 0.5 if way[a] >= 0 and way[b] >= 0 else 1.0
            inwards = share * np.array([line[1], -line[0]])
            for k in (a, b):
                if way[k] >= 0:
                    push[k] += inwards
            self.area[s] -= 0.5 * (start[0] + end[0]) * line[1]
        for k, grain in enumerate(way):
            if grain >= 0:
                force = self.pressure[s] * thickness * (push[k, 0] * side.along + push[k, 1] * side.up)
                self.force[s, grain] += force
                size = np.linalg.norm(force)
                if size > 0:
                    self.moment[s] += h.radius[grain] * np.outer(force, force) / size


class Side:
    """A disk on one side of the sample in one step: coordinates along the plates, into the sample,
    and above the first plate."""

    def __init__(self, h, s, disk, between, sign):
        self.up, base, self.height = np.array([0.0, 1.0]), 0.0, None
        if between:
            first, second = (h.N + h.wall_names.index(name) for name in between)
            self.up = h.wall_normal[first - h.N]
            base = h.mid[s, first] @ self.up
            self.height = h.mid[s, second] @ self.up - base
        self.along = sign * np.array([self.up[1], -self.up[0]])
        self.x = np.stack([h.mid[s, : h.N] @ self.along, h.mid[s, : h.N] @ self.up - base], 1)
        self.disk, self.radius, self.reach = disk, h.radius, h.radius + disk
        self._places()

    def _places(self):
        """Places of the disk: centre, the body that it comes from, the body that it goes to."""
        x, reach = self.x, self.reach
        i, j = np.nonzero(~np.eye(len(x), dtype=bool))
        way = x[j] - x[i]
        distance = norm(way)
        near = (distance < reach[i] + reach[j]) & (distance > np.abs(reach[i] - reach[j]))
        i, j, way, distance = i[near], j[near], way[near], distance[near]
        ahead = (distance**2 + reach[i] ** 2 - reach[j] ** 2) / (2 * distance)
        aside = np.sqrt(np.maximum(reach[i] ** 2 - ahead**2, 0.0))
        left = np.stack([-way[:, 1], way[:, 0]], 1)
        places = [(x[i] + (ahead[:, None] * way + aside[:, None] * left) / distance[:, None], i, j)]
        if self.height is not None:
            for level, plate in ((self.disk, FIRST), (self.height - self.disk, SECOND)):
                k = np.flatnonzero(np.abs(level - x[:, 1]) < reach)
                half = np.sqrt(reach[k] ** 2 - (level - x[k, 1]) ** 2)
                at = lambda sign: np.stack([x[k, 0] + sign * half, np.full(len(k), level)], 1)
                plates = np.full(len(k), plate)
                if plate == FIRST:
                    places += [(at(-1), plates, k), (at(1), k, plates)]
                else:
                    places += [(at(-1), k, plates)]
        centre, source, goal = (np.concatenate(part) for part in zip(*places))
        apart = norm(centre[:, None] - x[None]) - reach
        rows = np.arange(len(centre))
        for own in (source, goal):
            apart[rows[own >= 0], own[own >= 0]] = 0.0
        free = (apart >= -ROUNDING * self.disk).all(1)
        if self.height is not None:
            low, high = self.disk * (1 - ROUNDING), self.height - self.disk * (1 - ROUNDING)
            free &= (centre[:, 1] >= low) & (centre[:, 1] <= high)
        self.centre, self.source, self.goal = centre[free], source[free], goal[free]

    def next(self, body, place):
        """Number of the next place of a disk that is on a body at `place`; none if it rolls on for
        ever."""
        out = np.flatnonzero(self.source == body)
        if body == FIRST:
            way = self.centre[out, 0] - place[0]
            out, way = out[way > -ROUNDING * self.disk], way[way > -ROUNDING * self.disk]
        else:
            angle = lambda points: np.arctan2(*(points - self.x[body]).T[::-1])
            way = (angle(place) - angle(self.centre[out])) % (2 * np.pi)
            way[way > 2 * np.pi - ROUNDING] = 0.0
        return out[np.argmin(way)] if len(out) else None

    def way(self):
        """Bodies that the disk touches one after the other, or none: from plate to plate, or around
        the largest part of the sample."""
        if self.height is not None:
            way, at, k = [FIRST], np.array([-np.inf, self.disk]), None
        else:
            start = self.outermost()
            way, at, k = [start], self.x[start] - [self.reach[start], 0.0], None
        first = None
        for _ in range(4 * len(self.centre) + 4):
            k = self.next(way[-1], at)
            if k is None:
                return way if self.height is None else None
            if k == first:
                return way[:-1]
            first = k if first is None and self.height is None else first
            way.append(int(self.goal[k]))
            at = self.centre[k]
            if way[-1] == SECOND:
                return way
        return None

    def outermost(self):
        """The leftmost grain of the part of the sample with the most grains."""
        touching = norm(self.x[:, None] - self.x[None]) < self.reach[:, None] + self.reach[None]
        part = np.arange(len(self.x))
        for _ in range(len(self.x)):
            part = np.where(touching, part[None], len(self.x)).min(1)
        largest = np.argmax(np.bincount(part))
        left = np.where(part == largest, self.x[:, 0] - self.radius, np.inf)
        return int(np.argmin(left))

    def point(self, way, k):
        """The centre of a grain, and for a plate a function: the foot of its neighbour."""
        if way[k] >= 0:
            return self.x[way[k]], None
        level = 0.0 if way[k] == FIRST else self.height
        return None, lambda neighbour: np.array([neighbour[0], level])


def pressures(h):
    """Pressure (Pa) in the middle of every step, and the largest slope of the function (Pa/s)."""
    function, origin = h.scene["membrane"]["pressure"], 0
    out, steep = np.zeros(h.S), np.zeros(h.S)
    stages = h.scene.get("stages") or [{}]
    for begin, stage in zip(h.driving.began, stages):
        if stage.get("membrane_pressure") is not None:
            function, origin = stage["membrane_pressure"], begin
        out[begin:] = prescribed.at(function, h.load_times[begin:] - origin * h.h)
        steep[begin:] = prescribed.steepness(function)
    return out, steep


def check(h, report):
    """The pressure and the area in the history, and that there was a surface in every step."""
    if "membrane" not in h.scene:
        return
    m = h.membrane
    report.require("membrane", bool((m.found | ~h.single).all()), "a step without a surface")
    told, where = h.observed["membrane_pressure"], lambda s: f"step {s + 1}: membrane_pressure (Pa)"
    # a step in parts has the mean of the pressures of its parts
    off = np.where(h.single, np.abs(told - m.pressure), 0.0)
    report.expect("membrane", off, tolerances.rounding(m.pressure + m.steep * h.times[1:]), where)
    off = np.where(m.found, np.abs(h.observed["membrane_area"] - m.area), 0.0)
    size = norm(h.mid[:, : h.N]).max(1) * np.ptp(h.mid[:, : h.N], axis=1).max(1) * 8
    report.expect("membrane", off, tolerances.rounding(size), lambda s: f"step {s + 1}: membrane_area (m²)")
