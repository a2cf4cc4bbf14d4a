"""Fits a servo to bench logs, with the unknowns and the least squares of `hexapod identify`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hexapod_cosim.extensions.identify.bench.log import BenchLog
from hexapod_cosim.extensions.identify.bench.pendulum import STEP, Bench, Swing, stacked
from hexapod_cosim.extensions.identify.fitting.covariance import Series, coloured_information
from hexapod_cosim.extensions.identify.fitting.least_squares import damped_step, huber
from hexapod_cosim.extensions.identify.numbers import Unknown, section
from hexapod_cosim.extensions.identify.numbers.servo import SERVO, with_friction_model
from hexapod_cosim.models import Robot
from hexapod_cosim.models.arrays import Array

# rad  of an angle, some encoder steps: nearly all residuals count linearly, as in the errors that
# a fit is judged by; with squares few long deviations of one log would choose the servo
NOISE = 0.004
APART = 1e-3  # priors  between the points of a derivative
DAMPINGS = (0.0, 30.0, 1e3, 3e4, 1e6)  # of its steps [1/prior^2]
TRIED = len(DAMPINGS)
ENOUGH = 2e-4  # relative change of the sum of squares at which a search ends
# of the search: length [s] of the simulation's steps and most steps of the optimiser, first from
# all starts, then from the best place
STAGES = ((0.005, 25), (0.003, 40), (STEP, 2))
SEEDS = 3  # starts of the search
SPREAD = 1.0  # priors  of the further starts
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
        return self.rows[k].interval(self.values[key], float(self.deviations[k]))

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

    def residuals(self, points: Array) -> list[Array]:
        """Returns those of each of some points (points, numbers)."""
        errors = self.errors(points)
        return [np.concatenate([errors[:, k].ravel(), z]) for k, z in enumerate(points)]

    def slopes(self, places: Sequence[Array]) -> list[Array]:
        """Returns the derivatives of the errors (rows, logs, numbers) at each of some places."""
        high = self.bounds()[1]
        steps = [np.where(z + APART > high, -APART, APART) for z in places]
        points = [z + np.vstack([0.0 * z, np.diag(h)]) for z, h in zip(places, steps, strict=True)]
        errors = np.moveaxis(self.errors(np.concatenate(points)), 1, 2)
        found = np.split(errors, len(places), axis=2)
        return [(own[..., 1:] - own[..., :1]) / h for own, h in zip(found, steps, strict=True)]

    def jacobians(self, places: Sequence[Array]) -> list[Array]:
        """Returns the derivatives of the residuals (residuals, numbers) at each of some places."""
        size = len(self.rows)
        return [np.vstack([own.reshape(-1, size), np.eye(size)]) for own in self.slopes(places)]

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
    problem = _Problem(Bench(logs), start, rows)
    starts = problem.starts(seeds)
    if model in SIMPLER:
        simpler = fit_servo(logs, robot, SIMPLER[model], seeds=seeds, known=known)
        starts.append(problem.place(simpler))
    for length, steps in STAGES:
        problem.bench = Bench(logs, step=length)
        starts = [_searched(problem, starts, steps)]
    (z,) = starts
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
    errors, (slopes,) = problem.errors(z[None])[:, 0], problem.slopes([z])
    series = [
        Series(errors[:, k : k + 1], slopes[:, k : k + 1], float(np.mean(own)))
        for k, own in enumerate(problem.bench.counted.T)
    ]
    return np.asarray(np.linalg.inv(coloured_information(series) + np.eye(len(z))))


def _searched(problem: _Problem, starts: Sequence[Array], steps: int) -> Array:
    """Returns the numbers of the least sum of squares near some starts.

    The steps are Levenberg and Marquardt's; several dampings and all starts are simulated at once.
    """
    bounds = problem.bounds()
    places, residuals = list(starts), problem.residuals(np.array(starts))
    moving = list(range(len(places)))
    for _ in range(steps):
        if not moving:
            break
        jacobians = problem.jacobians([places[k] for k in moving])
        points = np.array([
            np.clip(places[k] + damped_step(own, residuals[k], places[k], bounds, damping), *bounds)
            for k, own in zip(moving, jacobians, strict=True) for damping in DAMPINGS
        ])  # fmt: skip
        found = problem.residuals(points)
        ahead = []
        for number, k in enumerate(moving):
            costs = [huber(one) for one in found[number * TRIED : (number + 1) * TRIED]]
            best, before = int(np.argmin(costs)), huber(residuals[k])
            if costs[best] < before:
                places[k], residuals[k] = (own[number * TRIED + best] for own in (points, found))
            if costs[best] < (1.0 - ENOUGH) * before:
                ahead.append(k)
        moving = ahead
    return places[int(np.argmin([huber(one) for one in residuals]))]


def unknowns(robot: Robot) -> Sequence[Unknown]:
    """Returns the rows of the servo's numbers and of the bench's."""
    limits = [row for row in LIMITS if row.read(robot) > 0.0]
    rows = [row for row in SERVO if row.applies(robot) and row.key not in NOT_FOUND]
    return [*(row.of_robot(robot) for row in (*rows, *limits)), *BENCH]
