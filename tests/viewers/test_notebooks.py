"""The notebooks of docs/notebooks run, and print what is stored in them."""

import os
import re

import nbformat
import pytest
from conftest import PROGRAMS, ROOT
from nbclient import NotebookClient

FOLDER = ROOT / "docs/notebooks"


def texts(notebook):
    """What the cells print, and how many pictures they draw."""
    outputs = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    assert not [output for output in outputs if output.output_type == "error"]
    printed = [output.text for output in outputs if output.output_type == "stream" and output.name == "stdout"]
    return printed, sum("image/png" in output.get("data", {}) for output in outputs)


@pytest.mark.parametrize("name", ["a-run", "a-study", "an-analysis"])
def test_notebook(name, monkeypatch):
    monkeypatch.setenv("PATH", os.pathsep.join([str(PROGRAMS), os.environ["PATH"]]))
    monkeypatch.setenv("PYTHONPATH", str(ROOT / "python"))
    monkeypatch.delenv("DEM_RUN", raising=False)
    stored = nbformat.read(FOLDER / f"{name}.ipynb", as_version=4)
    fresh = nbformat.from_dict(stored)
    for cell in fresh.cells:
        if cell.cell_type == "code":
            cell.outputs = []
    NotebookClient(fresh, timeout=900, resources={"metadata": {"path": str(FOLDER)}}).execute()
    (now, pictures), (then, before) = texts(fresh), texts(stored)
    assert pictures == before > 0
    if name == "an-analysis":
        # dem-post computes the same from the same file; rounding differs from machine to machine
        (difference,) = [float(found) for text in now for found in re.findall(r"largest difference (\S+)", text)]
        assert difference < 1e-12
        now, then = ([text for text in printed if "difference" not in text] for printed in (now, then))
    if name == "a-study":
        ratios = [float(found) for text in now for found in re.findall(r"deviation.* (\S+)$", text, re.M)]
        # each sample bears a multiple of its cohesion; the samples differ
        assert max(ratios[:3]) < 1e-6 < ratios[3]
        now, then = (re.sub(r"\d+\.\d+e[-+]\d+", "", "".join(printed)) for printed in (now, then))
    assert now == then
