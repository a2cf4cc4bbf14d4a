"""Draws static figures of one or several runs; colours and dashes distinguish the runs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from hexapod_cosim.controller.figure_style import PALETTE, WIDTH
from hexapod_cosim.cosim.common.control_style import control_styles
from hexapod_cosim.cosim.master.recorder import ColumnError
from hexapod_cosim.cosim.report.profile import profile
from hexapod_cosim.cosim.results.metrics import planned_feet, plans_feet
from hexapod_cosim.cosim.results.support import body_height, real_feet
from hexapod_cosim.cosim.results.window import (
    View,
    commanded_path,
    robot_weight,
    running_integral,
    slip_under_load,
)
from hexapod_cosim.models import JOINT_NAMES, LEG_NAMES
from hexapod_cosim.models.arrays import Array

PLAN = "0.7"  # grey of planned paths
PLANNED = "0.85"  # grey of planned swings
LEAST_WIDTH = 2.0  # mm    of the sideways axis: a smaller one would show round-off as a drift
STRAIGHT = 0.05  # a commanded path no wider than this share of its length is drawn enlarged
SIDES, PLACES = {"L": "left", "R": "right"}, {"F": "front", "M": "middle", "R": "rear"}
ENERGIES = {  # line styles
    "actuator_work": "-",
    "dissipated": (0, (5, 1.2)),
    "potential": (0, (1, 1)),
    "kinetic": "-",
    "push_work": (0, (3, 1, 1, 1)),
}

Views = Mapping[str, View]  # by control


def line_styles(labels: Iterable[str]) -> dict[str, dict[str, Any]]:
    """Returns matplotlib's settings for the line of each control."""
    return {
        label: {
            "color": style.light,
            "linestyle": (0, style.dash) if style.dash else "-",
            "linewidth": 1.0,
        }
        for label, style in control_styles(labels).items()
    }


def foot_forces(views: Views) -> Figure:
    """Draws the normal force of each foot over the last cycles, in body weights."""
    styles = line_styles(views)
    figure = Figure(figsize=(WIDTH, 3.8))
    axes = figure.subplots(2, 3, sharex=True, sharey=True)
    for label, view in views.items():
        end = view.last_cycles()
        force = end.recording.feet("normal_force") / robot_weight(view.parameters)
        for leg, axis in enumerate(axes.flat):
            axis.plot(end.recording.time, force[:, leg], label=label, **styles[label])
            axis.set_title(leg_title(leg))
    _label(axes[-1], "time [s]", axes[:, 0], "normal force [BW]")
    _legend(figure, axes.flat[0])
    return figure


def slip(views: Views) -> Figure:
    """Draws the total slip of all feet, and the slip speed of each foot over the last cycles."""
    styles = line_styles(views)
    figure = Figure(figsize=(WIDTH, 5.0))
    grid = figure.add_gridspec(3, 3)
    top = figure.add_subplot(grid[0, :])
    legs = grid[1:, :].subgridspec(2, 3)
    axes = np.ravel(legs.subplots(sharex=True, sharey=True))  # type: ignore[arg-type]
    for label, view in views.items():
        time, speed = view.recording.time, slip_under_load(view.recording, view.parameters)
        total = 1e3 * running_integral(time, speed.sum(axis=1))
        top.plot(time, total, label=label, **styles[label])
        last = slice(-len(view.last_cycles().recording.time), None)
        for leg, axis in enumerate(axes):
            axis.plot(time[last], 1e3 * speed[last, leg], **styles[label])
            axis.set_title(leg_title(leg))
    top.set_xlabel("time [s]")
    top.set_ylabel("slipped way [mm]")
    _label(axes[3:], "time [s]", axes[::3], "slip speed [mm/s]")
    _legend(figure, top)
    return figure


def feet(views: Views) -> Figure:
    """Draws each foot's planned and actual path over the last cycles from the side, torso frame."""
    styles = line_styles(views)
    figure = Figure(figsize=(WIDTH, 3.8))
    axes = figure.subplots(2, 3, sharey=True)
    planning = {label: view for label, view in views.items() if plans_feet(view.recording)}
    if not planning:
        got, expected = f"runs of {', '.join(views)}", "a controller that reports its plan"
        raise ColumnError("no plan of the feet was recorded", got=got, expected=expected)
    for number, (label, view) in enumerate(planning.items()):
        end = view.last_cycles()
        planned, real = planned_feet(end.recording), real_feet(end.recording, view.parameters)
        for leg, axis in enumerate(axes.flat):
            x, z = 1e3 * planned[:, leg, [0, 2]].T
            axis.plot(x, z, color=PLAN, linewidth=2.2, label=None if number else "planned")
            x, z = 1e3 * real[:, leg, [0, 2]].T
            axis.plot(x, z, label=label, **styles[label])
            axis.set_title(leg_title(leg))
    _label(axes[-1], "x, torso frame [mm]", axes[:, 0], "z [mm]")
    _legend(figure, axes.flat[0])
    return figure


def posture(views: Views) -> Figure:
    """Draws height, roll, pitch and yaw of the torso."""
    styles = line_styles(views)
    figure = Figure(figsize=(WIDTH, 5.2))
    axes = figure.subplots(4, 1, sharex=True)
    for label, view in views.items():
        recording = view.recording
        time, height = recording.time, 1e3 * body_height(recording, view.parameters)
        axes[0].plot(time, height, label=label, **styles[label])
        for axis, name in zip(axes[1:], ("roll", "pitch", "yaw"), strict=True):
            angle = np.degrees(np.unwrap(recording.column(f"torso.{name}")))
            axis.plot(time, angle, **styles[label])
    labels = ("height [mm]", "roll [deg]", "pitch [deg]", "yaw [deg]")
    for axis, text in zip(axes, labels, strict=True):
        axis.set_ylabel(text)
    axes[-1].set_xlabel("time [s]")
    figure.align_ylabels(axes)
    _legend(figure, axes[0])
    return figure


def path(views: Views) -> Figure:
    """Draws the actual and the commanded path of the torso from above."""
    styles = line_styles(views)
    figure = Figure(figsize=(WIDTH, 3.0))
    axis = figure.subplots()
    for label, view in views.items():
        x, y, _ = view.recording.vector("torso.position").T
        axis.plot(x, 1e3 * y, label=label, **styles[label])
        dot: dict[str, Any] = {"marker": "o", "markersize": 4, "clip_on": False}
        axis.plot(x[-1], 1e3 * y[-1], color=styles[label]["color"], **dot)
    x, y = commanded_path(next(iter(views.values())).recording).T
    axis.plot(x, 1e3 * y, color="0.45", linestyle=":", label="commanded, without its ramps")
    axis.margins(x=0.02)
    axis.set_xlabel("x [m]")
    axis.set_ylabel("y [mm]")
    _legend(figure, axis)
    if np.ptp(y) > STRAIGHT * np.ptp(x):
        axis.set_aspect(1e-3, adjustable="datalim")
        axis.set_title("to scale", loc="right", fontsize="small")
        return figure
    low, high = axis.get_ylim()
    missing = max(LEAST_WIDTH - (high - low), 0.0)
    axis.set_ylim(low - missing / 2, high + missing / 2)
    axis.set_title("not to scale: mm upwards, m along", loc="right", fontsize="small")
    return figure


def torques(views: Views) -> Figure:
    """Draws the largest absolute torque of the six legs over the last cycles, by joint."""
    styles = line_styles(views)
    figure = Figure(figsize=(WIDTH, 4.2))
    axes = figure.subplots(3, 1, sharex=True)
    for label, view in views.items():
        end = view.last_cycles().recording
        largest = np.abs(end.joints("torque")).max(axis=1)
        for joint, axis in enumerate(axes):
            axis.plot(end.time, largest[:, joint], label=label, **styles[label])
            axis.set_ylabel(f"{JOINT_NAMES[joint]} [N m]")
    for axis in axes:
        axis.set_ylim(bottom=0.0)  # last, since it stops automatic scaling
    axes[0].set_title("largest |torque| of the six legs", loc="left")
    axes[-1].set_xlabel("time [s]")
    figure.align_ylabels(axes)
    _legend(figure, axes[0])
    return figure


def energy(views: Views) -> Figure:
    """Draws the energy balance: work, losses, stored energies and the residual."""
    figure = Figure(figsize=(WIDTH, 0.3 + 2.4 * len(views)))
    axes = figure.subplots(len(views), 2, sharex=True, squeeze=False, width_ratios=(3, 2))
    pushed = any(np.ptp(view.recording.column("energy.push_work")) for view in views.values())
    for (axis, rest), (label, view) in zip(axes, views.items(), strict=True):
        recording = view.recording
        residual = recording.column("energy.residual")
        rest.plot(recording.time, 1e3 * (residual - residual[0]), color=PALETTE[-1], linewidth=0.9)
        rest.set_title(f"{label}: residual")
        rest.set_ylabel("residual since the start [mJ]")
        for color, (name, style) in zip(PALETTE, ENERGIES.items(), strict=False):
            if name != "push_work" or pushed:
                values = recording.column(f"energy.{name}")
                axis.plot(
                    recording.time,
                    values - values[0],
                    color=color,
                    linestyle=style,
                    label=name.replace("_", " "),
                    linewidth=1.0,
                )
        axis.set_title(label)
        axis.set_ylabel("since the start [J]")
    for axis in axes[-1]:
        axis.set_xlabel("time [s]")
    for column in axes.T:
        figure.align_ylabels(column)
    _legend(figure, axes[0, 0])
    return figure


def footfall(views: Views) -> Figure:
    """Draws when each foot is on the ground over the last cycles; grey bands are planned swings."""
    styles = line_styles(views)
    figure = Figure(figsize=(WIDTH, 0.5 + 1.6 * len(views)))
    axes = np.atleast_1d(figure.subplots(len(views), 1, sharex=True))
    for axis, (label, view) in zip(axes, views.items(), strict=True):
        end = view.last_cycles().recording
        for leg, name in enumerate(LEG_NAMES):
            swinging = f"controller.{name}.swinging"
            if swinging in end.names:
                _bars(axis, end.time, end.column(swinging) > 0.5, leg, height=0.9, color=PLANNED)
            contact, color = end.feet("contact")[:, leg] > 0.5, styles[label]["color"]
            _bars(axis, end.time, contact, leg, height=0.5, color=color)
        axis.set_yticks(range(len(LEG_NAMES)), LEG_NAMES)
        axis.invert_yaxis()
        axis.set_title(label)
        axis.grid(visible=False)
    axes[-1].set_xlabel("time [s]")
    keys = {f"on the ground, {label}": styles[label]["color"] for label in views} | {
        "swing the gait plans": PLANNED
    }
    patches = [Patch(color=color, linewidth=0) for color in keys.values()]
    figure.legend(patches, list(keys), loc="outside upper center", ncols=len(keys))
    return figure


def _bars(axis: Axes, time: Array, on: Any, row: int, *, height: float, color: str) -> None:
    """Draws a bar in a row for each period in which a flag (rows,) is on."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], on, [False]]).astype(int)))
    last = len(time) - 1
    spans = [
        (time[begin], time[min(end, last)] - time[begin])
        for begin, end in zip(edges[::2], edges[1::2], strict=True)
    ]
    axis.broken_barh(spans, (row - height / 2, height), color=color, linewidth=0)


def leg_title(leg: int) -> str:
    """Returns the position and name of a leg."""
    name = LEG_NAMES[leg]
    return f"{SIDES[name[0]]} {PLACES[name[1]]} ({name})"


def _label(bottom: Any, x: str, left: Any, y: str) -> None:
    for axis in bottom:
        axis.set_xlabel(x)
    for axis in left:
        axis.set_ylabel(y)


def _legend(figure: Figure, axis: Axes) -> None:
    handles, labels = axis.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels))


DRAWINGS: dict[str, Callable[[Views], Figure]] = {
    "foot_forces": foot_forces,
    "slip": slip,
    "feet": feet,
    "posture": posture,
    "path": path,
    "profile": profile,
    "torques": torques,
    "energy": energy,
    "footfall": footfall,
}
