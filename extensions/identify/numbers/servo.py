"""Numbers of servos: gains, motor, friction of the gears."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from hexapod_cosim.extensions.identify.numbers import Unknown, section
from hexapod_cosim.models import HexapodError, Robot, unknown_name
from hexapod_cosim.models.records import Servo

LINE: Callable[[Robot], bool] = lambda robot: robot.servo.drive == "line"  # noqa: E731
MOTOR: Callable[[Robot], bool] = lambda robot: robot.servo.drive == "motor"  # noqa: E731
# What terms of the friction of measured servos are, from `hexapod list servos` (M1 to M6):
TERM = 0.5  # of the file's value, at least
DRY = 0.02  # of the stall torque
VISCOUS = 0.05  # of the stall torque at the no-load speed
LOAD, SQUARE = 0.15, 0.01  # 1, 1/(N m)


def _term(
    name: str, unit: str, typical: Callable[[Servo], float], applies: Callable[[Robot], bool]
) -> Unknown:
    """Returns the row of a term of the friction of measured servos, on a linear scale from 0 on: a
    term near 0 could not move on a logarithmic one.

    typical: what such terms are of servos of this size; the prior is at least this.
    """
    row = section(name, unit, "servo", 0.0, positive=False, low=0.0, applies=applies)
    high = 1.0 if unit == "1" else math.inf

    def prior(robot: Robot) -> float:
        return max(TERM * row.read(robot), typical(robot.servo))

    return replace(row, high=high, prior_of=prior)


def _of_both(name: str, motor: str, external: str) -> Unknown:
    """Returns the row of a coefficient that the friction models M3 and M4 have for the torques of
    the motor and of the load, named "servo.key".
    """
    sides = [_term(f"servo.{key}", "1", lambda _servo: LOAD, MOTOR) for key in (motor, external)]

    def write(robot: Robot, value: float) -> Robot:
        for side in sides:
            robot = side.write(robot, value)
        return robot

    return replace(sides[0], key=name, write=write, applies=lambda robot: _alike(robot, sides))


def _alike(robot: Robot, sides: Sequence[Unknown]) -> bool:
    """Returns whether terms of a measured servo are equal and not 0."""
    first, second = (side.read(robot) for side in sides)
    return MOTOR(robot) and first == second > 0.0


def _has_term(*keys: str) -> Callable[[Robot], bool]:
    """Returns whether a measured servo has one of some terms."""
    return lambda robot: MOTOR(robot) and any(getattr(robot.servo, key) > 0.0 for key in keys)


def _unlike(key: str, other: str) -> Callable[[Robot], bool]:
    """Returns whether a measured servo has a term that differs from another one."""
    return lambda robot: MOTOR(robot) and getattr(robot.servo, key) != getattr(robot.servo, other)


LOADS = ("motor_load_friction", "external_load_friction")
STRIBECK_LOADS = ("stribeck_motor_load_friction", "stribeck_external_load_friction")
QUADRATIC = ("quadratic_motor_friction", "quadratic_external_friction")
STRIBECK = ("stribeck_friction", *STRIBECK_LOADS, *QUADRATIC)  # that fall with the speed
# coefficients of M3 and M4, with the keys of the robot file that have their value
TIED = {"servo.load_friction": LOADS, "servo.stribeck_load_friction": STRIBECK_LOADS}
FRICTION = (
    _term(
        "servo.viscous_friction", "N m s/rad",
        lambda servo: VISCOUS * servo.torque_max / servo.speed_max, _has_term("viscous_friction"),
    ),
    _term(
        "servo.stribeck_friction", "N m", lambda servo: DRY * servo.torque_max,
        _has_term("stribeck_friction"),
    ),
    *(_of_both(name, *keys) for name, keys in TIED.items()),
    *(
        _term(f"servo.{key}", "1", lambda _servo: LOAD, _unlike(key, other))
        for pair in TIED.values()
        for key, other in (pair, pair[::-1])
    ),
    *(
        _term(f"servo.{key}", "1/(N m)", lambda _servo: SQUARE, _has_term(key))
        for key in QUADRATIC
    ),
    section("servo.stribeck_speed", "rad/s", "servo", 0.5, applies=_has_term(*STRIBECK)),
    section(
        "servo.stribeck_exponent", "1", "servo", 0.5, high=16.0, applies=_has_term(*STRIBECK)
    ),
)  # fmt: skip
SERVO = (
    section("servo.kp", "N m/rad", "servo", 0.3),
    section("servo.kd", "N m s/rad", "servo", 0.3),
    section("servo.coulomb_friction", "N m", "servo", 0.5, applies=LINE),
    _term("servo.coulomb_friction", "N m", lambda servo: DRY * servo.torque_max, MOTOR),
    section("servo.rotor_inertia", "kg m2", "servo", 0.5),
    section("servo.torque_max", "N m", "servo", 0.2, applies=LINE),
    section("servo.speed_max", "rad/s", "servo", 0.2, applies=LINE),
    section("servo.torque_constant", "N m/A", "servo", 0.2, applies=MOTOR),
    section("servo.resistance", "ohm", "servo", 0.2, applies=MOTOR),
    *FRICTION,
)  # fmt: skip


# terms besides Coulomb and viscous friction
TERMS = {
    "m1": (),
    "m2": ("stribeck_friction",),
    "m3": LOADS,
    "m4": ("stribeck_friction", *LOADS, *STRIBECK_LOADS),
    "m5": ("stribeck_friction", *LOADS, *STRIBECK_LOADS),
    "m6": ("stribeck_friction", *LOADS, *STRIBECK_LOADS, *QUADRATIC),
}
SINGLE = ("m3", "m4")  # models with one coefficient for the torques of motor and load
FIRST = 0.5  # of a typical term: where the search of one begins that the file does not have
LEAST = 1e-3  # of a typical term: a smaller one of the file is as none
APART = 1.1  # between the coefficients of motor and load where the search of M5, M6 begins


def with_friction_model(robot: Robot, model: str) -> Robot:
    """Returns the robot with the terms of a friction model; other terms are 0.

    Terms are the robot file's, and a share of what is typical of servos of its size where it has
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
        if model in SINGLE:
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
