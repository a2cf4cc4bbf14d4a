"""Measures how long the plant's doStep takes, step by step, in a walk of a live robot.

Times are of the call through Python's ctypes, in processor time of the thread, which is what the
step costs, and in wall time, which adds what other processes and the system take.
"""

from __future__ import annotations

import gc
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from time import perf_counter_ns, thread_time_ns
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from hexapod_cosim.controller import BodyCommand, Gains
from hexapod_cosim.controller.figure_style import PALETTE, SETTINGS, WIDTH
from hexapod_cosim.cosim.report.figures import Figures, figure_files, write_figures
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.extensions.live.recording import NO_FORCE
from hexapod_cosim.extensions.live.robot import LiveRobot
from hexapod_cosim.extensions.live.settings import Choices, control_texts
from hexapod_cosim.models import HexapodError

SHARES = (0.5, 0.99, 0.999, 0.9999)  # quantiles
EDGES = np.geomspace(1.0, 1e5, 101)  # us    of the bins
FEWEST = 1000  # steps of a measurement
FIGURE = "realtime"
CLOCKS = ("thread time", "wall time")
Micro = NDArray[np.float64]
Times = Mapping[str, Micro]  # by clock, CLOCKS, of successive steps (n,) [us]


def measure(
    scenario: Scenario,
    *,
    step: float,
    count: int,
    gains: Gains | None = None,
    progress: Callable[[float], None] | None = None,
) -> Times:
    """Walks `count` macro-steps of `step` [s] under the scenario's first command.

    gains: designed for this step; None for a control without any. Raises HexapodError, also when
    the robot does not walk to the end.
    """
    if count < FEWEST:
        raise HexapodError(
            "too few steps", got=count, expected=f"at least {FEWEST}", fix="raise --steps"
        )
    first = scenario.commands[0]
    command = BodyCommand(first.vx, first.vy, first.yaw_rate, first.height, first.roll, first.pitch)
    wanted = replace(scenario, macro_step=step)
    with LiveRobot(Choices(wanted, control_texts(wanted, ()), {}), gains=gains) as robot:
        return _measure(robot, command, count, progress)


def _measure(
    robot: LiveRobot, command: BodyCommand, count: int, progress: Callable[[float], None] | None
) -> Times:
    """Steps a robot with a clock around its plant; collections of garbage wait."""
    times = np.zeros((2, count))
    advance, number = robot.advance, 0

    def timed(t: float, h: float) -> None:
        before = perf_counter_ns(), thread_time_ns()
        advance(t, h)
        thread = thread_time_ns() - before[1]
        times[:, number] = thread, perf_counter_ns() - before[0]

    robot.advance = timed
    gc.disable()
    try:
        for number in range(count):
            robot.step(command, NO_FORCE)
            if robot.fault:
                what, expected = "the robot did not walk to the end", f"{count} macro-steps"
                fix = "measure a scenario that `hexapod simulate` completes"
                raise HexapodError(what, got=robot.fault, expected=expected, fix=fix)
            if progress is not None and number % 1000 == 0:
                progress(number * robot.h)
    finally:
        gc.enable()
    return dict(zip(CLOCKS, times / 1e3, strict=True))


def facts_of(times: Times, step: float) -> dict[str, Any]:
    """Returns the number of steps and, by clock, quantiles and the largest time [us]."""
    return {
        "step": step,
        "steps": len(times[CLOCKS[0]]),
        "times": {
            clock: {f"{100.0 * share:g} %": float(np.quantile(values, share)) for share in SHARES}
            | {"largest": float(values.max())}
            for clock, values in times.items()
        },
    }


def write(times: Times, step: float, folder: Path) -> list[Path]:
    """Writes the histogram as PNG and SVG; returns the files."""
    folder.mkdir(parents=True, exist_ok=True)
    with matplotlib.rc_context(SETTINGS):
        images = {f"{FIGURE}.{kind}": image for kind, image in figure_files(draw(times, step))}
    return write_figures(Figures(images, {}), folder)


def draw(times: Times, step: float) -> Figure:
    """Draws the histograms of both clocks beside each other."""
    figure = Figure(figsize=(WIDTH, 2.6))
    axes = figure.subplots(1, 2, sharex=True, sharey=True)
    for (clock, values), axis, colour in zip(times.items(), axes, PALETTE, strict=False):
        axis.hist(values, bins=EDGES, color=colour, histtype="stepfilled", alpha=0.5)
        axis.set(title=clock, xlabel=f"doStep({1e3 * step:g} ms) [µs]")
    axes[0].set(ylabel="steps", xscale="log", yscale="log", xlim=(2.0, 5e4))
    return figure
