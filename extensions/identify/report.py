"""Renders the page of a log: warnings, tables of errors, and figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jinja2 import ChoiceLoader, PackageLoader
from numpy.typing import NDArray

from hexapod_cosim.cosim.common.control_style import all_styles
from hexapod_cosim.cosim.report.page import environment
from hexapod_cosim.extensions.identify.log import CHANNELS, Log, channel_of

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
    own = environment()
    loaders = [PackageLoader("hexapod_cosim.extensions", "identify"), own.loader]
    pages = own.overlay(loader=ChoiceLoader([each for each in loaders if each is not None]))
    template = pages.get_template(TEMPLATE)
    return template.render(styles=all_styles(()), sections=sections, **content)


def number(value: float) -> str:
    """Returns a number with four digits."""
    return f"{value:.4g}"
