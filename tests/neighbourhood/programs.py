"""Where `dem-run` is, and a run of it on a scene."""

import json
import os
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def dem_run():
    """The path of `dem-run`: in the folder that DEM_PROGRAMS names, else where cargo builds it."""
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    path = Path(os.environ.get("DEM_PROGRAMS", target / "release")) / "dem-run"
    if not path.exists():
        raise SystemExit(f"{path} is not there: cargo build --release -p dem-run")
    return path


def run(scene, folder, name="run", text=False):
    """Runs a scene (a dictionary) in `folder`: the history's path, the summary from --json, its
    text if asked for."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{name}.json").write_text(json.dumps(scene, indent=1))
    command = [dem_run(), "run", f"{name}.json", "-o", f"{name}.h5", "--force", "--quiet", "--threads", "1"]
    call = lambda *more: subprocess.run(
        command + list(more), cwd=folder, check=True, capture_output=True, text=True
    )
    # the second run makes the same history again, to the bit but for its clock
    printed = call().stdout if text else None
    told = json.loads(call("--json").stdout)
    return folder / f"{name}.h5", told, printed
