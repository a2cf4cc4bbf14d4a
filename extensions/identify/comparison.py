"""Compares the readings of a log with a simulation of it, column by column."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.extensions.identify.log import CHANNELS, Log

Array = NDArray[np.float64]


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

    def as_table(self) -> dict[str, Any]:
        """Returns the figures by name."""
        return asdict(self)


def column_differences(log: Log, names: Sequence[str], simulated: Array) -> list[Difference]:
    """Returns the difference of each column.

    names: columns of the log that were simulated. simulated: (rows, names). Readings that are no
    numbers are left out.
    """
    units = {name: (one.key, one.unit) for one in CHANNELS for name in one.names}
    found = []
    for name, values in zip(names, simulated.T, strict=True):
        measured = log.recording.column(name)
        error = values - measured
        known = np.isfinite(error)
        if not known.any():
            continue
        size = np.where(known, np.abs(error), -1.0)
        worst = int(np.argmax(size))
        channel, unit = units[name]
        spread, rms = float(np.std(measured[known])), _rms(error[known])
        at = float(log.time[worst])
        found.append(Difference(channel, name, unit, 1, spread, rms, float(size[worst]), at))
    return found


def channel_differences(columns: Sequence[Difference]) -> list[Difference]:
    """Returns the difference of each channel: root mean squares over its columns."""
    found = []
    for channel in CHANNELS:
        own = [one for one in columns if one.channel == channel.key]
        if own:
            worst = max(own, key=lambda one: one.largest)
            spread = _rms(np.array([one.spread for one in own]))
            rms = _rms(np.array([one.rms for one in own]))
            found.append(
                Difference(
                    channel.key, worst.name, channel.unit, len(own), spread, rms,
                    worst.largest, worst.at,
                )
            )  # fmt: skip
    return found


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
