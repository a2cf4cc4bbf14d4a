"""Makes docs/images/walk.png, the README's picture, from a comparison's folder.

hexapod compare walk_flat -o out/demo && python docs/figure_walk.py out/demo
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from hexapod_cosim.controller.figure_style import SETTINGS
from hexapod_cosim.cosim.plots import STYLES
from hexapod_cosim.cosim.recordings import read_recording
from hexapod_cosim.cosim.results import RESULTS
from hexapod_cosim.models import JOINT_NAMES, LEG_NAMES, Robot, load_robot
from hexapod_cosim.models.kinematics import axis_rotation, rotation_matrix

Array = NDArray[np.float64]
SNAPSHOTS = (0.75, 9.75)  # s
VIEW = np.array([[0.97, 0.24, 0.0], [-0.10, 0.38, 0.92]])  # world to picture: from the right, a little from above
FORCE_SCALE = 4e-3  # m/N, of the arrows
WINDOW = (7.0, 9.0)  # s


def read(folder: Path) -> dict[str, Array]:
    """Columns of a run by name."""
    recording = read_recording(folder, RESULTS)
    return dict(zip(recording.names, recording.data.T, strict=True))


def vectors(data: dict[str, Array], name: str, size: int, row: int) -> Array:
    """name[1] .. name[size] at a row."""
    return np.array([data[f"{name}[{i + 1}]"][row] for i in range(size)])


def leg_points(robot: Robot, data: dict[str, Array], row: int) -> Iterator[Array]:
    """(5, 3) hip, knee and foot points of each leg in the world, with the torso's edge point first."""
    R, r = rotation_matrix(vectors(data, "torso.quaternion", 4, row)), vectors(data, "torso.position", 3, row)
    for leg, name in zip(robot.legs, LEG_NAMES, strict=True):
        turn = R @ axis_rotation(np.array([0.0, 0.0, 1.0]), leg.hip_yaw)
        points = [r, r + R @ (np.array(leg.hip_position) - np.array(robot.torso.com))]
        for link, joint in zip(leg.links, JOINT_NAMES, strict=True):
            turn = turn @ axis_rotation(np.array(link.axis), float(data[f"{name}.{joint}.angle"][row]))
            points.append(points[-1] + turn @ np.array([link.length, link.offset_y, link.offset_z]))
        yield np.array(points)


def draw_robot(axis: Axes, robot: Robot, data: dict[str, Array], time: float) -> None:
    """The robot's links and the forces under its feet at a time."""
    row = int(np.searchsorted(data["time"], time))
    R, r = rotation_matrix(vectors(data, "torso.quaternion", 4, row)), vectors(data, "torso.position", 3, row)
    half = 0.5 * np.array(robot.torso.size)
    for z in (-1, 1):
        corners = r + (np.array([[-1, -1, z], [1, -1, z], [1, 1, z], [-1, 1, z]]) * half) @ R.T
        axis.fill(*(VIEW @ corners.T), facecolor="#8da0b3", edgecolor="#33475b", linewidth=0.8, alpha=0.55, zorder=2)
    for name, points in zip(LEG_NAMES, leg_points(robot, data, row), strict=True):
        axis.plot(*(VIEW @ points[1:].T), color="#33475b", linewidth=2.2, solid_capstyle="round", marker="o", markersize=2.5, zorder=3)
        force = FORCE_SCALE * VIEW @ vectors(data, f"{name}.foot.force", 3, row)
        if np.hypot(*force) > 0.01:
            start = VIEW @ points[-1]
            axis.annotate("", start + force, start, arrowprops={"arrowstyle": "-|>", "color": "#D55E00", "lw": 1.4}, zorder=4)


def draw_walk(axis: Axes, data: dict[str, Array], title: str) -> None:
    """Snapshots along the way, with the torso's path."""
    robot = load_robot("athena")
    ground = np.array([[-0.3, -0.35, 0.0], [1.15, -0.35, 0.0], [1.15, 0.35, 0.0], [-0.3, 0.35, 0.0]])
    axis.fill(*(VIEW @ ground.T), color="#e9ecef", zorder=0)
    path = np.stack([data[f"torso.position[{i}]"] for i in (1, 2, 3)])
    axis.plot(*(VIEW @ path), color="#0072B2", linewidth=1.2, zorder=5)
    for time in SNAPSHOTS:
        draw_robot(axis, robot, data, time)
    axis.set_aspect("equal")
    axis.set_title(title)
    axis.axis("off")


def main(folder: Path) -> None:
    """Draws the figure from folder/kinematic and folder/compliant."""
    runs = {control: read(folder / control) for control in ("kinematic", "compliant")}
    with mpl.rc_context(SETTINGS):
        figure = Figure(figsize=(10, 6.6), dpi=130)
        grid = figure.add_gridspec(2, 2, height_ratios=[1.15, 1])
        draw_walk(figure.add_subplot(grid[0, :]), runs["compliant"], "ATHENA-like hexapod, compliant control, at 0.75 s and 9.75 s")
        force, slip = figure.add_subplot(grid[1, 0]), figure.add_subplot(grid[1, 1])
        for control, data in runs.items():
            inside = (data["time"] >= WINDOW[0]) & (data["time"] <= WINDOW[1])
            force.plot(data["time"][inside], data["LR.foot.normal_force"][inside], label=control, **STYLES[control])
            loaded = sum(data[f"{leg}.foot.slip_speed"] * (data[f"{leg}.foot.normal_force"] > 0.55) for leg in LEG_NAMES)
            way = np.cumsum(loaded) * float(data["time"][1] - data["time"][0])
            slip.plot(data["time"], 1e3 * way, label=control, **STYLES[control])
        force.set(xlabel="time [s]", ylabel="normal force, left rear foot [N]")
        slip.set(xlabel="time [s]", ylabel="way slipped by all loaded feet [mm]")
        slip.legend(loc="upper left")
        figure.savefig(Path(__file__).parent / "images" / "walk.png")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "out/demo"))
