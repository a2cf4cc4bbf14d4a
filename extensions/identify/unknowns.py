"""The table of unknown numbers of a robot and its sensors.

A row says what is known beforehand: `prior` is the standard deviation of the robot file's value,
as a share of it for numbers above 0. A further number of the robot file is a further row.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from hexapod_cosim.cosim.interface.names import joint_names
from hexapod_cosim.extensions.identify.log import CHANNELS, SENSORS, Log
from hexapod_cosim.extensions.identify.numbers import Unknown, section
from hexapod_cosim.extensions.identify.numbers.bodies import (
    along_row,
    com_row,
    gyration_row,
    mass_row,
)
from hexapod_cosim.extensions.identify.numbers.servo import MOTOR, SERVO
from hexapod_cosim.models import Robot

GROUPS = ("servo", "mass", "contact", "sensor", "zero")  # that a user can choose
OF_FILE = ("servo", "mass", "contact")  # of the robot file, not of sensors
START = "start"  # group of what the first row of a log leaves open
CURRENT = "sensor.torque_constant"
DELAYS = {name: f"delay.{name}" for name in SENSORS}  # keys by sensors
BIAS = "bias."

ROBOT = (
    *SERVO,
    mass_row(None),
    *(com_row(axis, 0.01) for axis in range(3)),
    gyration_row(),
    *(mass_row(joint) for joint in range(3)),
    *(along_row(joint, 0.01) for joint in range(3)),
    section("contact.stiffness", "N/m^1.5", "contact", 1.0),
    section("contact.restitution", "1", "contact", 0.2, positive=False, low=0.0, high=1.0),
    section(
        "friction.mu", "1", "contact", 0.3, applies=lambda robot: robot.friction.has_friction
    ),
    section(
        "friction.slope", "s/m", "contact", 0.7, applies=lambda robot: robot.friction.creeps
    ),
    section(
        "friction.presliding", "m", "contact", 0.7,
        applies=lambda robot: robot.friction.has_bristles,
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
            positive=False, low=0.0, read=lambda _robot: 0.004,
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
    Unknown(key=CURRENT, unit="N m/A", group="sensor", prior=0.3, read=lambda _robot: 1.5),
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
    """Returns the rows of some groups that the robot has and the logs may show."""
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
        if row.applies(robot) and not (row.positive and row.read(robot) <= 0.0):
            found.append(row.of_robot(robot))
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


def changed_robot(robot: Robot, rows: Sequence[Unknown], values: Mapping[str, float]) -> Robot:
    """Returns the robot with the values of its rows; one that does not change keeps every digit."""
    for row in rows:
        if row.key in values and values[row.key] != row.read(robot):
            robot = row.write(robot, values[row.key])
    return robot
