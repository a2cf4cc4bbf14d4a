"""The friction models M1 to M6 of measured servos (eq. 50), as robots that have their terms."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from hexapod_cosim.extensions.identify.numbers.servo import (
    DRY,
    LOAD,
    LOADS,
    MOTOR,
    QUADRATIC,
    SQUARE,
    STRIBECK_LOADS,
    VISCOUS,
)
from hexapod_cosim.models import HexapodError, Robot, unknown_name
from hexapod_cosim.models.records import Servo

# terms besides Coulomb and viscous friction
TERMS = {
    "m1": (),
    "m2": ("stribeck_friction",),
    "m3": LOADS,
    "m4": ("stribeck_friction", *LOADS, *STRIBECK_LOADS),
    "m5": ("stribeck_friction", *LOADS, *STRIBECK_LOADS),
    "m6": ("stribeck_friction", *LOADS, *STRIBECK_LOADS, *QUADRATIC),
}
TIED = ("m3", "m4")  # models with one coefficient for the torques of motor and load
FIRST = 0.5  # of a typical term: where the search of one begins that the file does not have
LEAST = 1e-3  # of a typical term: a smaller one of the file is as none
APART = 1.1  # between the coefficients of motor and load where the search of M5, M6 begins


def with_friction_model(robot: Robot, model: str) -> Robot:
    """Returns the robot with the terms of a friction model; other terms are 0.

    Terms are the robot file's, and a part of what is typical of servos of its size where it has
    none.

    Raises HexapodError for an unknown model, and for a servo without a model of its motor, which
    has no such friction.
    """
    if model not in TERMS:
        raise unknown_name("friction model", model, TERMS, where="--friction")
    if not MOTOR(robot):
        raise HexapodError(
            "friction models are those of measured servos",
            got=f'drive = "{robot.servo.drive}"',
            expected='drive = "motor"',
            fix="give a servo of `hexapod list servos` as [servo] model, or leave --friction out",
            where="--friction",
        )
    servo, typical = robot.servo, _typical(robot.servo)
    values: dict[str, Any] = dict.fromkeys(typical, 0.0)
    for key in ("coulomb_friction", "viscous_friction", *TERMS[model]):
        own = getattr(servo, key)
        values[key] = own if own > LEAST * typical[key] else FIRST * typical[key]
    for motor, external in (LOADS, STRIBECK_LOADS):
        if model in TIED:
            values[motor] = values[external] = 0.5 * (values[motor] + values[external])
        elif values[motor] == values[external] > 0.0:
            values[motor] *= APART
    return replace(robot, servo=replace(servo, **values))


def _typical(servo: Servo) -> dict[str, float]:
    """Returns typical terms of the friction of servos of this size, by key."""
    return {
        "coulomb_friction": DRY * servo.torque_max,
        "viscous_friction": VISCOUS * servo.torque_max / servo.speed_max,
        "stribeck_friction": DRY * servo.torque_max,
        **dict.fromkeys((*LOADS, *STRIBECK_LOADS), LOAD),
        **dict.fromkeys(QUADRATIC, SQUARE),
    }
