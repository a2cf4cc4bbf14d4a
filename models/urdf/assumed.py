"""Completes the tables of a URDF: defaults for data that it lacks, scaled from the ATHENA-like
robot, and one number for all joints or feet.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.errors import RobotError
from hexapod_cosim.models.kinematics import axis_rotation
from hexapod_cosim.models.records import JOINT_NAMES
from hexapod_cosim.models.urdf.elements import Urdf
from hexapod_cosim.models.urdf.legs import FoundLeg

Table = dict[str, Any]

# keys of the servo, and of a joint in the URDF
SIZES = {"torque_max": "effort", "speed_max": "velocity", "coulomb_friction": "friction"}
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


def complete(table: Table, legs: list[FoundLeg], urdf: Urdf) -> list[str]:
    """Fills in missing values, in place; returns the names of assumed ones."""
    _unify(table, legs, urdf)
    assumed = ["foot.radius"] if any(leg.radius is None for leg in legs) else []
    assumed += [f"servo.{key}" for key in assume_servo(table["servo"])]
    stances = assume_stances(table["legs"])
    assumed += ["stance"] if stances else []
    return assumed + [f"gait.{key}" for key in assume_gait(table["gait"], _height(table))]


def add_damping(table: Table, legs: list[FoundLeg], assumed: list[str]) -> Table:
    """Adds the mean damping of the joints to an assumed kd, in place; returns the note about it."""
    damping = float(np.mean([branch.joint.damping for leg in legs for branch in leg.servo]))
    if damping == 0.0:
        return {}
    if "servo.kd" in assumed:
        table["servo"]["kd"] += damping
    done = "added to" if "servo.kd" in assumed else "without effect beside the given"
    return {"URDF, damping": f"{damping:.6g} N m s/rad of the joints, {done} servo.kd"}


def _unify(table: Table, legs: list[FoundLeg], urdf: Urdf) -> None:
    """Replaces lists of one number per joint or foot by a single number, in place."""
    joints = [name for leg in legs for name in leg.joints]
    for key, name in SIZES.items():
        _unify_one(table, f"servo.{key}", joints, name, urdf.where)
    _unify_one(table, "foot.radius", [leg.joints[2] for leg in legs], "radius", urdf.where)


def _unify_one(table: Table, key: str, owners: list[str], name: str, where: str) -> None:
    """Replaces a list of equal numbers; side files give one number. Raises RobotError."""
    section, _, last = key.partition(".")
    values = table[section].get(last)
    if not isinstance(values, list):
        return
    odd = next((k for k, value in enumerate(values) if value is None or value != values[0]), 0)
    if values[odd] is None or values[odd] != values[0]:
        raise RobotError(
            f"no {name}" if values[odd] is None else f"another {name}",
            got=values[odd],
            expected=f"{values[0]!r} as at {owners[0]!r}: all joints have the same servo, all feet "
            "the same radius",
            fix=f"give {key} for all in a robot file with [urdf] file",
            where=f"{where}: joint {owners[odd]!r}",
        )
    table[section][last] = values[0]


def _height(table: Table) -> float:
    """Returns the approximate height of the hips above the feet [m]."""
    legs = table["legs"].values()
    return float(np.mean([_drop(leg) for leg in legs]))


def _drop(leg: Table) -> float:
    """Returns how far a foot is below its hip in the standing pose [m]."""
    R_HP, z = np.eye(3), 0.0
    for joint in JOINT_NAMES:
        link = leg[joint]
        R_PL = axis_rotation(np.array(link["axis"]), link["stance"])
        R_HP = R_HL = R_HP @ R_PL  # the link is the next one's parent
        z -= float(R_HL[2] @ [link["length"], link.get("offset_y", 0.0), link.get("offset_z", 0.0)])
    return max(z, 1e-3)


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
