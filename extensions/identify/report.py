"""Renders the page of a log: warnings, tables of errors, and figures of readings over time."""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.controller.figure_style import PALETTE, SETTINGS, UNDATED, WIDTH
from hexapod_cosim.cosim.report.page import render
from hexapod_cosim.extensions.identify.log import CHANNELS, Channel, Log, channel_of
from hexapod_cosim.models import LEG_NAMES

if TYPE_CHECKING:
    from matplotlib.figure import Figure


Array = NDArray[np.float64]
TEMPLATE = "log.html.jinja"
TITLES = {channel.key: channel.title for channel in CHANNELS}
COLUMNS = ("channel", "unit", "columns", "spread", "rms error", "largest error", "in", "at [s]")


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
        return [
            TITLES[self.channel], self.unit, str(self.columns), *figures, self.name,
            number(self.at),
        ]  # fmt: skip


def column_differences(log: Log, names: Sequence[str], simulated: Array) -> list[Difference]:
    """Returns the difference of each column.

    names: columns of the log that were simulated. simulated: (rows, names). Readings that are no
    numbers are left out.
    """
    found = []
    for name, values in zip(names, simulated.T, strict=True):
        measured = log.recording.column(name)
        error = values - measured
        known = np.isfinite(error)
        if not known.any():
            continue
        size = np.where(known, np.abs(error), -1.0)
        worst = int(np.argmax(size))
        channel, at = channel_of(name), float(log.time[worst])
        spread, rms, largest = (
            float(np.std(measured[known])),
            _rms(error[known]),
            float(size[worst]),
        )
        found.append(Difference(channel.key, name, channel.unit, 1, spread, rms, largest, at))
    return found


def channel_differences(columns: Sequence[Difference]) -> list[Difference]:
    """Returns the difference of each channel: root mean squares over its columns."""
    found = []
    for channel in CHANNELS:
        own = [one for one in columns if one.channel == channel.key]
        if own:
            worst = max(own, key=lambda one: one.largest)
            spread, rms = (
                _rms(np.array([getattr(one, key) for one in own])) for key in ("spread", "rms")
            )
            found.append(
                Difference(
                    channel.key, worst.name, channel.unit, len(own), spread, rms,
                    worst.largest, worst.at,
                )
            )  # fmt: skip
    return found


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


@dataclass(frozen=True, kw_only=True)
class Section:
    """A table and pictures below a heading."""

    title: str
    caption: str = ""
    columns: Sequence[str] = ()
    rows: Sequence[Sequence[str]] = ()
    left: int = 1  # number of columns that are texts
    pictures: Mapping[str, str] = field(default_factory=dict)  # data URLs by title


def rendered(sections: Sequence[Section], **content: Any) -> str:
    """Returns a page. content: title, headline, lead, warnings, command, facts, source."""
    return render(TEMPLATE, package=__package__, sections=sections, **content)


def number(value: float) -> str:
    """Returns a number with four digits."""
    return f"{value:.4g}"


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
