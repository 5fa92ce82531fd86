"""The programs as a user builds them, and one compression that several tests read."""

import json
import os
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def built(*what):
    """Builds in release: the paths of the programs by their names."""
    build = [os.environ.get("CARGO", "cargo"), "build", "--release", "--locked", *what]
    output = subprocess.run(
        build + ["--message-format=json-render-diagnostics"], cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True
    ).stdout
    artifacts = [json.loads(line) for line in output.splitlines()]
    return {a["target"]["name"]: a["executable"] for a in artifacts if a.get("executable")}


@pytest.fixture(scope="session")
def programs():
    """The paths of `dem-run` and `dem-post`: `scripts/test` says where they are, or they are
    built."""
    if "DEM_PROGRAMS" in os.environ:
        return {name: Path(os.environ["DEM_PROGRAMS"]) / name for name in ("dem-run", "dem-post")}
    return built("-p", "dem-run", "-p", "dem-post")


def runner(program):
    def run(folder, *arguments):
        command = [program, *map(str, arguments)]
        return subprocess.run(command, cwd=folder, check=True, stdout=subprocess.PIPE, encoding="utf-8").stdout

    return run


@pytest.fixture(scope="session")
def dem_run(programs):
    """Runs `dem-run` with these arguments in a folder."""
    return runner(programs["dem-run"])


@pytest.fixture(scope="session")
def dem_post(programs):
    """Runs `dem-post` with these arguments in a folder."""
    return runner(programs["dem-post"])


@pytest.fixture(scope="session")
def compression(dem_run, tmp_path_factory):
    """The folder of compression.h5, made as README says, and of summary.txt, which that prints."""
    folder = tmp_path_factory.mktemp("compression")
    told = dem_run(folder, "run", ROOT / "configs/compression.json", "--quiet")
    (folder / "summary.txt").write_text(told, encoding="utf-8")
    return folder
