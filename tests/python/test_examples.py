"""The examples of docs/examples, which docs/history.md shows, work as described on a real
history."""

import subprocess
import sys

import h5py
import pytest
from conftest import ROOT

EXAMPLES = sorted((ROOT / "docs/examples").glob("*.py"))


def run(example, folder):
    answer = subprocess.run([sys.executable, ROOT / "docs/examples" / example], cwd=folder, stdout=subprocess.PIPE, text=True)
    assert answer.returncode == 0
    return answer.stdout.splitlines()


def test_the_h5py_example(compression):
    with h5py.File(compression / "compression.h5") as history:
        frames = int(history["commit"][()])
        # bonds broken in the frames that the example shows, from the events instead of the states
        shown = history["particles/grains/position/step"][:][range(0, frames, 20)]
        broken = [(history["events/rupture"]["step"] <= step).sum() for step in shown]
    lines = run("h5py_example.py", compression)
    assert lines[0].startswith("t = ") and "grain 0 at [" in lines[0]
    assert [int(line.split()[4]) for line in lines[1:]] == broken
    assert broken[0] == 0 < broken[-1]


def test_the_pandas_example(compression):
    with h5py.File(compression / "compression.h5") as history:
        ruptures = history["events/rupture"].size
    lines = run("pandas_example.py", compression)
    table = {line.split()[0]: line.split()[1:] for line in lines[2:]}
    assert set(table) <= {"TENSION", "SHEAR", "ROLLING", "TWIST"}
    assert sum(int(row[0]) for row in table.values()) == ruptures > 0


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.name)
def test_the_page_shows_the_example_as_it_is(example):
    text = example.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 12
    assert f"```python\n{text}```" in (ROOT / "docs/history.md").read_text(encoding="utf-8")
