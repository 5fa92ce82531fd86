"""The summaries of `compression` that the pages show are what the run prints."""

import pytest
from conftest import ROOT


@pytest.mark.parametrize("page", ["README.md", "docs/running.md"])
def test_a_page_shows_the_summary_of_the_run(compression, page):
    printed = (compression / "summary.txt").read_text(encoding="utf-8").splitlines()
    blocks = (ROOT / page).read_text(encoding="utf-8").split("```")[1::2]
    [shown] = [block.splitlines()[1:] for block in blocks if "\nfirst break " in block]
    # the time depends on the machine
    shown = [line for line in shown if not line.startswith("CPU time")]
    assert len(shown) >= 5 and [line for line in shown if line not in printed] == []
