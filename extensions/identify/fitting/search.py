"""Searches the numbers that explain the readings of logs best: output error.

The numbers minimise the sum of squares of (predicted - measured) / noise over all readings, and of
(number - number before) / prior over all numbers. The second sum keeps the robot file's value
where the readings say nothing. With white noise this is the most probable robot. The noise of a
channel is the typical size of its residuals, and large residuals count linearly (Huber's loss).

A search on the first seconds of long logs finds the valley of the best numbers, all rows its
bottom.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hexapod_cosim.extensions.identify.fitting.least_squares import FINE, huber, minimised, stepped
from hexapod_cosim.extensions.identify.fitting.misfit import read_noise
from hexapod_cosim.extensions.identify.fitting.problem import Problem
from hexapod_cosim.extensions.identify.unknowns import DELAYS
from hexapod_cosim.models.arrays import Array

Progress = Callable[[str], None]
COARSE = {"solver.tolerance": 1e-4}  # of the search: its errors are far below the readings' noise
SEARCHED = 40_000  # residuals of the search, about
SEARCHES = 2  # on these rows, each with the noise that the one before left
SHORT = 6.0  # s    of each log on which the search is made
# Torques jump when a command comes, so that their sum of squares has a valley between each two
# commands; the delay of currents and of forces is tried over these values.
DELAYS_TRIED = 0.001 * np.arange(21.0)  # s
FINISHING = 12  # steps of the last search, at most
# Readings that jump come and go near the optimum, so that a step is left, if a short one.
NEAR, SHORTER = 1.0, 0.5  # deviations; of the step before
# At the first steps all readings count anew. From then on those left out stay so: a search
# would go back and forth between two points at which different readings count.
ANEW = 2


def searched(problem: Problem, report: Progress) -> tuple[Problem, Array]:
    """Returns the problem of the fitted rows and its most probable numbers (rows,).

    report: called when a step begins.

    Raises HexapodError when the plant refuses the robot file's numbers.
    """
    z = np.zeros(len(problem.rows))
    short = problem.shortened(SHORT, parameters=COARSE, most=SEARCHED)
    for number in range(SEARCHES):
        report(f"search on the first seconds, part {number + 1} of {SEARCHES}")
        z = _optimised(short, z)
        if number == 0:
            z = _with_delays(short, z)
    report("all rows")
    fitted = problem.shortened(np.inf, parameters=COARSE)
    z = _optimised(fitted, z)
    fitted.use({})
    fitted.counted = fitted.known
    return fitted, finished(fitted, z, report)


def _optimised(problem: Problem, z: Array) -> Array:
    """Returns the numbers of the least sum of squares near a start, without rows near jumps."""
    problem.set_noise(problem.errors(z), least=read_noise(problem.experiments))
    problem.leave_out_jumps(z)
    return minimised(
        problem.residuals, z, jacobian=problem.jacobian, bounds=problem.bounds(), bound=1.0
    )


def _with_delays(problem: Problem, z: Array) -> Array:
    """Returns the numbers with the delays of currents and forces at the best of some values."""
    problem.set_noise(problem.errors(z), least=read_noise(problem.experiments))
    for k, row in enumerate(problem.rows):
        if row.key in (DELAYS["currents"], DELAYS["forces"]):
            points = np.tile(z, (len(DELAYS_TRIED), 1))
            before = problem.before[row.key]
            points[:, k] = [row.distance(delay, before) for delay in DELAYS_TRIED.tolist()]
            z = min(points, key=lambda one: _cost(problem, one))
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
    within the steps of the derivatives do not count: a search that counts them ends at the jump.
    """
    before = np.inf
    for number in range(FINISHING):
        report(f"all rows again, step {number + 1} of at most {FINISHING}")
        if number < ANEW:
            problem.counted = problem.known
        problem.set_noise(problem.errors(z))
        problem.leave_out_bent(z, FINE)
        jacobian = problem.jacobian(z, FINE)
        better, length = stepped(problem.residuals, jacobian, z, problem.bounds())
        if better is None or (length < NEAR and length > SHORTER * before):
            break
        z, before = better, length
    return z
