"""Measures controller calls in a co-simulation: `python -m benchmarks.control.calls`."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.controller import (
    BodyCommand,
    Controller,
    Gains,
    JointCommand,
    Measurement,
    make_gait,
)
from hexapod_cosim.cosim.design.gain_design import design_for
from hexapod_cosim.cosim.export.plant_export import export_fmu
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.master.loop import run
from hexapod_cosim.cosim.master.recorder import Recorder
from hexapod_cosim.cosim.master.signals import Signals
from hexapod_cosim.cosim.scenario.scenario import load_scenario
from hexapod_cosim.cosim.scenario.schedule import make_schedule
from hexapod_cosim.models import load_robot

SCENARIO, REPEATS = "walk_flat", 5
SHARES = {"median": 50.0, "90 %": 90.0, "99 %": 99.0, "longest": 100.0}


class Timed:
    """A controller that records the duration of its calls [s]."""

    def __init__(self, controller: Controller) -> None:
        self._controller, self.times = controller, list[float]()

    def step(self, t: float, command: BodyCommand, measurement: Measurement) -> JointCommand:
        """Calls the controller and measures the time."""
        begin = perf_counter()
        joints = self._controller.step(t, command, measurement)
        self.times.append(perf_counter() - begin)
        return joints


def call_times(fmu: Path, gains: Gains | None) -> NDArray[np.float64]:
    """Returns the time of every call in a walk (steps,) [us].

    Each is the least of some walks, because other programs only lengthen it.
    """
    scenario = load_scenario(SCENARIO)
    robot, schedule = load_robot(scenario.robot), make_schedule(scenario)
    walks = []
    for _ in range(REPEATS):
        controller = Timed(
            Controller(robot, period=scenario.macro_step, gait=make_gait(robot), gains=gains)
        )
        with Fmu(fmu) as plant:
            plant.initialise(0.0, scenario.duration)
            signals = Signals(plant)
            run(
                plant,
                signals,
                controller,
                schedule,
                Recorder(signals, schedule.times, schedule.rows),
                h=scenario.macro_step,
            )
        walks.append(controller.times)
    return np.asarray(1e6 * np.min(walks, axis=0))


def main() -> None:
    """Prints mean and percentiles under both controls."""
    robot = load_robot(load_scenario(SCENARIO).robot)
    with TemporaryDirectory(prefix="hexapod-bench-") as folder:
        fmu = export_fmu(robot, Path(folder) / "robot.fmu")
        for control, gains in (
            ("kinematic", None),
            ("compliant", design_for(robot, load_scenario(SCENARIO).macro_step)),
        ):
            times = call_times(fmu, gains)
            shown = ", ".join(
                f"{name} {np.percentile(times, share):.0f}" for name, share in SHARES.items()
            )
            print(f"{control}: mean {times.mean():.0f} us, {shown}")


if __name__ == "__main__":
    main()
