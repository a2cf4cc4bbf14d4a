"""Designs gains that meet requirements, with python-control.

Compliant control has no fast loop: its values are those of the requirements. The PID of the
paper's control gets the largest integral gain at which every eigenlocus of every plant keeps its
margins, its suspension the required deflection, frequency and damping, or a lower frequency where
the margins need it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
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
    Plants,
    Response,
    all_loci,
    critical_size,
    frequencies,
    quick_margins,
    response,
)
from hexapod_cosim.controller.design.paper import paper_loci, paper_slip, stable
from hexapod_cosim.controller.design.standing import StandingPlant, weight_share
from hexapod_cosim.controller.design.verify import MarginFinder, nominal, support_torque
from hexapod_cosim.controller.gains import (
    POSITIVE,
    Gains,
    GainsError,
    HoldGains,
    LimitGains,
    Margins,
    Requirements,
    SlipGains,
    SupportGains,
    SuspensionGains,
)
from hexapod_cosim.controller.size import requirements_for, size_of
from hexapod_cosim.models import LEG_NAMES, Robot

LEADS = (0.0, 0.001, 0.003, 0.01, 0.1)  # s    candidates of kp/ki, scaled by the robot's size
CURVATURES = (0.0, 1e-5, 2e-5, 5e-5, 2e-4, 5e-4)  # s2    candidates of kd/ki, by its square
DERIVATIVE_PERIODS = 2.0  # 1    filter of the derivative in controller periods
SEARCHED, FINER = 100, 4  # frequencies of the plants' loci; factor for loops, which turn faster
FREQUENCY_STEPS, FREQUENCY_FACTOR = 24, 0.85  # 1    attempts with a lower suspension frequency
SAFETY, SPARE = 0.98, 0.5  # 1, deg    reserve, as the grid may miss the worst frequency
BACK_OFF, BACK_OFFS = 0.95, 40  # 1    reduction of the gain at a missed margin, and attempts
TINY = 1e-9  # 1    floor of a loop's magnitude
SAME = 1e-9  # 1    relative tolerance of periods


def design_gains(
    robot: Robot,
    period: float,
    *,
    plants: Plants,
    requirements: Requirements | None = None,
    left_out: Sequence[str] = (),
) -> Gains:
    """Designs the gains of a robot for a controller period [s].

    Args:
        plants: the standing robot, linearised in its stances, by name.
        requirements: by default those for the robot's size.
        left_out: stances without a plant, and why. They become caveats of the gains, and so do
            stances in which the servos do not carry the robot.

    Raises:
        GainsError: no gains meet the requirements; the message says which one is missed.
    """
    needs = requirements_for(robot) if requirements is None else requirements
    _check(robot, needs, plants, period=period)
    plants, too_heavy = carried(robot, plants, needs)
    paper = design_paper(robot, plants, needs, period=period)
    return Gains(
        robot=robot.name,
        robot_hash=robot.hash,
        period=period,
        requirements=needs,
        paper_slip=paper_slip(paper.laws, needs),
        paper_suspension=paper.laws.suspension,
        margins=Margins(
            support_torque=support_torque(robot, plants),
            binding=paper.binding,
            paper_phase_margin=paper.phase,
            paper_gain_margin=paper.gain,
            paper_spectral_radius=paper.radius,
        ),
        caveats=(
            *(f"the design leaves out {text}" for text in (*left_out, *too_heavy)),
            *paper.shortfalls,
        ),
        support=_taken(SupportGains, needs),
        hold=_taken(HoldGains, needs),
        limits=_limits(robot, needs),
    )


@dataclass(frozen=True, kw_only=True)
class PaperDesign:
    """Laws of the paper's control and the margins of their worst loops."""

    laws: Laws
    phase: float  # deg
    gain: float  # dB
    radius: float  # 1    spectral radius of the whole loop
    binding: str  # the requirement that limited the gain of the tangential loop
    shortfalls: tuple[str, ...]  # texts on requirements that are missed


def design_paper(
    robot: Robot, plants: Plants, needs: Requirements, *, period: float
) -> PaperDesign:
    """Designs the laws of the paper's control by the same requirements, search and margins."""
    time = size_of(robot).time
    omega = frequencies(period, SEARCHED, slowest=SLOWEST / time)
    found = all_loci(robot, plants, omega, of=paper_loci)
    tangential, vertical = (loci.finer(FINER) for loci in found)
    slip, binding = design_slip(tangential, needs, period=period, time=time)
    suspension = design_suspension(robot, vertical, needs, period=period)
    finder = MarginFinder(robot, plants, period=period, of=paper_loci)
    late = delay_steps(needs, period=period)
    laws = Laws(slip=slip, suspension=suspension, period=period, delays=late)
    laws = _backed_off(finder, tangential, laws, needs)
    laws, radius = stable(robot, plants, laws)
    margins = finder.worst(tangential, 0, laws), finder.worst(vertical, 1, laws)
    phase, gain = min(m.phase for m in margins), min(m.gain for m in margins)
    missed = phase < needs.phase_margin or gain < needs.gain_margin or radius >= 1.0
    text = (
        f"the paper's control has {phase:.3g} deg and {gain:.3g} dB of margin and a spectral "
        f"radius of {radius:.6g} on these legs"
    )
    return PaperDesign(
        laws=laws,
        phase=phase,
        gain=gain,
        radius=radius,
        binding=binding,
        shortfalls=(text,) * missed,
    )


def _taken(kind: type[Any], needs: Requirements) -> Any:
    """Returns a section of the gains whose values are those of the requirements."""
    return kind(**{entry.name: getattr(needs, entry.name) for entry in fields(kind)})


def _limits(robot: Robot, needs: Requirements) -> LimitGains:
    """Returns the limit of commanded torques [N m]."""
    return LimitGains(torque=needs.torque_share * robot.servo.torque_max)


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
                "a plant sampled with another period",
                got=plant.system.dt,
                expected=f"{period} s",
                fix="linearise it with the controller's period",
                where=name,
            )


def _backed_off(finder: MarginFinder, loci: Loci, laws: Laws, needs: Requirements) -> Laws:
    """Reduces the gain until the tangential loops keep their margins by python-control.

    The search's grid may miss a resonance.
    """
    for _ in range(BACK_OFFS):
        found = finder.worst(loci, 0, laws)
        if found.phase >= needs.phase_margin and found.gain >= needs.gain_margin:
            return laws
        slip = laws.slip
        laws = replace(
            laws,
            slip=replace(slip, kp=BACK_OFF * slip.kp, ki=BACK_OFF * slip.ki, kd=BACK_OFF * slip.kd),
        )
    return laws


def carried(robot: Robot, plants: Plants, needs: Requirements) -> tuple[Plants, tuple[str, ...]]:
    """Returns the plants whose servos carry the robot within torque_share, and texts on the others.

    Raises GainsError when the servos carry the robot in no stance.
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
    """Returns the gains with the largest ki at which every locus keeps its margins.

    All candidates of kp/ki and kd/ki are tried; time: scales them by the robot's size (size.py).
    Also returns the name of the margin and the plant that limit ki.
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
    """Returns the gains for ki, kp/ki (lead) and kd/ki (curvature).

    The filter of the derivative follows the period, the anti-windup period and force filter.
    """
    return SlipGains(
        kp=ki * lead,
        ki=ki,
        kd=ki * curvature,
        derivative_time=DERIVATIVE_PERIODS * period,
        filter_time=needs.filter_time,
        load_time=needs.load_time,
        tracking_time=2.0 * max(needs.filter_time, period),
        limit=needs.deflection_limit,
    )


def _largest_gain(loops: Response, needs: Requirements, loci: Loci) -> tuple[float, str]:
    """Returns the largest factor on unit-gain loops that keeps all margins, and what limits it.

    A loop may not enter the sector of the phase margin with a gain above 1 at any frequency, which
    is more than the phase margin at the crossings requires.
    """
    inside = np.abs(np.angle(-loops)) < math.radians(needs.phase_margin + SPARE)
    near = np.where(inside, np.abs(loops), TINY).max(axis=1)
    critical = np.maximum(critical_size(loops), TINY)
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
    """Returns the suspension for the required deflection, frequency and damping ratio.

    The stiffness follows from the deflection under a third of the weight. The frequency is lowered
    until the loops of stiff legs keep their margins.
    """
    stiffness = weight_share(robot) / needs.deflection
    late = delay_response(delay_steps(needs, period=period), loci.omega, period=period)
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
    """Returns the suspension for a stiffness [N/m] and a natural frequency [Hz].

    The damping ratio is that of the requirements.
    """
    mass = stiffness / (2.0 * math.pi * frequency) ** 2
    return SuspensionGains(
        mass=mass,
        damping=2.0 * needs.damping_ratio * math.sqrt(stiffness * mass),
        stiffness=stiffness,
        limit=needs.deflection_limit,
    )
