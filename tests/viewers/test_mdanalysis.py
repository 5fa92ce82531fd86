"""MDAnalysis reads positions and velocities from the companion, and positions from the dump."""

import MDAnalysis


def test_companion(case):
    universe = MDAnalysis.Universe.empty(case.radius.size, trajectory=True)
    universe.load_new(str(case.folders["vtkhdf"] / "grains.h5md"), convert_units=False)
    assert len(universe.trajectory) == case.frames
    for k in case.some():
        step = universe.trajectory[k]
        assert step.time == case.times[k]
        # MDAnalysis keeps them in single precision
        assert (step.positions == case.positions(k).astype("f4")).all()
        assert (step.velocities == case.velocities(k).astype("f4")).all()
