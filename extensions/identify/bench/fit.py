"""Fits a servo to bench logs, with the unknowns and the least squares of `hexapod identify`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.extensions.identify.bench.log import BenchLog
from hexapod_cosim.extensions.identify.bench.pendulum import Bench, Swing, stacked
from hexapod_cosim.extensions.identify.fitting.covariance import Series, coloured_information
from hexapod_cosim.extensions.identify.fitting.least_squares import damped_step, huber
from hexapod_cosim.extensions.identify.numbers import Unknown, section
from hexapod_cosim.extensions.identify.numbers.servo import SERVO, with_friction_model
from hexapod_cosim.models import Robot

Array = NDArray[np.float64]
# rad  of an angle, some encoder steps: nearly all residuals count linearly, as in the errors that
# a fit is judged by; with squares few long deviations of one log would choose the servo
NOISE = 0.004
STEP = 1e-3  # priors  of the differences
STEPS = 40  # of the optimiser
DAMPINGS = (0.0, 30.0, 1e3, 3e4, 1e6)  # of its steps [1/prior^2]
ENOUGH = 2e-4  # relative change of the sum of squares at which a search ends
COARSE = 0.003  # s  of the search's steps
SEEDS = 3  # starts of the search
SPREAD = 1.0  # priors  of the further starts
SHORT = 25  # steps from each start, before the best one is finished
QUANTILE = 1.959963985  # of a normal distribution, for 95 %
OFFSET, DELAY = "bench.offset", "bench.delay"
BENCH = (
    Unknown(key=OFFSET, unit="rad", group="bench", prior=0.03, positive=False),
    Unknown(key=DELAY, unit="s", group="bench", prior=0.01, positive=False, low=0.0),
)
# of each model the largest one that it contains, whose fit is another start of its search
SIMPLER = {"m2": "m1", "m3": "m1", "m4": "m3", "m5": "m4", "m6": "m5"}
LIMITS = (
    section("servo.current_max", "A", "servo", 0.3),
    section("servo.goal_speed_max", "rad/s", "servo", 0.3),
)
NOT_FOUND = ("servo.kp", "servo.kd")  # these follow from the gain of each log


@dataclass(frozen=True)
class ServoFit:
    """A servo fitted to logs."""

    robot: Robot  # with the servo
    rows: tuple[Unknown, ...]
    z: Array  # (rows,)  distances from the start's values, in priors
    before: Mapping[str, float]
    deviations: Array  # (rows,) of z

    @property
    def values(self) -> dict[str, float]:
        """Returns the found numbers [SI] by their keys."""
        return _values(self.rows, self.before, self.z)

    def interval(self, key: str) -> tuple[float, float]:
        """Returns the 95 % interval of a number."""
        k = [row.key for row in self.rows].index(key)
        return self.rows[k].interval(self.values[key], QUANTILE * float(self.deviations[k]))

    def swing(self, bench: Bench) -> Swing:
        """Simulates the servo on the benches of logs."""
        return bench.simulate(self.robot.servo, self.values[OFFSET], self.values[DELAY])


def _values(rows: Sequence[Unknown], before: Mapping[str, float], z: Array) -> dict[str, float]:
    """Returns the numbers by key at distances z (rows,) from those before, in priors."""
    return {
        row.key: row.value(one, before[row.key]) for row, one in zip(rows, z.tolist(), strict=True)
    }


class _Problem:
    """Residuals of angles in deviations, with those from the start's values behind them."""

    def __init__(self, bench: Bench, robot: Robot, rows: Sequence[Unknown]) -> None:
        self.bench, self.robot, self.rows = bench, robot, tuple(rows)
        self.before = {row.key: row.read(robot) for row in rows}

    def errors(self, points: Array) -> Array:
        """Returns simulated - measured angles in deviations (rows, points, logs)."""
        values = [_values(self.rows, self.before, z) for z in points]
        robots = [self.changed(one) for one in values]
        offset, delay = (np.array([[one[key]] for one in values]) for key in (OFFSET, DELAY))
        swing = self.bench.simulate(stacked([one.servo for one in robots]), offset, delay)
        error = swing.angle - self.bench.measured[:, None]
        return np.where(self.bench.counted[:, None], error, 0.0) / NOISE

    def changed(self, values: Mapping[str, float]) -> Robot:
        """Returns the robot with the servo's numbers."""
        robot = self.robot
        for row in self.rows:
            robot = row.write(robot, values[row.key])
        return robot

    def residuals(self, z: Array) -> Array:
        return np.concatenate([self.errors(z[None])[:, 0].ravel(), z])

    def slopes(self, z: Array) -> Array:
        """Returns the derivatives of the errors (rows, logs, numbers)."""
        steps = np.where(z + STEP > self.bounds()[1], -STEP, STEP)
        errors = self.errors(np.vstack([z, z + np.diag(steps)]))
        found = (errors[:, 1:] - errors[:, :1]) / steps[:, None]
        return np.moveaxis(found, 1, 2)

    def jacobian(self, z: Array) -> Array:
        slopes = self.slopes(z)
        return np.vstack([slopes.reshape(-1, len(z)), np.eye(len(z))])

    def cost(self, z: Array) -> float:
        """Returns what a search lowers."""
        return huber(self.residuals(z))

    def place(self, fit: ServoFit) -> Array:
        """Returns the numbers (numbers,) at which the servo is that of a fit."""
        own = {row.key: row.read(fit.robot) for row in self.rows} | fit.values
        return np.array([row.distance(own[row.key], self.before[row.key]) for row in self.rows])

    def starts(self, seeds: int) -> list[Array]:
        """Returns the start's numbers and others near them."""
        rng, size = np.random.default_rng(1), len(self.rows)
        further = SPREAD * rng.standard_normal((seeds - 1, size))
        return list(np.clip(np.vstack([np.zeros(size), further]), *self.bounds()))

    def bounds(self) -> tuple[Array, Array]:
        low, high = zip(*(row.bounds(self.before[row.key]) for row in self.rows), strict=True)
        return np.array(low), np.array(high)


def fit_servo(
    logs: Sequence[BenchLog],
    robot: Robot,
    model: str | None,
    *,
    seeds: int = SEEDS,
    known: dict[str | None, ServoFit] | None = None,
) -> ServoFit:
    """Returns the servo that follows bench logs best, at least as well as with a simpler model.

    Args:
        logs: their gains are known.
        robot: whose servo is where the search begins.
        model: friction model, "m1" to "m6"; None: of the bench alone offset and delay are sought.
        seeds: number of starts.
        known: fits to the same logs from calls before, by model; this one's are added.

    Raises HexapodError for an unknown model and a servo without a motor.
    """
    known = {} if known is None else known
    if model in known:
        return known[model]
    start = robot if model is None else with_friction_model(robot, model)
    rows = BENCH if model is None else unknowns(start)
    problem, found = _Problem(Bench(logs, step=COARSE), start, rows), []
    if model in SIMPLER:
        simpler = fit_servo(logs, robot, SIMPLER[model], seeds=seeds, known=known)
        found.append(problem.place(simpler))
        found.append(_searched(problem, found[0], SHORT))
    found += [_searched(problem, z, SHORT) for z in problem.starts(seeds)]
    problem.bench = Bench(logs)
    z = _searched(problem, min(found, key=problem.cost), STEPS)
    known[model] = ServoFit(
        robot=problem.changed(_values(rows, problem.before, z)),
        rows=tuple(rows),
        z=z,
        before=problem.before,
        deviations=np.sqrt(np.diag(_covariance(problem, z))),
    )
    return known[model]


def _covariance(problem: _Problem, z: Array) -> Array:
    """Returns the covariance of the numbers (rows, rows), with the spectra of each log's errors."""
    errors, slopes = problem.errors(z[None])[:, 0], problem.slopes(z)
    series = [
        Series(errors[:, k : k + 1], slopes[:, k : k + 1], float(np.mean(own)))
        for k, own in enumerate(problem.bench.counted.T)
    ]
    return np.asarray(np.linalg.inv(coloured_information(series) + np.eye(len(z))))


def _searched(problem: _Problem, z: Array, steps: int) -> Array:
    """Returns the numbers of the least sum of squares near a start.

    The steps are Levenberg and Marquardt's; several dampings are simulated at once.
    """
    bounds = problem.bounds()
    residuals = problem.residuals(z)
    for _ in range(steps):
        cost, jacobian = huber(residuals), problem.jacobian(z)
        points = np.array([
            np.clip(z + damped_step(jacobian, residuals, z, bounds, damping), *bounds)
            for damping in DAMPINGS
        ])  # fmt: skip
        errors = problem.errors(points)
        found = [np.concatenate([errors[:, k].ravel(), own]) for k, own in enumerate(points)]
        costs = [huber(one) for one in found]
        best = int(np.argmin(costs))
        if not costs[best] < cost:
            break
        z, residuals = points[best], found[best]
        if costs[best] > (1.0 - ENOUGH) * cost:
            break
    return z


def unknowns(robot: Robot) -> Sequence[Unknown]:
    """Returns the rows of the servo's numbers and of the bench's."""
    limits = [row for row in LIMITS if row.read(robot) > 0.0]
    rows = [row for row in SERVO if row.applies(robot) and row.key not in NOT_FOUND]
    return [*(row.of_robot(robot) for row in (*rows, *limits)), *BENCH]
