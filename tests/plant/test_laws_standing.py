"""Tests standing, creeping, sliding and marching with the whole plant: balances of forces, friction
cone, energy balance.
"""

from __future__ import annotations

import ctypes as ct
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from plant import Plant
from states import changed, landing, random_command

from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.contact.geometry import foot_contacts
from hexapod_cosim.models.dynamics import Command
from hexapod_cosim.models.energy import centre_of_mass
from hexapod_cosim.models.kinematics import body_states, rotation_matrix
from hexapod_cosim.models.statics import standing

AT_REST = 1e-9  # relative, m, m/s and m/s2: the forces of the settled pose balance to 1e-9 N
CREEP = 1e-9  # relative, of the creep speed: the block settles within milliseconds
# relative, of the acceleration: in proportion to the tolerance, of which 1e-8 leaves 1e-6
SLIDE = 1e-5
WALK = 1e-3  # of the work of motors and push at the default tolerance of 1e-5 a step
DRIFT = (
    2e-6  # m or 1, sum over all joints at the same tolerance, against which Baumgarte's 50 1/s acts
)
ROBOTS = ("athena", "phantomx_mk4")
ACCURATE: dict[str, Any] = {"tolerance": 1e-8}


def stood(core: ct.CDLL, robot: Robot) -> Plant:
    pose = standing(robot)
    return Plant(
        core,
        robot,
        position=pose.position,
        quaternion=pose.quaternion,
        angle=pose.angle,
        velocity=pose.velocity,
    )


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("mode", ["position", "kinematic"])
@pytest.mark.parametrize("law", ["tanh", "bristle"])
def test_a_settled_robot_stays_and_its_foot_forces_carry_its_weight(
    core: ct.CDLL, name: str, mode: str, law: str
) -> None:
    robot = changed(load_robot(name), servo={"mode": mode}, solver=ACCURATE, friction={"law": law})
    plant = stood(core, robot)
    start = plant.bodies
    plant.step(2.0)
    output, weight = plant.output(), robot.total_mass * 9.81
    assert float(np.max(np.abs(plant.bodies - start))) < AT_REST
    assert output.foot.force.sum(axis=0) == pytest.approx([0.0, 0.0, weight], abs=AT_REST * weight)
    com = centre_of_mass(robot, plant.bodies)
    pressure = output.foot.normal_force @ output.foot.position / output.foot.normal_force.sum()
    assert pressure[:2] == pytest.approx(com[:2], abs=AT_REST)
    assert rotation_matrix(output.torso.quaternion) @ output.imu.specific_force == pytest.approx(
        [0.0, 0.0, 9.81], abs=10.0 * AT_REST
    )
    assert output.solver.touchdowns == 0


def test_standing_joint_torques_are_the_statics_of_the_legs(core: ct.CDLL) -> None:
    """The torques are tau = -J^T f with the foot's Jacobian, and the legs' own weight, both by
    virtual work from differences.
    """
    robot = changed(load_robot("athena"), solver=ACCURATE)
    pose = standing(robot)
    torque = stood(core, robot).output().torque

    def work(angle: Array) -> float:
        """Returns the potential energy of the legs less the work of the foot forces, with the torso
        fixed.
        """
        body = body_states(
            robot, pose.position, pose.quaternion, np.zeros(3), np.zeros(3), angle, np.zeros((6, 3))
        )
        feet = np.array([foot.point for foot in foot_contacts(robot, body)])
        return robot.total_mass * 9.81 * float(centre_of_mass(robot, body)[2]) - float(
            np.sum(pose.foot_force * feet)
        )

    for leg, joint in ((0, 0), (1, 1), (2, 2), (4, 1), (5, 2)):
        change = np.zeros((6, 3))
        change[leg, joint] = 1e-6
        slope = (work(pose.angle + change) - work(pose.angle - change)) / 2e-6
        assert torque[leg, joint] == pytest.approx(slope, abs=1e-6)


# a block on an incline: the robot with locked joints


def block(
    name: str, *, gravity: Array, terrain: dict[str, Any] | None = None, law: str = "tanh"
) -> Robot:
    robot = changed(
        load_robot(name),
        servo={"mode": "kinematic"},
        solver=ACCURATE,
        terrain=terrain or {},
        friction={"law": law},
    )
    return replace(robot, gravity=tuple(gravity))


def laid(core: ct.CDLL, robot: Robot, quaternion: Array) -> Plant:
    """Returns the robot in its stance, pressed into the ground by the depth that carries its
    weight.
    """
    still, flat = np.zeros(3), np.zeros((6, 3))
    feet = foot_contacts(
        robot, body_states(robot, still, quaternion, still, still, robot.stance, flat)
    )
    depth = (robot.total_mass * 9.81 / 6.0 / robot.contact.stiffness) ** (2.0 / 3.0)
    rise = (max(foot.penetration for foot in feet) - depth) / float(feet[0].normal[2])
    return Plant(core, robot, position=[0.0, 0.0, rise], quaternion=quaternion)


def tilted(
    core: ct.CDLL, angle: float, heading: float, *, by: str, law: str = "tanh"
) -> tuple[Plant, Array, Array]:
    """Returns a block on an incline, the downhill direction and the normal.

    The incline is made of tilted gravity or of sloping ground.
    """
    uphill = np.array([math.cos(heading), math.sin(heading), 0.0])
    if by == "gravity":
        gravity = -9.81 * (math.cos(angle) * np.eye(3)[2] + math.sin(angle) * uphill)
        return (
            laid(core, block("athena", gravity=gravity, law=law), np.eye(4)[0]),
            -uphill,
            np.eye(3)[2],
        )
    terrain = {"kind": "slope", "incline": angle, "heading": heading}
    robot = block("athena", gravity=np.array([0.0, 0.0, -9.81]), terrain=terrain, law=law)
    axis = np.array([math.sin(heading), -math.cos(heading), 0.0])
    turn = np.concatenate([[math.cos(angle / 2.0)], math.sin(angle / 2.0) * axis])
    normal = math.cos(angle) * np.eye(3)[2] - math.sin(angle) * uphill
    return (
        laid(core, robot, turn),
        -(math.cos(angle) * uphill + math.sin(angle) * np.eye(3)[2]),
        normal,
    )


@pytest.mark.parametrize("by", ["gravity", "slope"])
@pytest.mark.parametrize(
    ("angle", "heading"), [(0.1, 0.0), (0.35, 0.0), (0.35, math.pi), (0.5, 0.0)]
)
def test_below_the_friction_angle_a_block_creeps_at_its_closed_speed(
    core: ct.CDLL, by: str, angle: float, heading: float
) -> None:
    plant, downhill, normal = tilted(core, angle, heading, by=by)
    plant.step(1.0)
    torso, friction = plant.output().torso, plant.robot.friction
    creep = math.atanh(math.tan(angle) / friction.mu) / friction.slope
    assert torso.velocity @ downhill == pytest.approx(creep, rel=CREEP)
    assert abs(float(torso.velocity @ normal)) < CREEP * creep
    assert float(np.max(np.abs(torso.angular_velocity))) < CREEP
    assert plant.output().foot.slip_speed == pytest.approx(np.full(6, creep), rel=CREEP)


@pytest.mark.parametrize("by", ["gravity", "slope"])
@pytest.mark.parametrize("law", ["tanh", "bristle"])
def test_above_the_friction_angle_a_block_accelerates_at_its_closed_rate(
    core: ct.CDLL, by: str, law: str
) -> None:
    angle = 0.75
    plant, downhill, _ = tilted(core, angle, 0.0, by=by, law=law)
    plant.step(1.0)
    before = float(plant.output().torso.velocity @ downhill)
    plant.step(1.3)
    gained = float(plant.output().torso.velocity @ downhill) - before
    assert (
        before > 0.2
    )  # tanh(100 s/m v) is 1 to the last digit; bristles have slid over some hundred preslidings
    assert gained / 0.3 == pytest.approx(
        9.81 * (math.sin(angle) - plant.robot.friction.mu * math.cos(angle)), rel=SLIDE
    )


# walking in place


def marching(robot: Robot, t: float) -> Command:
    """Returns a command that lifts two tripods in turn, twice a second, under a varying push."""
    phase = 2.0 * math.pi * 2.0 * t + math.pi * (np.arange(6) % 2)
    swing = np.clip(np.sin(phase), 0.0, None)
    angle = robot.stance + np.column_stack([0.1 * np.cos(phase), 0.35 * swing, 0.2 * swing])
    return Command(angle_ref=angle, push_force=np.array([2.0 * math.sin(5.0 * t), 1.0, 0.0]))


def marched(
    core: ct.CDLL, robot: Robot, *, duration: float = 1.5, macro: float = 5e-3
) -> list[Any]:
    plant, seen = stood(core, robot), []
    for k in range(round(duration / macro)):
        command = marching(robot, k * macro)
        plant.step((k + 1) * macro, command)
        seen.append(plant.output(command))
    return seen


@pytest.mark.parametrize("mode", ["position", "kinematic"])
@pytest.mark.parametrize("law", ["tanh", "bristle"])
def test_walking_keeps_the_energy_balance_and_the_joints(
    core: ct.CDLL, mode: str, law: str
) -> None:
    robot = changed(load_robot("athena"), servo={"mode": mode}, friction={"law": law})
    seen = marched(core, robot)
    last, turnover = seen[-1].energy, max(output.energy.dissipated for output in seen)
    assert last.actuator_work > 0.5
    assert last.dissipated > 0.5
    assert max(abs(output.energy.residual) for output in seen) < WALK * turnover
    assert max(output.constraint.position_error for output in seen) < DRIFT
    assert max(output.constraint.velocity_error for output in seen) < 50.0 * DRIFT
    assert seen[-1].solver.touchdowns >= 12
    assert all(output.torso.position[2] > 0.08 for output in seen)


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("terrain", ["flat", "slope"])
@pytest.mark.parametrize("law", ["tanh", "bristle"])
def test_friction_stays_in_its_cone_and_forces_are_their_parts(
    core: ct.CDLL, name: str, terrain: str, law: str
) -> None:
    robot = changed(
        load_robot(name),
        terrain={"kind": terrain, "incline": 0.2, "heading": 0.4},
        friction={"law": law},
    )
    plant, pressed, slid = Plant(core, robot, **landing(robot)), 0, 0.0
    for k in range(60):
        command = random_command(robot, k // 6)
        plant.step((k + 1) * 4e-3, command)
        foot = plant.output(command).foot
        assert np.all(
            foot.tangential_force <= robot.friction.mu * foot.normal_force * (1.0 + 1e-12)
        )
        assert np.all(foot.normal_force >= 0.0)
        assert np.linalg.norm(foot.force, axis=1) == pytest.approx(
            np.hypot(foot.normal_force, foot.tangential_force), rel=1e-12
        )
        assert np.all(foot.normal_force[foot.contact == 0] == 0.0)
        assert np.all(foot.penetration[foot.contact == 0] <= 0.0)
        pressed += int(np.count_nonzero(foot.normal_force))
        slid = max(slid, float(np.max(foot.slip_speed * (foot.normal_force > 0.0))))
    assert pressed > 30
    assert slid > 0.05
