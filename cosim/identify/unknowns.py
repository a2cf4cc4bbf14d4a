"""The table of unknown numbers of a robot and its sensors.

A row tells what is known beforehand: `prior` is the standard deviation of the robot file's value,
as a share of it for numbers above 0. A further number of the robot file is a further row.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from hexapod_cosim.cosim.identify.inertia import BodyInertia, body_inertia
from hexapod_cosim.cosim.identify.log import CHANNELS, SENSORS, Log
from hexapod_cosim.cosim.interface.names import joint_names
from hexapod_cosim.models import JOINT_NAMES, Robot
from hexapod_cosim.models.records import BRISTLE_LAWS
from hexapod_cosim.models.servos.presets import followed

GROUPS = ("servo", "mass", "contact", "sensor", "zero")  # that a user can choose
OF_FILE = ("servo", "mass", "contact")  # of the robot file, not of sensors
START = "start"  # group of what the first row of a log leaves open
ALWAYS: Callable[[Robot], bool] = lambda _robot: True  # noqa: E731
LINE: Callable[[Robot], bool] = lambda robot: robot.servo.drive == "line"  # noqa: E731
MOTOR: Callable[[Robot], bool] = lambda robot: robot.servo.drive == "motor"  # noqa: E731
ELASTIC: Callable[[Robot], bool] = lambda robot: robot.servo.gear_stiffness > 0.0  # noqa: E731
GEAR = ("servo.gear_stiffness", "servo.gear_damping", "servo.backlash")  # of elastic gears
CURRENT = "sensor.torque_constant"
DELAYS = {name: f"delay.{name}" for name in SENSORS}  # keys by sensors
BIAS = "bias."


@dataclass(frozen=True, kw_only=True)
class Unknown:
    """A number to be found."""

    key: str
    unit: str
    group: str
    prior: float  # standard deviation; of the logarithm where `positive`
    positive: bool = True  # its logarithm is estimated
    start: float = 0.0  # value before, of numbers that no robot file has
    low: float = -math.inf
    high: float = math.inf
    # how the robot file's value is read and replaced; None: a number of sensors
    read: Callable[[Robot], float] | None = None
    write: Callable[[Robot, float], Robot] | None = None
    applies: Callable[[Robot], bool] = ALWAYS

    def value(self, z: float, before: float) -> float:
        """Returns the value at a distance z from the value before, in units of the prior."""
        if self.positive:
            return before * math.exp(self.prior * z)
        return min(max(before + self.prior * z, self.low), self.high)

    def distance(self, value: float, before: float) -> float:
        """Returns the z of a value, within the limits of z."""
        own = math.log(value / before) if self.positive else value - before
        low, high = self.bounds(before)
        return min(max(own / self.prior, low), high)

    def interval(self, value: float, deviation: float) -> tuple[float, float]:
        """Returns value -+ a deviation in units of the prior."""
        half = self.prior * deviation
        if self.positive:
            return value * math.exp(-half), value * math.exp(half)
        return value - half, value + half

    def bounds(self, before: float) -> tuple[float, float]:
        """Returns the limits of z."""
        if self.positive:
            return -FURTHEST, FURTHEST
        low, high = (self.low - before) / self.prior, (self.high - before) / self.prior
        return max(low, -FURTHEST), min(high, FURTHEST)


FURTHEST = 8.0  # priors from the value before


def _section(name: str, unit: str, group: str, prior: float, **more: Any) -> Unknown:
    """Returns the row of a number in a section of robot files, named "section.key"."""
    section, _, key = name.partition(".")

    def read(robot: Robot) -> float:
        return float(getattr(getattr(robot, section), key))

    def write(robot: Robot, value: float) -> Robot:
        changed: Any = replace(getattr(robot, section), **{key: value})
        sections: dict[str, Any] = {section: changed}
        return replace(robot, **sections)

    return Unknown(key=name, unit=unit, group=group, prior=prior, read=read, write=write, **more)


def _motor(name: str, unit: str, prior: float) -> Unknown:
    """Returns the row of a number of measured servos, named "servo.key".

    What follows from it, as the largest torque, changes with it; kp is a number of its own.
    """
    row = _section(name, unit, "servo", prior, applies=MOTOR)
    plain = row.write
    if plain is None:
        raise ValueError(f"{name} is no number of robot files")

    def write(robot: Robot, value: float) -> Robot:
        changed = plain(robot, value)
        return replace(changed, servo=followed(changed.servo))

    return replace(row, write=write)


def _mass(joint: int | None) -> Unknown:
    """Returns the row of the mass of the torso (None) or of a link of all legs."""
    name = "torso" if joint is None else f"links.{JOINT_NAMES[joint]}"

    def read(robot: Robot) -> float:
        return float(_body(robot, joint).mass)

    def write(robot: Robot, value: float) -> Robot:
        factor = value / read(robot)
        return _with_bodies(robot, joint, lambda body: body.with_mass(body.mass * factor))

    return Unknown(key=f"{name}.mass", unit="kg", group="mass", prior=0.2, read=read, write=write)


def _com(joint: int | None, axis: int, prior: float) -> Unknown:
    """Returns the row of a coordinate of a centre of mass; all legs move alike."""
    name = "torso" if joint is None else f"links.{JOINT_NAMES[joint]}"

    def read(robot: Robot) -> float:
        return float(_body(robot, joint).com[axis])

    def write(robot: Robot, value: float) -> Robot:
        shift = value - read(robot)

        def moved(body: Any) -> Any:
            com = list(body.com)
            com[axis] += shift
            return body.with_com(com)

        return _with_bodies(robot, joint, moved)

    return Unknown(
        key=f"{name}.com[{axis + 1}]", unit="m", group="mass", prior=prior, positive=False,
        read=read, write=write,
    )  # fmt: skip


def _gyration() -> Unknown:
    """Returns the row of the torso's radius of gyration: the root of the mean square distance of
    its mass from its centre, sqrt(trace I / 2 m). The shape of the inertia stays.
    """

    def read(robot: Robot) -> float:
        return math.sqrt(sum(robot.torso.inertia[:3]) / (2.0 * robot.torso.mass))

    def write(robot: Robot, value: float) -> Robot:
        factor = value / read(robot)
        return _with_bodies(robot, None, lambda body: body.scaled(factor))

    return Unknown(
        key="torso.gyration_radius", unit="m", group="mass", prior=0.2, read=read, write=write
    )


def _body(robot: Robot, joint: int | None) -> Any:
    """Returns the torso or a link of the first leg."""
    return robot.torso if joint is None else robot.legs[0].links[joint]


def _with_bodies(robot: Robot, joint: int | None, change: Callable[[Any], Any]) -> Robot:
    """Returns the robot with the torso, or a link of every leg, changed as a possible body."""
    found: dict[Any, Any] = {}  # links of most legs are alike

    def changed(body: Any) -> Any:
        key = body.mass, tuple(body.com), tuple(body.inertia)
        if key not in found:
            found[key] = _changed_body(key, change)
        mass, com, inertia = found[key]
        return replace(body, mass=mass, com=com, inertia=inertia)

    if joint is None:
        return replace(robot, torso=changed(robot.torso))
    legs = []
    for leg in robot.legs:
        links = list(leg.links)
        links[joint] = changed(links[joint])
        legs.append(replace(leg, links=(links[0], links[1], links[2])))
    return replace(robot, legs=tuple(legs))


def _changed_body(body: Any, change: Callable[[BodyInertia], BodyInertia]) -> Any:
    """Returns mass, centre of mass and inertia of a changed body; what does not change keeps every
    digit.
    """
    old = body_inertia(*body)
    new = change(old)
    mass = body[0] if new.size == old.size else new.mass
    alike = mass == body[0] and (new.widths, new.shears) == (old.widths, old.shears)
    return mass, new.com, body[2] if alike else new.inertia


ROBOT = (
    _section("servo.kp", "N m/rad", "servo", 0.3),
    _section("servo.kd", "N m s/rad", "servo", 0.3),
    _section("servo.coulomb_friction", "N m", "servo", 0.5),
    _section("servo.rotor_inertia", "kg m2", "servo", 0.5),
    _section("servo.torque_max", "N m", "servo", 0.2, applies=LINE),
    _section("servo.speed_max", "rad/s", "servo", 0.2, applies=LINE),
    _motor("servo.torque_constant", "N m/A", 0.2),
    _motor("servo.resistance", "ohm", 0.2),
    _motor("servo.viscous_friction", "N m s/rad", 0.5),
    _motor("servo.stribeck_friction", "N m", 0.5),
    _motor("servo.motor_load_friction", "1", 0.5),
    _motor("servo.external_load_friction", "1", 0.5),
    _section("servo.gear_stiffness", "N m/rad", "servo", 0.5, applies=ELASTIC),
    _section("servo.gear_damping", "N m s/rad", "servo", 0.7, applies=ELASTIC),
    _section(
        "servo.backlash", "rad", "servo", 0.003, positive=False, low=0.0, high=1.0, applies=ELASTIC
    ),
    _mass(None),
    *(_com(None, axis, 0.01) for axis in range(3)),
    _gyration(),
    *(_mass(joint) for joint in range(3)),
    *(_com(joint, 0, 0.01) for joint in range(3)),
    _section("contact.stiffness", "N/m^1.5", "contact", 1.0),
    _section("contact.restitution", "1", "contact", 0.2, positive=False, low=0.0, high=1.0),
    _section(
        "friction.mu", "1", "contact", 0.3, applies=lambda robot: robot.friction.law != "none"
    ),
    _section(
        "friction.slope", "s/m", "contact", 0.7, applies=lambda robot: robot.friction.law == "tanh"
    ),
    _section(
        "friction.presliding", "m", "contact", 0.7,
        applies=lambda robot: robot.friction.law in BRISTLE_LAWS,
    ),
)  # fmt: skip
# prior of the bias of each reading, by channel, in its unit
BIASES = {
    "gyroscope": 0.02,
    "accelerometer": 0.2,
    "torque": 0.05,
    "current": 0.05,
    "normal_force": 1.0,
    "force": 1.0,
}
READINGS = (
    *(
        Unknown(
            key=key, unit="s", group="sensor", prior=0.01 if name == "pose" else 0.004,
            positive=False, start=0.004, low=0.0,
        )
        for name, key in DELAYS.items()
    ),
    *(
        Unknown(
            key=f"{BIAS}{name}", unit=channel.unit.replace(".", " "), group="sensor",
            prior=BIASES[channel.key], positive=False,
        )
        for key in BIASES
        for channel in CHANNELS
        if channel.key == key
        for name in channel.names
    ),
    Unknown(key=CURRENT, unit="N m/A", group="sensor", prior=0.3, start=1.5),
)  # fmt: skip
ZEROS = tuple(
    Unknown(key=f"zero.{name}", unit="rad", group="zero", prior=0.02, positive=False)
    for name in (stem.removesuffix(".angle") for stem in joint_names("angle"))
)
# start values that the first row holds with its noise and that a walk does not forget
STARTS = (
    Unknown(key="start.x", unit="m", group=START, prior=0.005, positive=False),
    Unknown(key="start.y", unit="m", group=START, prior=0.005, positive=False),
    Unknown(key="start.yaw", unit="rad", group=START, prior=0.01, positive=False),
)


def chosen_unknowns(robot: Robot, logs: Sequence[Log], groups: Sequence[str]) -> list[Unknown]:
    """Returns the rows of some groups that the robot has and the logs may tell of."""
    have = {name for log in logs for name in log.measured}
    rows = [row for row in (*ROBOT, *READINGS, *ZEROS) if row.group in groups]
    found = []
    for row in rows:
        if row.key.startswith(BIAS) and row.key.removeprefix(BIAS) not in have:
            continue
        if is_delay(row) and not have & _read_by(row.key):
            continue
        # the currents of a servo with a motor follow from its torque constant
        if row.key == CURRENT and (MOTOR(robot) or not have & set(_channel("current"))):
            continue
        if row.applies(robot) and not (row.positive and row.read and row.read(robot) <= 0.0):
            found.append(row)
    if have & {*_channel("position"), *_channel("attitude")}:
        found += [
            replace(row, key=f"{row.key}[{number + 1}]")
            for number in range(len(logs))
            for row in STARTS
        ]
    return found


def is_delay(row: Unknown) -> bool:
    """Returns whether a row is the delay of sensors."""
    return row.key in DELAYS.values()


def _read_by(delay: str) -> set[str]:
    """Returns the columns that are late by a delay, given by its key."""
    return {name for one in CHANNELS if DELAYS[one.sensors] == delay for name in one.names}


def _channel(key: str) -> tuple[str, ...]:
    return next(channel.names for channel in CHANNELS if channel.key == key)


def value_before(row: Unknown, robot: Robot) -> float:
    """Returns the robot file's value of a row, or the start of a sensor's."""
    return row.start if row.read is None else row.read(robot)


def changed_robot(robot: Robot, rows: Sequence[Unknown], values: Mapping[str, float]) -> Robot:
    """Returns the robot with the values of its rows; one that does not change keeps every digit."""
    for row in rows:
        if row.write is not None and row.read is not None and row.key in values:
            value = values[row.key]
            robot = robot if value == row.read(robot) else row.write(robot, value)
    return robot
