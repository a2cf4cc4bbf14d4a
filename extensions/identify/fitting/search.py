"""Searches the numbers that explain the readings of logs best: output error.

The numbers minimise the sum of squares of (predicted - measured) / noise over all readings, and of
(number - number before) / prior over all numbers. The second sum keeps the robot file's value
where the readings say nothing. With white noise this is the most probable robot. The noise of a
channel is the typical size of its residuals, and large residuals count linearly (Huber's loss).

A search on the first seconds of long logs finds the valley of the best numbers, all rows its
bottom. The numbers of contacts act at touch-downs alone, and play at the meeting of teeth, where
gradients say little. So these are also tried one by one over their range, and the value with the
least sum of squares over all rows is the next start.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.extensions.identify.fitting.least_squares import (
    BOUND,
    FINE,
    huber,
    minimised,
    remaining_step,
)
from hexapod_cosim.extensions.identify.fitting.misfit import read_noise
from hexapod_cosim.extensions.identify.fitting.problem import ALL, Problem
from hexapod_cosim.extensions.identify.numbers.servo import GEAR
from hexapod_cosim.extensions.identify.unknowns import DELAYS

Array = NDArray[np.float64]
Progress = Callable[[str], None]
# Forces and accelerations have peaks at touch-downs. While the numbers are far off, these come at
# wrong times, and a difference says nothing of the next touch-down. Torques jump when a command
# comes, so that they are no smooth functions of the sensors' delay. Both are left out at first.
SMOOTH = ("angle", "motor_angle", "speed", "gyroscope", "position", "attitude")


@dataclass(frozen=True)
class Stage:
    """One run of the optimiser."""

    channels: tuple[str, ...]
    share: float  # of the residuals before it, which counts as noise
    bound: float  # larger residuals count linearly [deviations]
    steps: int  # of the optimiser at most
    enough: float  # relative change of the cost at which the stage ends


SEARCH = (Stage(SMOOTH, 0.3, 1.0, 15, 1e-2), Stage(ALL, 1.0, 1.0, 25, 1e-3))
REFINE = Stage(ALL, 1.0, BOUND, 25, 1e-4)
COARSE = {"solver.tolerance": 1e-4}  # of the search: its errors are far below the readings' noise
SEARCHED = 40_000  # residuals of the search, about
SHORT = 6.0  # s    of each log on which the search is made
TRIED = (-2.0, -1.0, -0.5, -0.25, -0.1, 0.1, 0.25, 0.5, 1.0, 2.0)  # priors from the present value
BETTER = 1e-4  # share of the sum of squares by which another start must be better
ROUNDS = 3  # of trying starts, at most
# Torques jump when a command comes, so that their sum of squares has a valley between each two
# commands; the delay of currents and of forces is tried over these values.
DELAYS_TRIED = 0.001 * np.arange(21.0)  # s
# Forces and accelerations have peaks at touch-downs, and so several valleys near each other.
NEAR_DELAYS = 1e-5 * np.array([-80.0, -40.0, -20.0, -10.0, -5.0, 5.0, 10.0, 20.0, 40.0, 80.0])  # s
# The last search ends where Gauss and Newton's next step is this long [deviations]. A relative
# change of the sum of squares is no measure: of a log of 60 s it is some 100,000, and a number that
# is wrong by a deviation adds 1.
ENOUGH = 0.1
FINISHING = 12  # steps of the last search, at most
# Readings that jump come and go near the optimum, so that a step is left, if a short one.
NEAR, SHORTER = 1.0, 0.5  # deviations; of the step before
# At the first steps all readings count anew. From then on those left out stay so: a search
# would go back and forth between two points at which different readings count.
ANEW = 2
SHORTENED = (1.0, 0.5, 0.25, 0.1, 0.03)  # of a step, until the sum of squares falls
SUFFICIENT = 0.1  # share of the fall that derivatives say
# A longer step changes residuals otherwise than derivatives say where nothing jumps, too.
LINEAR = 10.0  # deviations


def searched(problem: Problem, report: Progress) -> tuple[Problem, Array]:
    """Returns the problem of the fitted rows and its most probable numbers (rows,).

    report: called when a step begins.

    Raises HexapodError when the plant refuses the robot file's numbers.
    """
    short = problem.shortened(SHORT, parameters=COARSE, most=SEARCHED)
    z = np.zeros(len(problem.rows))
    for number, stage in enumerate(SEARCH):
        report(f"search on the first seconds, part {number + 1} of {len(SEARCH)}")
        z = _optimised(short, z, stage, read_noise(short.experiments))
        if number == 0:
            z = _with_delays(short, z, ("currents", "forces"), lambda _own: DELAYS_TRIED)
    report("other starts of the contacts")
    z = _best_of_starts(short, z)
    report("all rows")
    fitted = problem.shortened(np.inf, parameters=COARSE)
    z = _optimised(fitted, z, REFINE, read_noise(fitted.experiments))
    fitted.use({})
    short.use({})
    z = _with_delays(short, z, ("joints", "forces", "imu"), lambda own: own + NEAR_DELAYS)
    fitted.counted = fitted.known
    return fitted, finished(fitted, z, report)


def _optimised(problem: Problem, z: Array, stage: Stage, least: Mapping[str, float]) -> Array:
    """Returns the numbers of the least sum of squares near a start, without rows near jumps."""
    problem.set_noise(problem.errors(z), share=stage.share, least=least, channels=stage.channels)
    problem.leave_out_jumps(z)
    return minimised(
        problem.residuals,
        z,
        jacobian=problem.jacobian,
        bounds=problem.bounds(),
        bound=stage.bound,
        steps=stage.steps,
        enough=stage.enough,
    )


def _best_of_starts(problem: Problem, z: Array) -> Array:
    """Returns the best numbers that the optimiser finds from other values of the contacts."""
    least = read_noise(problem.experiments)
    z = _optimised(problem, z, REFINE, least)
    best = _cost(problem, z)
    for _ in range(ROUNDS):
        moved = tried(problem, z)
        if np.array_equal(moved, z):
            break
        moved = _optimised(problem, moved, REFINE, least)
        cost = _cost(problem, moved)
        if cost > (1.0 - BETTER) * best:
            break
        z, best = moved, cost
    return z


def _with_delays(
    problem: Problem, z: Array, sensors: Sequence[str], values: Callable[[float], Array]
) -> Array:
    """Returns the numbers with the delays of some sensors at the best of some values, one by one.

    values: to be tried instead of a delay [s].
    """
    problem.set_noise(problem.errors(z), least=read_noise(problem.experiments))
    keys = [DELAYS[name] for name in sensors]
    for k, row in enumerate(problem.rows):
        if row.key in keys:
            before = problem.before[row.key]
            points = [z]
            for delay in values(row.value(float(z[k]), before)).tolist():
                moved = z.copy()
                moved[k] = row.distance(delay, before)
                points.append(moved)
            z = min(points, key=lambda one: _cost(problem, one))
    return z


def tried(problem: Problem, z: Array) -> Array:
    """Returns the numbers with those of contacts, and of elastic gears and their friction, at the
    best of some values, one by one.
    """
    low, high = problem.bounds()
    elastic = {row.key for row in problem.rows} & set(GEAR)
    keys = {*GEAR, "servo.coulomb_friction"} if elastic else set()
    z, best = z.copy(), (1.0 - BETTER) * _cost(problem, z)
    for k, row in enumerate(problem.rows):
        own = z[k]
        for step in TRIED if row.group == "contact" or row.key in keys else ():
            if low[k] <= own + step <= high[k]:
                moved = z.copy()
                moved[k] = own + step
                cost = _cost(problem, moved)
                if cost < best:
                    z, best = moved, cost
    return z


def _cost(problem: Problem, z: Array) -> float:
    """Returns the sum of squares over all rows by Huber's loss."""
    counted, problem.counted = problem.counted, problem.known
    residuals = problem.residuals(z)
    problem.counted = counted
    return huber(residuals)


def finished(problem: Problem, z: Array, report: Progress) -> Array:
    """Returns the numbers near a start at which the step that remains is short.

    The noise of a channel is the typical size of its residuals at each step. Readings that jump
    within the steps of the derivatives, or within a step of the search, do not count: a search that
    counts them ends at the jump.
    """
    before = np.inf
    for number in range(FINISHING):
        report(f"all rows again, step {number + 1} of at most {FINISHING}")
        if number < ANEW:
            problem.counted = problem.known
        problem.set_noise(problem.errors(z))
        problem.leave_out_bent(z)
        better, length = _stepped(problem, z)
        if better is None or (length < NEAR and length > SHORTER * before):
            break
        z, before = better, length
    return z


def _stepped(problem: Problem, z: Array) -> tuple[Array | None, float]:
    """Returns the numbers after a step of Gauss and Newton's method, and its length in deviations.

    None where it is short or no part of it is better.
    """
    while True:
        jacobian, residuals = problem.jacobian(z, FINE), problem.residuals(z)
        step = remaining_step(jacobian, residuals, z, problem.bounds())
        length = float(np.linalg.norm(jacobian @ step))
        if length < ENOUGH:
            return None, length
        cost = huber(residuals)
        for share in SHORTENED:
            moved = np.clip(z + share * step, *problem.bounds())
            change = problem.residuals(moved) - residuals
            if huber(residuals + change) < cost - SUFFICIENT * share * length**2:
                return moved, length
            if share == 1.0 and length < LINEAR and np.isfinite(change).all():
                linear = jacobian @ (moved - z)
                if problem.leave_out_nonlinear(change, linear):
                    break  # again without these
        else:
            return None, length
