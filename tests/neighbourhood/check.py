#!/usr/bin/env python3
"""Checks a history with a frame at every step against the theory, independently of the program that
wrote it.

    check.py run.h5 [--summary run.json] [--text run.txt]

`run.json` is what `dem-run run --json` printed, `run.txt` what it prints without. Exit code: 0 right, 1
wrong, 2 unfit.
"""

import argparse
import json
import sys
from pathlib import Path

import numpy as np

import balance
import geometry
import laws
import materials
import membrane
import motion
import next_event
import rupture
import summary
import tolerances
from history import History, Unfit
from report import Report


def check(path, told=None, text=None):
    """The report on the history at `path`, on its summary `told` (a dictionary) and on the
    summary's text."""
    h, report = History(path), Report()
    report.figures["steps"] = h.S
    if h.S == 0:
        return report
    check_finite(h, report)
    if report.wrong:
        return report
    residual = h.observed["solver_residual"]
    report.figures["steps in parts, not checked as one solve"] = int((~h.single).sum())
    report.figures["steps that missed the tolerance"] = int((residual > h.scene["solver"]["tolerance"]).sum())
    contacts = geometry.Contacts(h)
    solved = laws.Solved(h, contacts)
    materials.check(h, report)
    membrane.check(h, report)
    if h.quasi_static:
        next_event.check(h, contacts, solved, report)
        if told is not None:
            summary.check(h, report, told, text)
        return report
    motion.check(h, report)
    geometry.check(h, contacts, report)
    geometry.check_left_out(h, contacts, report)
    geometry.check_crossing(h, report)
    laws.check(h, contacts, solved, report)
    rupture.check(h, contacts, solved, report)
    balance.check(h, contacts, solved, report)
    if told is not None:
        summary.check(h, report, told, text)
    return report


def check_finite(h, report):
    """Every number is finite."""
    arrays = {
        "positions": h.x,
        "velocities": h.v,
        "spins": h.w,
        "walls": h.X,
        "reactions": h.force,
        "moments": h.moment,
    }
    arrays |= {"gaps": h.gap, "points": h.point, "normals": h.normal, **h.observed}
    # NaN in a step in which no solve reports a load error
    error = h.observed["solver_load_error"]
    arrays["solver_load_error"] = error[~np.isnan(error)]
    for name, array in arrays.items():
        report.require("finite numbers", bool(np.isfinite(array).all()), f"{name} hold what is not finite")


def main():
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("history", type=Path)
    parser.add_argument("--summary", type=Path)
    parser.add_argument("--text", type=Path)
    parser.add_argument("--tolerances", action="store_true", help="print the tolerances too")
    arguments = parser.parse_args()
    told = json.loads(arguments.summary.read_text()) if arguments.summary else None
    try:
        report = check(arguments.history, told, arguments.text.read_text() if arguments.text else None)
    except Unfit as reason:
        sys.exit(f"{arguments.history}: {reason}")
    if arguments.tolerances:
        print("\n".join(tolerances.lines()), "\n", sep="")
    print("\n".join(report.lines()))
    sys.exit(1 if report.wrong else 0)


if __name__ == "__main__":
    main()
