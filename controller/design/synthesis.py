"""Gains by requirement, with python-control.

The tangential PID gets the most integral action that keeps the margins at every load; the suspension the deflection, frequency and
damping asked for, or a lower frequency where the margins demand it.
"""

from __future__ import annotations

import itertools
import math

import control
import numpy as np

from hexapod_cosim.controller.compliance import LARGEST_LOAD
from hexapod_cosim.controller.design.leg import extreme_directions, stiffest_vertical, vertical_compliance, weight_share
from hexapod_cosim.controller.design.loops import (
    Response,
    contact_stiffness,
    creep_damping,
    delay,
    frequencies,
    loop_margins,
    normal_plant,
    quick_margins,
    response,
    sampled_slip_law,
    sampled_slip_response,
    sampled_suspension,
    tangential_plant,
)
from hexapod_cosim.controller.gains import Gains, GainsError, Margins, Requirements, SlipGains, SuspensionGains
from hexapod_cosim.models import Robot

LOADS = (0.1, 0.4, 1.0, LARGEST_LOAD)  # 1    normal forces the margins must hold at, in thirds of the weight
LEADS = (0.0, 0.003, 0.01, 0.03, 0.1)  # s    tried kp/ki
CURVATURES = (0.0, 2e-5, 1e-4, 5e-4)  # s2    tried kd/ki
DERIVATIVE_PERIODS = 2.0  # 1    filter of the derivative in controller periods
NOMINAL = 5  # index of the stiffest direction under its share in tangential_loops
FREQUENCY_STEPS, FREQUENCY_FACTOR = 24, 0.85  # 1    how far the suspension's frequency may give way
SAFETY = 0.98  # 1    the search's frequency grid may miss the worst frequency by a hair


def tangential_loops(robot: Robot, gains: SlipGains, *, period: float, delay_periods: float) -> list[control.StateSpace]:
    """The loop at the softest and the stiffest direction under each of LOADS; see NOMINAL."""
    law, late = sampled_slip_law(gains, period=period), delay(delay_periods, period=period)
    return [plant * law * late for plant in _tangential_plants(robot, period=period)]


def _tangential_plants(robot: Robot, *, period: float) -> list[control.StateSpace]:
    # the shift goes with the load (controller/compliance.py), so does the loop's gain
    share = weight_share(robot)
    cases = [(direction, load) for load in LOADS for direction in extreme_directions(robot)]
    return [load * tangential_plant(direction, creep=creep_damping(robot, load * share), period=period) for direction, load in cases]


def normal_loops(robot: Robot, gains: SuspensionGains, *, period: float, delay_periods: float) -> list[control.StateSpace]:
    """The suspension's loop at the stiffest leg under each of LOADS."""
    law, late = sampled_suspension(gains, period=period), delay(delay_periods, period=period)
    return [plant * law * late for plant in _normal_plants(robot, period=period)]


def _normal_plants(robot: Robot, *, period: float) -> list[control.StateSpace]:
    share, direction = weight_share(robot), stiffest_vertical(robot)
    mass = share / float(np.linalg.norm(robot.gravity))
    return [normal_plant(direction, mass=mass, contact=contact_stiffness(robot, load * share), period=period) for load in LOADS]


def design_gains(robot: Robot, period: float, *, requirements: Requirements | None = None) -> Gains:
    """Gains of a robot for a controller period [s].

    Raises GainsError when no gains meet the requirements: which one binds, what was reached, what was asked for.
    """
    needs = Requirements() if requirements is None else requirements
    _check(robot, needs, period=period)
    slip = _design_slip(robot, needs, period=period)
    suspension = _design_suspension(robot, needs, period=period)
    margins = _verify(robot, slip, suspension, needs, period=period)
    return Gains(
        robot=robot.name, robot_hash=robot.hash, period=period, requirements=needs, slip=slip, suspension=suspension, margins=margins
    )


def _check(robot: Robot, needs: Requirements, *, period: float) -> None:
    if not 0.0 < period < math.inf:
        raise GainsError("impossible controller period", got=period, expected="a number > 0", fix="give it in seconds")
    if robot.servo.mode != "position" or robot.servo.kp <= 0.0:
        raise GainsError(
            "compliant control shifts the servos' targets", got=f"servo mode {robot.servo.mode}, kp {robot.servo.kp}",
            expected="servo mode position with kp > 0", fix="use position servos, or kinematic control",
        )  # fmt: skip
    for name in ("filter_time", "load_time", "shift_limit", "deflection", "frequency", "damping_ratio", "deflection_limit"):
        if not 0.0 < getattr(needs, name) < math.inf:
            raise GainsError("impossible requirement", got=getattr(needs, name), expected="a number > 0", fix="correct it", where=name)


def _design_slip(robot: Robot, needs: Requirements, *, period: float) -> SlipGains:
    """Among shapes kp/ki, kd/ki: the largest ki for which every loop stays out of the sector of the phase margin beyond gain 1."""
    omega = frequencies(period)
    late = np.exp(-1j * omega * period * math.ceil(needs.delay_periods))
    plants = [response(plant, omega, period=period) for plant in _tangential_plants(robot, period=period)]
    best = _slip_gains(0.0, 0.0, 0.0, needs, period=period)
    for lead, curvature in itertools.product(LEADS, CURVATURES):
        law = sampled_slip_response(_slip_gains(1.0, lead, curvature, needs, period=period), omega, period=period)
        loops = np.array([(plant @ law)[:, 0, 0] * late for plant in plants])
        ki = SAFETY * _largest_gain(loops, needs)
        if ki > best.ki:
            best = _slip_gains(ki, lead, curvature, needs, period=period)
    return best


def _slip_gains(ki: float, lead: float, curvature: float, needs: Requirements, *, period: float) -> SlipGains:
    return SlipGains(
        kp=ki * lead, ki=ki, kd=ki * curvature, derivative_time=DERIVATIVE_PERIODS * period, filter_time=needs.filter_time,
        load_time=needs.load_time,
        tracking_time=max(2.0 * needs.filter_time, 2.0 * period), limit=needs.shift_limit,
    )  # fmt: skip


def _largest_gain(loops: Response, needs: Requirements) -> float:
    """Scale of unit-gain loops (n, frequencies) at which the phase or the gain margin of the worst is just kept."""
    near = np.abs(loops[np.abs(np.angle(-loops)) < math.radians(needs.phase_margin)]).max(initial=1e-12)
    margin = min(quick_margins(loop)[0] for loop in loops)
    return float(min(1.0 / near, 10.0 ** ((margin - needs.gain_margin) / 20.0)))


def _design_suspension(robot: Robot, needs: Requirements, *, period: float) -> SuspensionGains:
    """k from the deflection under one leg's share of the weight, m from the frequency, b from the damping ratio.

    A stiff leg on a soft suspension asks for more margin than the wanted frequency leaves: then the frequency gives way.
    """
    omega = frequencies(period)
    late = np.exp(-1j * omega * period * math.ceil(needs.delay_periods))
    plants = [response(plant, omega, period=period) for plant in _normal_plants(robot, period=period)]
    stiffness = weight_share(robot) / needs.deflection
    compliance = vertical_compliance(robot)
    gains = _suspension_gains(stiffness, needs.frequency, compliance, needs)
    for step in range(FREQUENCY_STEPS):
        gains = _suspension_gains(stiffness, needs.frequency * FREQUENCY_FACTOR**step, compliance, needs)
        law = response(sampled_suspension(gains, period=period), omega, period=period)
        margins = [quick_margins((plant @ law)[:, 0, 0] * late) for plant in plants]
        if min(g for g, _ in margins) > needs.gain_margin / SAFETY and min(p for _, p in margins) > needs.phase_margin / SAFETY:
            break
    return gains


def _suspension_gains(stiffness: float, frequency: float, compliance: float, needs: Requirements) -> SuspensionGains:
    mass = stiffness / (2.0 * math.pi * frequency) ** 2
    return SuspensionGains(
        mass=mass, damping=2.0 * needs.damping_ratio * math.sqrt(stiffness * mass), stiffness=stiffness,
        preload=1.0 + needs.sag_compensation * stiffness * compliance, limit=needs.deflection_limit,
    )  # fmt: skip


def _verify(robot: Robot, slip: SlipGains, suspension: SuspensionGains, needs: Requirements, *, period: float) -> Margins:
    """Margins of the sampled loops by python-control, worst of all cases. Raises GainsError when one is missed."""
    tangential = tangential_loops(robot, slip, period=period, delay_periods=needs.delay_periods)
    normal = normal_loops(robot, suspension, period=period, delay_periods=needs.delay_periods)
    slip_gain, slip_phase = _worst(tangential, period=period)
    suspension_gain, suspension_phase = _worst(normal, period=period)
    margins = Margins(
        slip_crossover=loop_margins(tangential[NOMINAL], period=period)[2],
        slip_phase_margin=slip_phase,
        slip_gain_margin=slip_gain,
        slip_rejection=1.0 / (1.0 + slip.ki * creep_damping(robot, weight_share(robot))),
        suspension_phase_margin=suspension_phase,
        suspension_gain_margin=suspension_gain,
    )
    for name, reached, asked in (
        ("phase margin of the tangential loop", slip_phase, needs.phase_margin),
        ("gain margin of the tangential loop", slip_gain, needs.gain_margin),
        ("phase margin of the suspension", suspension_phase, needs.phase_margin),
        ("gain margin of the suspension", suspension_gain, needs.gain_margin),
    ):
        if reached < asked:
            raise GainsError(
                f"the design misses its {name}", got=round(reached, 2), expected=f"at least {asked}",
                fix="shorten the period, allow less deflection, or ask for less margin", where=f"robot {robot.name}",
            )  # fmt: skip
    return margins


def _worst(loops: list[control.StateSpace], *, period: float) -> tuple[float, float]:
    """Least gain [dB] and phase [deg] margins: the worst loops are picked by a quick estimate and judged by python-control."""
    omega = frequencies(period)
    quick = [quick_margins(response(loop, omega, period=period)[:, 0, 0]) for loop in loops]
    picked = {min(range(len(loops)), key=lambda k: quick[k][which]) for which in (0, 1)}
    judged = [loop_margins(loops[k], period=period) for k in picked]
    return min(gain for gain, _, _ in judged), min(phase for _, phase, _ in judged)
