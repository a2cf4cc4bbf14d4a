"""Runs trials with many instances, threads and steps.

Each trial prints its figures and exits with 1 if they are bad.

usage: PYTHONPATH=tests/support python tests/fmi/endurance.py LIBRARY [TRIAL COUNT]

Without a trial all of them run at full length, as in `make test-endurance`. test_endurance.py runs
short ones, each in its own process.
"""

from __future__ import annotations

import ctypes
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from fmi_plant import ATHENA, GUID, LAST_SUCCESSFUL_TIME, OK, Plant
from memory import resident

from hexapod_cosim.cosim.export.start_values import start_values

H = 0.005  # s
ALLOWED_GROWTH = 1_000_000  # bytes, half a percent of the memory of 10,000 instances
WARM_UP = 100  # first calls, in which the allocator and Python reserve memory
MAPS, OPEN_FILES = Path("/proc/self/maps"), Path("/proc/self/fd")

Figures = dict[str, float]


def open_files() -> int:
    return len(os.listdir(OPEN_FILES)) if OPEN_FILES.exists() else 0


def growth(action: Callable[[], object], count: int) -> Figures:
    """Repeats an action; returns the memory and open files that it leaks and the time of one
    repetition.
    """
    for _ in range(WARM_UP):
        action()
    memory, files, begin = resident(), open_files(), time.perf_counter()
    for _ in range(count):
        action()
    seconds = time.perf_counter() - begin
    figures = {
        "count": count,
        "growth_bytes": resident() - memory,
        "growth_files": open_files() - files,
        "each_us": 1e6 * seconds / count,
    }
    assert figures["growth_bytes"] < ALLOWED_GROWTH, figures
    assert figures["growth_files"] == 0, figures
    return figures


def instances(library: Path, count: int) -> Figures:
    """Creates, initializes, steps, saves and frees instances without fmi2Terminate, and instances
    with a wrong GUID.
    """
    with tempfile.TemporaryDirectory() as folder:
        resources = Path(folder)
        (resources / "start_values.txt").write_text(start_values(ATHENA, GUID), encoding="utf-8")

        def live() -> None:
            with Plant(library, resources=resources.as_uri()) as plant:
                assert plant.initialize().step(0.0, H) == OK
                plant.free(plant.save())
            with Plant(library, guid="{another}", resources=resources.as_uri()) as refused:
                assert refused.component is None

        return growth(live, count)


def trace(plant: Plant, seed: int, first: int, last: int) -> list[list[float]]:
    """Returns all variables after each step under inputs of this instance."""
    rows = []
    for k in range(first, last):
        assert (
            plant.set_reals(
                {
                    "torso.push_force[1]": 0.1 * seed + k % 5,
                    "RM.femur.angle_ref": 0.4 + 0.001 * (seed * k % 70),
                }
            )
            == OK
        )
        assert plant.step(k * H, H) == OK
        rows.append(plant.everything())
    return rows


def threads(library: Path, count: int) -> Figures:
    """Steps 64 instances from 2 threads in turns; the results must equal those of single instances
    bit for bit.
    """
    plants = [Plant(library, name=f"plant {k}").initialize() for k in range(64)]
    together: list[list[list[float]]] = [[] for _ in plants]
    with ThreadPoolExecutor(2) as pool:
        for k in range(count):  # a free thread takes the next instance, so instances change threads
            for seed, rows in enumerate(
                pool.map(lambda seed, k=k: trace(plants[seed], seed, k, k + 1), range(len(plants)))
            ):
                together[seed] += rows
    for seed, rows in enumerate(together):
        with Plant(library) as alone:
            assert trace(alone.initialize(), seed, 0, count) == rows, f"instance {seed}"
    for plant in plants:
        plant.__exit__(None, None, None)
    return {"instances": len(plants), "steps": count}


def clock(library: Path, count: int) -> Figures:
    """Steps by 1/60 s with the clock of a master that sums up time.

    The FMU must follow this clock to the last bit until the stop time.
    """
    size, now, reached = 1.0 / 60.0, 0.0, ctypes.c_double()
    with Plant(library) as plant:
        assert plant.call("fmi2SetupExperiment", 0, 0.0, 0.0, 1, count * size) == OK
        assert plant.call("fmi2EnterInitializationMode") == OK
        assert plant.call("fmi2ExitInitializationMode") == OK
        height, begin = plant.real("torso.position[3]"), time.perf_counter()
        step = plant._library.fmi2DoStep
        step.argtypes = [ctypes.c_void_p, ctypes.c_double, ctypes.c_double, ctypes.c_int]
        for k in range(count):
            assert step(plant.component, now, size, 1) == OK, (k, plant.last_message)
            now += size
        seconds = time.perf_counter() - begin
        assert plant.call("fmi2GetRealStatus", LAST_SUCCESSFUL_TIME, ctypes.byref(reached)) == OK
        assert reached.value == now
        sunk = abs(plant.real("torso.position[3]") - height)
    assert sunk < 1e-9, sunk  # m, the robot has not moved
    return {
        "steps": count,
        "off_by_s": now - count * size,
        "each_us": 1e6 * seconds / count,
        "sunk_m": sunk,
    }


TRIALS: dict[str, tuple[Callable[[Path, int], Figures], int]] = {
    "instances": (instances, 10_000),
    "threads": (threads, 100),
    "clock": (clock, 1_000_000),
}


def main(arguments: list[str]) -> int:
    """Runs one trial, or all at full length, each in its own process."""
    library = arguments[0]
    if len(arguments) == 1:
        trials = (
            [sys.executable, __file__, library, name, str(count)]
            for name, (_, count) in TRIALS.items()
        )
        return max(subprocess.run(trial, check=False).returncode != 0 for trial in trials)
    name, count = arguments[1], int(arguments[2])
    print(name, json.dumps(TRIALS[name][0](Path(library), count)), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
