"""Draws the figures of docs/control/paper.md: the front of slip against energy, and the feet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from hexapod_cosim.controller import LegSolver
from hexapod_cosim.controller.figure_style import DPI, PALETTE, SETTINGS, UNDATED
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.run.walker import Walker
from hexapod_cosim.cosim.scenario.scenario import load_scenario
from hexapod_cosim.models import LEG_NAMES, load_robot

LEG = "LM"
CYCLE = (6.0, 7.0)  # s    one gait cycle of the flat walk, after the first ones
SCALE = 10.0  # 1    by which deviations are drawn larger
CONTROLS = ("kinematic", "paper")


def draw_front(
    path: Path,
    found: Mapping[str, Sequence[Mapping[str, float]]],
    shares: Sequence[float],
    default: float,
) -> None:
    """Draws slip over electrical cost with the share along each curve; the default is marked."""
    with rc_context(SETTINGS):
        figure = Figure(figsize=(8.0, 3.4), layout="constrained")
        for axes, law in zip(figure.subplots(1, 2, sharey=True), ("tanh", "bristle"), strict=True):
            for colour, (name, values) in zip(
                PALETTE, ((n, v) for n, v in found.items() if n.endswith(law)), strict=False
            ):
                cost = [one["electrical_cost"] for one in values]
                slip = [1e3 * one["slip_per_metre"] for one in values]
                axes.plot(cost, slip, "o-", color=colour, ms=3, label=name.split(",")[0])
                points = dict(
                    reversed(list(zip(zip(cost, slip, strict=True), shares, strict=True)))
                )
                for (x, y), share in points.items():
                    axes.annotate(f"{share:g}", (x, y), xytext=(3, 3), textcoords="offset points")
                at = list(shares).index(default)
                axes.plot(cost[at], slip[at], "o", color=colour, ms=9, mfc="none")
            axes.set(title=f"friction law {law}", xlabel="electrical cost [1]", ylim=(0.0, None))
            axes.legend()
        figure.axes[0].set_ylabel("slip [mm/m]")
        figure.savefig(path, dpi=DPI, metadata=UNDATED["svg"])


def draw_feet(path: Path) -> None:
    """Draws where a foot should be and where it is in one gait cycle, under both controls."""
    with rc_context(SETTINGS):
        figure = Figure(figsize=(8.0, 4.6), layout="constrained")
        grid = figure.subplots(2, 2, sharex="row", sharey="row")
        with Walker(everything=True) as walker:
            for column, control in zip(grid.T, CONTROLS, strict=True):
                plan = load_scenario(
                    "walk_flat", overrides=[f"control={control}", "walk.stance=own"]
                )
                _draw_foot(column, walker.simulate(plan).outcome.recording, control)
        grid[0, 0].legend(loc="upper right")
        figure.savefig(path, dpi=DPI, metadata=UNDATED["svg"])


def _draw_foot(column: Sequence[Any], recording: Recording, control: str) -> None:
    """Draws planned and real foot: height over way, and the deviation over time."""
    number = LEG_NAMES.index(LEG)
    chosen = (recording.time >= CYCLE[0]) & (recording.time <= CYCLE[1])
    time = recording.time[chosen] - CYCLE[0]
    angle = recording.joints("angle")[chosen].reshape(-1, 6, 3)
    real = LegSolver(load_robot("athena")).forward(angle)[:, number]
    planned = recording.vector(f"controller.{LEG}.planned")[chosen]
    off = 1e3 * (real - planned)
    path, error = column
    drawn = 1e3 * planned + SCALE * off
    path.plot(1e3 * planned[:, 0], 1e3 * planned[:, 2], color="0.6", lw=3, label="planned")
    path.plot(drawn[:, 0], drawn[:, 2], color=PALETTE[3], label=f"real, deviation x {SCALE:g}")
    path.set(title=f"{control}: foot {LEG} from the side", xlabel="x [mm], torso frame")
    path.set_ylabel("z [mm]")
    stance = ~recording.column(f"controller.{LEG}.swinging")[chosen].astype(bool)
    for axis, name in enumerate("xyz"):
        error.plot(time, off[:, axis], color=PALETTE[axis], lw=1.0, label=name)
    error.fill_between(time, -6, 6, where=stance, color="0.92", zorder=0, label="stance")
    error.set(xlabel="time in the cycle [s]", ylabel="real - planned [mm]")
    error.set_ylim(-6.0, 6.0)
    error.legend(ncols=4, loc="lower right")
    rms = float(np.sqrt((off[stance] ** 2).sum(axis=1).mean()))
    error.set_title(f"{rms:.1f} mm RMS in stance")
