"""docs/tutorial.md, done word for word in an empty folder: its commands work, what it quotes is
what they print, and the files that it names are there. It takes about a minute of CPU."""

import os
import re
import subprocess

import pytest
from conftest import ROOT

PAGE = (ROOT / "docs/tutorial.md").read_text(encoding="utf-8")
# the language of each fenced block, and its text
BLOCKS = re.findall(r"^```(\w+)\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)
# files in the results of a command, as in `seven-post/chains.png`
FILES = sorted(set(re.findall(r"`([\w-]+-(?:post|strength|sweep)/[\w./-]+)`", PAGE)))


@pytest.fixture(scope="module")
def done(programs, tmp_path_factory):
    """The folder of the tutorial, and each quoted line with what the commands before it printed."""
    folder = tmp_path_factory.mktemp("tutorial")
    path = f"{programs['dem-run'].parent}{os.pathsep}{os.environ['PATH']}"
    printed, quoted = "", []
    for language, text in BLOCKS:
        if language == "sh":
            command = ["bash", "-euo", "pipefail", "-c", text]
            answer = subprocess.run(
                command, cwd=folder, env=os.environ | {"PATH": path}, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
            )
            assert answer.returncode == 0, f"{text}\n{answer.stdout}"
            printed = answer.stdout
        else:
            quoted += [(line, printed) for line in text.splitlines()]
    return folder, quoted


def test_what_it_quotes_is_printed(done):
    _, quoted = done
    assert len(quoted) > 8
    for line, printed in quoted:
        words = " ".join(line.split())
        assert any(words in " ".join(found.split()) for found in printed.splitlines()), f"{line}\nin\n{printed}"


def test_the_files_that_it_names_are_there(done):
    folder, _ = done
    assert len(FILES) > 5
    assert [file for file in FILES if not (folder / file).exists()] == []


def test_seven_grains_break_where_the_pencil_says(done):
    """The closed form of the page: bonds at 60°, in shear, without a horizontal bond."""
    _, quoted = done
    friction, strength = 0.3, 10
    normal = friction * strength / (3**-0.5 - friction)
    load = 4 * (normal * 3**0.5 / 2 + normal * 3**-0.5 / 2)
    seven = [line for line, printed in quoted if re.search("^sample +7 grains", printed, re.MULTILINE)]
    [first] = [line for line in seven if line.startswith("first break")]
    # the load grows by 0.02 N a step
    assert load <= float(first.split()[2]) <= load + 0.02 and f"{load:.2f} N" in PAGE and f"{normal:.2f} N" in PAGE
