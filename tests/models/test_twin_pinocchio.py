"""Compares the readable equations with an independent engine, Pinocchio's articulated-body
algorithm in joint coordinates.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from states import random_bodies, random_command

from hexapod_cosim.models import LEG_NAMES, Robot, load_robot
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.constraints import constraints
from hexapod_cosim.models.contact.geometry import foot_contacts, foot_force
from hexapod_cosim.models.dynamics import accelerations, joint_torques
from hexapod_cosim.models.energy import kinetic_energy
from hexapod_cosim.models.kinematics import (
    inertia_matrix,
    joint_angles,
    joint_speeds,
    rotation_matrix,
)

# relative to the largest entry: about 1e3 times the rounding of the two algorithms
AGREEMENT = 1e-11
ROBOTS = ("athena", "phantomx_mk4")


def pinocchio_model(robot: Robot) -> Any:
    """Returns the robot as a free-flyer at the torso's centre of mass with 18 revolute joints."""
    model = pin.Model()
    model.gravity.linear = np.array(robot.gravity)
    root = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "torso")
    model.appendBodyToJoint(
        root,
        pin.Inertia(robot.torso.mass, np.zeros(3), inertia_matrix(robot.torso.inertia)),
        pin.SE3.Identity(),
    )
    for leg, name in zip(robot.legs, LEG_NAMES, strict=True):
        parent = root
        placement = pin.SE3(
            pin.utils.rotate("z", leg.hip_yaw), np.subtract(leg.hip_position, robot.torso.com)
        )
        for number, link in enumerate(leg.links):
            parent = model.addJoint(
                parent,
                pin.JointModelRevoluteUnaligned(np.array(link.axis)),
                placement,
                f"{name}{number}",
            )
            model.appendBodyToJoint(
                parent,
                pin.Inertia(link.mass, np.array(link.com), inertia_matrix(link.inertia)),
                pin.SE3.Identity(),
            )
            placement = pin.SE3(np.eye(3), np.array(link.tip))
    model.armature = np.concatenate([np.zeros(6), np.full(18, robot.servo.rotor_inertia)])
    return model


def pinocchio_accelerations(
    robot: Robot, body: Array, torque: Array, foot: Array, push: Array
) -> Array:
    """Returns the accelerations (24,) by the articulated-body algorithm: the torso's linear and
    angular acceleration in world axes and those of the joints.

    torque (6, 3) acts at the joints; foot (6, 2, 3) holds contact points and forces in world axes;
    push (6,) is the force and torque on the torso.
    """
    model = pinocchio_model(robot)
    data = model.createData()
    R, v, w = rotation_matrix(body[0, 3:7]), body[0, 7:10], body[0, 10:13]
    q = np.concatenate(
        [body[0, 0:3], body[0, 4:7], body[0, 3:4], joint_angles(robot, body).ravel()]
    )
    qd = np.concatenate([R.T @ v, R.T @ w, joint_speeds(robot, body).ravel()])
    pin.forwardKinematics(model, data, q, qd)
    external = [pin.Force(np.zeros(6)) for _ in range(model.njoints)]
    external[1] = pin.Force(R.T @ push[0:3], R.T @ push[3:6])
    for leg, (point, force) in enumerate(foot):
        placement = data.oMi[4 + 3 * leg]
        external[4 + 3 * leg] = placement.actInv(pin.Force(force, np.cross(point, force)))
    a = pin.aba(model, data, q, qd, np.concatenate([np.zeros(6), torque.ravel()]), external)
    linear = R @ (a[0:3] + np.cross(qd[3:6], qd[0:3]))
    return np.concatenate([linear, R @ a[3:6], a[6:]])


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("terrain", ["flat", "slope"])
@pytest.mark.parametrize("mode", ["position", "torque"])
def test_forward_dynamics_agree_with_pinocchio(name: str, terrain: str, mode: str) -> None:
    robot = load_robot(name)
    robot = replace(
        robot,
        body=replace(robot.body, contact="off"),  # the other engine has forces on feet alone
        servo=replace(robot.servo, mode=mode),
        terrain=replace(robot.terrain, kind=terrain, height=0.01, incline=0.2, heading=0.6),
    )
    touching = 0
    for seed in range(8):
        body, command, damping = (
            random_bodies(robot, seed),
            random_command(robot, seed),
            np.full(6, 3.0),
        )
        result = accelerations(robot, body, command, damping)
        feet = foot_contacts(robot, body)
        forces = np.array(
            [
                [foot.point, foot_force(robot, foot, d)]
                for foot, d in zip(feet, damping, strict=True)
            ]
        )
        touching += sum(foot.penetration > 0.0 for foot in feet)
        motor, gear = joint_torques(robot, body, command)
        push = np.concatenate([command.push_force, command.push_torque])
        theirs = pinocchio_accelerations(robot, body, motor + gear, forces, push)
        ours = np.concatenate([result.dv[0], constraints(robot, body).G @ result.dv.ravel()])
        assert float(np.max(np.abs(ours - theirs))) <= AGREEMENT * float(np.max(np.abs(theirs)))
    assert touching > 8


def test_kinetic_energy_agrees_with_pinocchio() -> None:
    robot = load_robot("phantomx_mk4")
    body, model = random_bodies(robot, 6), pinocchio_model(load_robot("phantomx_mk4"))
    R = rotation_matrix(body[0, 3:7])
    q = np.concatenate(
        [body[0, 0:3], body[0, 4:7], body[0, 3:4], joint_angles(robot, body).ravel()]
    )
    qd = np.concatenate(
        [R.T @ body[0, 7:10], R.T @ body[0, 10:13], joint_speeds(robot, body).ravel()]
    )
    rotors = 0.5 * robot.servo.rotor_inertia * float(np.sum(qd[6:] ** 2))
    assert kinetic_energy(robot, body) == pytest.approx(
        pin.computeKineticEnergy(model, model.createData(), q, qd) + rotors, rel=AGREEMENT
    )
