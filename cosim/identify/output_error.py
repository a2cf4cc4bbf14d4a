"""Fits the unknown numbers to the readings of logs by output error.

The numbers minimise the sum of squares of (predicted - measured) / noise over all readings, and of
(number - number before) / prior over all numbers. The second sum keeps the robot file's value
where the readings tell nothing. With white noise this is the most probable robot; the covariance is
that of the linearised problem, plus the square of the step that the optimiser left. The noise of a
channel is the typical size of its residuals, and residuals beyond three deviations count linearly
(Huber's loss). Correlated residuals count as fewer readings. Residuals larger than the noise of the
readings themselves say that the model does not explain the log: they widen all intervals.

A search on the first seconds of long logs finds the valley of the best numbers, all rows its
bottom. The numbers of contacts act at touch-downs alone, where gradients say little. So they are
also tried one by one over their range, and the value with the least sum of squares over all rows is
the next start.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.identify.experiment import (
    Experiment,
    first_part,
    needs_simulation,
    readings,
    simulated,
)
from hexapod_cosim.cosim.identify.log import CHANNELS, LogError
from hexapod_cosim.cosim.identify.log_plant import LogPlant
from hexapod_cosim.cosim.identify.unknowns import DELAY, Unknown, value_before
from hexapod_cosim.cosim.identify.workers import Workers
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
SEARCH = (Stage(SMOOTH, 0.3, 1.0, 15), Stage(ALL, 1.0, 1.0, 25))
REFINE = Stage(ALL, 1.0, 3.0, 25)
SHORT = 6.0  # s    of each log on which the search is made
TRIED = (-2.0, -1.0, -0.5, -0.25, -0.1, 0.1, 0.25, 0.5, 1.0, 2.0)  # priors from the present value
BETTER = 1e-4  # share of the sum of squares by which another start must be better
ROUNDS = 3  # of trying starts, at most
CLIPPED = 5.0  # deviations    of a residual in the test whether the model explains the log
# Largest mean square of residuals over that of the readings' noise, of many readings. That of the
# noise has a relative deviation of about 3.8 over the root of their number.
EXPLAINED = 1.1
UNCERTAIN, DEVIATIONS = 3.8, 3.0


@dataclass(frozen=True)
class Misfit:
    """How large residuals of a channel are."""

    value: float  # mean square of residuals over that of the noise
    readings: int

    @property
    def explained(self) -> bool:
        """Whether the noise of the readings may be all of it."""
        return self.value <= EXPLAINED + DEVIATIONS * UNCERTAIN / float(np.sqrt(self.readings))


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
    misfit: Mapping[str, Misfit]  # by channel
    held_out: Mapping[str, Misfit]  # the same on held-out rows; empty without them

    @property
    def unexplained(self) -> dict[str, float]:
        """Returns the channels that the model does not explain, with the larger mean square."""
        both = [*self.misfit.items(), *self.held_out.items()]
        found: dict[str, float] = {}
        for key, one in both:
            if not one.explained:
                found[key] = max(one.value, found.get(key, 0.0))
        return found

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
        workers: Workers | None = None,
    ) -> None:
        self.plant, self.robot, self.workers = plant, robot, workers
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
        self.counted = self.all_known()  # which readings count (fitted rows, columns)

    def all_known(self) -> list[NDArray[np.bool_]]:
        """Returns which readings are numbers (fitted rows, columns)."""
        pairs = zip(self.experiments, self._measured, strict=True)
        return [np.isfinite(measured[one.fitted]) for one, measured in pairs]

    def count_all(self) -> None:
        """Makes all readings count that are numbers."""
        self.counted = self.all_known()

    def shortened(self, seconds: float) -> Problem:
        """Returns the problem of the first seconds of the logs; itself where none is longer."""
        parts = [first_part(one, seconds) for one in self.experiments]
        if all(part is one for part, one in zip(parts, self.experiments, strict=True)):
            return self
        return Problem(self.plant, self.robot, parts, self.rows, self.workers)

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
        base_outputs, base = self.outputs(z), self.residuals(z)
        found = np.zeros((len(base), len(z)))
        moves = [(k, step) for k in range(len(z)) for step in self._steps(k, z)]
        points = []
        for k, step in moves:
            moved = z.copy()
            moved[k] += step
            points.append(moved)
        slopes: dict[int, Array] = {}
        for (k, step), moved, outputs in zip(
            moves, points, self._all_outputs(points, moves, base_outputs), strict=True
        ):
            if outputs is None:
                continue
            self._outputs = moved.tobytes(), outputs
            slope = (self.residuals(moved) - base) / step
            # of the delay the smaller slope is the one within a period of the commands
            if k not in slopes or _size(slope) < _size(slopes[k]):
                slopes[k] = slope
        for k, slope in slopes.items():
            found[:, k] = slope
        self._outputs = z.tobytes(), base_outputs
        found[~np.isfinite(found)] = 0.0
        return found

    def _steps(self, k: int, z: Array) -> list[float]:
        """Returns the steps of the differences of a number: one, of the delay both ways."""
        row = self.rows[k]
        low, high = row.bounds(self.before[row.key])
        steps = [step for step in (STEP, -STEP) if low <= z[k] + step <= high]
        return steps if row.key == DELAY else steps[:1]

    def _all_outputs(
        self, points: Sequence[Array], moves: Sequence[tuple[int, float]], base: list[Array]
    ) -> Iterator[list[Array] | None]:
        """Yields the simulated outputs at each point; None where the plant refuses it.

        A number of sensors alone needs no simulation. Worker processes simulate all points first.
        """
        needed = [needs_simulation(self.rows[k]) for k, _ in moves]
        if self.workers is not None:
            many = [self.values(point) for point, own in zip(points, needed, strict=True) if own]
            found = iter(self.workers.outputs(self.experiments, many))
            yield from (next(found) if own else base for own in needed)
            return
        for point, own in zip(points, needed, strict=True):
            try:
                yield self.outputs(point) if own else base
            except (LogError, FmuError):
                yield None

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


def _size(slope: Array) -> float:
    return float(slope @ slope)


def remaining_step(jacobian: Array, residuals: Array) -> Array:
    """Returns the step (rows,) that Gauss and Newton's method would still take, in priors.

    It is 0 at an optimum. Residuals beyond three deviations count as three.
    """
    bounded = np.clip(residuals, -REFINE.scale, REFINE.scale)
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
    found: dict[str, list[Array]] = {}
    for one in problem.experiments:
        second = np.abs(np.diff(one.measured[one.fitted], n=2, axis=0))
        for key, column in zip(one.channels, second.T, strict=True):
            found.setdefault(key, []).append(column)
    scale = 0.6745 * np.sqrt(6.0)
    return {key: float(np.nanmedian(np.concatenate(own))) / scale for key, own in found.items()}


def better_start(problem: Problem, start: Array | None) -> Array:
    """Returns a start (rows,), or 0 where the robot file's numbers have smaller errors."""
    zero = np.zeros(len(problem.rows))
    before = problem.typical(problem.errors(zero))
    if start is None:
        return zero
    try:
        after = problem.typical(problem.errors(start))
    except (LogError, FmuError):
        return zero
    own = [key for key, size in before.items() if size > 0.0]
    own = [key for key in own if key in SMOOTH] or own
    gains = [np.log(max(after[key], FLOOR) / before[key]) for key in own]
    return start if sum(gains) < 0.0 else zero


def fit(problem: Problem, *, start: Array | None = None, progress: Progress | None = None) -> Fit:
    """Returns the most probable numbers.

    start: z of another start than the robot file's numbers; the one with the smaller errors is
    taken.

    Raises HexapodError when the plant refuses the robot file's numbers.
    """
    report: Progress = progress or (lambda _text: None)
    short = problem.shortened(SHORT)
    z = better_start(short, start)
    for number, stage in enumerate(SEARCH):
        report(f"search, stage {number + 1} of {len(SEARCH)}")
        z = _optimised(short, z, stage, read_noise(short))
    report("other starts of the contacts")
    z = _best_of_starts(short, z)
    report("all rows")
    least = read_noise(problem)
    z = _optimised(problem, z, REFINE, least)
    counted = list(problem.counted)
    z = _optimised(problem, z, REFINE, least, jumps=True)
    problem.counted = counted
    return _judged(problem, z, least)


def _optimised(
    problem: Problem, z: Array, stage: Stage, least: Mapping[str, float], *, jumps: bool = False
) -> Array:
    """Returns the numbers of the least sum of squares near a start.

    jumps: whether rows beside jumps of the simulated signals count too.
    """
    from scipy.optimize import least_squares  # noqa: PLC0415  slow to import

    problem.set_noise(problem.errors(z), share=stage.share, least=least, channels=stage.channels)
    if jumps:
        problem.count_all()
    else:
        problem.leave_out_jumps(z)
    found = least_squares(
        problem.residuals,
        z,
        jac=problem.jacobian,
        bounds=problem.bounds(),
        loss="huber",
        f_scale=stage.scale,
        max_nfev=stage.steps,
        ftol=ENOUGH,
        xtol=1e-6,
        gtol=1e-8,
    )
    return np.asarray(found.x, dtype=np.float64)


def _best_of_starts(problem: Problem, z: Array) -> Array:
    """Returns the best numbers that the optimiser finds from other values of the contacts."""
    least = read_noise(problem)
    z = _optimised(problem, z, REFINE, least)
    best = _cost(problem, z)
    for _ in range(ROUNDS):
        moved = _tried(problem, z)
        if np.array_equal(moved, z):
            break
        moved = _optimised(problem, moved, REFINE, least)
        cost = _cost(problem, moved)
        if cost > (1.0 - BETTER) * best:
            break
        z, best = moved, cost
    return z


def _tried(problem: Problem, z: Array) -> Array:
    """Returns the numbers with those of the contacts at the best of some values, one by one."""
    low, high = problem.bounds()
    z, best = z.copy(), (1.0 - BETTER) * _cost(problem, z)
    for k, row in enumerate(problem.rows):
        own = z[k]
        for step in TRIED if row.group == "contact" else ():
            if low[k] <= own + step <= high[k]:
                moved = z.copy()
                moved[k] = own + step
                cost = _cost(problem, moved)
                if cost < best:
                    z, best = moved, cost
    return z


def _cost(problem: Problem, z: Array) -> float:
    """Returns the sum of squares over all rows by Huber's loss."""
    counted, problem.counted = problem.counted, problem.all_known()
    size = np.abs(problem.residuals(z))
    problem.counted = counted
    near = np.minimum(size, REFINE.scale)
    return float(np.sum(near * (size - 0.5 * near)))


def _judged(problem: Problem, z: Array, least: Mapping[str, float]) -> Fit:
    """Returns the numbers with what the readings tell of them.

    least: noise of the readings themselves, by channel.
    """
    errors = problem.errors(z)
    problem.set_noise(errors)
    correlated = problem.correlation(errors)
    jacobian = problem.jacobian(z)
    covariance, singular = problem.covariance(jacobian, correlated)
    left = remaining_step(jacobian, problem.residuals(z))
    misfit = problem.misfit(z, least, "fitted")
    # errors of the model count as noise; at most the whole prior is unknown
    worst = max(1.0, *(one.value for one in misfit.values()))
    information = np.linalg.inv(covariance) - np.eye(len(z))
    # where touch-downs make the sum of squares rough, the optimiser stops on the way
    widened = np.linalg.inv(information / worst + np.eye(len(z))) + np.outer(left, left)
    return Fit(
        rows=problem.rows,
        before=problem.before,
        z=z,
        covariance=np.asarray(widened, dtype=np.float64),
        singular=singular / np.sqrt(worst),
        noise=dict(problem.noise),
        correlated=correlated,
        predictions=tuple(problem.predictions(z)),
        misfit=misfit,
        held_out=problem.misfit(z, least, "held_out"),
    )
