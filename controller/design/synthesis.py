"""Designs the gains of a robot, with python-control for the loops of the paper's control.

Compliant control has no fast loop: its values are those of the requirements. The paper's control
gets the largest shares, up to those asked for, that keep the margins of its loops (paper.py).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from hexapod_cosim.controller.design.paper import (
    PaperDesign,
    Plants,
    StandingPlant,
    design_paper,
    meets,
)
from hexapod_cosim.controller.gains import Gains, GainsError, Margins, Requirements
from hexapod_cosim.controller.gains_file import raising_gains_errors
from hexapod_cosim.controller.size import requirements_for, sections_for
from hexapod_cosim.models import LEG_NAMES, Robot
from hexapod_cosim.models.schema import check_record

NOMINAL = (0.8, 1.25)  # 1    range of mean loads that are about the robot's own
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
        **sections_for(robot, needs) | {"paper": paper.gains},
        margins=Margins(
            support_torque=support_torque(robot, plants),
            binding=paper.binding,
            paper_phase_margin=paper.margins.phase,
            paper_gain_margin=paper.margins.gain,
            paper_static_margin=paper.margins.static,
            paper_spectral_radius=paper.radius,
        ),
        caveats=(
            *(f"the design leaves out {text}" for text in (*left_out, *too_heavy)),
            *_shortfalls(paper, needs),
        ),
    )


def _shortfalls(paper: PaperDesign, needs: Requirements) -> tuple[str, ...]:
    """Returns a text on margins of the paper's control that are missed, or nothing."""
    found = paper.margins
    if meets(found, needs) and paper.radius < 1.0:
        return ()
    return (
        f"the paper's control has {found.phase:.3g} deg and {found.gain:.3g} dB of margin, "
        f"{found.static:.3g} dB at rest, and a spectral radius of {paper.radius:.6g} on these legs",
    )


def support_torque(robot: Robot, plants: Plants) -> float:
    """Returns the largest feed-forward torque of a servo in stances near the nominal load [N m]."""
    return max(
        float(np.abs(plant.torque).max()) for plant in plants.values() if nominal(robot, plant)
    )


def nominal(robot: Robot, plant: StandingPlant) -> bool:
    """Returns whether the feet of a plant carry about the robot's own weight."""
    return bool(NOMINAL[0] <= plant.load(robot).mean() <= NOMINAL[1])


def check_period(period: float) -> None:
    """Raises GainsError for a period of the controller [s] that is not a positive number."""
    if not 0.0 < period < math.inf:
        raise GainsError(
            "impossible controller period",
            got=period,
            expected="a number > 0",
            fix="give it in seconds",
        )


def check_position_servos(robot: Robot) -> None:
    """Raises GainsError for a robot whose servos hold no position."""
    if robot.servo.mode != "position" or robot.servo.kp <= 0.0:
        raise GainsError(
            "compliant control shifts the servos' targets",
            got=f"servo mode {robot.servo.mode}, kp {robot.servo.kp}",
            expected="servo mode position with kp > 0",
            fix="use position servos, or kinematic control",
        )


def _check(robot: Robot, needs: Requirements, plants: Plants, *, period: float) -> None:
    check_period(period)
    check_position_servos(robot)
    with raising_gains_errors():
        check_record(needs, "requirements")
    for name, plant in plants.items():
        if not math.isclose(plant.system.dt, period, rel_tol=SAME):
            raise GainsError(
                "a plant sampled with another period",
                got=plant.system.dt,
                expected=f"{period} s",
                fix="linearise it with the controller's period",
                where=name,
            )


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
