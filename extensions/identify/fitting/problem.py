"""The residuals of logs and their derivatives, as functions of the unknown numbers.

A residual is (predicted - measured) / noise of a reading. Numbers are distances z from the robot
file's, in units of what was known of them beforehand (priors).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.extensions.identify.experiment import (
    Experiment,
    first_part,
    needs_simulation,
    readings,
    simulated,
)
from hexapod_cosim.extensions.identify.fitting.covariance import Series
from hexapod_cosim.extensions.identify.fitting.differences import (
    FINE,
    ROUGH,
    Differences,
    Slopes,
    differences,
    size_of,
)
from hexapod_cosim.extensions.identify.fitting.misfit import CLIPPED, Misfit
from hexapod_cosim.extensions.identify.fitting.workers import Workers
from hexapod_cosim.extensions.identify.log import CHANNELS, LogError
from hexapod_cosim.extensions.identify.log_plant import LogPlant
from hexapod_cosim.extensions.identify.numbers.unknown import Unknown
from hexapod_cosim.extensions.identify.unknowns import is_delay, value_before
from hexapod_cosim.models import FmuError, Robot

Array = NDArray[np.float64]
ALL = tuple(channel.key for channel in CHANNELS)
TO_DEVIATION = 1.4826  # from the median of absolute values, of a normal distribution
MOST_RESIDUALS = 150_000  # rows are thinned evenly where there would be more
# A reading is left out around a jump of the simulated signal: there a shift in time by a fraction
# of a row, of which a difference tells nothing, is a large error.
JUMP = 1.0  # second difference of a simulated signal [deviations]
BESIDE = 6  # rows before and after a jump
# A reading whose second difference over the numbers' short steps is larger jumps with a number; see
# `Problem.leave_out_bent`.
BENT = 0.05  # deviations
# A larger share of readings that change otherwise than derivatives say does not jump: the valley of
# the sum of squares is curved, and a shorter step follows it.
CURVED = 0.1
FLOOR = 1e-9  # smallest noise, in the units of the channels


class Problem:
    """The residuals of experiments and their derivatives, as functions of z."""

    def __init__(
        self,
        plant: LogPlant,
        robot: Robot,
        experiments: Sequence[Experiment],
        rows: Sequence[Unknown],
        workers: Workers | None = None,
        parameters: Mapping[str, float] | None = None,
        most: int = MOST_RESIDUALS,
    ) -> None:
        """parameters: further ones of the FMU, by name. most: residuals, at most about."""
        self.plant, self.robot, self.workers = plant, robot, workers
        self.parameters = dict(parameters or {})
        self.experiments, self.rows = tuple(experiments), tuple(rows)
        self.before = {row.key: value_before(row, robot) for row in rows}
        self.noise: dict[str, float] = {}
        count = sum(
            len(range(*one.fitted.indices(len(one.log.time)))) * len(one.columns)
            for one in self.experiments
        )
        self._thin = -(-count // most)
        self._measured = [one.measured for one in self.experiments]
        self._outputs: tuple[bytes, list[Array]] | None = None
        self._simulated = np.array([needs_simulation(row, robot) for row in rows], dtype=np.bool_)
        self._differences: Differences | None = None  # the last ones
        self._nonlinear: NDArray[np.bool_] | None = None  # (predictions,)  see leave_out_nonlinear
        self._size = 0  # of the residuals
        self._held: NDArray[np.bool_] | None = None  # (rows,)  see `holding`
        self.counted = self.all_known()  # which readings count (fitted rows, columns)

    def all_known(self) -> list[NDArray[np.bool_]]:
        """Returns which readings are numbers (fitted rows, columns)."""
        pairs = zip(self.experiments, self._measured, strict=True)
        return [np.isfinite(measured[one.fitted]) for one, measured in pairs]

    def count_all(self) -> None:
        """Makes all readings count that are numbers."""
        self.counted = self.all_known()

    def shortened(
        self,
        seconds: float = math.inf,
        *,
        parameters: Mapping[str, float],
        most: int = MOST_RESIDUALS,
    ) -> Problem:
        """Returns the problem of the first seconds of the logs, without held-out rows.

        parameters: further ones of the FMU, by name. most: residuals, at most about.
        """
        parts = [first_part(one, seconds) for one in self.experiments]
        return Problem(self.plant, self.robot, parts, self.rows, self.workers, parameters, most)

    def use(self, parameters: Mapping[str, float]) -> None:
        """Replaces the further parameters of the FMU. Simulated derivatives are kept."""
        self.parameters, self._outputs = dict(parameters), None

    def misfit(self, z: Array, noise: Mapping[str, float], part: str) -> dict[str, Misfit]:
        """Returns the mean square of residuals over that of a noise, by channel.

        It is 1 where the model explains the readings. Residuals beyond five deviations count as
        five. part: "fitted" or "held_out" rows.
        """
        found: dict[str, list[Array]] = {}
        pairs = zip(self.experiments, self.predictions(z), self._measured, strict=True)
        for one, own, measured in pairs:
            rows = getattr(one, part)
            error = (own - measured)[rows]
            for key, column in zip(one.channels, error.T, strict=True):
                size = column[np.isfinite(column)] / max(noise[key], FLOOR)
                found.setdefault(key, []).append(np.clip(size, -CLIPPED, CLIPPED) ** 2)
        joined = {key: np.concatenate(parts) for key, parts in found.items()}
        return {
            key: Misfit(float(np.mean(values)), len(values))
            for key, values in joined.items()
            if len(values)
        }

    def values(self, z: Array) -> dict[str, float]:
        """Returns the numbers by key."""
        pairs = zip(self.rows, z.tolist(), strict=True)
        return {row.key: row.value(one, self.before[row.key]) for row, one in pairs}

    def outputs(self, z: Array) -> list[Array]:
        """Returns the simulated outputs of each experiment; those of the last z are kept."""
        key = z[self._simulated].tobytes()
        if self._outputs is None or self._outputs[0] != key:
            self._outputs = key, self._simulate(z)
        return self._outputs[1]

    def _simulate(self, z: Array) -> list[Array]:
        """Returns the simulated outputs of each experiment."""
        values, rows = self.values(z), self.rows
        return [
            simulated(self.plant, one, self.robot, rows, values, self.parameters)
            for one in self.experiments
        ]

    def predictions(self, z: Array) -> list[Array]:
        """Returns the readings of each experiment (rows, columns)."""
        return self._read(self.outputs(z), z)

    def _read(self, outputs: Sequence[Array], z: Array) -> list[Array]:
        """Returns what the sensors read of simulated outputs."""
        values, pairs = self.values(z), zip(self.experiments, outputs, strict=True)
        return [readings(one, own, values, self.robot) for one, own in pairs]

    def errors(self, z: Array) -> list[Array]:
        """Returns predicted - measured in the fitted rows; 0 where a reading does not count."""
        parts = zip(
            self.experiments, self.predictions(z), self._measured, self.counted, strict=True
        )
        return [
            np.where(counted, (own - measured)[one.fitted], 0.0)
            for one, own, measured, counted in parts
        ]

    def leave_out_jumps(self, z: Array) -> None:
        """Makes readings count that are numbers and not beside a jump of the simulated signal."""
        for k, (one, own) in enumerate(zip(self.experiments, self.predictions(z), strict=True)):
            limit = JUMP * self._weights(one)
            second = np.zeros(own.shape)
            second[1:-1] = np.diff(own, n=2, axis=0)
            jump = (np.abs(second) > limit)[one.fitted]
            near = jump.copy()
            for shift in range(1, BESIDE + 1):
                near[shift:] |= jump[:-shift]
                near[:-shift] |= jump[shift:]
            self.counted[k] = np.isfinite(self._measured[k][one.fitted]) & ~near

    def set_noise(
        self,
        errors: Sequence[Array],
        *,
        share: float = 1.0,
        least: Mapping[str, float] | None = None,
        channels: Sequence[str] = ALL,
    ) -> None:
        """Sets the noise of each channel to a share of its typical error, at least `least`.

        Other channels than these count nothing from then on.
        """
        typical = self.typical(errors)
        self.noise = {
            key: max(share * value, (least or {}).get(key, 0.0), FLOOR)
            if key in channels
            else np.inf
            for key, value in typical.items()
        }

    def typical(self, errors: Sequence[Array]) -> dict[str, float]:
        """Returns the deviation of each channel's errors, in which rare peaks count little."""
        sizes: dict[str, list[Array]] = {}
        for one, error, counted in zip(self.experiments, errors, self.counted, strict=True):
            for key, column, own in zip(one.channels, error.T, counted.T, strict=True):
                sizes.setdefault(key, []).append(np.abs(column[own]))
        joined = {key: np.concatenate(parts) for key, parts in sizes.items()}
        return {
            key: TO_DEVIATION * float(np.median(values)) if len(values) else 0.0
            for key, values in joined.items()
        }

    def residuals(self, z: Array) -> Array:
        """Returns all residuals in deviations; infinite ones where the plant refuses z."""
        try:
            errors = self.errors(z)
        except (LogError, FmuError):
            return np.full(self._size, np.inf)
        parts = [
            (error[:: self._thin] / self._weights(one)).ravel()
            for one, error in zip(self.experiments, errors, strict=True)
        ]
        found = np.concatenate([*parts, z])
        self._size = len(found)
        return found

    def jacobian(self, z: Array, slopes: Slopes = ROUGH) -> Array:
        """Returns the residuals' derivatives (residuals, rows), by differences of simulations."""
        known = self._known(z, slopes)
        scale = np.concatenate([
            np.where(counted[:: self._thin], 1.0 / self._weights(one), 0.0).ravel()
            for one, counted in zip(self.experiments, self.counted, strict=True)
        ])  # fmt: skip
        found = np.zeros((len(scale) + len(z), len(z)))
        for k, own in enumerate(known.slopes):
            weighted = [slope * scale for slope in own]
            if weighted:
                # of the delay the smaller slope is the one within a period of the commands
                found[: -len(z), k] = min(weighted, key=size_of)
        found[len(scale) :][np.diag_indices(len(z))] = 1.0
        return found

    def leave_out_bent(self, z: Array) -> None:
        """Makes readings not count that jump between the numbers at which derivatives are made, nor
        those that jumped on the way there.
        """
        jump = self._known(z, FINE).bend / self._flat_weights() > BENT
        self.leave_out(jump if self._nonlinear is None else jump | self._nonlinear)

    def leave_out_nonlinear(self, change: Array, linear: Array) -> bool:
        """Makes readings not count from now on that change otherwise than derivatives say.

        Args:
            change: of all residuals.
            linear: what derivatives say of it.

        Returns whether any reading is new among these.
        """
        count = sum(own[:: self._thin].size for own in self.counted)
        flags = np.abs(change - linear)[:count] > BENT
        if float(np.mean(flags)) > CURVED:
            return False
        self._nonlinear = flags if self._nonlinear is None else flags | self._nonlinear
        return self.leave_out(flags)

    def leave_out(self, flags: NDArray[np.bool_]) -> bool:
        """Makes flagged ones (predictions,) not count; returns whether any of them did."""
        start, new = 0, False
        for counted in self.counted:
            own = counted[:: self._thin]
            flagged = flags[start : start + own.size].reshape(own.shape)
            start += own.size
            new |= bool(np.any(own & flagged))
            own &= ~flagged
        return new

    def _flat_weights(self) -> Array:
        parts = zip(self.experiments, self.counted, strict=True)
        return np.concatenate(
            [np.tile(self._weights(one), len(own[:: self._thin])) for one, own in parts]
        )

    def _known(self, z: Array, slopes: Slopes) -> Differences:
        """Returns the differences at z, or those near it that count there."""
        known = self._differences
        if known is None or not known.hold(z, slopes):
            self._differences = known = self._made(z, slopes)
        return known

    def _made(self, z: Array, slopes: Slopes) -> Differences:
        """Returns the differences of all predictions by each number."""
        base_outputs, base = self.outputs(z), self._flat(self.predictions(z))
        moves = [(k, step) for k in range(len(z)) for step in self._steps(k, z, slopes)]
        points = []
        for k, step in moves:
            moved = z.copy()
            moved[k] += step
            points.append(moved)
        found: list[list[tuple[float, Array]]] = [[] for _ in z]  # moves and changes
        for (k, step), moved, outputs in zip(
            moves, points, self._all_outputs(points, moves, base_outputs), strict=True
        ):
            if outputs is not None:
                found[k].append((step, self._flat(self._read(outputs, moved)) - base))
        delays = [is_delay(row) for row in self.rows]
        return differences(z.copy(), slopes, found, delays, len(base))

    def _flat(self, predictions: Sequence[Array]) -> Array:
        """Returns the predictions of all fitted rows that are not thinned out, in one array."""
        pairs = zip(self.experiments, predictions, strict=True)
        return np.concatenate([own[one.fitted][:: self._thin].ravel() for one, own in pairs])

    def _steps(self, k: int, z: Array, slopes: Slopes) -> list[float]:
        """Returns the steps of the differences of a number within its limits."""
        row = self.rows[k]
        low, high = row.bounds(self.before[row.key])
        both = (slopes.step, -slopes.step)
        steps = [step for step in both if low <= z[k] + step <= high]
        return steps if slopes.both or is_delay(row) else steps[:1]

    def _all_outputs(
        self, points: Sequence[Array], moves: Sequence[tuple[int, float]], base: list[Array]
    ) -> Iterator[list[Array] | None]:
        """Yields the simulated outputs at each point; None where the plant refuses it.

        A number of sensors alone needs no simulation. Worker processes simulate all points first.
        """
        needed = [bool(self._simulated[k]) for k, _ in moves]
        if self.workers is not None:
            many = [self.values(point) for point, own in zip(points, needed, strict=True) if own]
            found = iter(self.workers.outputs(self.experiments, many, self.parameters))
            yield from (next(found) if own else base for own in needed)
            return
        for point, own in zip(points, needed, strict=True):
            try:
                yield self._simulate(point) if own else base
            except (LogError, FmuError):
                yield None

    def bounds(self) -> tuple[Array, Array]:
        """Returns the limits of z, which are 0 of numbers that are held."""
        low, high = zip(*(row.bounds(self.before[row.key]) for row in self.rows), strict=True)
        if self._held is None:
            return np.array(low), np.array(high)
        return np.where(self._held, 0.0, low), np.where(self._held, 0.0, high)

    @contextmanager
    def holding(self, numbers: NDArray[np.bool_]) -> Iterator[None]:
        """Keeps some numbers (rows,) at the robot file's values, z = 0, within the block."""
        self._held = numbers
        try:
            yield
        finally:
            self._held = None

    def _weights(self, experiment: Experiment) -> Array:
        return np.array([self.noise[key] for key in experiment.channels])

    def series(self, jacobian: Array, residuals: Array) -> list[Series]:
        """Returns residuals and derivatives of each channel of each log, without the priors."""
        found, start = [], 0
        for one, counted in zip(self.experiments, self.counted, strict=True):
            own = counted[:: self._thin]
            part = slice(start, start + own.size)
            start += own.size
            error = residuals[part].reshape(own.shape)
            slopes = jacobian[part].reshape(*own.shape, -1)
            channels = np.array(one.channels)
            for key in dict.fromkeys(one.channels):
                at = channels == key
                share = float(np.mean(own[:, at]))
                found.append(Series(key, error[:, at], slopes[:, at], share))
        return found
