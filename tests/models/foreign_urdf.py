"""Provides a URDF as other authors write them, and the same robot as a robot file."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from hexapod_cosim import models
from hexapod_cosim.models import Robot, robot_from_table

STANCE = (0.0, 0.4, 1.8)  # rad
HIPS = {
    "LF": (0.14, 0.09, 60),
    "LM": (0.0, 0.11, 90),
    "LR": (-0.14, 0.09, 120),
    "RF": (0.14, -0.09, -60),
    "RM": (0.0, -0.11, -90),
    "RR": (-0.14, -0.09, -120),
}
# the legs in the order of their numbers in the URDF
NUMBERS = {"RM": 1, "LR": 2, "LF": 3, "RR": 4, "LM": 5, "RF": 6}

# other names, a base_footprint below, rpy rounded as printed, z axes throughout, the axes of right
# legs reversed, masses in fixed links
LEG = """
  <joint name="j_c{n}" type="revolute">
    <parent link="body"/> <child link="coxa_{n}"/>
    <origin xyz="{x} {y} 0.01" rpy="0 0 {yaw}"/> <axis xyz="0 0 {up}"/>
    <limit lower="{c_low}" upper="{c_high}" effort="5.5" velocity="6.0"/>
    <dynamics damping="0" friction="0.04"/>
  </joint>
  <link name="coxa_{n}">
    <inertial> <origin xyz="0.03 0 0" rpy="0 0 1.5708"/> <mass value="0.15"/>
      <inertia ixx="8e-5" iyy="6e-5" izz="9e-5" ixy="0" ixz="0" iyz="0"/> </inertial>
    <visual> <geometry> <mesh filename="package://spider/coxa.stl"/> </geometry> </visual>
  </link>
  <joint name="j_f{n}" type="revolute">
    <parent link="coxa_{n}"/> <child link="femur_{n}"/>
    <origin xyz="0.05 0 0" rpy="{roll} 0 0"/> <axis xyz="0 0 1"/>
    <limit lower="{f_low}" upper="{f_high}" effort="5.5" velocity="6.0"/>
    <dynamics friction="0.04"/>
  </joint>
  <link name="femur_{n}">
    <inertial> <origin xyz="0.05 0 0"/> <mass value="0.16"/>
      <inertia ixx="5e-5" iyy="1.8e-4" izz="1.7e-4" ixy="0" ixz="0" iyz="0"/> </inertial>
  </link>
  <joint name="j_t{n}" type="revolute">
    <parent link="femur_{n}"/> <child link="tibia_{n}"/>
    <origin xyz="0.09 0 0" rpy="3.14159 0 0"/> <axis xyz="0 0 2"/>
    <limit lower="{t_low}" upper="{t_high}" effort="5.5" velocity="6.0"/>
    <dynamics friction="0.04"/>
  </joint>
  <link name="tibia_{n}">
    <inertial> <origin xyz="0.06 0 0"/> <mass value="0.09"/>
      <inertia ixx="8e-6" iyy="2e-4" izz="2e-4" ixy="0" ixz="0" iyz="0"/> </inertial>
  </link>
  <link name="toe_{n}">
    <inertial> <mass value="0.01"/> <inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/>
    </inertial>
    <collision> <geometry> <sphere radius="0.012"/> </geometry> </collision>
  </link>
  <joint name="toe_joint_{n}" type="fixed">
    <parent link="tibia_{n}"/> <child link="toe_{n}"/> <origin xyz="0.15 0 0"/>
  </joint>
  <transmission name="t_{n}"/>
"""

BODY = """<?xml version="1.0"?>
<!-- a spider as somebody else draws it -->
<robot name="spider">
  <link name="base_footprint"/>
  <joint name="base_joint" type="fixed"> <parent link="base_footprint"/> <child link="body"/>
  <origin xyz="0 0 0.13"/> </joint>
{legs}
  <link name="body">
    <inertial> <mass value="2.0"/>
    <inertia ixx="8e-3" iyy="0.025" izz="0.03" ixy="0" ixz="0" iyz="0"/> </inertial>
    <collision> <geometry> <box size="0.34 0.2 0.07"/> </geometry> </collision>
  </link>
  <link name="battery">
    <inertial> <mass value="0.4"/>
    <inertia ixx="2e-4" iyy="5e-4" izz="6e-4" ixy="0" ixz="0" iyz="0"/> </inertial>
  </link>
  <joint name="battery_joint" type="fixed">
    <parent link="body"/> <child link="battery"/> <origin xyz="-0.06 0 0.03" rpy="0 0 1.57"/>
  </joint>
  <gazebo reference="body"/>
</robot>
"""

SIDE = """
[urdf]
file = "spider.urdf"

[links]
coxa.stance = 0.0
femur.stance = 0.4
tibia.stance = 1.8
"""


def spider_urdf(names: Iterable[str] = NUMBERS) -> str:
    """Returns the URDF with these legs."""
    return BODY.format(legs="".join(_spider_leg(name) for name in names))


def _spider_leg(name: str) -> str:
    """Returns the links and joints of a leg.

    The joints of a left leg turn as those of this project. On the right the coxa and the femur, and
    with it the tibia, turn the other way.
    """
    x, y, yaw = HIPS[name]
    left = name.startswith("L")
    bounds = {
        key: (low, high) if left else (-high, -low)
        for key, low, high in (("c", -0.9, 0.8), ("f", -1.5, 1.4), ("t", -0.7, 2.1))
    }
    limits = {f"{key}_low": pair[0] for key, pair in bounds.items()} | {
        f"{key}_high": pair[1] for key, pair in bounds.items()
    }
    return LEG.format(
        n=NUMBERS[name],
        x=x,
        y=y,
        yaw=repr(math.radians(yaw)),
        up=1 if left else -1,
        roll=1.5708 if left else -1.5708,
        **limits,
    )


def spider() -> Robot:
    return robot_from_table(spider_table(), where="spider.toml")


def spider_table() -> dict[str, Any]:
    """Returns the same robot as the tables of a robot file.

    Masses are combined here by the parallel-axis theorem, written out by hand.
    """
    table = athena_table()
    for name in ("links", "legs", "source"):
        del table[name]
    # the battery is turned by 90 degrees, which exchanges xx and yy; d = (-0.06, 0, 0.03) between
    # the two, reduced mass 2 x 0.4/2.4
    m, dx, dz = 2.0 * 0.4 / 2.4, 0.06, 0.03
    inertia = [
        8e-3 + 5e-4 + m * dz * dz,
        0.025 + 2e-4 + m * (dx * dx + dz * dz),
        0.03 + 6e-4 + m * dx * dx,
        0.0,
        m * dx * dz,
        0.0,
    ]
    table["torso"] = {
        "mass": 2.4,
        "size": [0.34, 0.2, 0.07],
        "com": [-0.01, 0.0, 0.005],
        "inertia": inertia,
    }
    table["links"] = _spider_links()
    table["legs"] = {
        name: {"hip_position": [x, y, 0.01], "hip_yaw": math.radians(yaw)}
        for name, (x, y, yaw) in HIPS.items()
    }
    for joint, low, high in (("coxa", -0.9, 0.8), ("femur", -1.5, 1.4), ("tibia", -0.7, 2.1)):
        table["links"][joint] |= {"angle_min": low, "angle_max": high}
    table["foot"]["radius"] = 0.012
    table["servo"] |= {
        "torque_max": 5.5,
        "speed_max": 6.0,
        "coulomb_friction": 0.04,
        "kp": 5.5 / 0.15,
        "kd": 0.02 * 5.5 / 0.15,
    }
    table["servo"] |= {
        "rotor_inertia": 0.01 / 40.0 * 5.5 / 0.15,
        "torque_continuous": 0.2 * 5.5,
        "motor_constant": math.sqrt(5.5 / 6.0),
    }
    return table | {"name": "spider"}


def _spider_links() -> dict[str, dict[str, Any]]:
    # a toe of 0.01 kg at 0.15 m on a tibia of 0.09 kg whose centre of mass is at 0.06 m
    shift = 0.09 * 0.01 / 0.1 * (0.15 - 0.06) ** 2
    rows = (
        ("coxa", 0.15, 0.05, 0.03, (6e-5, 8e-5, 9e-5), [0.0, 0.0, 1.0]),
        ("femur", 0.16, 0.09, 0.05, (5e-5, 1.7e-4, 1.8e-4), [0.0, -1.0, 0.0]),
        ("tibia", 0.1, 0.15, 0.069, (8e-6, 2e-4 + shift, 2e-4 + shift), [0.0, 1.0, 0.0]),
    )
    return {
        name: {
            "mass": mass,
            "length": length,
            "com": [x, 0.0, 0.0],
            "inertia": [*moments, 0.0, 0.0, 0.0],
            "axis": axis,
            "stance": stance,
        }
        for (name, mass, length, x, moments, axis), stance in zip(rows, STANCE, strict=True)
    }


def athena_table() -> dict[str, Any]:
    return tomllib.loads((Path(models.__file__).parent / "athena.toml").read_text(encoding="utf-8"))
