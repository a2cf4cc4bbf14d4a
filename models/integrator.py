"""Integrates the motion with error control and ends a step at every touch-down.

This is the readable form of integrator.h in plant_fmu/src/kernels, with the same names, on every
ground: planes, surfaces, blocks and soil, with contacts of feet, torso, knees and shanks. It
omits the measurements of a step (models/measure.py), commands that change within a step, and calls
that an event interrupts.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from hexapod_cosim.models.contact.forces import Contacts
from hexapod_cosim.models.contact.switching import (
    Depths,
    cross_cells,
    depths_of,
    switch_contacts,
    yield_soil,
)
from hexapod_cosim.models.dynamics import Command
from hexapod_cosim.models.errors import HexapodError
from hexapod_cosim.models.kinematics import LEGS
from hexapod_cosim.models.method import Method
from hexapod_cosim.models.records import Robot
from hexapod_cosim.models.step import Start, State, Trial, try_step

STEP_FLOOR = 1e-11  # s  the error control fails below this step


# touch-down


def deepest_open(contacts: Contacts, depths: Depths) -> float:
    """Returns the depth of the deepest open contact, or how far a foot has left its cell [m]."""
    deep = np.where(np.isnan(contacts.damping), depths.delta, -math.inf)
    return max(float(np.max(deep)), float(np.max(depths.outside)))


def cubic_crossing(
    start: float, slope_start: float, end: float, slope_end: float, level: float
) -> float:
    """Returns where on [0, 1] the cubic with these ends and slopes reaches a level (eq. 24)."""
    bend = slope_start + slope_end - 2.0 * (end - start)
    curve = end - start - slope_start - bend
    low, high = 0.0, 1.0
    while high - low > 1e-14:
        x = 0.5 * (low + high)
        above = start + x * (slope_start + x * (curve + x * bend)) > level
        low, high = (low, x) if above else (x, high)
    return high


def expected_touch(start: Start, t_low: float, low: Depths, t_high: float, high: Depths) -> float:
    """Returns the time [s] at which the first open contact reaches half the touch depth (eq. 24),
    or the first foot has left its cell by as much.
    """
    h, level, first = t_high - t_low, 0.5 * start.touch_depth, 1.0
    for k, damping in enumerate(start.state.contacts.damping):
        if np.isnan(damping) and high.delta[k] > level:
            ends = (low.delta[k], h * low.ddelta[k], high.delta[k], h * high.ddelta[k])
            first = min(first, cubic_crossing(*ends, level))
    for leg in range(LEGS):
        if high.outside[leg] > level:
            way = high.outside[leg] - low.outside[leg]
            first = min(first, float((level - low.outside[leg]) / way))
    return t_low + first * h


def find_touchdown(start: Start, h: float, trial: Trial) -> tuple[float, Trial, int]:
    """Shortens a step of h [s] that ends below the ground to one that ends on it.

    Each guess takes a step of its own. Every third guess halves the interval, in case the cubics
    converge slowly.

    Returns:
        The step [s], its result, and the number of trials.
    """
    robot, contacts, tried = start.robot, start.state.contacts, 0
    low, high = 0.0, h
    depths_low = depths_of(robot, start.state.body, contacts)
    depths = depths_of(robot, trial.body, contacts)
    while deepest_open(contacts, depths) > start.touch_depth and high - low > STEP_FLOOR:
        tried += 1
        middle = expected_touch(start, low, depths_low, high, depths) if tried % 3 else low
        if not low < middle < high:
            middle = 0.5 * (low + high)
        nearer = try_step(start, middle)
        found = depths_of(robot, nearer.body, contacts)
        if deepest_open(contacts, found) > 0.0:
            high, depths, trial = middle, found, nearer
        else:
            low, depths_low = middle, found
    return high, trial, tried


def end_step(start: Start, h: float, trial: Trial) -> State:
    """Returns the state after an accepted step of h [s], with its contacts switched.

    The soil yields first, then contacts pass between the faces of blocks. The bristles of open feet
    are 0.
    """
    robot, state, contacts = start.robot, start.state, start.state.contacts
    before, after = (depths_of(robot, body, contacts) for body in (state.body, trial.body))
    yielded = replace(contacts, plastic=yield_soil(robot, contacts, h, before, after))
    moved = cross_cells(robot, trial.body, yielded, after)
    depths = depths_of(robot, trial.body, moved)
    switched, touchdowns = switch_contacts(robot, trial.body, moved, depths)
    is_open = np.isnan(switched.damping[:LEGS])
    return replace(
        state,
        body=trial.body,
        bristle=np.where(is_open[:, None], 0.0, trial.bristle),
        contacts=switched,
        touchdowns=state.touchdowns + touchdowns,
    )


# error control


def step_factor(method: Method, error: float) -> float:
    """Returns the factor by which the step may change after a trial with this error (eq. 23)."""
    if error <= 0.0 or math.isnan(error):
        return 0.2 if math.isnan(error) else 5.0
    return float(np.clip(0.9 * error ** (-1.0 / method.order), 0.2, 5.0))


def advance(start: Start, h_max: float, next_step: float) -> tuple[State, float, float]:
    """Computes one accepted step of at most h_max [s], shortened by the error control and by
    touch-downs.

    Returns:
        The state at its end (its time is the caller's to set), its length [s], and the next
        step that the error control would take [s].
    """
    robot, method, state = start.robot, start.method, start.state
    solver, stages = robot.solver, method.stages
    h = h_max if solver.step > 0.0 else h_max / math.ceil(max(1.0, h_max / next_step - 1e-9))
    tried, rejected = 1, 0
    while not (trial := try_step(start, h)).error <= 1.0:  # nan is rejected, too
        tried, rejected = tried + 1, rejected + 1
        h *= min(step_factor(method, trial.error), 0.9)
        if h < STEP_FLOOR:
            what = "the error control finds no step that meets the tolerance"
            expected = f"a step of at least {STEP_FLOOR:g} s"
            fix = "check the inputs for extreme values, or raise solver.tolerance"
            raise HexapodError(what, got=h, expected=expected, fix=fix)
    if solver.step == 0.0:
        next_step = min(solver.step_max, h * step_factor(method, trial.error))
        kept = next_step if h < h_max else max(next_step, state.next_step)
        state = replace(state, next_step=kept)
        next_step = kept
    taken, more = h, 0
    if deepest_open(state.contacts, depths_of(robot, trial.body, state.contacts)) > 0.0:
        taken, trial, more = find_touchdown(start, h, trial)
    state = replace(
        end_step(replace(start, state=state), taken, trial),
        steps=state.steps + 1,
        rejected=state.rejected + rejected,
        evaluations=state.evaluations + stages * (tried + more),
    )
    return state, taken, next_step


def run_to(robot: Robot, command: Command, state: State, t_call: float, t_end: float) -> State:
    """Advances from state.time to t_end [s]; the last step ends on t_end exactly.

    t_call: start of the call [s].
    """
    first = t_call == state.time
    while state.time < t_end:
        left, aged = t_end - state.time, command.age + state.time - t_call
        start = Start(robot, replace(command, age=aged), state)
        # new inputs cause a larger error than the last step's
        size = min(state.first_step, state.next_step) if first else state.next_step
        after, taken, size = advance(start, left, size)
        if first:
            after, first = replace(after, first_step=size), False
        t = state.time + taken
        state = replace(after, time=t_end if taken >= left or t_end - t < STEP_FLOOR else t)
    return state


def integrate(robot: Robot, command: Command, state: State, t_end: float) -> State:
    """Advances the state to t_end [s] exactly under a constant command whose age is that at the
    start.

    With solver.step = 0 the error control chooses the steps. Otherwise a call consists of equal
    steps of at most solver.step. Raises HexapodError when the error control finds no step.
    """
    t_start, solver = state.time, robot.solver
    if solver.step == 0.0:
        return run_to(robot, command, state, t_start, t_end)
    count = max(1, math.ceil((t_end - t_start) / solver.step - 1e-9))
    for i in range(1, count + 1):
        t = t_start + (t_end - t_start) * (i / count) if i < count else t_end
        state = run_to(robot, command, state, t_start, t)
    return state
