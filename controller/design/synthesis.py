"""Gains by requirement, with python-control.

The tangential PID gets the most integral action that keeps the margins of every eigenlocus of every plant; the suspension the deflection,
frequency and damping asked for, or a lower frequency where the margins demand it.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import fields
from typing import Any

import numpy as np

from hexapod_cosim.controller.design.laws import Laws, delay_response, delay_steps, sampled_suspension, slip_response
from hexapod_cosim.controller.design.loci import Loci, Plants, Response, all_loci, critical_size, frequencies, quick_margins, response
from hexapod_cosim.controller.design.standing import weight_share
from hexapod_cosim.controller.design.verify import verify
from hexapod_cosim.controller.gains import (
    POSITIVE,
    Gains,
    GainsError,
    HoldGains,
    LimitGains,
    Requirements,
    SlipGains,
    SupportGains,
    SuspensionGains,
)
from hexapod_cosim.models import Robot

LEADS = (0.0, 0.001, 0.003, 0.01, 0.1)  # s    tried kp/ki
CURVATURES = (0.0, 1e-5, 2e-5, 5e-5, 2e-4, 5e-4)  # s2    tried kd/ki
DERIVATIVE_PERIODS = 2.0  # 1    filter of the derivative in controller periods
SEARCHED, FINER = 100, 4  # frequencies, and how many times as many with the laws, which turn faster
FREQUENCY_STEPS, FREQUENCY_FACTOR = 24, 0.85  # 1    how far the suspension's frequency may give way
SAFETY, SPARE = 0.98, 0.5  # 1, deg    the search's frequencies may miss the worst by a hair
TINY = 1e-9  # 1    size of a loop that stops nothing
SAME = 1e-9  # relative, of periods


def design_gains(robot: Robot, period: float, *, plants: Plants, requirements: Requirements | None = None) -> Gains:
    """Gains of a robot for a controller period [s] from its standing plants, by name.

    Raises GainsError when no gains meet the requirements: which one is missed, what was reached, what was asked for.
    """
    needs = Requirements() if requirements is None else requirements
    _check(robot, needs, plants, period=period)
    tangential, vertical = (loci.finer(FINER) for loci in all_loci(robot, plants, frequencies(period, SEARCHED)))
    slip, binding = design_slip(tangential, needs, period=period)
    suspension = design_suspension(robot, vertical, needs, period=period)
    laws = Laws(slip=slip, suspension=suspension, period=period, delays=delay_steps(needs, period=period))
    margins = verify(robot, plants, (tangential, vertical), laws, needs, binding=binding)
    return Gains(
        robot=robot.name, robot_hash=robot.hash, period=period, requirements=needs, slip=slip, suspension=suspension, margins=margins,
        support=_taken(SupportGains, needs), hold=_taken(HoldGains, needs),
        limits=LimitGains(speed=needs.speed_share * robot.servo.speed_max, torque=needs.torque_share * robot.servo.torque_max),
    )  # fmt: skip


def _taken(kind: type[Any], needs: Requirements) -> Any:
    """A section of the gains that the requirements hold as it is."""
    return kind(**{entry.name: getattr(needs, entry.name) for entry in fields(kind)})


def _check(robot: Robot, needs: Requirements, plants: Plants, *, period: float) -> None:
    if not 0.0 < period < math.inf:
        raise GainsError("impossible controller period", got=period, expected="a number > 0", fix="give it in seconds")
    if robot.servo.mode != "position" or robot.servo.kp <= 0.0:
        raise GainsError(
            "compliant control shifts the servos' targets", got=f"servo mode {robot.servo.mode}, kp {robot.servo.kp}",
            expected="servo mode position with kp > 0", fix="use position servos, or kinematic control",
        )  # fmt: skip
    for entry in fields(needs):
        value, strict = getattr(needs, entry.name), entry.name in POSITIVE["requirements"]
        if not 0.0 <= value < math.inf or (strict and not value):
            expected = f"a number >{'' if strict else '='} 0"
            raise GainsError("impossible requirement", got=value, expected=expected, fix="correct it", where=entry.name)
    for name, plant in plants.items():
        if not math.isclose(plant.system.dt, period, rel_tol=SAME):
            raise GainsError("a plant sampled otherwise", got=plant.system.dt, expected=f"{period} s", fix="sample it anew", where=name)


def design_slip(loci: Loci, needs: Requirements, *, period: float) -> tuple[SlipGains, str]:
    """Among shapes kp/ki, kd/ki the one with the largest ki at which every locus keeps its margins; and what stopped that ki."""
    late = delay_response(delay_steps(needs, period=period), loci.omega, period=period)
    best, binding = slip_gains(0.0, 0.0, 0.0, needs, period=period), "no integral action is possible"
    for lead, curvature in itertools.product(LEADS, CURVATURES):
        shape = slip_gains(1.0, lead, curvature, needs, period=period)
        loops = loci.values * slip_response(shape, loci.omega, period=period) * late
        most, stopped = _largest_gain(loops, needs, loci)
        if SAFETY * most > best.ki:
            best, binding = slip_gains(SAFETY * most, lead, curvature, needs, period=period), stopped
    return best, binding


def slip_gains(ki: float, lead: float, curvature: float, needs: Requirements, *, period: float) -> SlipGains:
    """Gains of a shape; the derivative and the anti-windup go with period and filter."""
    return SlipGains(
        kp=ki * lead, ki=ki, kd=ki * curvature, derivative_time=DERIVATIVE_PERIODS * period, filter_time=needs.filter_time,
        load_time=needs.load_time, tracking_time=2.0 * max(needs.filter_time, period), limit=needs.slip_limit,
    )  # fmt: skip


def _largest_gain(loops: Response, needs: Requirements, loci: Loci) -> tuple[float, str]:
    """Scale of unit-gain loops at which the worst just keeps its margins, and which margin of which plant that is.

    Out of the sector of the phase margin beyond gain 1 at all frequencies: more than the margin at the crossings asks for.
    """
    inside = np.abs(np.angle(-loops)) < math.radians(needs.phase_margin + SPARE)
    near, critical = np.where(inside, np.abs(loops), TINY).max(axis=1), np.maximum(critical_size(loops), TINY)
    allowed = {"phase_margin": 1.0 / near, "gain_margin": 10.0 ** (-needs.gain_margin / 20.0) / critical}
    name = min(allowed, key=lambda margin: float(allowed[margin].min()))
    worst = int(allowed[name].argmin())
    return float(allowed[name][worst]), f"{name} ({loci.names[worst]})"


def design_suspension(robot: Robot, loci: Loci, needs: Requirements, *, period: float) -> SuspensionGains:
    """k from the deflection under a third of the weight, m from the frequency, b from the damping ratio.

    A stiff leg on a soft suspension asks for more margin than the wanted frequency leaves: then the frequency gives way.
    """
    stiffness, late = weight_share(robot) / needs.deflection, delay_response(delay_steps(needs, period=period), loci.omega, period=period)
    gains = suspension_gains(stiffness, needs.frequency, needs)
    for step in range(FREQUENCY_STEPS):
        gains = suspension_gains(stiffness, needs.frequency * FREQUENCY_FACTOR**step, needs)
        law = response(sampled_suspension(gains, period=period), loci.omega)[:, 0, 0] * late
        found = [quick_margins(locus * law, loci.omega) for locus in loci.values]
        if min(m.gain for m in found) > needs.gain_margin / SAFETY and min(m.phase for m in found) > needs.phase_margin / SAFETY:
            break
    return gains


def suspension_gains(stiffness: float, frequency: float, needs: Requirements) -> SuspensionGains:
    """A mass on that spring with the natural frequency [Hz] and the damping ratio asked for."""
    mass = stiffness / (2.0 * math.pi * frequency) ** 2
    return SuspensionGains(
        mass=mass, damping=2.0 * needs.damping_ratio * math.sqrt(stiffness * mass), stiffness=stiffness, limit=needs.deflection_limit
    )
