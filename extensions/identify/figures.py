"""Draws readings of a log and simulations of it over time, one figure for each channel."""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.controller.figure_style import PALETTE, SETTINGS, UNDATED, WIDTH
from hexapod_cosim.extensions.identify.log import CHANNELS, Channel, Log
from hexapod_cosim.models import LEG_NAMES

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
Simulated = Mapping[str, Mapping[str, Array]]  # label of a simulation: columns by name (rows,)
MOST_POINTS = 600  # of a line
ROW = 1.05  # in    height of a row of panels
COLOURS = (PALETTE[3], PALETTE[0], PALETTE[2])  # of simulations


def channel_figures(
    log: Log, simulations: Simulated, *, split: float | None = None
) -> dict[str, str]:
    """Returns a figure of each channel with simulated columns, by the channel's title, as data URL.

    split: time [s] of a vertical line.
    """
    from matplotlib import rc_context  # noqa: PLC0415  slow to import

    found = {}
    for channel in CHANNELS:
        names = [
            name
            for name in log.names(channel)
            if any(name in columns for columns in simulations.values())
        ]
        if names:
            with rc_context(SETTINGS):
                found[channel.title] = _embedded(_draw(log, channel, names, simulations, split))
    return found


def _draw(
    log: Log, channel: Channel, names: list[str], simulations: Simulated, split: float | None
) -> Figure:
    legs = names[0].split(".")[0] in LEG_NAMES
    across = len(LEG_NAMES) if legs else 3
    rows = -(-len(channel.names if legs else names) // across)
    from matplotlib.figure import Figure  # noqa: PLC0415  slow to import

    figure = Figure(figsize=(1.5 * WIDTH, ROW * max(rows, 1) + 0.5))
    axes = figure.subplots(rows, across, squeeze=False, sharex=True)
    thin = slice(None, None, max(len(log.time) // MOST_POINTS, 1))
    for axis in axes.flat:
        axis.set_visible(False)
    for name in names:
        place = channel.names.index(name)
        axis = axes[place % rows, place // rows] if legs else axes[place // across, place % across]
        axis.set_visible(True)
        axis.set_title(name, fontsize=6.5)
        axis.tick_params(labelsize=5.5)
        axis.plot(
            log.time[thin], log.recording.column(name)[thin], color="0.55", label="measured",
            linewidth=1.4,
        )  # fmt: skip
        if split is not None:
            axis.axvline(split, color="0.75", linewidth=0.7)
        for colour, (label, columns) in zip(COLOURS, simulations.items(), strict=False):
            axis.plot(log.time[thin], columns[name][thin], color=colour, label=label, linewidth=0.7)
    figure.supylabel(f"[{channel.unit}]", fontsize=7.0)
    figure.supxlabel("time [s]", fontsize=7.0)
    shown = next(axis for axis in axes.flat if axis.get_visible())
    handles, labels = shown.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper right", ncols=len(labels), fontsize=7.0)
    return figure


def _embedded(figure: Figure) -> str:
    """Returns a figure as a data URL of an SVG."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="svg", metadata=UNDATED["svg"])
    return "data:image/svg+xml;base64," + base64.b64encode(buffer.getvalue()).decode("ascii")
