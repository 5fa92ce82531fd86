"""OVITO opens the dumps: grains with radii, bonds that hold and contacts as bonds of its own."""

import os

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
os.environ["OVITO_GUI_MODE"] = "0"

import numpy
from ovito.io import import_file
from ovito.modifiers import LoadTrajectoryModifier


def same(found, expected):
    """Up to the last digits, in which OVITO's reader of decimal numbers differs."""
    return numpy.allclose(found, expected, rtol=2**-50, atol=0)


def topology(pipeline, path, columns):
    """Adds pairs of a dump as bonds."""
    loader = LoadTrajectoryModifier()
    loader.source.load(str(path), columns=columns)
    pipeline.modifiers.append(loader)


def pairs(data):
    """The pairs of the bonds by the numbers of the grains, in the order of the file."""
    return data.particles.identifiers[...][data.particles.bonds.topology[...]]


def test_grains(case):
    pipeline = import_file(str(case.folders["lammps"] / "grains.dump"))
    assert pipeline.source.num_frames == case.frames
    for k in case.some():
        data = pipeline.compute(k)
        grains = data.particles
        assert data.attributes["Timestep"] == case.steps[k]
        assert same(data.attributes["Time"], case.times[k])
        assert (grains.identifiers[...] == case.grains["id"][:]).all()
        assert same(grains.positions[...], case.positions(k))
        assert same(grains["Velocity"][...], case.velocities(k))
        assert numpy.allclose(grains["Radius"][...], case.radius, rtol=2**-23, atol=0)
        assert numpy.allclose(grains["Mass"][...], case.grains["mass"][:], rtol=2**-23, atol=0)
        if "orientation" in case.grains:
            w = case.grains["orientation/value"][k]
            assert numpy.allclose(grains["Orientation"][...], w[:, [1, 2, 3, 0]], rtol=0, atol=2**-22)
        assert not any(data.cell.pbc)
        # the box is that of the grains
        low, high = case.positions(k) - case.radius[:, None], case.positions(k) + case.radius[:, None]
        assert numpy.allclose(data.cell[:, 3], low.min(axis=0), rtol=1e-12)
        assert numpy.allclose(numpy.diag(data.cell[:, :3]), high.max(axis=0) - low.min(axis=0), rtol=1e-12)


def test_bonds(case):
    if "bonds" not in case.history:
        assert not (case.folders["lammps"] / "bonds.dump").exists()
        return
    pipeline = import_file(str(case.folders["lammps"] / "grains.dump"))
    columns = [None, "Particle Identifiers.1", "Particle Identifiers.2", "Strength"]
    topology(pipeline, case.folders["lammps"] / "bonds.dump", columns)
    numbers = set()
    for k in case.some():
        data = pipeline.compute(k)
        holds = case["bonds/status/value"][k] == 0
        assert (pairs(data) == case["bonds/pair"][:][holds]).all()
        assert same(data.particles.bonds["Strength"][...], case["bonds/strength"][:][holds])
        numbers.add(data.particles.bonds.count)
    assert case.name != "flat" or len(numbers) > 1


def test_contacts(case):
    pipeline = import_file(str(case.folders["lammps"] / "grains.dump"))
    columns = [None, "Particle Identifiers.1", "Particle Identifiers.2", "Status", "Gap", "Normal force", "Tangential force"]
    topology(pipeline, case.folders["lammps"] / "contacts.dump", columns)
    for k in case.some():
        data, rows = pipeline.compute(k), case.contacts(k)
        pair = case["contacts/pair"][rows]
        between = pair[:, 1] >= 0
        if not between.any():
            assert data.particles.bonds is None or data.particles.bonds.count == 0
            continue
        reaction = case["contacts/reaction"][rows][between]
        bonds = data.particles.bonds
        assert (pairs(data) == pair[between]).all()
        assert (bonds["Status"][...] == case["contacts/status"][rows][between]).all()
        assert same(bonds["Gap"][...], case["contacts/gap"][rows][between])
        assert same(bonds["Normal force"][...], reaction[:, 0])
        tangential = numpy.linalg.norm(reaction[:, 1:], axis=1)
        assert numpy.allclose(bonds["Tangential force"][...], tangential, rtol=1e-14, atol=0)
