"""Checks servos: motors have their constants, gears their rotors."""

from __future__ import annotations

from hexapod_cosim.models.errors import RobotError
from hexapod_cosim.models.records import Servo


def check_servo(servo: Servo, at: str) -> None:
    """Checks motor, gear and continuous torque of the servos. Raises RobotError."""
    _check_motor(servo, at)
    _check_gear(servo, at)
    if servo.torque_continuous > servo.torque_max:
        expected = f"at most torque_max = {servo.torque_max:g} N m"
        raise RobotError(
            "more torque for ever than at stall",
            got=servo.torque_continuous,
            expected=expected,
            fix="lower it",
            where=at + "servo.torque_continuous",
        )


def _check_motor(servo: Servo, at: str) -> None:
    """Checks that a motor has its constants."""
    motor = servo.drive == "motor"
    if servo.winding_capacity > 0.0 and servo.housing_capacity == 0.0:
        raise RobotError(
            "a housing without heat capacity",
            got=servo.housing_capacity,
            expected="a number > 0 [J/K] where winding_capacity is",
            fix="give servo.housing_capacity",
            where=at + "servo.housing_capacity",
        )
    coolest = max(servo.derate_temperature, servo.air_temperature)
    if servo.temperature_max <= coolest:
        raise RobotError(
            "windings that are never too hot",
            got=servo.temperature_max,
            expected=f"more than {coolest:g} K, derate_temperature and air_temperature",
            fix="raise servo.temperature_max",
            where=at + "servo.temperature_max",
        )
    for key in ("voltage", "torque_constant", "resistance"):
        if motor and not getattr(servo, key) > 0.0:
            what = "a motor without its constants"
            got = getattr(servo, key)
            expected = "a number > 0 with the drive motor"
            fix = f"give servo.{key}, or a servo of `hexapod list servos` as servo.model"
            raise RobotError(what, got=got, expected=expected, fix=fix, where=at + f"servo.{key}")


def _check_gear(servo: Servo, at: str) -> None:
    """Checks that an elastic gear has a rotor, and that play is in an elastic gear."""
    if servo.gear_stiffness > 0.0 and servo.rotor_inertia == 0.0:
        raise RobotError(
            "elastic gear without a rotor",
            got=servo.rotor_inertia,
            expected="rotor_inertia > 0 with gear_stiffness, whose gear moves the rotor",
            fix="give servo.rotor_inertia, or set servo.gear_stiffness to 0",
            where=at + "servo.rotor_inertia",
        )
    if servo.backlash > 0.0 and servo.gear_stiffness == 0.0:
        raise RobotError(
            "play in a rigid gear",
            got=servo.gear_stiffness,
            expected="gear_stiffness > 0 with backlash, whose teeth meet elastically",
            fix="give servo.gear_stiffness, or set servo.backlash to 0",
            where=at + "servo.gear_stiffness",
        )
