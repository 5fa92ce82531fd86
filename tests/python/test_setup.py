"""`scripts/setup` says what is missing before it installs anything."""

import os
import subprocess

import pytest
from conftest import ROOT


@pytest.fixture
def setup(tmp_path):
    """Runs the script with a cargo of this version, and nothing that could install."""

    def run(version):
        for name in ("bash", "sed", "sort", "head", "dirname", "env", "python3", "cc", "valgrind"):
            (tmp_path / name).unlink(missing_ok=True)
            (tmp_path / name).symlink_to(f"/usr/bin/{name}")
        if version:
            (tmp_path / "cargo").write_text(f"#!/bin/sh\necho 'cargo {version} (5ffbef321 2026-03-01)'\n")
            (tmp_path / "cargo").chmod(0o755)
        environment = {"PATH": str(tmp_path), "HDF5_DIR": "/"} | {"HOME": os.environ.get("HOME", "/")}
        return subprocess.run(["/bin/bash", ROOT / "scripts/setup"], env=environment, capture_output=True, text=True)

    return run


def required():
    lines = (ROOT / "Cargo.toml").read_text().splitlines()
    return next(line.split('"')[1] for line in lines if line.startswith("rust-version"))


@pytest.mark.parametrize("version", ["1.63.0", "1.9.0", "0.90.1"])
def test_an_old_rust_is_refused_before_the_build(setup, version):
    told = setup(version)
    assert told.returncode == 1
    assert f"cargo is of Rust {version}: install Rust {required()} or newer" in told.stderr


def test_no_rust_is_refused(setup):
    told = setup(None)
    assert told.returncode == 1 and f"there is no cargo: install Rust {required()} or newer" in told.stderr


@pytest.mark.parametrize("version", ["1.90.0", "1.100.0", "2.0.0-nightly"])
def test_a_new_rust_is_taken(setup, version):
    # the next thing that is missing
    assert "missing: pkg-config" in setup(version).stderr
