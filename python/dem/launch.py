"""Runs of scenes by `dem-run`."""

import json
import os
import shutil
import subprocess
import tempfile
import warnings
from pathlib import Path

from .history import History


class RunFailed(RuntimeError):
    """`dem-run` ended with an error: its message, and its exit code in `code`."""

    def __init__(self, code, message):
        super().__init__(message)
        self.code = code


def run(scene, output=None, *, force=False, threads=None, program=None, **sets):
    """Runs a scene and returns its history, with what the run printed at its end in `summary`.

    `scene` is a file, or a dict; a dict needs `output`, and the path of its sample file starts in
    the current folder. `output` is the history to write, by default the name of the scene with .h5
    in the current folder; with `force`, one that exists is replaced. Other arguments set fields of
    the scene, with two underscores for a full stop: `bonds__strength=5`; also as
    `**{"bonds.strength": 5}`. None is JSON's null. `program` is `dem-run` by its path, by default
    that in the environment variable DEM_RUN, else that on PATH.

    Raises RunFailed if the scene is wrong, a step does not converge, or a file cannot be written.
    """
    command = [_program(program), "run", "--json", "--progress", "none"]
    for name, value in sets.items():
        text = json.dumps(value, allow_nan=False)
        command += ["--set", f"{name.replace('__', '.')}={text}"]
    if force:
        command.append("--force")
    if threads is not None:
        command += ["--threads", str(threads)]
    if not isinstance(scene, dict):
        output = Path(scene).with_suffix(".h5").name if output is None else os.fspath(output)
        return _run(command, os.fspath(scene), output)
    if output is None:
        raise TypeError("run() of a dict needs output, the history to write")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "scene.json"
        file.write_text(json.dumps(_absolute(scene), allow_nan=False), encoding="utf-8")
        return _run(command, str(file), os.fspath(output))


def _run(command, scene, output):
    done = subprocess.run([*command, "-o", output, "--", scene], capture_output=True, encoding="utf-8", errors="replace")
    if done.returncode != 0:
        raise RunFailed(done.returncode, done.stderr.strip().removeprefix("error: "))
    for line in done.stderr.splitlines():
        if line.startswith("warning: "):
            warnings.warn(line.removeprefix("warning: "), stacklevel=3)
    history = History(output)
    history.summary = json.loads(done.stdout)
    return history


def _program(program):
    named = program or os.environ.get("DEM_RUN") or "dem-run"
    found = shutil.which(named)
    if found is None:
        raise FileNotFoundError(
            f"there is no program {named}: install it with `cargo install --path dem-run`, or name it with "
            "program=… or the environment variable DEM_RUN"
        )
    return found


def _absolute(scene):
    """The scene with a path of its sample file that does not depend on the folder of the scene."""
    file = scene.get("sample", {}).get("file") if isinstance(scene.get("sample"), dict) else None
    if not isinstance(file, dict) or "path" not in file:
        return scene
    return {**scene, "sample": {"file": {**file, "path": os.path.abspath(file["path"])}}}
