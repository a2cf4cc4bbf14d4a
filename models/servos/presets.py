"""Reads measured servos by name from data/*.toml, and the [servo] section of a file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, replace
from dataclasses import fields as dataclass_fields
from functools import cache
from pathlib import Path
from typing import Annotated, Any

from hexapod_cosim.models.errors import HexapodError, RobotError, unknown_name
from hexapod_cosim.models.files import preset_tables
from hexapod_cosim.models.records import Servo
from hexapod_cosim.models.schema import (
    Choice,
    Number,
    Text,
    expect_table,
    read_given,
    require,
    specs,
    wrong_type,
)
from hexapod_cosim.models.servos.motor import (
    motor_constant,
    no_load_speed,
    position_gain,
    stall_torque,
)

MODEL = "model"  # key of a [servo] section that starts from a servo of `list_servos()`
GAIN = "duty_gain"  # key of a [servo] section beside `model`
FRICTION_MODELS = ("m1", "m2", "m3", "m4", "m5", "m6")
# fields of a motor that follow from its constants
FOLLOWING = ("torque_max", "speed_max", "motor_constant")
CONSTANTS = ("voltage", "duty_max", "torque_constant", "resistance")


@dataclass(frozen=True, kw_only=True)
class About:
    """What a servo's table holds besides fields of `Servo`."""

    title: Annotated[str, Text()]
    source: Annotated[str, Text()]  # of each number
    friction_model: Annotated[str, Choice(FRICTION_MODELS)]  # of Duclusaud et al. (eq. 50)
    # duty for each radian of the position error: firmware gain times its unit
    duty_gain: Annotated[float, Number("1/rad", above=0.0)]


@dataclass(frozen=True)
class Measured:
    """A measured servo: its provenance, and the fields of `Servo` that its table gives."""

    about: About
    fields: Mapping[str, float]

    @property
    def servo(self) -> Servo:
        """The servo, in position mode."""
        return Servo(**require(Servo, _with_motor(self.fields, self.about.duty_gain), ""))


@cache
def _measured() -> dict[str, Measured]:
    """Returns all servos, sorted by name."""
    found = {}
    for name, table, where in preset_tables(Path(__file__).parent / "data"):
        own = {key: table.pop(key) for key in specs(About) if key in table}
        own["source"] = own["source"].format_map(own)
        about = About(**require(About, read_given(About, own, where), where))
        found[name] = Measured(about, read_given(Servo, table, where))
    return found


def list_servos() -> list[str]:
    """Returns the names of the measured servos in this package."""
    return list(_measured())


def measured_servo(
    name: str, *, where: str | None = None, error: type[HexapodError] = RobotError
) -> Measured:
    """Returns a servo by name. Raises `error` for a name outside `list_servos()`."""
    if name not in _measured():
        raise unknown_name("servo", name, list_servos(), where=where, error=error)
    return _measured()[name]


def servo_table(value: Any, where: str) -> Mapping[str, Any]:
    """Returns the table of numbers of a [servo] section. Raises RobotError.

    The key `model` names a servo of `list_servos()`; the other keys replace its numbers. With a
    motor, of a model or by `drive = "motor"`, kp follows from `duty_gain` unless it is given;
    torque_max, speed_max and motor_constant follow from the motor's constants.
    """
    table = dict(expect_table(value, where))
    fields: Mapping[str, Any] = {}
    gain: float | None = None
    if MODEL in table:
        name, at = table.pop(MODEL), f"{where}.{MODEL}"
        if not isinstance(name, str):
            expected = "a name of `hexapod list servos`"
            raise wrong_type(name, expected, "give a name in quotes", at)
        measured = measured_servo(name, where=at)
        fields, gain = measured.fields, measured.about.duty_gain
    elif table.get("drive") != "motor":
        return table
    if GAIN in table:
        gain = read_given(About, {GAIN: table.pop(GAIN)}, where)[GAIN]
    given = {**fields, **read_given(Servo, table, where)}
    check_constants(given, where)
    complete = _with_motor(given, gain)
    refuse_others(given, complete, where)
    return complete


def _with_motor(given: Mapping[str, Any], gain: float | None) -> dict[str, Any]:
    """Returns the fields of a servo with a motor, given ones and those that follow from them.

    gain: `duty_gain`, if it is known.
    """
    own = {"drive": "motor", "kd": 0.0, **given}
    rest = {item.name: 0.0 for item in dataclass_fields(Servo) if item.default is MISSING}
    servo = followed(Servo(**{**rest, "mode": "position", **own}))
    if gain is not None:
        own = {"kp": position_gain(servo, gain)} | own
    return own | {key: getattr(servo, key) for key in FOLLOWING}


def check_constants(own: Mapping[str, Any], where: str) -> None:
    """Raises RobotError for a motor that lacks a constant or has one that is 0."""
    for key in ("voltage", "torque_constant", "resistance"):
        if not own.get(key, 0.0) > 0.0:
            what = "a motor without its constants"
            got, at = own.get(key), f"{where}.{key}"
            fix = f"give {key}, or a servo of `hexapod list servos` as {MODEL}"
            raise RobotError(what, got=got, expected="a number > 0", fix=fix, where=at)


def refuse_others(given: Mapping[str, Any], derived: Mapping[str, Any], where: str) -> None:
    """Raises RobotError for a given value that differs from what follows from a motor's constants.

    where: the section.
    """
    for key in FOLLOWING:
        if not math.isclose(given.get(key, derived[key]), derived[key], rel_tol=1e-9):
            what = "a value that follows from the motor's constants"
            got = given[key]
            expected = f"{derived[key]:g}"
            fix = f"remove it, or change {', '.join(CONSTANTS)}"
            raise RobotError(what, got=got, expected=expected, fix=fix, where=f"{where}.{key}")


def followed(servo: Servo) -> Servo:
    """Returns a servo of the drive motor whose fields of FOLLOWING follow from its constants."""
    return replace(
        servo,
        torque_max=stall_torque(servo),
        speed_max=no_load_speed(servo),
        motor_constant=motor_constant(servo),
    )


def changed_servo(own: Servo, values: Mapping[str, Any], where: str) -> Servo:
    """Returns a robot's servo with the fields that a scenario gives. Raises RobotError.

    If they change constants of a motor, the fields that follow from these change, and kp in
    proportion to the torque of a duty, unless it is given.
    """
    servo = replace(own, **dict(values))
    if servo.drive != "motor":
        return servo
    known = own.drive == "motor" and "kp" not in values
    if known and set(CONSTANTS) & set(values) and not set(FOLLOWING) <= set(values):
        servo = replace(servo, kp=own.kp * position_gain(servo, 1.0) / position_gain(own, 1.0))
    servo = followed(servo)
    refuse_others(values, {key: getattr(servo, key) for key in FOLLOWING}, where)
    return servo
