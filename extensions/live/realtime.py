"""Measures how long the plant's doStep takes, step by step, in a walk of a live robot.

Times are of the call through Python's ctypes, in processor time of the thread and in wall time. The
thread's time is what the step costs; wall time adds what other processes and the system take. Every
step counts, from the first one on.
"""

from __future__ import annotations

import gc
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from time import perf_counter_ns, thread_time_ns
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from hexapod_cosim.controller import BodyCommand, Gains
from hexapod_cosim.controller.figure_style import DPI, PALETTE, SETTINGS, UNDATED, WIDTH
from hexapod_cosim.cosim.common.files import atomic_path, write_text
from hexapod_cosim.cosim.interface.names import foot_names
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.extensions.live.robot import LiveRobot
from hexapod_cosim.extensions.live.settings import Choices, control_texts
from hexapod_cosim.extensions.live.take import NO_FORCE
from hexapod_cosim.models import HexapodError

SHARES = (0.5, 0.99, 0.999, 0.9999)  # quantiles
GOAL, GOAL_SHARE = 100.0, 0.9999  # us, and the share of steps below it
WORST = 300.0  # us    goal of the slowest step
EDGES = np.geomspace(1.0, 1e5, 101)  # us    of the bins
FEWEST = 1000  # steps of a measurement
CSV, FIGURE = "realtime.csv", "realtime"
Micro = NDArray[np.float64]


@dataclass(frozen=True)
class StepTimes:
    """Times of successive steps of `step` [s] (n,) [us], and whether a foot touched down."""

    step: float
    thread: Micro
    wall: Micro
    touched: NDArray[np.bool_]

    def chosen(self) -> dict[str, dict[str, Micro]]:
        """Returns the times by clock and by kind of steps."""
        clocks = {"thread": self.thread, "wall": self.wall}
        return {
            clock: {"all steps": values, "with a touch-down": values[self.touched]}
            for clock, values in clocks.items()
        }


def measure(
    scenario: Scenario,
    *,
    step: float,
    count: int,
    gains: Gains | None = None,
    progress: Callable[[float], None] | None = None,
) -> StepTimes:
    """Walks `count` macro-steps of `step` [s] under the scenario's first command.

    gains: designed for this step; None for a control without any. Raises HexapodError, also when
    the robot does not walk to the end.
    """
    if count < FEWEST:
        raise HexapodError(
            "too few steps", got=count, expected=f"at least {FEWEST}", fix="raise --steps"
        )
    wanted = replace(scenario, macro_step=step)
    own = control_texts(wanted, ())
    with LiveRobot(Choices(wanted, own, {}), gains=gains) as robot:
        return _measure(robot, _first_command(scenario), count, progress)


def _first_command(scenario: Scenario) -> BodyCommand:
    first = scenario.commands[0]
    return BodyCommand(first.vx, first.vy, first.yaw_rate, first.height, first.roll, first.pitch)


def _measure(
    robot: LiveRobot, command: BodyCommand, count: int, progress: Callable[[float], None] | None
) -> StepTimes:
    """Steps a robot with a clock around its plant; collections of garbage wait."""
    names = robot.signals.names
    places = [names.index(name) for name in foot_names("landings")]
    thread, wall = np.zeros(count), np.zeros(count)
    touched, step = np.zeros(count, dtype=np.bool_), robot.plan.scenario.macro_step
    advance, number = robot.advance, 0

    def timed(t: float, h: float) -> None:
        before_wall, before = perf_counter_ns(), thread_time_ns()
        advance(t, h)
        after = thread_time_ns()
        wall[number], thread[number] = perf_counter_ns() - before_wall, after - before

    robot.advance = timed
    gc.disable()
    try:
        for number in range(count):
            landings = robot.signals.values[places].copy()
            robot.step(command, NO_FORCE)
            touched[number] = np.any(robot.signals.values[places] != landings)
            if robot.fault:
                raise HexapodError("the robot did not walk to the end", got=robot.fault)
            if progress is not None and number % 1000 == 0:
                progress(number * step)
    finally:
        gc.enable()
        robot.advance = advance
    return StepTimes(step, thread / 1e3, wall / 1e3, touched)


def facts_of(times: StepTimes) -> dict[str, Any]:
    """Returns counts, quantiles [us] and whether the goals are met, for people and for JSON."""
    found: dict[str, Any] = {
        "step": times.step,
        "steps": len(times.thread),
        "touch_downs": int(times.touched.sum()),
        "goal_met": goal_met(times.thread),
    }
    for clock, kinds in times.chosen().items():
        found[clock] = {kind: _quantiles(values) for kind, values in kinds.items()}
    return found


def goal_met(thread: Micro) -> bool:
    """Whether GOAL_SHARE of the steps took less than GOAL and none more than WORST [us]."""
    return bool(np.mean(thread < GOAL) >= GOAL_SHARE and np.max(thread) <= WORST)


def _quantiles(values: Micro) -> dict[str, float]:
    """Returns quantiles and the largest [us], and the number of steps above the goals."""
    if len(values) == 0:
        return {}
    found = {f"{100.0 * share:g} %": float(np.quantile(values, share)) for share in SHARES}
    return {
        **found,
        "largest": float(values.max()),
        f"above {GOAL:g} us": int(np.sum(values >= GOAL)),
        f"above {WORST:g} us": int(np.sum(values > WORST)),
    }


def table_of(facts: Mapping[str, Any]) -> tuple[list[str], list[list[str]]]:
    """Returns the heading and the rows of a table of the quantiles [us]."""
    names = list(facts["thread"]["all steps"])
    rows = [
        [f"{clock} time, {kind}", *(f"{values[name]:.0f}" for name in names)]
        for clock in ("thread", "wall")
        for kind, values in facts[clock].items()
        if values
    ]
    return ["us", *names], rows


def write(times: StepTimes, folder: Path) -> list[Path]:
    """Writes the histogram as CSV, PNG and SVG; returns the files."""
    folder.mkdir(parents=True, exist_ok=True)
    counts = {
        f"{clock}, {kind}": np.histogram(np.clip(values, EDGES[0], EDGES[-1]), EDGES)[0]
        for clock, kinds in times.chosen().items()
        for kind, values in kinds.items()
    }
    lines = [
        "from_us,to_us," + ",".join(name.replace(", ", "_").replace(" ", "_") for name in counts)
    ]
    for k, (low, high) in enumerate(pairwise(EDGES)):
        numbers = ",".join(str(column[k]) for column in counts.values())
        lines.append(f"{low:.6g},{high:.6g},{numbers}")
    files = [folder / CSV]
    write_text(files[0], "\n".join(lines) + "\n")
    with matplotlib.rc_context(SETTINGS):
        figure = draw(times)
        for kind, metadata in UNDATED.items():
            files.append(folder / f"{FIGURE}.{kind}")
            with atomic_path(files[-1]) as temporary:
                figure.savefig(temporary, format=kind, dpi=DPI, metadata=metadata)
    return files


def draw(times: StepTimes) -> Figure:
    """Draws the histograms of both clocks beside each other, with the goals."""
    figure = Figure(figsize=(WIDTH, 2.6))
    titles = {"thread": "processor time of the thread", "wall": "wall time"}
    axes = figure.subplots(1, 2, sharex=True, sharey=True)
    for axis, (clock, kinds) in zip(axes, times.chosen().items(), strict=True):
        _draw_clock(axis, kinds)
        axis.set_title(titles[clock])
        axis.set_xlabel(f"doStep({1e3 * times.step:g} ms) [µs]")
    axes[0].set_ylabel("steps")
    axes[0].legend(loc="upper right")
    return figure


def _draw_clock(axis: Axes, kinds: Mapping[str, Micro]) -> None:
    """Draws the histograms of the kinds of steps over each other."""
    edges = EDGES.tolist()
    for (kind, values), colour in zip(kinds.items(), PALETTE, strict=False):
        shown = np.clip(values, EDGES[0], EDGES[-1])
        axis.hist(shown, edges, histtype="stepfilled", alpha=0.35, color=colour, label=kind)
        axis.hist(shown, edges, histtype="step", color=colour)
    for goal in (GOAL, WORST):
        axis.axvline(goal, color="0.4", linestyle=":", linewidth=1.0)
    axis.set_xscale("log")
    axis.set_yscale("log")
    axis.set_xlim(2.0, 5e4)
