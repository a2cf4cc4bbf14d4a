"""Figures of a design: the step response of the closed loops and their Bode diagrams with the margins."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import control
import numpy as np

from hexapod_cosim.controller.design.loops import frequencies, response
from hexapod_cosim.controller.design.synthesis import NOMINAL, normal_loops, tangential_loops
from hexapod_cosim.controller.gains import Gains, GainsError
from hexapod_cosim.controller.kinematics import Array
from hexapod_cosim.models import Robot, load_robot

STEP_TIME = 0.5  # s    shown of a step response
NOMINAL_LOAD = 2  # index of a third of the weight in synthesis.LOADS


def plot_design(gains: Gains, directory: str | Path, *, robot: Robot | None = None) -> list[Path]:
    """Writes `slip_bode`, `slip_step`, `suspension_bode` and `suspension_step` as SVG and PNG; returns the paths.

    `robot` is the one the gains were designed for; by default the packaged robot of that name. Raises GainsError when its hash
    is another, or when the figures cannot be written.
    """
    owner = load_robot(gains.robot) if robot is None else robot
    if owner.hash != gains.robot_hash:
        fix = "pass the robot they were designed for"
        raise GainsError("not the robot of these gains", got=owner.hash[:12], expected=gains.robot_hash[:12], fix=fix)
    delay = gains.requirements.delay_periods
    loops = {
        "slip": (tangential_loops(owner, gains.slip, period=gains.period, delay_periods=delay), NOMINAL, "tangential force"),
        "suspension": (normal_loops(owner, gains.suspension, period=gains.period, delay_periods=delay), NOMINAL_LOAD, "normal force"),
    }
    folder, written = Path(directory), []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, (systems, nominal, quantity) in loops.items():
            written += _save(_bode(systems, nominal, gains, f"{owner.name}: loop of the {quantity}"), folder, f"{name}_bode")
            written += _save(_step(systems[nominal], gains, f"{owner.name}: {quantity} after a jump"), folder, f"{name}_step")
    except OSError as error:
        raise GainsError(
            "cannot write the design's figures", got=error.strerror, fix="choose a writable folder", where=str(folder)
        ) from error
    return written


def _figure(rows: int) -> tuple[Any, Any]:
    # a figure without pyplot: no global state, no display
    from matplotlib.figure import Figure  # noqa: PLC0415

    figure = Figure(figsize=(7.0, 2.6 * rows), layout="constrained")
    return figure, figure.subplots(rows, 1, sharex=True, squeeze=False)[:, 0]


def _bode(loops: list[control.StateSpace], nominal: int, gains: Gains, title: str) -> Any:
    omega = frequencies(gains.period)
    figure, (size, angle) = _figure(2)
    for k, loop in enumerate(loops):
        values = response(loop, omega, period=gains.period)[:, 0, 0]
        style = {"color": "C0", "lw": 2.0, "label": "a third of the weight"} if k == nominal else {"color": "0.7", "lw": 0.8}
        size.semilogx(omega, 20.0 * np.log10(np.abs(values)), **style)
        angle.semilogx(omega, np.degrees(np.unwrap(np.angle(values))), **style)
    needs = gains.requirements
    size.axhline(0.0, color="k", lw=0.6)
    size.axhline(-needs.gain_margin, color="C1", ls="--", lw=0.8, label=f"gain margin asked: {needs.gain_margin:g} dB")
    angle.axhline(-180.0, color="k", lw=0.6)
    angle.axhline(-180.0 + needs.phase_margin, color="C1", ls="--", lw=0.8, label=f"phase margin asked: {needs.phase_margin:g} deg")
    size.set(title=title, ylabel="gain (dB)", ylim=(-60.0, 40.0))
    angle.set(xlabel="frequency (rad/s)", ylabel="phase (deg)")
    for axes in (size, angle):
        axes.grid(alpha=0.3)
        axes.legend(fontsize="small")
    return figure


def _step(loop: control.StateSpace, gains: Gains, title: str) -> Any:
    figure, (axes,) = _figure(1)
    time: Array = np.arange(0.0, STEP_TIME, gains.period)
    sensitivity = control.feedback(control.ss([], [], [], [[1.0]], gains.period), loop)
    answer = control.forced_response(sensitivity, time, np.ones_like(time)).outputs
    axes.step(time, answer, where="post", label="part of the disturbing force that is left")
    axes.axhline(0.0, color="k", lw=0.6)
    axes.set(title=title, xlabel="time (s)", ylabel="force left (1)")
    axes.grid(alpha=0.3)
    axes.legend(fontsize="small")
    return figure


def _save(figure: Any, folder: Path, name: str) -> list[Path]:
    paths = [folder / f"{name}.{kind}" for kind in ("svg", "png")]
    for path in paths:
        figure.savefig(path, dpi=150)
    return paths
