"""Reads MCAP files: our recordings bit for bit, and the ROS 2 topics of robots.

The type of its messages and its name say what a topic has. A topic of joint states whose name
contains "command" or "desired" has commands, any other one measurements. The measured joint states
give the times of the rows; commands hold until the next one, and readings of other sensors are
interpolated linearly between their own times.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from hexapod_cosim.cosim.common.files import why_unreadable
from hexapod_cosim.cosim.interface.names import joint_names, vector_names
from hexapod_cosim.cosim.logs import messages as ros
from hexapod_cosim.cosim.logs.mcap_writer import ABOUT, COLUMNS, NANO, OURS
from hexapod_cosim.cosim.logs.messages import require_mcap
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.models import LEG_NAMES, HexapodError, Robot
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.kinematics import rotation_matrix
from hexapod_cosim.models.records import JointNames

COMMAND_WORDS = ("command", "desired", "reference")  # in the name of a topic
UNIX_TIME = 10**15  # ns    later stamps are Unix times, which count from the first row
FIELDS = ("position", "velocity", "effort")
UNREADABLE = (ValueError, KeyError, IndexError, EOFError, struct.error)  # of damaged records
MEASURED, COMMANDED = ("angle", "speed", "torque"), ("angle_ref", "speed_ref", "torque_ref")
Places = Mapping[str, tuple[int, float]]  # of joints by their plain names, and signs


@dataclass
class Series:
    """Readings of several columns at their own times."""

    times: list[int] = field(default_factory=list)  # ns
    rows: list[list[float]] = field(default_factory=list)


def read_mcap(path: Path, *, robot: Robot | None = None) -> Recording:
    """Reads our recording, or the ROS 2 topics of a robot, whose joints have its names or ours.

    Raises HexapodError for a missing or damaged file, and for one without joint states.
    """
    require_mcap(path)
    from mcap.exceptions import McapError  # noqa: PLC0415  an extra
    from mcap.reader import make_reader  # noqa: PLC0415

    try:
        with path.open("rb") as file:
            reader = make_reader(file)
            found = _own_recording(reader)
        return read_topics(path, robot=robot) if found is None else found
    except HexapodError:
        raise
    except FileNotFoundError as error:
        fix = "correct the path, or record one with `hexapod simulate --format mcap`"
        raise HexapodError("no such recording", got=str(path), fix=fix) from error
    except (OSError, McapError, *UNREADABLE) as error:
        raise HexapodError(
            "not an MCAP file of a robot",
            got=why_unreadable(error, "undamaged MCAP file"),
            expected="an MCAP file with ROS 2 messages in CDR",
            fix="record it again, or convert it with `mcap recover`",
            where=str(path),
        ) from error


def _own_recording(reader: Any) -> Recording | None:
    """Returns the recording of a file that we wrote; None for other files."""
    names: tuple[str, ...] = ()
    for metadata in reader.iter_metadata():
        if metadata.name == ABOUT:
            names = tuple(json.loads(metadata.metadata[COLUMNS]))
    if not names:
        return None
    # the fields are doubles alone: behind the 4 bytes of CDR's header they are one array
    rows = [
        np.frombuffer(message.data, "<f8", offset=4)
        for _, _, message in reader.iter_messages(topics=[ros.ROW_TOPIC])
    ]
    if any(len(row) != len(names) for row in rows):
        raise ValueError("rows of another length than the list of columns")
    return Recording(names, np.array(rows, float).reshape(-1, len(names)))


def read_topics(path: Path, *, robot: Robot | None = None) -> Recording:
    """Reads the ROS 2 topics of a file, ours or a robot's; arguments are those of read_mcap()."""
    from mcap.reader import make_reader  # noqa: PLC0415  an extra
    from mcap_ros2.decoder import DecoderFactory  # noqa: PLC0415

    series: dict[tuple[str, ...], Series] = {}
    com = np.array(robot.torso.com) if robot else np.zeros(3)
    joints = robot.joints if robot else OURS
    places = _places(joints)
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        known = [channel.topic for channel in _known_channels(reader)]
        if known:
            for schema, channel, message, decoded in reader.iter_decoded_messages(topics=known):
                kind = "" if schema is None else schema.name
                for names, stamp, values in _readings(kind, channel.topic, decoded, com, places):
                    one = series.setdefault(names, Series())
                    one.times.append(stamp or message.log_time)
                    one.rows.append(values)
    return _joined(series, path, joints.names[0])


def _places(joints: JointNames) -> Places:
    """Returns where a plain name stands: our names, and above them those of the robot."""
    return {
        _plain(name): (k, float(sign))
        for one in (OURS, joints)
        for k, (name, sign) in enumerate(zip(one.names, one.signs, strict=True))
    }


def _plain(name: str) -> str:
    """Returns a joint's name in small letters and without "_joint"."""
    return name.lower().removesuffix("_joint")


def _known_channels(reader: Any) -> list[Any]:
    """Returns the channels whose messages can be read here."""
    summary = reader.get_summary()
    if summary is None:
        raise ValueError("a file without a summary, which was not closed")
    return [
        channel
        for channel in summary.channels.values()
        if summary.schemas[channel.schema_id].name in ros.DEFINITIONS
    ]


Reading = tuple[tuple[str, ...], int, list[float]]  # names of columns, time [ns], values


def _readings(kind: str, topic: str, message: Any, com: Array, places: Places) -> Iterable[Reading]:
    """Returns what a message contains; nothing where its joints or frames are not the robot's."""
    if kind == ros.JOINT_STATE:
        return _joint_readings(topic, message, places)
    if kind == ros.WRENCH:
        return _foot_readings(topic, message)
    if kind == ros.IMU:
        return _imu_readings(message)
    return _pose_readings(message, com)


def _stamp(header: Any) -> int:
    """Returns the time of a header [ns]; 0 where the sender left it out."""
    return int(header.stamp.sec * NANO + header.stamp.nanosec)


def _joint_readings(topic: str, message: Any, known: Places) -> list[Reading]:
    commanded = any(word in topic.lower() for word in COMMAND_WORDS)
    places = [known.get(_plain(name)) for name in message.name]
    found = []
    for quantity, key in zip(COMMANDED if commanded else MEASURED, FIELDS, strict=True):
        values, names = getattr(message, key), joint_names(quantity)
        pairs = [
            (names[place[0]], place[1] * float(value))
            for place, value in zip(places, values, strict=False)
            if place is not None
        ]
        if pairs:
            columns, numbers = zip(*pairs, strict=True)
            found.append((columns, _stamp(message.header), list(numbers)))
    return found


def _leg_of(*texts: str) -> str | None:
    """Returns the leg that a topic or frame names as a word of its own: /LF/foot, lf_foot."""
    for text in texts:
        words = text.upper().replace("/", "_").split("_")
        for leg in LEG_NAMES:
            if leg in words:
                return leg
    return None


def _foot_readings(topic: str, message: Any) -> list[Reading]:
    """Returns a foot's force. One in a frame of the robot has no known direction in the world."""
    leg, force = _leg_of(topic, message.header.frame_id), message.wrench.force
    if leg is None or message.header.frame_id not in ros.WORLD_FRAMES:
        return []
    names = tuple(vector_names(f"{leg}.foot.force"))
    return [(names, _stamp(message.header), [force.x, force.y, force.z])]


def _imu_readings(message: Any) -> list[Reading]:
    at, rate, force = _stamp(message.header), message.angular_velocity, message.linear_acceleration
    found = []
    for stem, value, covariance in (
        ("imu.angular_velocity", rate, message.angular_velocity_covariance),
        ("imu.specific_force", force, message.linear_acceleration_covariance),
    ):
        if covariance[0] != -1.0:  # -1: no estimate, by the definition of sensor_msgs/Imu
            found.append((tuple(vector_names(stem)), at, [value.x, value.y, value.z]))
    if message.orientation_covariance[0] != -1.0:
        turn = message.orientation
        names = tuple(vector_names("imu.quaternion", 4))
        found.append((names, at, [turn.w, turn.x, turn.y, turn.z]))
    return found


def _pose_readings(message: Any, com: Array) -> list[Reading]:
    """Returns the pose of the torso's centre of mass."""
    names = (*vector_names("torso.position"), *vector_names("torso.quaternion", 4))
    found: list[Reading] = []
    for one in message.transforms:
        if one.child_frame_id in ros.TORSO_FRAMES and one.header.frame_id in ros.WORLD_FRAMES:
            place, turn = one.transform.translation, one.transform.rotation
            q_WT = np.array([turn.w, turn.x, turn.y, turn.z])
            position = np.array([place.x, place.y, place.z])
            if com.any():
                position = position + rotation_matrix(q_WT) @ com
            found.append((names, _stamp(one.header), [*position.tolist(), *q_WT.tolist()]))
    return found


def _joined(series: Mapping[tuple[str, ...], Series], path: Path, joint: str) -> Recording:
    """Returns one row for each measured joint state from the first command on."""
    base = next((one for names, one in series.items() if names[0].endswith(".angle")), None)
    if base is None:
        raise HexapodError(
            "no joint states of this robot",
            got=f"columns of {len(series)} topics",
            expected=f"sensor_msgs/JointState with joints {joint}, ...",
            fix="name the joints in the robot file: [joints] names",
            where=str(path),
        )
    # differences of integers: a Unix time in seconds as a double is exact to 0.2 us only
    first = base.times[0] if base.times[0] > UNIX_TIME else 0
    time = _seconds(base.times, first)
    names, blocks = ["time"], [time[:, None]]
    for columns, one in series.items():
        holds = columns[0].endswith("_ref")
        names += columns
        blocks.append(
            _at(time, one, first, holds=holds, turns=columns[-1].endswith("quaternion[4]"))
        )
    data = np.hstack(blocks)
    return Recording(tuple(names), data[np.isfinite(data).all(axis=1)])


def _seconds(times: Sequence[int], first: int) -> Array:
    """Returns times [ns] as seconds since the first one."""
    return np.array([(stamp - first) / NANO for stamp in times])


def _at(time: Array, series: Series, first: int, *, holds: bool, turns: bool) -> Array:
    """Returns readings at other times (rows, columns); NaN before the first one.

    first: the stamp [ns] that is time 0.
    holds: whether each holds until the next. turns: whether the last four are quaternions, whose
    signs are made continuous first.
    """
    times, rows = _seconds(series.times, first), np.array(series.rows)
    order = np.argsort(times, kind="stable")
    times, rows = times[order], rows[order]
    if turns:
        rows = rows.copy()
        signs = np.sign(np.sum(rows[1:, -4:] * rows[:-1, -4:], axis=1))
        rows[1:, -4:] *= np.cumprod(np.where(signs < 0.0, -1.0, 1.0))[:, None]
    if holds:
        places = np.searchsorted(times, time, side="right") - 1
        found = rows[np.maximum(places, 0)].copy()
    else:
        found = np.column_stack([np.interp(time, times, column) for column in rows.T])
    found[time < times[0]] = np.nan
    return found
