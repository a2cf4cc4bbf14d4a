"""Definitions of the ROS 2 messages in MCAP files, and names of topics, joints and frames.

The messages are std_msgs/Header, sensor_msgs/JointState, sensor_msgs/Imu,
geometry_msgs/WrenchStamped and tf2_msgs/TFMessage of ROS 2 (docs.ros.org). An MCAP file contains
the definition of each message type, so that a reader needs no ROS installation.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from hexapod_cosim.cosim.common.installation import require_packages
from hexapod_cosim.models import LEG_NAMES

JOINT_STATE = "sensor_msgs/msg/JointState"
WRENCH = "geometry_msgs/msg/WrenchStamped"
IMU = "sensor_msgs/msg/Imu"
TRANSFORMS = "tf2_msgs/msg/TFMessage"
ROW = "hexapod_msgs/msg/Row"  # all columns of a recording, one field each

JOINT_TOPIC, COMMAND_TOPIC = "/joint_states", "/joint_commands"
IMU_TOPIC, TRANSFORM_TOPIC, ROW_TOPIC = "/imu", "/tf", "/hexapod/recording"
WORLD, TORSO = "world", "torso"  # frames
WORLD_FRAMES = (WORLD, "odom", "map")  # names of frames at rest, in files of others
TORSO_FRAMES = (TORSO, "base_link", "base")
FOOT_TOPICS = {leg: f"/{leg}/foot_force" for leg in LEG_NAMES}

_SEPARATOR = "=" * 80
_PARTS = {
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec\n",
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id\n",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n",
    "geometry_msgs/Wrench": "geometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque\n",
    "geometry_msgs/Transform": (
        "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n"
    ),
    "geometry_msgs/TransformStamped": (
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n"
    ),
}
_HEADER = ("std_msgs/Header", "builtin_interfaces/Time")


def _definition(text: str, *parts: str) -> str:
    """Returns a message's definition, followed by those of the types that it contains."""
    used = (f"{_SEPARATOR}\nMSG: {name}\n{_PARTS[name]}" for name in parts)
    return text + "".join(used)


DEFINITIONS = {
    JOINT_STATE: _definition(
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\n"
        "float64[] effort\n",
        *_HEADER,
    ),
    WRENCH: _definition(
        "std_msgs/Header header\ngeometry_msgs/Wrench wrench\n",
        *_HEADER,
        "geometry_msgs/Wrench",
        "geometry_msgs/Vector3",
    ),
    IMU: _definition(
        "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\n"
        "float64[9] orientation_covariance\ngeometry_msgs/Vector3 angular_velocity\n"
        "float64[9] angular_velocity_covariance\ngeometry_msgs/Vector3 linear_acceleration\n"
        "float64[9] linear_acceleration_covariance\n",
        *_HEADER,
        "geometry_msgs/Quaternion",
        "geometry_msgs/Vector3",
    ),
    TRANSFORMS: _definition(
        "geometry_msgs/TransformStamped[] transforms\n",
        "geometry_msgs/TransformStamped",
        *_HEADER,
        "geometry_msgs/Transform",
        "geometry_msgs/Vector3",
        "geometry_msgs/Quaternion",
    ),
}


def field_names(columns: Sequence[str]) -> list[str]:
    """Returns a ROS field name for each column: lower-case letters, digits and underscores.

    "LF.foot.force[1]" becomes "lf_foot_force_1". A name that an earlier column has gets a number.
    """
    found: dict[str, int] = {}
    names = []
    for column in columns:
        plain = "".join(c if c.isascii() and c.isalnum() else "_" for c in column.lower())
        name = "_".join(part for part in plain.split("_") if part)
        name = name if name[:1].isalpha() else f"column_{name}"
        found[name] = found.get(name, 0) + 1
        names.append(name if found[name] == 1 else f"{name}_n{found[name]}")
    return names


def row_definition(columns: Sequence[str]) -> str:
    """Returns the definition of the message that has one float64 field for each column."""
    return "".join(f"float64 {name}\n" for name in field_names(columns))


EXTRA, PACKAGES = "logs", ("mcap", "mcap_ros2")


def require_mcap(where: str | Path) -> None:
    """Raises HexapodError, which names the extra, unless MCAP files can be written and read."""
    require_packages(PACKAGES, "MCAP", extra=EXTRA, where=where)
