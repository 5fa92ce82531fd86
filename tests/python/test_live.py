"""A reader of a file that is being written never sees an error, or a row that is not complete."""

import subprocess

import h5py
import numpy
from conftest import ROOT


def test_a_live_reader_polls_a_thousand_times(programs, tmp_path):
    arguments = [ROOT / "configs/column.json", "-o", "live.h5", "--quiet", "--set", "time.end=1e4"]
    arguments += ["--set", "output.every_steps=3"]
    run = subprocess.Popen([programs["dem-run"], "run", *map(str, arguments)], cwd=tmp_path)
    try:
        polls, seen, file = 0, [], None
        while polls < 1000:
            if file is None:
                if not (tmp_path / "live.h5").exists():
                    continue
                file = h5py.File(tmp_path / "live.h5", "r", swmr=True)
            # a fresh reader every so often, as a person starts one
            if polls % 100 == 99:
                file.close()
                file = h5py.File(tmp_path / "live.h5", "r", swmr=True)
            polls += 1
            commit, position = file["commit"], file["particles/grains/position"]
            commit.refresh()
            frames = int(commit[()])
            seen.append(frames)
            if frames == 0:
                continue
            tables = [position["step"], position["time"], position["value"], file["contacts/count"], file["contacts/start"]]
            tables += [file["contacts/pair"], file["contacts/reaction"], file["commit_rows/contacts"]]
            tables += [file["commit_rows/steps"], file["observables/step"], file["observables/kinetic_energy/value"]]
            for table in tables:
                table.refresh()
            last = frames - 1
            # every promised row is there, and none is left at its fill value
            assert position["step"][last] == 3 * last
            assert last == 0 or position["time"][last] > position["time"][last - 1]
            assert numpy.all(position["value"][last][:, 1] > 0)
            rows, steps = int(file["commit_rows/contacts"][last]), int(file["commit_rows/steps"][last])
            start, count = int(file["contacts/start"][last]), int(file["contacts/count"][last])
            assert start + count == rows <= file["contacts/pair"].shape[0]
            pairs = file["contacts/pair"][start : start + count]
            assert numpy.all(pairs[:, 0] != pairs[:, 1])
            assert steps == 3 * last
            observed = file["observables/step"][:steps]
            assert numpy.array_equal(observed, numpy.arange(1, steps + 1))
        file.close()
        assert run.poll() is None, "the run ended before the reader"
        assert seen == sorted(seen) and len(set(seen)) > 20
    finally:
        run.kill()
        run.wait()
