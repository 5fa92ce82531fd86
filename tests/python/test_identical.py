"""Equal bits: a second run, another number of threads, a sample read back from its file."""

import json
import os
from concurrent.futures import ThreadPoolExecutor

import h5py
import pytest
from conftest import ROOT

SCENE = ROOT / "configs/compression.json"


def content(path):
    """Every object of a history with its bytes and attributes, except data about host and clock."""
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


@pytest.fixture(scope="module")
def runs(compression, dem_run, tmp_path_factory):
    """The same run over and over, as many at a time as there are cores: by name, its folder with
    compression.h5."""
    folders = {name: tmp_path_factory.mktemp("run") for name in ["packed", "second", "1", "2", "3", "read"]}

    def again(name, *options):
        dem_run(folders[name], "run", SCENE, "--quiet", *options)

    def packed_and_read():
        again("packed", "--write-sample", "sample.csv")
        sample = json.dumps({"file": {"path": str(folders["packed"] / "sample.csv")}})
        again("read", "--set", f"sample={sample}", "--write-sample", "sample.csv")

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        waiting = [pool.submit(packed_and_read), pool.submit(again, "second")]
        waiting += [pool.submit(again, threads, "--threads", threads) for threads in ["1", "2", "3"]]
        for one in waiting:
            one.result()
    return folders


@pytest.mark.parametrize("other", ["second", "1", "2", "3", "packed", "read"])
def test_a_run_is_the_same_again(compression, runs, other):
    """Run once more, with any number of threads, writing its sample, and with that sample read
    back."""
    assert_identical(compression / "compression.h5", runs[other] / "compression.h5")


def test_a_sample_read_back_is_the_sample(runs):
    assert (runs["packed"] / "sample.csv").read_bytes() == (runs["read"] / "sample.csv").read_bytes()


def test_other_samples_differ(compression, dem_run, tmp_path):
    """The comparison sees a difference where there is one."""
    dem_run(tmp_path, "run", SCENE, "--quiet", "--set", "seed=2", "--set", "time.end=1e-3")
    with pytest.raises(AssertionError):
        assert_identical(compression / "compression.h5", tmp_path / "compression.h5")
