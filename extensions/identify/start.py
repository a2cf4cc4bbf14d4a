"""Finds the state in which a log begins, as initial values of the FMU.

A log should begin with the robot standing still: all rows before the first change of a command are
averaged then. Unknown quantities are those of a robot at rest on level ground. A measured angle far
from its command is not where the robot starts, so that a wrong column (in degrees, turned round) is
found by its comparison with the simulation instead of preventing it.
"""

from __future__ import annotations

import numpy as np

from hexapod_cosim.cosim.interface.names import LEGS, joint_names, vector_names
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.extensions.identify.log import ATTITUDE, Log
from hexapod_cosim.models import Robot
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.kinematics import axis_quaternion, foot_positions, quaternion_product
from hexapod_cosim.models.kinematics import rotation_matrix as rotation

LONGEST_REST = 0.5  # s    of rest that is averaged
FARTHEST = 0.5  # rad    of a joint from its command; a servo under load sags by some 0.1 rad
RATES = {  # quantity of the log: initial value of the FMU
    "torso.velocity": "initial.velocity",
    "torso.angular_velocity": "initial.angular_velocity",
}


def rest_rows(log: Log) -> int:
    """Returns the number of rows from the first one on that have its commands."""
    table = np.column_stack(list(log.commands.values()))
    moved = np.flatnonzero((table != table[0]).any(axis=1))
    end = int(moved[0]) if moved.size else len(table)
    return max(1, min(end, int(np.searchsorted(log.time, log.time[0] + LONGEST_REST))))


def initial_state(log: Log, robot: Robot) -> dict[str, float]:
    """Returns the initial values of the FMU's parameters for the first row of a log."""
    rest = rest_rows(log)
    rows = log.recording.rows(slice(0, rest))

    def mean(name: str) -> float:
        return _mean(rows.column(name))

    def rate(name: str) -> float:
        return float(np.nan_to_num(mean(name)))

    found: dict[str, float] = {}
    angle = np.zeros((6, 3))
    commanded = joint_names("angle_ref")
    for k, name in enumerate(joint_names("angle")):
        wanted = mean(commanded[k])
        measured = mean(name) if log.has([name]) else wanted
        near = abs(measured - wanted) <= FARTHEST
        angle.flat[k] = measured if near else wanted
        found[f"initial.{name}"] = float(angle.flat[k])
    for name in joint_names("speed"):
        found[f"initial.{name}"] = rate(name) if rest == 1 and log.has([name]) else 0.0
    q_WT = _attitude(rows, robot, angle)
    found |= dict(zip(vector_names("initial.quaternion", 4), q_WT.tolist(), strict=True))
    place = vector_names("torso.position")
    position = _resting(robot, angle, q_WT)
    if log.has(place):
        position = [mean(name) for name in place]
    found |= dict(zip(vector_names("initial.position"), position, strict=True))
    for stem, target in RATES.items():
        names = vector_names(stem)
        known = rest == 1 and log.has(names)
        values = [rate(name) if known else 0.0 for name in names]
        found |= dict(zip(vector_names(target), values, strict=True))
    return found


def _mean(values: Array) -> float:
    """Returns the mean of the numbers of a column; NaN where it has none."""
    known = values[np.isfinite(values)]
    return float(np.mean(known)) if len(known) else float("nan")


def _attitude(rows: Recording, robot: Robot, angle: Array) -> Array:
    """Returns the mean attitude (4,) in the rows at rest.

    On flat ground it is that of the standing feet where the log lacks it.
    """
    roll, pitch, yaw = 0.0, 0.0, 0.0
    if set(ATTITUDE) <= set(rows.names):
        roll, pitch, yaw = (_mean(rows.column(name)) for name in ATTITUDE)
    elif robot.terrain.kind == "flat":
        roll, pitch = standing_attitude(robot, angle)
    q_WV = axis_quaternion(np.array([0.0, 0.0, 1.0]), yaw)
    q_VU = axis_quaternion(np.array([0.0, 1.0, 0.0]), pitch)
    q_UT = axis_quaternion(np.array([1.0, 0.0, 0.0]), roll)
    return quaternion_product(quaternion_product(q_WV, q_VU), q_UT)


def standing_attitude(robot: Robot, angle: Array) -> tuple[float, float]:
    """Returns roll and pitch [rad] of a robot whose feet stand on level ground.

    angle: of the joints (6, 3) [rad]. The ground is the plane nearest to the feet.
    """
    feet = foot_positions(robot, angle)
    offset = feet - feet.mean(axis=0)
    slopes, *_ = np.linalg.lstsq(offset[:, :2], offset[:, 2], rcond=None)
    up = np.array([-slopes[0], -slopes[1], 1.0]) / np.sqrt(1.0 + float(slopes @ slopes))
    return float(np.arctan2(up[1], up[2])), -float(np.arcsin(up[0]))


def _resting(robot: Robot, angle: Array, q_WT: Array) -> list[float]:
    """Returns the torso's position above the origin at which the lowest foot carries its share.

    The share is a sixth of the weight, under which the foot sinks in by (share/K)^(2/3) (eq. 14).
    """
    from_origin = foot_positions(robot, angle) - np.array(robot.torso.com)
    lowest = float((from_origin @ rotation(q_WT).T)[:, 2].min())
    depth = (robot.weight / LEGS / robot.contact.stiffness) ** (2.0 / 3.0)
    return [0.0, 0.0, robot.terrain.height + robot.foot.radius - depth - lowest]
