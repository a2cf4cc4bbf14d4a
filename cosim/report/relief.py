"""Draws a surface of the ground as a shaded relief with contour lines and the robot for scale."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LightSource, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle

from hexapod_cosim.controller.figure_style import DPI, SETTINGS, UNDATED
from hexapod_cosim.cosim.common.files import atomic_path
from hexapod_cosim.models import Robot, foot_positions
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.ground.faces import surface_heights
from hexapod_cosim.models.ground.surface import Surface

WIDTH = 5.0  # in
BELOW = -28.0  # pt    of the text below the labels of the x axis
LIGHT = LightSource(azdeg=315.0, altdeg=40.0)
EXAGGERATION = 1.5  # of slopes in the shading
SAMPLES = 4  # drawn per cell and direction of a small map
MOST_SAMPLES = 400  # along an edge
STEPS = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)  # m
CONTOURS = 12  # at most


def draw_relief(surface: Surface, robot: Robot, path: Path) -> Path:
    """Writes the relief as PNG or SVG and returns its path; the robot stands at the origin."""
    with matplotlib.rc_context(SETTINGS | {"axes.grid": False}):
        left, right, low, high = surface.extent
        share = min(max((high - low) / (right - left), 0.25), 1.5)
        figure = Figure(figsize=(WIDTH, 0.9 * WIDTH * share + 0.4))
        axes = figure.subplots()
        scale = draw_surface(axes, surface)
        draw_robot(axes, robot)
        if np.ptp(surface.height) > 0.0:
            bar = figure.colorbar(scale, ax=axes, shrink=0.8, pad=0.02, label="height [mm]")
            bar.ax.set_ylim(1e3 * surface.height.min(), 1e3 * surface.height.max())
        axes.set_xlabel("x [m]")
        axes.set_ylabel("y [m]")
        axes.set_title(surface.name)
        with atomic_path(path) as part:
            kind = path.suffix.removeprefix(".")
            figure.savefig(part, format=kind, dpi=DPI, metadata=UNDATED[kind])
    return path


def draw_surface(axes: Axes, surface: Surface) -> ScalarMappable:
    """Draws shading, colour of the height and contour lines; returns the scale of colours [mm]."""
    x, y, height = sampled(surface)
    pitch = float(x[1] - x[0]), float(y[1] - y[0])
    lowest, highest = float(height.min()), float(height.max())
    span = max(highest - lowest, 1e-6)
    darkest, brightest = lowest - 0.3 * span, highest + 0.1 * span
    colours = matplotlib.colormaps["cividis"]
    plain = colours(Normalize(darkest, brightest)(height))[..., :3]
    shaded = LIGHT.blend_soft_light(plain, _light(height, pitch)[..., np.newaxis])
    left, right, low, high = surface.extent
    axes.imshow(shaded, origin="lower", extent=(left, right, low, high), interpolation="nearest")
    step = next((step for step in STEPS if span / step <= CONTOURS), STEPS[-1])
    # half a step off, because level ground at a contour line has no line
    levels = step * (np.arange(np.floor(lowest / step), np.ceil(highest / step) + 1.0) + 0.5)
    if surface.kind == "smooth" and highest > lowest:
        axes.contour(x, y, height, levels=levels, colors="0.15", linewidths=0.4)
    text = f"{_digits(1e3 * lowest)} to {_digits(1e3 * highest)} mm"
    text += f", contour lines every {1e3 * step:g} mm" if surface.kind == "smooth" else ", blocks"
    axes.annotate(
        text,
        (0.0, 0.0),
        xycoords="axes fraction",
        xytext=(0.0, BELOW),
        textcoords="offset points",
        fontsize=6.5,
        va="top",
    )
    return ScalarMappable(Normalize(1e3 * darkest, 1e3 * brightest), colours)


def _light(height: Array, pitch: tuple[float, float]) -> Array:
    """Returns the light (rows, columns) on slopes, from 0 to 1.

    Level ground has 0.5, by which colours keep the values of their scale.
    """
    along_y, along_x = np.gradient(EXAGGERATION * height, pitch[1], pitch[0])
    normals = np.stack([-along_x, -along_y, np.ones_like(height)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    return np.asarray(np.clip(0.5 * normals @ LIGHT.direction / LIGHT.direction[2], 0.0, 1.0))


def _digits(value: float) -> str:
    """Returns a value with three digits or more, never as a power of ten."""
    return f"{value:.0f}" if abs(value) >= 1000.0 else f"{value:.3g}"


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
