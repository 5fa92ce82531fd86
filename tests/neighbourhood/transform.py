"""Scenes turned, mirrored, shifted, in another order of the grains, in other units."""

import copy

import numpy as np


def scaled(function, factor, time=1.0):
    """A function of time, its values times a factor and its times times another."""
    if "constant" in function:
        return {"constant": function["constant"] * factor}
    if "ramp" in function:
        ramp = function["ramp"]
        return {"ramp": {"rate": ramp["rate"] * factor / time, "start": ramp.get("start", 0.0) * time}}
    return {"table": [[t * time, v * factor] for t, v in function["table"]]}


def regions_of(scene):
    """All regions of a scene."""
    named = [region for material in scene["materials"].get("named", []) for region in material.get("regions", [])]
    return named + (scene.get("bonds") or {}).get("absent", [])


class Transform:
    """How a scene is turned about the vertical plane (rad), mirrored, shifted (m), in an order
    drawn with the seed `permute`, and with units `units` times smaller (length, mass, time)."""

    def __init__(self, dimension, turn=0.0, mirror=False, permute=None, units=None, shift=None):
        self.length, self.mass, self.time = units or (1.0, 1.0, 1.0)
        self.force = self.mass * self.length / self.time**2
        self.pressure = self.force / self.length**2
        self.permute, self.move = permute, np.full(dimension, shift or 0.0)
        c, s = (0.0, 1.0) if np.isclose(turn, np.pi / 2) else (np.cos(turn), np.sin(turn))
        # vertical is the last axis
        plane_of_turn = np.ix_([0, dimension - 1], [0, dimension - 1])
        self.R = np.eye(dimension)
        self.R[plane_of_turn] = [[c, -s], [s, c]]
        if mirror:
            self.R = self.R @ np.diag([-1.0] + [1.0] * (dimension - 1))

    def place(self, x):
        """Of a point (m)."""
        return (self.length * (self.R @ np.asarray(x, float) + self.move)).tolist()

    def along(self, x, unit=1.0):
        """Of a vector in a unit."""
        return (unit * (self.R @ np.asarray(x, float))).tolist()

    def points(self, points):
        """Of grains: rows of centre and radius, and their former numbers."""
        order = np.arange(len(points))
        if self.permute is not None:
            order = np.random.default_rng(self.permute).permutation(len(points))
        points = np.asarray(points, float)[order]
        return np.column_stack([[self.place(x) for x in points[:, :-1]], self.length * points[:, -1]]), order

    def wall(self, wall):
        """Alters a wall of a scene."""
        for shape in wall["shape"].values():
            for key, how in (
                ("normal", self.along),
                ("axis", self.along),
                ("center", self.place),
                ("seated", self.along),
                ("side", self.along),
            ):
                if isinstance(shape.get(key), list):
                    shape[key] = how(shape[key])
            if isinstance(shape.get("place"), dict):
                shape["place"]["at"] = self.place(shape["place"]["at"])
            if "radius" in shape:
                shape["radius"] *= self.length
            if "size" in shape:
                shape["size"] = [self.length * size for size in shape["size"]]
        if "direction" in wall:
            wall["direction"] = self.along(wall["direction"])
        if "grip" in wall:
            wall["grip"] *= self.length
        if "slide" in wall:
            slide = wall["slide"]
            slide["direction"] = self.along(slide["direction"])
            slide["velocity"] = scaled(slide["velocity"], self.length / self.time, self.time)
        self.drive(wall)

    def drive(self, wall):
        """Alters the drive of a wall, or that of a stage."""
        if "force_rate" in wall:
            wall["force_rate"] *= self.force / self.time
        for drive, unit in (("force", self.force), ("velocity", self.length / self.time), ("stress", self.pressure)):
            if drive in wall:
                wall[drive] = scaled(wall[drive], unit, self.time)

    def region(self, region):
        """Alters a region. A box stays one where axes turn into axes."""
        for kind, shape in region.items():
            if kind == "box":
                ends = np.array([self.place(shape["from"]), self.place(shape["to"])])
                shape["from"], shape["to"] = ends.min(0).tolist(), ends.max(0).tolist()
                continue
            for key, how in (("point", self.place), ("normal", self.along), ("center", self.place)):
                if key in shape:
                    shape[key] = how(shape[key])
            if "radius" in shape:
                shape["radius"] *= self.length

    def bonds(self, fields):
        """Alters the bonds of a scene, or those of a pair of materials."""
        for key, unit in (("strength", self.force), ("stress", self.pressure)):
            if key in fields:
                fields[key] *= unit
        stiffness = fields.get("stiffness", {})
        for key in stiffness.get("springs", {}):
            stiffness["springs"][key] *= (
                self.force / self.length if key in ("normal", "tangential") else self.force * self.length
            )
        if "young" in stiffness:
            stiffness["young"]["modulus"] *= self.pressure


def transformed(scene, points, **way):
    """The scene and its sample, rows of centre and radius, transformed by `Transform`.

    Returns the scene without its sample, the points, and a dictionary: the matrix `R` that turned it, the
    `order` in which the grains stand now, and the units of `force` and `length`."""
    scene = copy.deepcopy({key: value for key, value in scene.items() if not key.startswith("as ")})
    how = Transform(scene["dimension"], **way)
    points, order = how.points(points)
    for wall in scene["walls"].values():
        how.wall(wall)
    if "gravity" in scene:
        scene["gravity"] = how.along(scene["gravity"], how.length / how.time**2)
    for region in regions_of(scene):
        how.region(region)
    for material in [scene["materials"], *scene["materials"].get("named", [])]:
        if "density" in material:
            material["density"] *= how.mass / how.length**3
    for pair in scene["materials"].get("pairs", []):
        how.bonds(pair.get("bonds", {}))
    if "membrane" in scene:
        membrane = scene["membrane"]
        membrane["pressure"] = scaled(membrane["pressure"], how.pressure, how.time)
        if "disk_radius" in membrane:
            membrane["disk_radius"] *= how.length
    for stage in scene.get("stages", []):
        if "duration" in stage:
            stage["duration"] *= how.time
        if "membrane_pressure" in stage:
            stage["membrane_pressure"] = scaled(stage["membrane_pressure"], how.pressure, how.time)
        for drive in stage["walls"].values():
            how.drive(drive)
    if "thickness" in scene:
        scene["thickness"] *= how.length
    scene["time"] = {key: value * how.time for key, value in scene["time"].items()}
    how.bonds(scene.get("bonds") or {})
    return scene, points, {"R": how.R, "order": order, "force": how.force, "length": how.length}
