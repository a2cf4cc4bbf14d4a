"""The residuals of logs and their derivatives, as functions of the unknown numbers.

A residual is (predicted - measured) / noise of a reading. Numbers are distances z from the robot
file's, in units of what was known of them beforehand (priors), which are the last residuals.

Predictions jump where a touch-down or a lift-off does: a foot that barely leaves the ground has
another impact speed, and so another damping, than one that stays. Over such a jump a difference is
no derivative; its second difference shows it, and the reading does not count.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.extensions.identify.experiment import (
    Experiment,
    first_part,
    needs_simulation,
    readings,
    simulated,
)
from hexapod_cosim.extensions.identify.fitting import workers
from hexapod_cosim.extensions.identify.fitting.covariance import Series
from hexapod_cosim.extensions.identify.log import CHANNELS, LogError
from hexapod_cosim.extensions.identify.log_plant import LogPlant
from hexapod_cosim.extensions.identify.numbers.unknown import Unknown
from hexapod_cosim.extensions.identify.unknowns import is_delay, value_before
from hexapod_cosim.models import FmuError, Robot

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
ALL = tuple(channel.key for channel in CHANNELS)
TO_DEVIATION = 1.4826  # from the median of absolute values, of a normal distribution
MOST_RESIDUALS = 150_000  # rows are thinned evenly where there would be more
# A reading is left out around a jump of the simulated signal: there a shift in time by a fraction
# of a row, of which a difference tells nothing, is a large error.
JUMP = 1.0  # second difference of a simulated signal [deviations]
BESIDE = 6  # rows before and after a jump
BENT = 0.05  # deviations    second difference over short steps of a number, of a reading that jumps
# A larger share of readings that change otherwise than derivatives say does not jump: the valley of
# the sum of squares is curved, and a shorter step follows it.
CURVED = 0.1
UNLIKE = 0.5  # difference of slopes to both sides, in the smaller one, beyond which one jumps
FLOOR = 1e-9  # smallest noise, in the units of the channels


@dataclass(frozen=True)
class Slopes:
    """How derivatives are made of simulations."""

    step: float  # priors
    both: bool  # whether from both sides
    near: float  # priors: up to this distance from where they were made they count


# A long step is what the search needs while sums of squares are rough. But its error of second
# order hides combinations of numbers that the readings hardly tell: with it, the deviation of the
# torso's mass came out five times too small. Short central differences have converged there.
ROUGH = Slopes(0.1, both=False, near=0.1)
FINE = Slopes(0.01, both=True, near=1e-6)


@dataclass(frozen=True)
class Differences:
    """Differences of predictions at some numbers."""

    z: Array  # (numbers,)
    made: Slopes
    slopes: Array  # (predictions, numbers)  0 where the plant refuses the numbers
    bend: Array  # (predictions,)  largest second difference by a number that is no delay

    def count_at(self, z: Array, made: Slopes) -> bool:
        """Returns whether they count at numbers z."""
        return self.made == made and float(np.max(np.abs(z - self.z))) <= made.near


class Problem:
    """The residuals of experiments and their derivatives, as functions of z."""

    def __init__(
        self,
        plant: LogPlant,
        robot: Robot,
        experiments: Sequence[Experiment],
        rows: Sequence[Unknown],
        pool: Executor | None = None,
    ) -> None:
        """pool: worker processes of `simulating_workers` for the same experiments."""
        self.plant, self.robot, self.pool = plant, robot, pool
        self.rows = tuple(rows)
        self.before = {row.key: value_before(row, robot) for row in rows}
        self._kept: Flags = np.zeros(len(rows), dtype=np.bool_)  # see `keeping`
        self.noise: dict[str, float] = {}  # by channel
        self.parameters: dict[str, float] = {}  # further ones of the FMU
        self._needs = np.array([needs_simulation(row) for row in rows], dtype=np.bool_)
        self._size = 0  # of the residuals
        self._take(experiments, np.inf, MOST_RESIDUALS)

    def _take(self, experiments: Sequence[Experiment], seconds: float, most: int) -> None:
        """Takes experiments, of which the first seconds are simulated."""
        self.experiments, self._seconds = tuple(experiments), seconds
        self._measured = [one.measured for one in self.experiments]
        self.count_all()
        self._thin = -(-sum(own.size for own in self.counted) // most)
        self._outputs: tuple[bytes, list[Array]] | None = None
        self._differences: Differences | None = None  # the last ones
        self._nonlinear: Flags | None = None  # (predictions,)  see leave_out_nonlinear

    def shortened(
        self, seconds: float, *, parameters: Mapping[str, float], most: int = MOST_RESIDUALS
    ) -> Problem:
        """Returns the problem of the first seconds of the logs, without held-out rows.

        parameters: further ones of the FMU, by name. most: residuals, at most about.
        """
        found = Problem(self.plant, self.robot, self.experiments, self.rows, self.pool)
        found._take([first_part(one, seconds) for one in self.experiments], seconds, most)
        found.use(parameters)
        return found

    def use(self, parameters: Mapping[str, float]) -> None:
        """Replaces the further parameters of the FMU. Simulated derivatives are kept."""
        self.parameters, self._outputs = dict(parameters), None

    def bounds(self) -> tuple[Array, Array]:
        """Returns the limits of z, which are 0 of numbers that are kept."""
        low, high = zip(*(row.bounds(self.before[row.key]) for row in self.rows), strict=True)
        return np.where(self._kept, 0.0, low), np.where(self._kept, 0.0, high)

    @contextmanager
    def keeping(self, numbers: Flags) -> Iterator[None]:
        """Keeps some numbers (rows,) at the robot file's values, z = 0, within the block."""
        before, self._kept = self._kept, numbers
        yield
        self._kept = before

    def values(self, z: Array) -> dict[str, float]:
        """Returns the numbers by key."""
        pairs = zip(self.rows, z.tolist(), strict=True)
        return {row.key: row.value(one, self.before[row.key]) for row, one in pairs}

    def predictions(self, z: Array) -> list[Array]:
        """Returns the readings of each experiment (rows, columns)."""
        key = z[self._needs].tobytes()
        if self._outputs is None or self._outputs[0] != key:
            self._outputs = key, self._simulated(z)
        return self._read(self._outputs[1], z)

    def _simulated(self, z: Array) -> list[Array]:
        values = self.values(z)
        return [
            simulated(self.plant, one, self.robot, self.rows, values, self.parameters)
            for one in self.experiments
        ]

    def _read(self, outputs: Sequence[Array], z: Array) -> list[Array]:
        values = self.values(z)
        pairs = zip(self.experiments, outputs, strict=True)
        return [readings(one, own, values) for one, own in pairs]

    def errors(self, z: Array) -> list[Array]:
        """Returns predicted - measured in the fitted rows; 0 where a reading does not count."""
        parts = zip(
            self.experiments, self.predictions(z), self._measured, self.counted, strict=True
        )
        return [
            np.where(counted, (own - measured)[one.fitted], 0.0)
            for one, own, measured, counted in parts
        ]

    def residuals(self, z: Array) -> Array:
        """Returns all residuals in deviations; infinite ones where the plant refuses z."""
        try:
            errors = self.errors(z)
        except (LogError, FmuError):
            return np.full(self._size, np.inf)
        found = np.concatenate([*(own.ravel() for own in self._thinned(errors)), z])
        found[: -len(z)] /= self._noises()
        self._size = len(found)
        return found

    def _thinned(self, tables: Sequence[NDArray[np.generic]]) -> list[Array]:
        """Returns the rows of tables (fitted rows, columns) that are not thinned out."""
        return [np.asarray(own[:: self._thin]) for own in tables]

    def _noises(self) -> Array:
        """Returns the noise of each prediction."""
        parts = zip(self.experiments, self._thinned(self.counted), strict=True)
        return np.concatenate([np.tile(self._weights(one), len(own)) for one, own in parts])

    def _weights(self, experiment: Experiment) -> Array:
        return np.array([self.noise[key] for key in experiment.channels])

    # which readings count

    def all_known(self) -> list[Flags]:
        """Returns which readings are numbers (fitted rows, columns)."""
        pairs = zip(self.experiments, self._measured, strict=True)
        return [np.isfinite(measured[one.fitted]) for one, measured in pairs]

    def count_all(self) -> None:
        """Makes all readings count that are numbers."""
        self.counted = self.all_known()

    def leave_out_jumps(self, z: Array) -> None:
        """Makes readings count that are numbers and not beside a jump of the simulated signal."""
        self.count_all()
        for k, (one, own) in enumerate(zip(self.experiments, self.predictions(z), strict=True)):
            second = np.zeros(own.shape)
            second[1:-1] = np.diff(own, n=2, axis=0)
            jump = (np.abs(second) > JUMP * self._weights(one))[one.fitted]
            near = jump.copy()
            for shift in range(1, BESIDE + 1):
                near[shift:] |= jump[:-shift]
                near[:-shift] |= jump[shift:]
            self.counted[k] &= ~near

    def leave_out_bent(self, z: Array) -> None:
        """Makes readings not count that jump between the numbers at which derivatives are made, nor
        those that jumped on the way there.
        """
        jump = self._known(z, FINE).bend / self._noises() > BENT
        self._leave_out(jump if self._nonlinear is None else jump | self._nonlinear)

    def leave_out_nonlinear(self, change: Array, linear: Array) -> bool:
        """Makes readings not count from now on that change otherwise than derivatives say.

        Args:
            change: of all residuals.
            linear: what derivatives say of it.

        Returns whether any reading is new among these.
        """
        flags = np.abs(change - linear)[: -len(self.rows)] > BENT
        if float(np.mean(flags)) > CURVED:
            return False
        self._nonlinear = flags if self._nonlinear is None else flags | self._nonlinear
        return self._leave_out(flags)

    def _leave_out(self, flags: Flags) -> bool:
        """Makes flagged ones (predictions,) not count; returns whether any of them did."""
        start, new = 0, False
        for counted in self.counted:
            own = counted[:: self._thin]
            flagged = flags[start : start + own.size].reshape(own.shape)
            start += own.size
            new |= bool(np.any(own & flagged))
            own &= ~flagged
        return new

    # noise

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
        sizes: dict[str, list[Array]] = {}
        for one, error, counted in zip(self.experiments, errors, self.counted, strict=True):
            for key, column, own in zip(one.channels, error.T, counted.T, strict=True):
                sizes.setdefault(key, []).append(np.abs(column[own]))
        for key, parts in sizes.items():
            values = np.concatenate(parts)
            # of the typical error, in which rare peaks count little
            typical = TO_DEVIATION * float(np.median(values)) if len(values) else 0.0
            own_noise = max(share * typical, (least or {}).get(key, 0.0), FLOOR)
            self.noise[key] = own_noise if key in channels else np.inf

    # derivatives

    def jacobian(self, z: Array, made: Slopes = ROUGH) -> Array:
        """Returns the residuals' derivatives (residuals, rows), by differences of simulations."""
        known = self._known(z, made)
        counted = np.concatenate([own.ravel() for own in self._thinned(self.counted)])
        scale = np.where(counted, 1.0 / self._noises(), 0.0)
        return np.vstack([known.slopes * scale[:, None], np.eye(len(z))])

    def _known(self, z: Array, made: Slopes) -> Differences:
        """Returns the differences at z, or those near it that count there."""
        if self._differences is None or not self._differences.count_at(z, made):
            self._differences = self._made(z, made)
        return self._differences

    def _made(self, z: Array, made: Slopes) -> Differences:
        """Returns the differences of all predictions by each number."""
        base = self._flat(self.predictions(z))
        points, steps = [], []
        for k in range(len(z)):
            for step in self._steps(k, z, made):
                point = z.copy()
                point[k] += step
                points.append(point)
                steps.append((k, step))
        changes: list[list[tuple[float, Array]]] = [[] for _ in z]
        outputs = self._all_outputs(points, [bool(self._needs[k]) for k, _ in steps])
        for (k, step), point, own in zip(steps, points, outputs, strict=True):
            if own is not None:
                changes[k].append((step, self._flat(self._read(own, point)) - base))
        slopes, bend = np.zeros((len(base), len(z))), np.zeros(len(base))
        for k, row in enumerate(self.rows):
            slopes[:, k], second = differences(changes[k], len(base))
            if not is_delay(row):  # by which readings jump when a command comes
                np.maximum(bend, second, out=bend)
        return Differences(z.copy(), made, slopes, bend)

    def _flat(self, predictions: Sequence[Array]) -> Array:
        """Returns the predictions of all fitted rows that are not thinned out, in one array."""
        pairs = zip(self.experiments, predictions, strict=True)
        return np.concatenate(
            [own.ravel() for own in self._thinned([p[e.fitted] for e, p in pairs])]
        )

    def _steps(self, k: int, z: Array, made: Slopes) -> list[float]:
        """Returns the steps of the differences of a number within its limits."""
        row = self.rows[k]
        low, high = row.bounds(self.before[row.key])
        both = (made.step, -made.step)
        steps = [step for step in both if low <= z[k] + step <= high]
        return steps if made.both or is_delay(row) else steps[:1]

    def _all_outputs(
        self, points: Sequence[Array], needed: Sequence[bool]
    ) -> list[list[Array] | None]:
        """Returns the simulated outputs at each point; None where the plant refuses it.

        needed: whether a point needs a simulation; one that moves a number of sensors does not.
        """
        if self.pool is not None:
            submitted = [
                self.pool.submit(
                    workers.simulate, self.values(point), self._seconds, self.parameters
                )
                for point, own in zip(points, needed, strict=True)
                if own
            ]
            done = iter([future.result() for future in submitted])
            return [next(done) if own else self._last() for own in needed]
        return [
            self._try(point) if own else self._last()
            for point, own in zip(points, needed, strict=True)
        ]

    def _last(self) -> list[Array] | None:
        """Returns the outputs that were simulated last for predictions."""
        return None if self._outputs is None else self._outputs[1]

    def _try(self, z: Array) -> list[Array] | None:
        try:
            return self._simulated(z)
        except (LogError, FmuError):
            return None

    def series(self, jacobian: Array, residuals: Array) -> list[Series]:
        """Returns residuals and derivatives of each channel of each log, without the priors."""
        found, start = [], 0
        for one, own in zip(self.experiments, self._thinned(self.counted), strict=True):
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


def differences(changes: Sequence[tuple[float, Array]], count: int) -> tuple[Array, Array]:
    """Returns slopes and second differences (predictions,) of steps of a number and the changes
    that they make.

    Of two slopes it is the mean; where they differ, the smaller one: over a jump a slope is too
    large, by so much more the shorter the step is.
    """
    found = [change / step for step, change in changes]
    bend = np.zeros(count)
    if not found:
        return np.zeros(count), bend
    slope = found[0]
    if len(found) == 2:
        forth, back = found
        smaller = np.where(np.abs(forth) < np.abs(back), forth, back)
        differ = np.abs(forth - back) > UNLIKE * np.abs(smaller)
        slope = np.where(differ, smaller, 0.5 * (forth + back))
        bend = np.nan_to_num(np.abs(changes[0][1] + changes[1][1]), posinf=0.0)
    return np.where(np.isfinite(slope), slope, 0.0), bend
