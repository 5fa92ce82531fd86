"""A problem that `dem-run export` wrote, read with nothing but h5py and numpy."""

import h5py
import numpy
import pytest
from conftest import ROOT


def dense(group):
    """W from its triplets, columns or rows."""
    nz, m, n = (int(group[name][0]) for name in ("nz", "m", "n"))
    p, i, x = (group[name][:] for name in ("p", "i", "x"))
    matrix = numpy.zeros((m, n))
    if nz >= 0:
        numpy.add.at(matrix, (i[:nz], p[:nz]), x[:nz])
    else:
        lines = numpy.repeat(numpy.arange(len(p) - 1), numpy.diff(p))
        numpy.add.at(matrix, (i, lines) if nz == -1 else (lines, i), x)
    return matrix


def check(path):
    with h5py.File(path) as file:
        local, solution = file["fclib_local"], file["solution"]
        matrix, q, size = dense(local["W"]), local["vectors/q"][:], int(local["spacedim"][0])
        mu = local["vectors/mu"][:]
        mu_r = local["vectors/mu_r"][:] if "mu_r" in local["vectors"] else numpy.zeros_like(mu)
        rolling = "mu_r" in local["vectors"]
        u, r = solution["u"][:], solution["r"][:]
        associated = file["cohesive_dem/associated"][:]
        assert local["W/p"].dtype == numpy.int32 and local["W/x"].dtype == numpy.float64
        assert b"associated" in local["info/description"][()]
    assert numpy.allclose(matrix, matrix.T, rtol=0, atol=1e-12 * abs(matrix).max())
    assert numpy.linalg.eigvalsh(matrix).min() >= -1e-12 * abs(matrix).max()
    scale = abs(matrix).max() * abs(r).max()
    assert numpy.abs(matrix @ r + q - u).max() <= 1e-12 * scale
    # the cones: r in K, the velocity in its dual, and no work between them
    u, r = u.reshape(-1, size), r.reshape(-1, size)
    tangents = (size - 1) // 2 if rolling else size - 1
    groups = slice(1, 1 + tangents), slice(1 + tangents, None)
    (rt, rm), (ut, um) = ([numpy.linalg.norm(v[:, group], axis=1) for group in groups] for v in (r, u))
    # the scene's solver may miss its aim, up to solver.accept = 1e-6
    force, speed = 1e-6 * numpy.linalg.norm(r), 1e-6 * scale
    assert (r[:, 0] >= -force).all()
    assert (rt <= mu * r[:, 0] + force).all() and (rm <= mu_r * r[:, 0] + force).all()
    dual = u[:, 0] - numpy.where(associated == 1, mu * ut + mu_r * um, 0)
    assert (dual >= -speed).all()
    shifted = u[:, 0] + numpy.where(associated == 1, 0, mu * ut + mu_r * um)
    work = shifted * r[:, 0] + (u[:, 1:] * r[:, 1:]).sum(axis=1)
    assert numpy.abs(work).max() <= speed * numpy.linalg.norm(r)


def test_an_exported_problem(dem_run, tmp_path):
    dem_run(tmp_path, "run", ROOT / "tests/problems/scenes/sheared.json", "-o", "a.h5", "--set", "time.end=0.03", "-q")
    dem_run(tmp_path, "export", "a.h5", "--step", "250", "-o", "a.hdf5", "-q")
    check(tmp_path / "a.hdf5")


@pytest.mark.parametrize("path", sorted((ROOT / "tests/problems").glob("*.hdf5")), ids=lambda path: path.stem)
def test_the_collection(path):
    check(path)
