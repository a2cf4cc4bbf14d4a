"""MuJoCo reads from the exported MJCF file what the plant's laws say: moments of the feet, joint
stops, shapes of torso, knees and shanks.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
import pytest

from hexapod_cosim.models import Robot, RobotError, Terrain, load_robot
from hexapod_cosim.models.energy import joint_mobility
from hexapod_cosim.models.ground.table import make_surface
from hexapod_cosim.models.mjcf import robot_to_mjcf

STIFFNESS, DAMPING = 344.0, 2.0  # N m/rad, N m s/rad
# 1  the impedance of a stop: the share of its torque that depends on the joint's acceleration
STOP = 0.01


def changed(**friction: Any) -> Robot:
    """Returns the athena with other friction."""
    robot = load_robot("athena")
    return replace(robot, friction=replace(robot.friction, **friction))


def with_stops() -> Robot:
    """Returns the athena with joint stops and without gears' friction."""
    robot = load_robot("athena")
    stops: dict[str, Any] = {
        "stop_stiffness": STIFFNESS,
        "stop_damping": DAMPING,
        "coulomb_friction": 0.0,
    }
    return replace(robot, servo=replace(robot.servo, **stops))


def contacts(robot: Robot, height: float, quaternion: tuple[float, ...] = (1, 0, 0, 0)) -> Any:
    """Returns model and data of the robot in its stance with its torso at a height [m]."""
    model = mujoco.MjModel.from_xml_string(robot_to_mjcf(robot))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("stance").id)
    data.qpos[2], data.qpos[3:7] = height, quaternion
    mujoco.mj_forward(model, data)
    return model, data


@pytest.mark.parametrize(
    ("spin", "rolling", "dimensions", "friction"),
    [
        (0.0, 0.0, 3, (0.7, 0.7, 1e-5, 1e-5, 1e-5)),  # MuJoCo's least coefficient is 1e-5
        (0.004, 0.0, 4, (0.7, 0.7, 0.0028, 1e-5, 1e-5)),
        (0.004, 0.001, 6, (0.7, 0.7, 0.0028, 0.001, 0.001)),
    ],
)
def test_the_feet_have_the_moments_against_spin_and_rolling(
    spin: float, rolling: float, dimensions: int, friction: tuple[float, ...]
) -> None:
    robot = changed(mu=0.7, spin_radius=spin, rolling_radius=rolling)
    _, data = contacts(robot, 0.13)
    assert data.ncon == 6
    for contact in data.contact:
        assert contact.dim == dimensions
        assert tuple(contact.friction) == pytest.approx(friction, rel=1e-12)


def test_joint_stops_are_the_spring_and_damper_of_the_plant() -> None:
    robot = with_stops()
    model = mujoco.MjModel.from_xml_string(robot_to_mjcf(robot))
    data = mujoco.MjData(model)
    for joint, limit in enumerate(robot.angle_max.ravel()):
        data.qpos[:] = np.concatenate([[0, 0, 2, 1, 0, 0, 0], robot.stance.ravel()])
        data.qvel[:] = 0.0
        data.qpos[7 + joint], data.qvel[6 + joint] = limit + 0.01, 0.5
        mujoco.mj_forward(model, data)
        # eq. 39
        expected = -(STIFFNESS * 0.01 + DAMPING * 0.5)
        acceleration = data.qacc[6 + joint] / joint_mobility(robot).ravel()[joint]
        virtual = -0.001 / 0.999 * acceleration  # of the constraint's regularisation
        assert data.qfrc_constraint[6 + joint] == pytest.approx(expected + virtual, rel=1e-6)
        assert data.qfrc_constraint[6 + joint] == pytest.approx(expected, rel=STOP)


def test_a_robot_on_a_surface_is_refused() -> None:
    stairs = Terrain(kind="grid", surface=make_surface("stairs", {}))
    with pytest.raises(RobotError, match="got 'stairs', expected flat or slope"):
        robot_to_mjcf(replace(load_robot("athena"), terrain=stairs))


def test_shapes_of_torso_knees_and_shanks_are_those_of_the_robot_file() -> None:
    robot = load_robot("athena")
    model = mujoco.MjModel.from_xml_string(robot_to_mjcf(robot))
    torso = model.geom("torso_contact")
    assert tuple(torso.size) == pytest.approx((0.18, 0.10, 0.04), abs=1e-15)
    for leg in ("LF", "LM", "LR", "RF", "RM", "RR"):
        for part, place in (("knee", 0.0), ("shank", 0.08)):
            geom = model.geom(f"{leg}_{part}")
            assert geom.size[0] == 0.0105
            assert tuple(geom.pos) == pytest.approx((place, 0.0, 0.0), abs=1e-15)
            assert model.body(int(geom.bodyid[0])).name == f"{leg}_tibia"
