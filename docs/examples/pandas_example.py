import h5py
import pandas

with h5py.File("compression.h5") as history:
    events = history["events/rupture"]
    codes = h5py.check_enum_dtype(events.dtype["mode"])  # TENSION, SHEAR, ROLLING, TWIST
    ruptures = pandas.DataFrame(events[:])
ruptures["mode"] = ruptures["mode"].map({code: name for name, code in codes.items()})
modes = ruptures.groupby("mode")
print(modes.agg(bonds=("bond", "count"), first=("time", "min"), rn=("rn", "mean"), rt=("rt", "mean"), m=("m", "mean")))
