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
        # without these data it is another problem
        assert not associated.any() or b"associated" in local["info/description"][()]
    assert numpy.allclose(matrix, matrix.T, rtol=0, atol=1e-12 * abs(matrix).max())
    assert numpy.linalg.eigvalsh(matrix).min() >= -1e-12 * abs(matrix).max()
    scale = abs(matrix).max() * abs(r).max()
    assert numpy.abs(matrix @ r + q - u).max() <= 1e-12 * scale
    # the cones: r in K, the velocity in its dual, and no work between them
    u, r = u.reshape(-1, size), r.reshape(-1, size)
    tangents = (size - 1) // 2 if rolling else size - 1
    groups = slice(1, 1 + tangents), slice(1 + tangents, None)
    (rt, rm), (ut, um) = ([numpy.linalg.norm(v[:, group], axis=1) for group in groups] for v in (r, u))
    # the scene's solver may miss its tolerance, up to solver.accept = 1e-6
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


def random_problem(path, seed, rolling):
    """Chains of bodies that branch, written as FCLIB's header says: W as triplets, columns or
    rows."""
    draw = numpy.random.default_rng(seed)
    bodies, contacts, size = 20, 19, 5 if rolling else 3
    mass, radius = draw.uniform(0.5, 2, bodies), draw.uniform(0.5, 1, bodies)
    # of unit mass and inertia: the columns of H over the roots of theirs
    rows = numpy.zeros((contacts * size, 6 * bodies))
    for c in range(contacts):
        pair = c + 1, draw.integers(c + 1)
        frame = numpy.linalg.qr(draw.normal(size=(3, 3)))[0].T
        for body, sign in zip(pair, (1, -1)):
            at, root, arm = 6 * body, numpy.sqrt(mass[body]), -sign * radius[body] * frame[0]
            # v + ω × arm along n, t1, t2; spins about t1, t2 times a diameter
            lever = numpy.cross(arm, frame) / (radius[body] * numpy.sqrt(0.4))
            rows[c * size : c * size + 3, at : at + 3] = sign * frame / root
            rows[c * size : c * size + 3, at + 3 : at + 6] = sign * lever / root
            if rolling:
                spins = 1.5 * sign * frame[1:] / (radius[body] * numpy.sqrt(0.4) * root)
                rows[c * size + 3 : c * size + 5, at + 3 : at + 6] = spins
    matrix = rows @ rows.T
    # most contacts close
    q = rows @ draw.normal(size=6 * bodies)
    q[::size] -= draw.exponential(size=contacts)
    i, p = numpy.nonzero(matrix)
    nz = (-1, -2, len(i))[seed % 3]
    starts = numpy.searchsorted(i, numpy.arange(len(matrix) + 1))
    with h5py.File(path, "w") as file:
        local = file.create_group("fclib_local")
        local["spacedim"] = numpy.array([size], "i4")
        vectors = {"q": q, "mu": draw.uniform(0, 0.8, contacts)}
        vectors |= {"mu_r": draw.uniform(0, 0.3, contacts)} if rolling else {}
        for name, values in vectors.items():
            local[f"vectors/{name}"] = values
        scalars = {"m": len(matrix), "n": len(matrix), "nzmax": len(i), "nz": nz}
        for name, value in scalars.items():
            local[f"W/{name}"] = numpy.array([value], "i4")
        # a symmetric matrix has the same lines by rows and by columns
        local["W/p"] = (p if nz >= 0 else starts).astype("i4")
        local["W/i"] = (i if nz >= 0 else p).astype("i4")
        local["W/x"] = matrix[i, p]
    return matrix


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("rolling", [False, True], ids=["sliding", "rolling"])
def test_random_problems_in_space(dem_run, tmp_path, seed, rolling):
    matrix = random_problem(tmp_path / "a.hdf5", seed, rolling)
    with h5py.File(tmp_path / "a.hdf5") as file:
        assert numpy.array_equal(dense(file["fclib_local/W"]), matrix)
    for solver in ("gauss-seidel", "newton"):
        solve = ("solve", "a.hdf5", "--solver", solver, "--tolerance", "1e-9", "--force", "-o", "b.hdf5")
        # exit code 0: the residual was reached
        dem_run(tmp_path, *solve)
        with h5py.File(tmp_path / "b.hdf5") as file:
            assert numpy.allclose(dense(file["fclib_local/W"]), matrix, rtol=0, atol=1e-14 * abs(matrix).max())
        check(tmp_path / "b.hdf5")
