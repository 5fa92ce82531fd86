"""Histories of cohesive-dem as labelled arrays and data frames; runs from Python.

    import dem

    history = dem.run("configs/compression.json", bonds__strength=5)
    history = dem.open("compression.h5")
    history.observables()["applied_force"].sel(wall="top").plot()
    history.contacts(frame=-1).groupby("status").size()

SI units: arrays carry them in `attrs["units"]`, data frames in `attrs["units"][column]`.
"""

from .history import History
from .launch import RunFailed, run

__all__ = ["History", "RunFailed", "open", "run"]


def open(path):
    """The history at `path`, of a run that ended, goes on, or was killed."""
    return History(path)
