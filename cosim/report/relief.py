"""Draws the heights of a surface of the ground, with contour lines and the robot for scale."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.patches import Circle, Rectangle

from hexapod_cosim.controller.figure_style import DPI, SETTINGS, UNDATED
from hexapod_cosim.cosim.common.files import atomic_path
from hexapod_cosim.models import Robot, foot_positions
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.ground.faces import surface_heights
from hexapod_cosim.models.ground.surface import Surface

WIDTH = 5.0  # in
SAMPLES = 4  # drawn per cell and direction of a small map
MOST_SAMPLES = 400  # along an edge
CONTOURS = 12  # at most


def draw_relief(surface: Surface, robot: Robot, path: Path) -> Path:
    """Writes the heights as PNG or SVG and returns its path; the robot stands at the origin."""
    with matplotlib.rc_context(SETTINGS | {"axes.grid": False}):
        left, right, low, high = surface.extent
        share = min(max((high - low) / (right - left), 0.25), 1.5)
        figure = Figure(figsize=(WIDTH, 0.9 * WIDTH * share + 0.4))
        axes = figure.subplots()
        picture = draw_surface(axes, surface)
        draw_robot(axes, robot)
        if np.ptp(surface.height) > 0.0:
            figure.colorbar(picture, ax=axes, shrink=0.8, pad=0.02, label="height [mm]")
        axes.set_xlabel("x [m]")
        axes.set_ylabel("y [m]")
        axes.set_title(surface.name)
        with atomic_path(path) as part:
            kind = path.suffix.removeprefix(".")
            figure.savefig(part, format=kind, dpi=DPI, metadata=UNDATED[kind])
    return path


def draw_surface(axes: Axes, surface: Surface) -> AxesImage:
    """Draws heights [mm] as colours, and contour lines of smooth ground; returns the picture."""
    x, y, height = sampled(surface)
    picture = axes.imshow(
        1e3 * height, cmap="cividis", origin="lower", extent=surface.extent, interpolation="nearest"
    )
    if surface.kind == "smooth" and np.ptp(height) > 0.0:
        axes.contour(x, y, height, levels=CONTOURS, colors="0.15", linewidths=0.4)
    return picture


def sampled(surface: Surface) -> tuple[Array, Array, Array]:
    """Returns x (columns,), y (rows,) and heights (rows, columns) [m] of a picture."""
    left, right, low, high = surface.extent
    columns, rows = (
        min(max(SAMPLES * count, 50), MOST_SAMPLES) for count in (surface.columns, surface.rows)
    )
    x = left + (right - left) * (np.arange(columns) + 0.5) / columns
    y = low + (high - low) * (np.arange(rows) + 0.5) / rows
    return x, y, surface_heights(surface, x, y)


def draw_robot(axes: Axes, robot: Robot) -> None:
    """Draws the torso and the standing feet, for scale."""
    length, width, _ = robot.torso.size
    com = robot.torso.com
    corner = (com[0] - 0.5 * length, com[1] - 0.5 * width)
    axes.add_patch(Rectangle(corner, length, width, fill=False, color="#D55E00", linewidth=1.0))
    for x, y, _ in foot_positions(robot, robot.stance):
        axes.add_patch(Circle((x, y), robot.foot.radius, color="#D55E00"))
