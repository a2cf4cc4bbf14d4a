"""Writes a recording as an MCAP file with ROS 2 messages, which Foxglove and Rerun read.

Each row becomes a joint state, a joint command, six foot forces, an IMU reading and a transform, as
far as the recording has their columns, and one message with all columns, whose numbers read back
bit for bit. The time of a message is the row's, counted from 1970.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hexapod_cosim.cosim.common.files import atomic_path
from hexapod_cosim.cosim.interface.names import joint_names, vector_names
from hexapod_cosim.cosim.logs import messages as ros
from hexapod_cosim.cosim.logs.messages import require_mcap
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.models import HexapodError
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.kinematics import rotation_matrix
from hexapod_cosim.models.records import JointNames

Message = dict[str, Any]
Source = tuple[str, str, Callable[[int, Message], Message]]  # topic, type, message of a row
NANO = 1_000_000_000
LAST_STAMP = 2**31  # s    ROS 2 stores seconds as int32
UNKNOWN_COVARIANCE = [0.0] * 9  # by the definition of sensor_msgs/Imu
NO_ESTIMATE = [-1.0, *[0.0] * 8]
OURS = JointNames()
ABOUT, COLUMNS = "hexapod", "columns"  # metadata: the run's facts and the names of all columns


def write_mcap(
    recording: Recording,
    path: Path,
    *,
    about: Mapping[str, str] | None = None,
    torso_com: Sequence[float] = (0.0, 0.0, 0.0),
    joints: JointNames = OURS,
) -> None:
    """Writes the messages of all rows. A failed write leaves no partial file.

    Args:
        recording: rows with times from 0 [s] on.
        path: the file to write.
        about: texts for the file's metadata.
        torso_com: centre of mass in the torso's frame [m]; transforms are those of the frame's
            origin.
        joints: their names and signs for the owner of the robot.

    Raises HexapodError without the extra `logs` and for times that ROS 2 cannot express.
    """
    require_mcap(path)
    from mcap_ros2.writer import Writer  # noqa: PLC0415  an extra

    stamps = _stamps(recording.time, path)
    sources = list(_sources(recording, np.asarray(torso_com, float), joints))
    definitions = {**ros.DEFINITIONS, ros.ROW: ros.row_definition(recording.names)}
    with atomic_path(path) as temporary, temporary.open("wb") as file, Writer(file) as writer:
        facts = {**(about or {}), COLUMNS: json.dumps(recording.names)}
        writer.add_metadata(ABOUT, facts)
        schemas = {
            kind: writer.register_msgdef(kind, definitions[kind])
            for kind in dict.fromkeys(kind for _, kind, _ in sources)
        }
        for row, stamp in enumerate(stamps):
            header = {"sec": stamp // NANO, "nanosec": stamp % NANO}
            for topic, kind, message in sources:
                writer.write_message(
                    topic, schemas[kind], message(row, header), log_time=stamp, sequence=row
                )


def check_start(start: float, where: str | Path) -> None:
    """Raises HexapodError when ROS 2 cannot express a time [s]."""
    if not 0.0 <= start < LAST_STAMP:
        raise HexapodError(
            "a time that ROS 2 cannot express",
            got=f"{start:g} s",
            expected="0 s or later",
            fix="start the run at 0 or write Parquet",
            where=str(where),
        )


def _stamps(time: Array, path: Path) -> list[int]:
    """Returns the times [ns]. Raises HexapodError for one outside ROS 2's range."""
    if len(time):
        check_start(float(time.min()), path)
    return [round(float(t) * NANO) for t in time]


def _sources(recording: Recording, com: Array, joints: JointNames) -> Iterator[Source]:
    """Yields the topics for which the recording has columns."""
    have = set(recording.names)
    for topic, quantities in (
        (ros.JOINT_TOPIC, ("angle", "speed", "torque")),
        (ros.COMMAND_TOPIC, ("angle_ref", "speed_ref", "torque_ref")),
    ):
        known = [set(joint_names(quantity)) <= have for quantity in quantities]
        if any(known):
            yield _joints(recording, topic, quantities, known, joints)
    for leg, topic in ros.FOOT_TOPICS.items():
        if set(vector_names(f"{leg}.foot.force")) <= have:
            yield _foot(recording, leg, topic)
    yield from _imu(recording, have)
    yield from _transform(recording, have, com)
    yield ros.ROW_TOPIC, ros.ROW, _row_message(recording)


def _header(stamp: Message, frame: str) -> Message:
    return {"stamp": stamp, "frame_id": frame}


def _xyz(values: Array) -> Message:
    return dict(zip("xyz", values.tolist(), strict=True))


def _rotation(quaternion: Array) -> Message:
    """Returns the message of a quaternion [w x y z]."""
    return dict(zip("wxyz", quaternion.tolist(), strict=True))


def _joints(
    recording: Recording,
    topic: str,
    quantities: Sequence[str],
    known: Sequence[bool],
    joints: JointNames,
) -> Source:
    """Returns the source of joint states with the quantities that are known."""
    rows = len(recording.time)
    tables = [
        joints.signs * recording.columns(joint_names(quantity)) if has else np.empty((rows, 0))
        for quantity, has in zip(quantities, known, strict=True)
    ]
    fields = ("position", "velocity", "effort")

    def message(row: int, stamp: Message) -> Message:
        values = {key: table[row].tolist() for key, table in zip(fields, tables, strict=True)}
        return {"header": _header(stamp, ""), "name": joints.names, **values}

    return topic, ros.JOINT_STATE, message


def _foot(recording: Recording, leg: str, topic: str) -> Source:
    """Returns the source of the force of the ground on a foot, world axes."""
    force, none = recording.vector(f"{leg}.foot.force"), np.zeros(3)

    def message(row: int, stamp: Message) -> Message:
        wrench = {"force": _xyz(force[row]), "torque": _xyz(none)}
        return {"header": _header(stamp, ros.WORLD), "wrench": wrench}

    return topic, ros.WRENCH, message


def _imu(recording: Recording, have: set[str]) -> Iterator[Source]:
    """Yields the source of the IMU, torso axes; the attitude is left out where it is unknown."""
    rate, force = "imu.angular_velocity", "imu.specific_force"
    if not set(vector_names(rate)) | set(vector_names(force)) <= have:
        return
    rates, forces = recording.vector(rate), recording.vector(force)
    known = set(vector_names("torso.quaternion", 4)) <= have
    unit = np.tile([1.0, 0.0, 0.0, 0.0], (len(rates), 1))
    turns = recording.vector("torso.quaternion", 4) if known else unit

    def message(row: int, stamp: Message) -> Message:
        return {
            "header": _header(stamp, ros.TORSO),
            "orientation": _rotation(turns[row]),
            "orientation_covariance": UNKNOWN_COVARIANCE if known else NO_ESTIMATE,
            "angular_velocity": _xyz(rates[row]),
            "angular_velocity_covariance": UNKNOWN_COVARIANCE,
            "linear_acceleration": _xyz(forces[row]),
            "linear_acceleration_covariance": UNKNOWN_COVARIANCE,
        }

    yield ros.IMU_TOPIC, ros.IMU, message


def _transform(recording: Recording, have: set[str], com: Array) -> Iterator[Source]:
    """Yields the source of the torso's pose: its frame's origin in the world."""
    place, turn = vector_names("torso.position"), vector_names("torso.quaternion", 4)
    if not {*place, *turn} <= have:
        return
    positions, turns = _torso_places(recording, com), recording.columns(turn)

    def message(row: int, stamp: Message) -> Message:
        transform = {"translation": _xyz(positions[row]), "rotation": _rotation(turns[row])}
        one = {
            "header": _header(stamp, ros.WORLD),
            "child_frame_id": ros.TORSO,
            "transform": transform,
        }
        return {"transforms": [one]}

    yield ros.TRANSFORM_TOPIC, ros.TRANSFORMS, message


def _row_message(recording: Recording) -> Callable[[int, Message], Message]:
    """Returns the function that makes the message with all columns of a row."""
    fields = ros.field_names(recording.names)
    return lambda row, _stamp: dict(zip(fields, recording.data[row].tolist(), strict=True))


def _torso_places(recording: Recording, com: Array) -> Array:
    """Returns the positions (rows, 3) of the origin of the torso's frame in the world [m].

    com: centre of mass in that frame (3,) [m].
    """
    positions = recording.columns(vector_names("torso.position"))
    if not com.any():
        return positions
    turns = recording.columns(vector_names("torso.quaternion", 4))
    return np.asarray(positions - np.array([rotation_matrix(q_WT) @ com for q_WT in turns]))
