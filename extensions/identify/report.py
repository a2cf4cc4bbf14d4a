"""Compares readings with their simulation, and renders the page of a replay: warnings, tables of
errors, and figures of readings over time.
"""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from hexapod_cosim.controller.figure_style import PALETTE, SETTINGS, UNDATED, WIDTH
from hexapod_cosim.extensions.identify.log import CHANNELS, Channel, Log, channel_of
from hexapod_cosim.models.arrays import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure


TITLES = {channel.key: channel.title for channel in CHANNELS}
COLUMNS = ("channel", "unit", "columns", "spread", "rms error", "largest error", "in", "at [s]")
MOST_POINTS = 600  # of a line
ROW = 1.05  # in    height of a row of panels


@dataclass(frozen=True)
class Difference:
    """How far a simulation is from the readings of one column, or of all columns of a channel."""

    channel: str
    name: str  # of the column, or of the one with the largest difference
    unit: str
    columns: int
    spread: float  # rms of the readings about their mean
    rms: float  # of simulated - measured
    largest: float  # largest absolute difference
    at: float  # s    its time

    def as_row(self) -> list[str]:
        """Returns the row of a table with COLUMNS."""
        figures = [number(value) for value in (self.spread, self.rms, self.largest)]
        title, at = TITLES[self.channel], number(self.at)
        return [title, self.unit, str(self.columns), *figures, self.name, at]


def column_differences(log: Log, names: Sequence[str], simulated: Array) -> list[Difference]:
    """Returns the difference of each column.

    names: columns of the log that were simulated. simulated: (rows, names). Readings that are no
    numbers are left out.
    """
    found = []
    for name, values in zip(names, simulated.T, strict=True):
        measured = log.recording.column(name)
        known = np.isfinite(measured)
        if known.any():
            size = np.where(known, np.abs(values - measured), -1.0)
            worst, channel = int(np.argmax(size)), channel_of(name)
            found.append(
                Difference(
                    channel=channel.key,
                    name=name,
                    unit=channel.unit,
                    columns=1,
                    spread=float(np.std(measured[known])),
                    rms=rms(size[known]),
                    largest=float(size[worst]),
                    at=float(log.time[worst]),
                )
            )
    return found


def channel_differences(columns: Sequence[Difference]) -> list[Difference]:
    """Returns the difference of each channel: root mean squares over its columns."""
    found = []
    for channel in CHANNELS:
        own = [one for one in columns if one.channel == channel.key]
        if own:
            worst = max(own, key=lambda one: one.largest)
            found.append(
                replace(
                    worst,
                    columns=len(own),
                    spread=rms(np.array([one.spread for one in own])),
                    rms=rms(np.array([one.rms for one in own])),
                )
            )
    return found


def rms(values: Array) -> float:
    """Returns the root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def number(value: float) -> str:
    """Returns a number with four digits."""
    return f"{value:.4g}"


def channel_figures(log: Log, simulated: Mapping[str, Array]) -> dict[str, str]:
    """Returns a figure of each channel with simulated columns, by the channel's title, as data URL.

    simulated: columns by name (rows,).
    """
    from matplotlib import rc_context  # noqa: PLC0415  slow to import

    found = {}
    for channel in CHANNELS:
        names = [name for name in log.names(channel) if name in simulated]
        if names:
            with rc_context(SETTINGS):
                found[channel.title] = embedded(_draw(log, channel, names, simulated))
    return found


def _draw(log: Log, channel: Channel, names: list[str], simulated: Mapping[str, Array]) -> Figure:
    from matplotlib.figure import Figure  # noqa: PLC0415  slow to import

    across = min(len(names), 6 if len(channel.names) > 3 else 3)
    down = -(-len(names) // across)
    figure = Figure(figsize=(1.5 * WIDTH, ROW * down + 0.5))
    axes = figure.subplots(down, across, squeeze=False, sharex=True)
    thin = slice(None, None, max(len(log.time) // MOST_POINTS, 1))
    for axis, name in zip(axes.T.flat, names, strict=False):
        measured = log.recording.column(name)
        axis.set_title(name, fontsize=6.5)
        axis.tick_params(labelsize=5.5)
        axis.plot(log.time[thin], measured[thin], color="0.55", label="measured", linewidth=1.4)
        found = simulated[name][thin]
        axis.plot(log.time[thin], found, color=PALETTE[3], label="simulated", linewidth=0.7)
    figure.supylabel(f"[{channel.unit}]", fontsize=7.0)
    figure.supxlabel("time [s]", fontsize=7.0)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper right", ncols=2, fontsize=7.0)
    return figure


def embedded(figure: Figure) -> str:
    """Returns a figure as a data URL of an SVG."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="svg", metadata=UNDATED["svg"])
    return "data:image/svg+xml;base64," + base64.b64encode(buffer.getvalue()).decode("ascii")
