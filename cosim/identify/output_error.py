"""Fits the unknown numbers to the readings of logs by output error.

The numbers minimise the sum of squares of (predicted - measured) / noise over all readings, and of
(number - number before) / prior over all numbers. The second sum keeps the robot file's value
where the readings tell nothing. With white noise this is the most probable robot; the covariance is
that of the linearised problem, plus the square of the step that the optimiser left. The noise of a
channel is the typical size of its residuals, and residuals beyond three deviations count linearly
(Huber's loss). Correlated residuals count as fewer readings.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.identify.experiment import (
    Experiment,
    needs_simulation,
    readings,
    simulated,
)
from hexapod_cosim.cosim.identify.log import CHANNELS, LogError
from hexapod_cosim.cosim.identify.log_plant import LogPlant
from hexapod_cosim.cosim.identify.unknowns import DELAY, Unknown, value_before
from hexapod_cosim.models import FmuError, Robot

Array = NDArray[np.float64]
Progress = Callable[[str], None]
# Forces and accelerations have peaks at touch-downs. While the numbers are far off, these come at
# wrong times, and a difference says nothing of the next touch-down. Torques jump when a command
# comes, so that they are no smooth functions of the sensors' delay. Both are left out at first.
SMOOTH = ("angle", "speed", "gyroscope", "position", "attitude")
STEP = 0.1  # of a difference, in priors: large against the integrator's errors
ENOUGH = 1e-4  # relative change of the cost at which a stage ends
TO_DEVIATION = 1.4826  # from the median of absolute values, of a normal distribution
MOST_RESIDUALS = 150_000  # later ones are thinned evenly
LONGEST_CORRELATION = 50  # rows
# A reading is left out around a jump of the simulated signal: there a shift in time by a fraction
# of a row, of which a difference tells nothing, is a large error.
JUMP = 1.0  # second difference of a simulated signal [deviations]
BESIDE = 6  # rows before and after a jump
FLOOR = 1e-9  # smallest noise, in the units of the channels


@dataclass(frozen=True)
class Stage:
    """One run of the optimiser."""

    channels: tuple[str, ...]
    share: float  # of the residuals before it, which counts as noise
    scale: float  # of Huber's loss: larger residuals count linearly [deviations]
    steps: int  # of the optimiser at most


ALL = tuple(channel.key for channel in CHANNELS)
STAGES = (Stage(SMOOTH, 0.3, 1.0, 15), Stage(ALL, 1.0, 1.0, 25), Stage(ALL, 1.0, 3.0, 25))


@dataclass(frozen=True)
class Fit:
    """Holds the most probable numbers, with what their intervals are made of."""

    rows: tuple[Unknown, ...]
    before: Mapping[str, float]  # values of the robot file
    z: Array  # (rows,)  distances from these, in priors
    covariance: Array  # (rows, rows) of z
    singular: Array  # singular values of the readings' sensitivity, in priors, largest first
    noise: Mapping[str, float]  # by channel
    correlated: Mapping[str, float]  # by channel: readings that count as one
    predictions: tuple[Array, ...]  # (rows, columns) of each experiment

    @property
    def values(self) -> dict[str, float]:
        """Returns the numbers by key."""
        return {
            row.key: row.value(z, self.before[row.key])
            for row, z in zip(self.rows, self.z.tolist(), strict=True)
        }

    @property
    def deviations(self) -> dict[str, float]:
        """Standard deviations by key, in priors: 1 where the logs tell nothing."""
        own = np.sqrt(np.diag(self.covariance))
        return {row.key: float(value) for row, value in zip(self.rows, own, strict=True)}


class Problem:
    """The residuals of experiments and their derivatives, as functions of z."""

    def __init__(
        self,
        plant: LogPlant,
        robot: Robot,
        experiments: Sequence[Experiment],
        rows: Sequence[Unknown],
    ) -> None:
        self.plant, self.robot = plant, robot
        self.experiments, self.rows = tuple(experiments), tuple(rows)
        self.before = {row.key: value_before(row, robot) for row in rows}
        self.noise: dict[str, float] = {}
        count = sum(
            len(range(*one.fitted.indices(len(one.log.time)))) * len(one.columns)
            for one in self.experiments
        )
        self._thin = -(-count // MOST_RESIDUALS)
        self._measured = [one.measured for one in self.experiments]
        self._outputs: tuple[bytes, list[Array]] | None = None
        self._size = 0  # of the residuals
        self.counted = [
            np.isfinite(measured[one.fitted])
            for one, measured in zip(self.experiments, self._measured, strict=True)
        ]  # which readings count (fitted rows, columns)

    def values(self, z: Array) -> dict[str, float]:
        """Returns the numbers by key."""
        pairs = zip(self.rows, z.tolist(), strict=True)
        return {row.key: row.value(one, self.before[row.key]) for row, one in pairs}

    def outputs(self, z: Array) -> list[Array]:
        """Returns the simulated outputs of each experiment; those of the last z are kept."""
        key = z.tobytes()
        if self._outputs is None or self._outputs[0] != key:
            values = self.values(z)
            found = [
                simulated(self.plant, one, self.robot, self.rows, values)
                for one in self.experiments
            ]
            self._outputs = key, found
        return self._outputs[1]

    def predictions(self, z: Array) -> list[Array]:
        """Returns the readings of each experiment (rows, columns)."""
        values = self.values(z)
        pairs = zip(self.experiments, self.outputs(z), strict=True)
        return [readings(one, outputs, values) for one, outputs in pairs]

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

    def jacobian(self, z: Array) -> Array:
        """Returns the derivatives of the residuals, by differences of simulations."""
        base_outputs = self.outputs(z)
        base = self.residuals(z)
        found = np.empty((len(base), len(z)))
        for k, row in enumerate(self.rows):
            low, high = row.bounds(self.before[row.key])
            steps = [step for step in (STEP, -STEP) if low <= z[k] + step <= high]
            slopes = []
            # of the delay the smaller slope is the one within a period of the commands
            for step in steps if row.key == DELAY else steps[:1]:
                moved = z.copy()
                moved[k] += step
                if not needs_simulation(row):
                    self._outputs = moved.tobytes(), base_outputs
                slopes.append((self.residuals(moved) - base) / step)
            found[:, k] = min(slopes, key=lambda slope: float(slope @ slope))
        self._outputs = z.tobytes(), base_outputs
        found[~np.isfinite(found)] = 0.0
        return found

    def bounds(self) -> tuple[Array, Array]:
        """Returns the limits of z."""
        low, high = zip(*(row.bounds(self.before[row.key]) for row in self.rows), strict=True)
        return np.array(low), np.array(high)

    def _weights(self, experiment: Experiment) -> Array:
        return np.array([self.noise[key] for key in experiment.channels])

    def correlation(self, errors: Sequence[Array]) -> dict[str, float]:
        """Returns, for each channel, how many readings in a row count as one.

        That is 1 + 2 sum of the autocorrelations up to the first that is not positive, as a mean
        over the channel's columns.
        """
        found: dict[str, list[float]] = {}
        for one, error in zip(self.experiments, errors, strict=True):
            for key, column in zip(one.channels, error[:: self._thin].T, strict=True):
                found.setdefault(key, []).append(_correlated(column))
        return {key: float(np.mean(parts)) for key, parts in found.items()}

    def covariance(self, jacobian: Array, correlated: Mapping[str, float]) -> tuple[Array, Array]:
        """Returns the covariance of z and the singular values of the readings' sensitivity."""
        scales = [
            np.tile(
                [1.0 / np.sqrt(correlated[key]) for key in one.channels],
                len(range(*one.fitted.indices(len(one.log.time)))[:: self._thin]),
            )
            for one in self.experiments
        ]
        weighted = jacobian[: -len(self.rows)] * np.concatenate(scales)[:, None]
        information = weighted.T @ weighted
        eigenvalues = np.linalg.eigvalsh(information)[::-1]
        covariance = np.linalg.inv(information + np.eye(len(self.rows)))
        return covariance, np.sqrt(np.maximum(eigenvalues, 0.0))


def remaining_step(jacobian: Array, residuals: Array) -> Array:
    """Returns the step (rows,) that Gauss and Newton's method would still take, in priors.

    It is 0 at an optimum. Residuals beyond three deviations count as three.
    """
    bounded = np.clip(residuals, -STAGES[-1].scale, STAGES[-1].scale)
    normal, right = jacobian.T @ jacobian, jacobian.T @ bounded
    return np.asarray(-np.linalg.lstsq(normal, right, rcond=None)[0], dtype=np.float64)


def _correlated(column: Array) -> float:
    """Returns how many readings of a column of residuals in a row count as one."""
    centred = column - np.mean(column)
    power = float(centred @ centred)
    total = 1.0
    for lag in range(1, min(LONGEST_CORRELATION, len(column) // 4)):
        share = float(centred[lag:] @ centred[:-lag]) / power if power > 0.0 else 0.0
        if share <= 0.0:
            break
        total += 2.0 * share
    return total


def read_noise(problem: Problem) -> dict[str, float]:
    """Returns the noise of each channel from the readings alone.

    It is a robust estimate from second differences, in which slow motions cancel:
    median |y[k-1] - 2 y[k] + y[k+1]| / (0.6745 sqrt 6).
    """
    found: dict[str, list[float]] = {}
    for one in problem.experiments:
        second = np.abs(np.diff(one.measured[one.fitted], n=2, axis=0))
        typical = np.nanmedian(second, axis=0) / (0.6745 * np.sqrt(6.0))
        for key, value in zip(one.channels, typical.tolist(), strict=True):
            found.setdefault(key, []).append(value)
    return {key: float(np.median(values)) for key, values in found.items()}


def fit(problem: Problem, *, progress: Progress | None = None) -> Fit:
    """Returns the most probable numbers. Raises HexapodError when the plant refuses the start."""
    from scipy.optimize import least_squares  # noqa: PLC0415  slow to import

    z, least, bounds = np.zeros(len(problem.rows)), read_noise(problem), problem.bounds()
    for number, stage in enumerate(STAGES):
        problem.set_noise(
            problem.errors(z), share=stage.share, least=least, channels=stage.channels
        )
        if progress is not None:
            progress(f"stage {number + 1} of {len(STAGES)}")
        problem.leave_out_jumps(z)
        z = least_squares(
            problem.residuals,
            z,
            jac=problem.jacobian,
            bounds=bounds,
            loss="huber",
            f_scale=stage.scale,
            max_nfev=stage.steps,
            ftol=ENOUGH,
            xtol=1e-6,
            gtol=1e-8,
        ).x
    errors = problem.errors(z)
    problem.set_noise(errors)
    correlated = problem.correlation(errors)
    jacobian = problem.jacobian(z)
    covariance, singular = problem.covariance(jacobian, correlated)
    left = remaining_step(jacobian, problem.residuals(z))
    # where touch-downs make the sum of squares rough, the optimiser stops on the way
    covariance = covariance + np.outer(left, left)
    return Fit(
        rows=problem.rows,
        before=problem.before,
        z=z,
        covariance=covariance,
        singular=singular,
        noise=dict(problem.noise),
        correlated=correlated,
        predictions=tuple(problem.predictions(z)),
    )
