"""Fits the unknown numbers to the readings of logs by output error.

The numbers minimise the sum of squares of (predicted - measured) / noise over all readings, and of
(number - number before) / prior over all numbers. The second sum keeps the robot file's value
where the readings tell nothing. With white noise this is the most probable robot. The noise of a
channel is the typical size of its residuals, and residuals beyond three deviations count linearly
(Huber's loss). judging.py says what the readings tell of the numbers.

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

from hexapod_cosim.extensions.identify.fitting.judging import Fit, judged
from hexapod_cosim.extensions.identify.fitting.last_search import BOUND, finished, huber
from hexapod_cosim.extensions.identify.fitting.misfit import read_noise
from hexapod_cosim.extensions.identify.fitting.problem import ALL, FLOOR, Problem
from hexapod_cosim.extensions.identify.log import LogError
from hexapod_cosim.extensions.identify.numbers.servo import GEAR
from hexapod_cosim.extensions.identify.unknowns import DELAYS
from hexapod_cosim.models import FmuError

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
    scale: float  # of Huber's loss: larger residuals count linearly [deviations]
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
    short = problem.shortened(SHORT, parameters=COARSE, most=SEARCHED)
    z = searched(short, start, report)
    report("other starts of the contacts")
    z = _best_of_starts(short, z)
    report("all rows")
    fitted = problem.shortened(parameters=COARSE)
    least = read_noise(fitted.experiments)
    z = _optimised(fitted, z, REFINE, least)
    fitted.use({})
    short.use({})
    z = _with_delays(short, z, ("joints", "forces", "imu"), lambda own: own + NEAR_DELAYS)
    fitted.count_all()
    z = finished(fitted, z, report)
    return judged(problem, fitted, z, least, report)


def searched(short: Problem, start: Array | None, report: Progress) -> Array:
    """Returns numbers from the first seconds of logs, without those of contacts tried one by one.

    short: the problem of these rows. start, report: as of `fit`.
    """
    z = better_start(short, start)
    for number, stage in enumerate(SEARCH):
        report(f"search on the first seconds, part {number + 1} of {len(SEARCH)}")
        z = _optimised(short, z, stage, read_noise(short.experiments))
        if number == 0:
            z = _with_delays(short, z, ("currents", "forces"), lambda _own: DELAYS_TRIED)
    return z


def misfit_cost(problem: Problem, z: Array) -> float:
    """Returns the sum of squares of all rows over the readings' own noise, by Huber's loss."""
    problem.set_noise(
        [np.zeros_like(one) for one in problem.errors(z)], least=read_noise(problem.experiments)
    )
    return 2.0 * _cost(problem, z)


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
        ftol=stage.enough,
        xtol=1e-6,
        gtol=1e-8,
    )
    return np.asarray(found.x, dtype=np.float64)


def _best_of_starts(problem: Problem, z: Array) -> Array:
    """Returns the best numbers that the optimiser finds from other values of the contacts."""
    least = read_noise(problem.experiments)
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


def _tried(problem: Problem, z: Array) -> Array:
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
    counted, problem.counted = problem.counted, problem.all_known()
    residuals = problem.residuals(z)
    problem.counted = counted
    return huber(residuals)
