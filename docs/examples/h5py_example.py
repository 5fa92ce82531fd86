import h5py

with h5py.File("compression.h5") as history:
    position = history["particles/grains/position"]
    print(f"t = {position['time'][-1]:.4f} s: grain 0 at {position['value'][-1, 0]} m")
    status = history["bonds/status"]
    codes = h5py.check_enum_dtype(status["value"].dtype)  # INTACT, TENSION, SHEAR, ROLLING, TWIST
    broken = (status["value"][:] != codes["INTACT"]).sum(axis=1)
    for frame in range(0, len(broken), 20):
        print(f"t = {status['time'][frame]:.4f} s: {broken[frame]} bonds broken")
