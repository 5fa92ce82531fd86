"""Histories, and what `dem-post view` makes of them; see scripts/test_viewers."""

import hashlib
import os
import subprocess
from pathlib import Path

import h5py
import numpy
import pytest

ROOT = Path(__file__).resolve().parents[2]
PROGRAMS = Path(os.environ["DEM_PROGRAMS"])
FOLDER = Path(os.environ["DEM_VIEWERS"]) / "histories"
# in 2D bonds break; in 3D grains turn, and bonds resist twist
SCENES = {
    "flat": (
        "configs/compression.json",
        [
            "sample.random.count=100",
            "sample.random.width=0.018",
            "sample.random.preparation.compaction.solid_fraction=0.79",
        ],
    ),
    "space": ("tests/problems/scenes/cube.json", ['bonds={"strength": 0.01, "gap_tolerance": 1e-3, "twist": 0.1}']),
    "loose": ("tests/problems/scenes/cube.json", []),
}


def call(program, *arguments):
    subprocess.run([PROGRAMS / program, *map(str, arguments), "--quiet"], check=True, stdout=subprocess.DEVNULL)


class Case:
    """A history, and the folders of its files for viewers, by format."""

    def __init__(self, name):
        self.name, self.path = name, FOLDER / f"{name}.h5"
        self.folders = {form: FOLDER / f"{name}-{form}" for form in ("vtkhdf", "vtp", "lammps")}
        FOLDER.mkdir(parents=True, exist_ok=True)
        # made once for all environments
        made, state = FOLDER / f"{name}.made", self.state()
        if not made.exists() or made.read_text() != state:
            self.make()
            made.write_text(state)
        self.history = h5py.File(self.path, "r")
        self.grains = self.history["particles/grains"]
        self.frames = int(self.history["commit"][()])
        self.times, self.steps = self.grains["position/time"][:], self.grains["position/step"][:]
        self.radius = self.grains["radius"][:]

    def state(self):
        """A digest of the programs and the scene."""
        digest = hashlib.sha256(str(SCENES[self.name]).encode())
        for path in (PROGRAMS / "dem-run", PROGRAMS / "dem-post", ROOT / SCENES[self.name][0]):
            digest.update(path.read_bytes())
        return digest.hexdigest()

    def make(self):
        scene, sets = SCENES[self.name]
        call("dem-run", "run", ROOT / scene, "-o", self.path, "--force", *(f"--set={field}" for field in sets))
        for form, folder in self.folders.items():
            call("dem-post", "view", self.path, "--format", form, "-o", folder, "--force")

    def __getitem__(self, place):
        return self.history[place]

    def positions(self, frame):
        return padded(self.grains["position/value"][frame])

    def velocities(self, frame):
        return padded(self.grains["velocity/value"][frame])

    def contacts(self, frame):
        """The rows of a frame."""
        start = int(self["contacts/start"][frame])
        return slice(start, start + int(self["contacts/count"][frame]))

    def some(self):
        """Some frames: the first has no contacts, in the last bonds are broken."""
        return sorted({0, 1, self.frames // 2, self.frames - 1})


def padded(values):
    return numpy.pad(values, ((0, 0), (0, 3 - values.shape[1])))


@pytest.fixture(scope="session", params=SCENES)
def case(request):
    case = Case(request.param)
    yield case
    case.history.close()
