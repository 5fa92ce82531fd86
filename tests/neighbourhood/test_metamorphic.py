"""One sample as it is, turned, mirrored, shifted, in other units and in other orders breaks the
same bond in the same step.

The forces of the step before are the same within 1e-6 of the largest: positions differ by rounding,
and reactions are those of the stiff limit, which is unique.
"""

import numpy as np
import pytest

import bases
import programs
import run
from history import History
from transform import transformed

WAYS = {
    "turned by 0.3": {"turn": 0.3},
    "turned by 90°": {"turn": np.pi / 2},
    "mirrored": {"mirror": True},
    "shifted": {"shift": 0.37},
    "in mm, g, ms": {"units": (1e3, 1e3, 1e3)},
    "in order 1": {"permute": 1},
    "in order 2": {"permute": 2},
    "in order 3": {"permute": 3},
}
SAME = 1e-6


def scene_of(dimension, restitution):
    """A sample that is compressed until its first bond breaks."""
    scene = (bases.disks if dimension == 2 else bases.spheres)()
    scene["materials"]["restitution"] = {"grain_grain": restitution, "grain_wall": restitution}
    scene["stop"] = {"broken_fraction": 1e-9}
    return scene


class FirstBreak:
    """Step and pairs of the first break, and the forces of all pairs in the step before, turned
    back to the sample as it is."""

    def __init__(self, path, how):
        h = History(path)
        self.step = int(h.events["step"][0])
        order, self.grains = how["order"], h.N
        number = lambda k: np.where(k < h.N, np.append(order, np.zeros(h.W, int))[k], k)
        first = h.events[h.events["round"] == 0]
        self.broken = {tuple(sorted((int(order[e["i"]]), int(order[e["j"]])))) for e in first}
        rows = np.flatnonzero(h.row_step == self.step - 2)
        i, j = number(h.i[rows]), number(h.j[rows])
        force = h.force[rows] @ how["R"] / how["force"]
        moment = h.torque[rows] / (how["force"] * how["length"])
        moment = moment * np.linalg.det(how["R"]) @ (how["R"] if h.D == 3 else np.eye(1))
        # of j on i; in another order i and j may have changed places
        swapped = np.where(i < j, 1.0, -1.0)[:, None]
        pairs = np.sort(np.stack([i, j], 1), 1)
        self.forces = {tuple(map(int, p)): np.append(f, m) for p, f, m in zip(pairs, force * swapped, moment * swapped)}


def first_break(scene, way, folder, name):
    """The first break of a scene with its sample transformed in this way."""
    plain = {**scene}
    points = run.sample_of(bases.disks if scene["dimension"] == 2 else bases.spheres, folder, programs.dem_run())
    scene, points, how = transformed(plain, points, **way)
    run.write_sample(scene, points, folder / f"{name}.csv")
    return FirstBreak(programs.run(scene, folder, name)[0], how)


@pytest.fixture(scope="session")
def plain(tmp_path_factory):
    """The samples as they are, by dimension and restitution, and their folder."""
    folder, known = tmp_path_factory.mktemp("metamorphic"), {}

    def of(dimension, restitution):
        key = (dimension, restitution)
        if key not in known:
            known[key] = first_break(scene_of(*key), {}, folder, f"plain-{dimension}-{restitution}")
        return known[key], folder

    return of


def scales(found):
    """The largest force, and the largest moment, of a step."""
    D = 2 if len(next(iter(found.forces.values()))) == 3 else 3
    rows = np.array(list(found.forces.values()))
    return np.repeat([np.abs(rows[:, :D]).max(), np.abs(rows[:, D:]).max()], [D, rows.shape[1] - D])


@pytest.mark.parametrize("restitution", [0.0, 0.001, 0.5])
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("dimension", [2, 3])
def test_the_same_sample_breaks_alike(plain, dimension, way, restitution):
    as_it_is, folder = plain(dimension, restitution)
    other = first_break(scene_of(dimension, restitution), WAYS[way], folder, "other")
    assert (other.step, other.broken) == (as_it_is.step, as_it_is.broken)
    # pairs that only one of them lists touch within rounding, and carry nothing
    nothing = np.zeros_like(scales(as_it_is))
    pairs = set(as_it_is.forces) | set(other.forces)
    off = max(
        (np.abs(as_it_is.forces.get(p, nothing) - other.forces.get(p, nothing)) / scales(as_it_is)).max() for p in pairs
    )
    assert off <= SAME, f"forces differ by {off:.2e} of the largest"


@pytest.mark.parametrize("dimension", [2, 3])
def test_restitution_changes_nothing_before_the_first_break(plain, dimension):
    steps = {restitution: plain(dimension, restitution)[0].step for restitution in (0.0, 0.001, 0.5)}
    assert len(set(steps.values())) == 1, steps
