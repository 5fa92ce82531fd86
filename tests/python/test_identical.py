"""What must not change a bit: a second run, another number of threads, a sample read back from its file."""

import json

import h5py
import pytest
from conftest import ROOT

SCENE = ROOT / "configs/compression.json"


def content(path):
    """Every object of a history with its bytes and attributes, but what tells of the run and its clock."""
    found = {}

    def enter(name, item):
        if name.split("/")[0] == "parameters" or name.startswith("observables/cpu_time"):
            return
        attributes = {key: str(value) for key, value in item.attrs.items()}
        if not isinstance(item, h5py.Dataset):
            found[name] = attributes
        elif item.dtype.hasobject:
            found[name] = (attributes, item.shape, item[()].tolist())
        else:
            # bytes, so that a NaN is equal to itself and −0 is not 0
            found[name] = (attributes, item.shape, str(item.dtype), item[()].tobytes())

    with h5py.File(path) as history:
        history.visititems(enter)
    return found


def assert_identical(one, other):
    one, other = content(one), content(other)
    assert len(one) > 50
    assert sorted(one) == sorted(other)
    assert [name for name in one if one[name] != other[name]] == []


def test_a_second_run(compression, dem_run, tmp_path):
    dem_run(tmp_path, "run", SCENE, "--quiet")
    assert_identical(compression / "compression.h5", tmp_path / "compression.h5")


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_any_number_of_threads(compression, dem_run, tmp_path, threads):
    dem_run(tmp_path, "run", SCENE, "--quiet", "--threads", threads)
    assert_identical(compression / "compression.h5", tmp_path / "compression.h5")


def test_a_sample_read_back_from_its_file(compression, dem_run, tmp_path):
    dem_run(tmp_path, "run", SCENE, "--quiet", "--write-sample", "sample.csv", "-o", "packed.h5")
    sample = json.dumps({"file": {"path": str(tmp_path / "sample.csv")}})
    dem_run(tmp_path, "run", SCENE, "--quiet", "--set", f"sample={sample}", "--write-sample", "again.csv", "-o", "read.h5")
    assert (tmp_path / "sample.csv").read_bytes() == (tmp_path / "again.csv").read_bytes()
    assert_identical(compression / "compression.h5", tmp_path / "packed.h5")
    assert_identical(tmp_path / "packed.h5", tmp_path / "read.h5")


def test_other_samples_differ(compression, dem_run, tmp_path):
    """The comparison sees a difference where there is one."""
    dem_run(tmp_path, "run", SCENE, "--quiet", "--set", "seed=2", "--set", "time.end=1e-3")
    with pytest.raises(AssertionError):
        assert_identical(compression / "compression.h5", tmp_path / "compression.h5")
