"""Gains by requirement, with python-control.

The tangential PID gets the most integral action that keeps the margins of every eigenlocus of every
plant; the suspension the deflection, frequency and damping asked for, or a lower frequency where
the margins demand it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np

from hexapod_cosim.controller.design.laws import (
    Laws,
    delay_response,
    delay_steps,
    sampled_suspension,
    slip_response,
)
from hexapod_cosim.controller.design.loci import (
    SLOWEST,
    Loci,
    LoopMargins,
    Plants,
    Response,
    all_loci,
    critical_size,
    frequencies,
    quick_margins,
    response,
)
from hexapod_cosim.controller.design.standing import StandingPlant, weight_share
from hexapod_cosim.controller.design.verify import Judge, nominal, support_torque, verify
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
from hexapod_cosim.controller.size import requirements_for, size_of
from hexapod_cosim.models import LEG_NAMES, Robot

LEADS = (0.0, 0.001, 0.003, 0.01, 0.1)  # s    tried kp/ki, by the robot's size
CURVATURES = (0.0, 1e-5, 2e-5, 5e-5, 2e-4, 5e-4)  # s2    tried kd/ki, by its square
DERIVATIVE_PERIODS = 2.0  # 1    filter of the derivative in controller periods
SEARCHED, FINER = 100, 4  # frequencies, and how many times as many with the laws, which turn faster
FREQUENCY_STEPS, FREQUENCY_FACTOR = 24, 0.85  # 1    how far the suspension's frequency may give way
SAFETY, SPARE = 0.98, 0.5  # 1, deg    the search's frequencies may miss the worst by a hair
BACK_OFF, BACK_OFFS = 0.95, 40  # 1    of the gain where they miss it by more, and how often
TINY = 1e-9  # 1    size of a loop that stops nothing
SAME = 1e-9  # relative, of periods


def design_gains(
    robot: Robot,
    period: float,
    *,
    plants: Plants,
    requirements: Requirements | None = None,
    left_out: Sequence[str] = (),
) -> Gains:
    """Gains of a robot for a controller period [s] from its standing plants, by name.

    requirements: by default those for its size;  left_out: stances that there are no plants of,
    and why; those in which its servos do not carry it are added. Raises GainsError when no gains
    meet the requirements: which one is missed, what was reached, what was asked for.
    """
    needs = requirements_for(robot) if requirements is None else requirements
    _check(robot, needs, plants, period=period)
    plants, too_heavy = carried(robot, plants, needs)
    time = size_of(robot).time
    omega = frequencies(period, SEARCHED, slowest=SLOWEST / time)
    tangential, vertical = (loci.finer(FINER) for loci in all_loci(robot, plants, omega))
    slip, binding = design_slip(tangential, needs, period=period, time=time)
    suspension = design_suspension(robot, vertical, needs, period=period)
    judge, late = Judge(robot, plants, period=period), delay_steps(needs, period=period)
    laws = Laws(slip=slip, suspension=suspension, period=period, delays=late)
    laws, reached = _backed_off(judge, tangential, laws, needs)
    margins, shortfalls = verify(
        robot, plants, judge, vertical, laws, needs, slip=reached, binding=binding
    )
    return Gains(
        robot=robot.name,
        robot_hash=robot.hash,
        period=period,
        requirements=needs,
        slip=laws.slip,
        suspension=suspension,
        margins=margins,
        caveats=(
            *(f"the design leaves out {text}" for text in (*left_out, *too_heavy)),
            *shortfalls,
        ),
        support=_taken(SupportGains, needs),
        hold=_taken(HoldGains, needs),
        limits=LimitGains(
            speed=needs.speed_share * robot.servo.speed_max,
            torque=needs.torque_share * robot.servo.torque_max,
        ),
    )


def _taken(kind: type[Any], needs: Requirements) -> Any:
    """A section of the gains that the requirements hold as it is."""
    return kind(**{entry.name: getattr(needs, entry.name) for entry in fields(kind)})


def _check(robot: Robot, needs: Requirements, plants: Plants, *, period: float) -> None:
    if not 0.0 < period < math.inf:
        raise GainsError(
            "impossible controller period",
            got=period,
            expected="a number > 0",
            fix="give it in seconds",
        )
    if robot.servo.mode != "position" or robot.servo.kp <= 0.0:
        raise GainsError(
            "compliant control shifts the servos' targets",
            got=f"servo mode {robot.servo.mode}, kp {robot.servo.kp}",
            expected="servo mode position with kp > 0",
            fix="use position servos, or kinematic control",
        )
    for entry in fields(needs):
        value, strict = getattr(needs, entry.name), entry.name in POSITIVE["requirements"]
        if not 0.0 <= value < math.inf or (strict and not value):
            expected = f"a number >{'' if strict else '='} 0"
            raise GainsError(
                "impossible requirement",
                got=value,
                expected=expected,
                fix="correct it",
                where=entry.name,
            )
    for name, plant in plants.items():
        if not math.isclose(plant.system.dt, period, rel_tol=SAME):
            raise GainsError(
                "a plant sampled otherwise",
                got=plant.system.dt,
                expected=f"{period} s",
                fix="sample it anew",
                where=name,
            )


def _backed_off(
    judge: Judge, loci: Loci, laws: Laws, needs: Requirements
) -> tuple[Laws, LoopMargins]:
    """Laws whose tangential loops keep their margins by python-control's judgement; and these.

    The search's frequencies may step over a resonance: then the gain gives way.
    """
    for _ in range(BACK_OFFS):
        found = judge.worst(loci, 0, laws)
        if found.phase >= needs.phase_margin and found.gain >= needs.gain_margin:
            return laws, found
        slip = laws.slip
        laws = replace(
            laws,
            slip=replace(slip, kp=BACK_OFF * slip.kp, ki=BACK_OFF * slip.ki, kd=BACK_OFF * slip.kd),
        )
    return laws, judge.worst(loci, 0, laws)


def carried(robot: Robot, plants: Plants, needs: Requirements) -> tuple[Plants, tuple[str, ...]]:
    """The plants of stances in which the servos carry the robot within their share of torque.

    And texts that say in which they do not. Raises GainsError when they carry it in none.
    """
    most = needs.torque_share * robot.servo.torque_max
    torque = {
        _legs(plant): support_torque(robot, {name: plant})
        for name, plant in plants.items()
        if nominal(robot, plant)
    }
    able = {name: plant for name, plant in plants.items() if torque.get(_legs(plant), 0.0) <= most}
    if not any(nominal(robot, plant) for plant in able.values()):
        fix = "stronger servos, less weight, or feet closer to the hips"
        got, expected = (
            f"{min(torque.values()):.3g} N m",
            f"at most {most:.3g} N m, torque_share x servo.torque_max, of a servo in some stance",
        )
        raise GainsError(
            "the servos do not carry the robot",
            got=got,
            expected=expected,
            fix=fix,
            where=f"robot {robot.name}",
        )
    expected = f"at most {most:.3g} N m, torque_share x servo.torque_max"
    return able, tuple(
        f"{legs}: the servos do not carry the robot (got {value:.3g} N m, expected {expected})"
        for legs, value in torque.items()
        if value > most
    )


def _legs(plant: StandingPlant) -> str:
    return "standing on " + " ".join(
        leg for leg, stands in zip(LEG_NAMES, plant.standing, strict=True) if stands
    )


def design_slip(
    loci: Loci, needs: Requirements, *, period: float, time: float = 1.0
) -> tuple[SlipGains, str]:
    """Among shapes kp/ki, kd/ki the one with the largest ki at which every locus keeps its margins.

    And what stopped that ki. time: of the robot's size (size.py), which the shapes go with.
    """
    late = delay_response(delay_steps(needs, period=period), loci.omega, period=period)
    best, binding = (
        slip_gains(0.0, 0.0, 0.0, needs, period=period),
        "no integral action is possible",
    )
    leads, curvatures = [time * lead for lead in LEADS], [time * time * bend for bend in CURVATURES]
    for lead, curvature in itertools.product(leads, curvatures):
        shape = slip_gains(1.0, lead, curvature, needs, period=period)
        loops = loci.values * slip_response(shape, loci.omega, period=period) * late
        most, stopped = _largest_gain(loops, needs, loci)
        if SAFETY * most > best.ki:
            best, binding = (
                slip_gains(SAFETY * most, lead, curvature, needs, period=period),
                stopped,
            )
    return best, binding


def slip_gains(
    ki: float, lead: float, curvature: float, needs: Requirements, *, period: float
) -> SlipGains:
    """Gains of a shape; the derivative and the anti-windup go with period and filter."""
    return SlipGains(
        kp=ki * lead,
        ki=ki,
        kd=ki * curvature,
        derivative_time=DERIVATIVE_PERIODS * period,
        filter_time=needs.filter_time,
        load_time=needs.load_time,
        tracking_time=2.0 * max(needs.filter_time, period),
        limit=needs.slip_limit,
    )


def _largest_gain(loops: Response, needs: Requirements, loci: Loci) -> tuple[float, str]:
    """Scale of unit-gain loops at which the worst just keeps its margins, and which margin of which
    plant that is.

    Out of the sector of the phase margin beyond gain 1 at all frequencies: more than the margin at
    the crossings asks for.
    """
    inside = np.abs(np.angle(-loops)) < math.radians(needs.phase_margin + SPARE)
    near, critical = (
        np.where(inside, np.abs(loops), TINY).max(axis=1),
        np.maximum(critical_size(loops), TINY),
    )
    allowed = {
        "phase_margin": 1.0 / near,
        "gain_margin": 10.0 ** (-needs.gain_margin / 20.0) / critical,
    }
    name = min(allowed, key=lambda margin: float(allowed[margin].min()))
    worst = int(allowed[name].argmin())
    return float(allowed[name][worst]), f"{name} ({loci.names[worst]})"


def design_suspension(
    robot: Robot, loci: Loci, needs: Requirements, *, period: float
) -> SuspensionGains:
    """k from the deflection under a third of the weight, m from the frequency, b from the damping
    ratio.

    A stiff leg on a soft suspension asks for more margin than the wanted frequency leaves: then the
    frequency gives way.
    """
    stiffness, late = (
        weight_share(robot) / needs.deflection,
        delay_response(delay_steps(needs, period=period), loci.omega, period=period),
    )
    gains = suspension_gains(stiffness, needs.frequency, needs)
    for step in range(FREQUENCY_STEPS):
        gains = suspension_gains(stiffness, needs.frequency * FREQUENCY_FACTOR**step, needs)
        law = response(sampled_suspension(gains, period=period), loci.omega)[:, 0, 0] * late
        found = [quick_margins(locus * law, loci.omega) for locus in loci.values]
        if (
            min(m.gain for m in found) > needs.gain_margin / SAFETY
            and min(m.phase for m in found) > needs.phase_margin / SAFETY
        ):
            break
    return gains


def suspension_gains(stiffness: float, frequency: float, needs: Requirements) -> SuspensionGains:
    """A mass on that spring with the natural frequency [Hz] and the damping ratio asked for."""
    mass = stiffness / (2.0 * math.pi * frequency) ** 2
    return SuspensionGains(
        mass=mass,
        damping=2.0 * needs.damping_ratio * math.sqrt(stiffness * mass),
        stiffness=stiffness,
        limit=needs.deflection_limit,
    )
