"""What was found of a robot: the numbers with their intervals, and the errors before and after."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.extensions.identify.experiment import Experiment
from hexapod_cosim.extensions.identify.fitting.judging import Fit
from hexapod_cosim.extensions.identify.fitting.misfit import DETERMINED
from hexapod_cosim.extensions.identify.numbers import Unknown
from hexapod_cosim.extensions.identify.report import (
    Difference,
    channel_differences,
    column_differences,
)
from hexapod_cosim.extensions.identify.screening import BadColumn
from hexapod_cosim.extensions.identify.unknowns import START
from hexapod_cosim.models import Robot

Array = NDArray[np.float64]
QUANTILE = 1.959963985  # of a normal distribution, for 95 %
FEWEST_DIGITS = 5  # of a value and its interval in texts


@dataclass(frozen=True)
class Estimate:
    """What was found of one number."""

    key: str
    unit: str
    group: str
    before: float
    value: float
    low: float  # of the 95 % interval
    high: float
    deviation: float  # over that of what was known before: 1 where the logs say nothing
    alone: bool = True  # whether the logs determine it without numbers that they do not determine
    depends: tuple[str, ...] = ()  # numbers of the robot file with which alone it is determined

    @property
    def determined(self) -> bool:
        """Whether the logs determine the number: they at least halve what was unknown of it."""
        return self.alone and self.deviation < DETERMINED

    @property
    def interval(self) -> str:
        """The 95 % interval as a text, with the digits in which its ends differ, and one more."""
        return f"{self._text(self.low)} to {self._text(self.high)}"

    @property
    def found(self) -> str:
        """The value as a text, with the digits of the interval."""
        return self._text(self.value)

    def _text(self, value: float) -> str:
        largest, width = max(abs(self.low), abs(self.high)), self.high - self.low
        digits = math.ceil(math.log10(largest / width)) + 2 if width > 0.0 else FEWEST_DIGITS
        return f"{value:.{max(FEWEST_DIGITS, digits)}g}"


@dataclass(frozen=True)
class Identified:
    """A robot identified from logs."""

    file: Robot  # from which the search begins: as the robot file has it
    robot: Robot  # with the numbers found
    fit: Fit
    experiments: tuple[Experiment, ...]
    bad: tuple[tuple[int, BadColumn], ...]  # number of the log and column left out
    before: tuple[Array, ...]  # readings that the robot file predicts (rows, columns)

    @property
    def rejected(self) -> bool:
        """Whether the logs reject the model, so that the robot is the file's."""
        return bool(self.fit.rejected)

    @property
    def estimates(self) -> list[Estimate]:
        """The numbers of robot and sensors, in the order of the table of unknowns."""
        return [self._estimate(k, row) for k, row in enumerate(self.fit.rows) if row.group != START]

    def _estimate(self, k: int, row: Unknown) -> Estimate:
        """Returns what was found of a number; nothing of a model that the logs reject."""
        before, rejected = self.fit.before[row.key], self.rejected
        # z = 0 is the file's value to the last digit
        value = before if self.fit.kept[k] or rejected else self.fit.values[row.key]
        deviation = 1.0 if rejected else self.fit.deviations[row.key]
        low, high = row.interval(value, QUANTILE * deviation)
        return Estimate(
            row.key, row.unit, row.group, before, value,
            max(low, row.low), min(high, row.high), deviation,
            bool(self.fit.alone[k]) and not self.fit.kept[k] and not rejected,
            () if rejected else self.fit.depends.get(row.key, ()),
        )  # fmt: skip

    def differences(self, part: str) -> list[tuple[Difference, Difference]]:
        """Returns the difference of each channel before and after. part: "fitted" or "held_out"."""
        sides = []
        for predictions in (self.before, self.fit.predictions):
            columns: list[Difference] = []
            for one, own in zip(self.experiments, predictions, strict=True):
                rows = getattr(one, part)
                columns += column_differences(one.log.part(rows), one.columns, own[rows])
            sides.append(channel_differences(columns))
        return list(zip(*sides, strict=True))
