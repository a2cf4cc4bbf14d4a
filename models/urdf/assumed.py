"""Computes defaults for data that a URDF lacks, scaled from the ATHENA-like robot."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.records import JOINT_NAMES

Table = dict[str, Any]

TORQUE_ANGLE = 0.15  # rad    error at which the servo gives all it has: kp
DAMPING_TIME = 0.02  # s    kd / kp
ROTOR_TIME = math.sqrt(0.01 / 40.0)  # s    sqrt(rotor inertia / kp)
CONTINUOUS = 0.2  # 1    of the stall torque
FEMUR_RISE, TIBIA_RISE = (
    0.386,
    -1.399,
)  # rad    directions of both above the horizontal when standing
STRIDE, STEP_HEIGHT = 2.0 / 3.0, 1.0 / 3.0  # 1    of the height of the hips above the feet
# s, m    of the ATHENA-like robot; robots of other heights walk at the same Froude number
GAIT_PERIOD, HIP_HEIGHT = 1.0, 0.12


def assume_servo(servo: Table) -> list[str]:
    """Fills in the servo data that follow from the stall torque; returns the names of assumed
    values.
    """
    if not isinstance(servo.get("torque_max"), float):
        return []
    kp = servo.get("kp", servo["torque_max"] / TORQUE_ANGLE)
    if not isinstance(kp, int | float):
        return []  # the reader refuses it
    scaled = {
        "kp": kp,
        "kd": DAMPING_TIME * kp,
        "rotor_inertia": ROTOR_TIME**2 * kp,
        "torque_continuous": CONTINUOUS * servo["torque_max"],
    }
    return _fill(servo, scaled)


def assume_gait(gait: Table, height: float) -> list[str]:
    """Fills in stride and period for hips at a height [m] above the feet."""
    taller = height / HIP_HEIGHT if height > 0.0 else 1.0  # what has no height is refused later
    scaled = {"stride": STRIDE * height, "step_height": STEP_HEIGHT * height}
    return _fill(gait, {"period": GAIT_PERIOD * math.sqrt(taller), **scaled})


def _fill(table: Table, values: Mapping[str, float]) -> list[str]:
    missing = [key for key in values if key not in table]
    table.update({key: values[key] for key in missing})
    return missing


def equivalent_box(mass: float, inertia: list[float]) -> list[float]:
    """Returns the edges [m] of the homogeneous box with these moments about its centre."""
    xx, yy, zz = inertia[:3]
    return [
        math.sqrt(max(6.0 * square / mass, 1e-8))
        for square in (yy + zz - xx, xx + zz - yy, xx + yy - zz)
    ]


def assume_stances(legs: Mapping[str, Table]) -> list[str]:
    """Fills in the joint angles of legs without a stance; returns those legs' names.

    The femur points slightly up and the tibia steeply down; all feet have one height.
    """
    missing = [
        name
        for name, leg in legs.items()
        if any("stance" not in leg[joint] for joint in JOINT_NAMES)
    ]
    planes = {name: _Plane(legs[name]) for name in missing}
    height = (
        float(np.mean([plane.foot_height(FEMUR_RISE) for plane in planes.values()]))
        if planes
        else 0.0
    )
    for name, plane in planes.items():
        for joint, angle in zip(JOINT_NAMES, plane.stance(height), strict=True):
            leg = legs[name][joint]
            leg.setdefault("stance", float(np.clip(angle, leg["angle_min"], leg["angle_max"])))
    return missing


class _Plane:
    """A leg of the controller's pattern in its own plane (see controller/walk/kinematics.py)."""

    def __init__(self, leg: Table) -> None:
        tips = [
            complex(leg[joint]["length"], leg[joint].get("offset_z", 0.0)) for joint in JOINT_NAMES
        ]
        self.base = leg["hip_position"][2] + tips[0].imag
        self.size = [abs(tip) for tip in tips[1:]]
        self.tilt = [math.atan2(tip.imag, tip.real) for tip in tips[1:]]

    def foot_height(self, rise: float) -> float:
        """Returns z of the foot [m] in the torso's frame with the femur at `rise`."""
        return float(
            self.base + self.size[0] * math.sin(rise) + self.size[1] * math.sin(TIBIA_RISE)
        )

    def stance(self, height: float) -> Array:
        """Returns the angles (3,) [rad] that put the foot at a height [m]."""
        wanted = (height - self.foot_height(0.0)) / max(self.size[0], 1e-9)
        rise = math.asin(min(max(wanted, -1.0), 1.0))
        femur = rise - self.tilt[0]
        return np.array([0.0, femur, femur + self.tilt[1] - TIBIA_RISE])
