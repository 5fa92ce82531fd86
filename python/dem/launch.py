"""Runs of scenes by `dem-run`."""

import json
import os
import shutil
import signal
import subprocess
import tempfile
import warnings
from pathlib import Path

from .history import History


# fields of a scene that are paths
PATHS = ("sample.file.path", "bonds.list")


class RunFailed(RuntimeError):
    """`dem-run` ended with an error: its message, and its exit code in `code`."""

    def __init__(self, code, message):
        super().__init__(message)
        self.code = code


def run(scene, output=None, *, force=False, threads=None, program=None, **sets):
    """Runs a scene and returns its history, with what the run printed at its end in `summary`.

    `scene` is a file, or a dict; a dict needs `output`, and the paths of its sample file and of its
    list of bonds start in the current folder. `output` is the history to write, by default the name
    of the scene with .h5 in the current folder; with `force`, one that exists is replaced. Other
    arguments set fields of the scene, with two underscores for a full stop: `bonds__strength=5`;
    also as `**{"bonds.strength": 5}`. None is JSON's null. `program` is `dem-run` by its path, by
    default that in the environment variable DEM_RUN, else that on PATH.

    Raises RunFailed if the scene is wrong, a step does not converge, or a file cannot be written.
    After Ctrl-C the run ends with the current step; its history is closed, and `dem-run resume` goes on.
    """
    command = [_program(program), "run", "--json", "--progress", "none"]
    sets = {name.replace("__", "."): value for name, value in sets.items()}
    if isinstance(scene, dict):
        sets = {name: _absolute(value, name.split(".")) for name, value in sets.items()}
    for name, value in sets.items():
        command += ["--set", f"{name}={_json(value)}"]
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
        file.write_text(_json(_absolute(scene)), encoding="utf-8")
        return _run(command, str(file), os.fspath(output))


def _run(command, scene, output):
    # in a session of its own: Ctrl-C in a terminal reaches Python alone, which passes it on
    with subprocess.Popen(
        [*command, "-o", output, "--", scene],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        encoding="utf-8",
        errors="replace",
        start_new_session=True,
    ) as program:
        try:
            printed, told = program.communicate()
        except KeyboardInterrupt:
            program.send_signal(signal.SIGINT)
            program.communicate()
            raise
    if program.returncode != 0:
        message = told.strip().removeprefix("error: ").replace("--force", "force=True")
        raise RunFailed(program.returncode, message)
    for line in told.splitlines():
        if line.startswith("warning: "):
            warnings.warn(line.removeprefix("warning: "), stacklevel=3)
    history = History(output)
    history.summary = json.loads(printed)
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


def _json(value):
    """JSON of a value; numbers and arrays of numpy are those of Python."""
    return json.dumps(value, allow_nan=False, default=_plain)


def _plain(value):
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"a {type(value).__name__} cannot be a value of a scene: {value!r}")


def _absolute(value, place=()):
    """The value of the field of a scene at `place`, or a scene, with paths that do not depend on its
    folder."""
    for path in PATHS:
        names = path.split(".")
        if names[: len(place)] == list(place):
            value = _with_absolute(value, names[len(place) :])
    return value


def _with_absolute(value, place):
    """`value` with an absolute path at `place`, where there is a path."""
    if not place:
        return os.path.abspath(value) if isinstance(value, str) else value
    if not isinstance(value, dict) or place[0] not in value:
        return value
    return {**value, place[0]: _with_absolute(value[place[0]], place[1:])}
