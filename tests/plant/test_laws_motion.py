"""Tests laws of motion with the whole plant: momentum, energy, steady spin, pendulum, symmetry."""

from __future__ import annotations

import ctypes as ct
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from plant import Plant
from states import changed, landing, random_command, random_pose, with_links

from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.dynamics import Command
from hexapod_cosim.models.energy import kinetic_energy, momentum

# relative, for each quantity: rounding of sums of 19 terms over some hundred steps
ROUNDING = 1e-13
CONSTRAINED = (
    1e-9  # relative, of conserved quantities: the integrator's error at a tolerance of 1e-12
)
FLIGHT: dict[str, Any] = {"method": "dp54", "tolerance": 1e-12, "step_max": 1.0}
LOSSLESS: dict[str, Any] = {
    "mode": "torque",
    "coulomb_friction": 0.0,
    "torque_max": 100.0,
    "speed_max": 1e4,
}
WEIGHTLESS = (0.0, 0.0, 0.0)
HIGH = 3.0  # m above the ground


def tumbling(core: ct.CDLL, robot: Robot, seed: int = 1) -> Plant:
    pose = random_pose(robot, seed)
    return Plant(
        core,
        robot,
        **pose
        | {"position": np.array([0.2, -0.1, HIGH]), "angular_velocity": np.array([2.0, -3.0, 1.5])},
    )


def free(**solver: Any) -> Robot:
    """Returns a robot without gravity, torque and gear friction."""
    return replace(
        changed(load_robot("phantomx_mk4"), servo=LOSSLESS, solver=FLIGHT | solver),
        gravity=WEIGHTLESS,
    )


# free flight


@pytest.mark.parametrize("mode", ["position", "torque", "kinematic"])
@pytest.mark.parametrize("method", ["rosw3", "dp54"])
def test_linear_momentum_changes_by_the_weight_alone_to_rounding(
    core: ct.CDLL, mode: str, method: str
) -> None:
    """The law holds under any servo torque; every method preserves linear invariants exactly."""
    robot = changed(load_robot("phantomx_mk4"), servo={"mode": mode}, solver={"method": method})
    plant = tumbling(core, robot)
    before = momentum(robot, plant.bodies)[0]
    plant.step(0.2, random_command(robot, 1, size=0.0))
    plant.step(0.3, replace(plant.hold(), torque_ref=np.full((6, 3), 0.1)))
    gained = momentum(robot, plant.bodies)[0] - before
    weight = robot.total_mass * np.array(robot.gravity)
    assert float(np.max(np.abs(gained - 0.3 * weight))) < 100.0 * ROUNDING * float(
        np.max(np.abs(weight))
    )


def test_angular_momentum_is_conserved_whatever_the_joints_do(core: ct.CDLL) -> None:
    robot = replace(changed(load_robot("phantomx_mk4"), solver=FLIGHT), gravity=WEIGHTLESS)
    plant = tumbling(core, robot)
    before = momentum(robot, plant.bodies)[1]
    plant.step(0.2, random_command(robot, 2, size=0.0))
    after = momentum(robot, plant.bodies)[1]
    assert float(np.max(np.abs(after - before))) < CONSTRAINED * float(np.linalg.norm(before))
    assert float(np.max(np.abs(plant.output().angle - robot.stance))) < 0.5


@pytest.mark.parametrize(("method", "order"), [("rosw3", 3), ("ros2", 2), ("dp54", 5)])
def test_the_energy_of_a_free_robot_is_conserved_at_the_order_of_the_method(
    core: ct.CDLL, method: str, order: int
) -> None:
    robot, errors, steps = free(), [], 0.1 / np.array([40.0, 80.0] if order == 5 else [80.0, 160.0])
    for step in steps:
        plant = tumbling(core, changed(robot, solver={"method": method, "step": float(step)}))
        before = kinetic_energy(robot, plant.bodies)
        plant.step(0.1, Command(angle_ref=robot.stance))
        errors.append(abs(kinetic_energy(robot, plant.bodies) - before))
        assert plant.output().energy.residual == pytest.approx(
            kinetic_energy(robot, plant.bodies) - before, abs=1e-12
        )
    # at least: a method may conserve energy with a higher order than it has for the motion
    assert math.log2(errors[0] / errors[1]) > order - 0.3
    assert errors[0] < 1e-2 * before


@pytest.mark.parametrize("axis", range(3))
def test_a_spin_about_a_principal_axis_is_steady(core: ct.CDLL, axis: int) -> None:
    """With locked joints and level legs the torso's axes are principal axes by symmetry."""
    robot = replace(
        changed(load_robot("athena"), servo={"mode": "kinematic"}, solver=FLIGHT),
        gravity=WEIGHTLESS,
    )
    flat, spin = np.zeros((6, 3)), 0.9 * np.eye(3)[axis]
    plant = Plant(core, robot, angle=flat, angular_velocity=spin, position=(0.0, 0.0, HIGH))
    plant.step(7.0, Command(angle_ref=flat))
    torso = plant.output().torso
    assert torso.angular_velocity == pytest.approx(spin, abs=1e-9)
    assert torso.position == pytest.approx([0.0, 0.0, HIGH], abs=1e-9)
    turned = np.concatenate([[math.cos(0.45 * 7.0)], math.sin(0.45 * 7.0) * np.eye(3)[axis]])
    assert abs(float(torso.quaternion @ turned)) == pytest.approx(1.0, abs=1e-9)


# the pendulum

# s, period of 1 kg at 1 m on a massless rod, released horizontally: 4 K(sin 45 deg) sqrt(l/g) with
# g = 9.81 m/s2
PERIOD = 2.3678419476
BOB = (1e-9, 1e-9, 1e-9, 0.0, 0.0, 0.0)  # kg m2; the bob has 1 kg m2 about the joint
HEAVY = (1e6, 1e6, 1e6, 0.0, 0.0, 0.0)


def pendulums() -> Robot:
    """Returns a robot with a 1 kg bob at the end of each tibia of 1 m.

    Coxas and femurs are too heavy to move, and their joints are at the hips.
    """
    robot = changed(
        load_robot("athena"),
        servo=LOSSLESS | {"rotor_inertia": 0.0},
        torso={"mass": 1e9, "inertia": (1e9, 1e9, 1e9, 0, 0, 0)},
    )
    for joint in (0, 1):
        robot = with_links(robot, joint, mass=1e3, length=1e-9, com=(0.0, 0.0, 0.0), inertia=HEAVY)
    robot = with_links(robot, 2, mass=1.0, length=1.0, com=(1.0, 0.0, 0.0), inertia=BOB)
    return changed(robot, solver=FLIGHT, terrain={"height": -100.0})


def test_a_pendulum_let_go_horizontally_has_its_closed_period(core: ct.CDLL) -> None:
    robot, flat = pendulums(), np.zeros((6, 3))
    # the push carries the weight of all bodies but the bobs; the torso is too heavy to react to the
    # bobs
    carry = Command(angle_ref=flat, push_force=np.array([0.0, 0.0, robot.total_mass * 9.81]))
    plant = Plant(core, robot, angle=flat)
    plant.step(PERIOD / 4.0, carry)
    bottom = plant.output(carry)
    assert bottom.angle[:, 2] == pytest.approx(np.full(6, math.pi / 2.0), abs=1e-7)
    assert bottom.speed[:, 2] == pytest.approx(np.full(6, math.sqrt(2.0 * 9.81)), rel=1e-7)
    # N, centripetal force plus weight: 3 m g
    assert bottom.reaction_force[:, 2, 2] == pytest.approx(np.full(6, 3.0 * 9.81), rel=1e-6)
    plant.step(PERIOD, carry)
    back = plant.output(carry)
    assert back.angle[:, 2] == pytest.approx(np.zeros(6), abs=1e-9)
    late = (
        back.speed[:, 2] / 9.81
    )  # s; near the turning point the speed is g/l times the time since then
    assert late == pytest.approx(np.zeros(6), abs=2e-8)


# symmetry

# no step-size control, whose decisions rounding could change
FIXED: dict[str, Any] = {"method": "rosw3", "step": 1e-4}
MIRRORED = 1e-9  # after 1500 steps with impacts: rounding, amplified by the stiff contacts
OTHER_SIDE = [3, 4, 5, 0, 1, 2]
COXA = np.array([-1.0, 1.0, 1.0])
POLAR, AXIAL, TURN = (
    np.array([1.0, -1.0, 1.0]),
    np.array([-1.0, 1.0, -1.0]),
    np.array([1.0, -1.0, 1.0, -1.0]),
)


def mirrored_command(command: Command) -> Command:
    joints = {
        name: getattr(command, name)[OTHER_SIDE] * COXA
        for name in ("angle_ref", "speed_ref", "torque_ref")
    }
    return Command(
        **joints, push_force=command.push_force * POLAR, push_torque=command.push_torque * AXIAL
    )


def landed(plant: Plant, mirror: Any) -> tuple[Any, Any]:
    """Returns output and bodies after five commands during which the robot lands."""
    for k in range(5):
        command = mirror(random_command(plant.robot, k, size=0.3))
        plant.step(0.03 * (k + 1), command)
    return plant.output(command), plant.bodies


def test_left_right_mirrored_commands_give_the_mirrored_motion(core: ct.CDLL) -> None:
    robot = changed(load_robot("athena"), solver=FIXED)
    pose = landing(robot, 6)
    other = {
        "position": pose["position"] * POLAR,
        "quaternion": pose["quaternion"] * TURN,
        "velocity": pose["velocity"] * POLAR,
        "angular_velocity": pose["angular_velocity"] * AXIAL,
        "angle": pose["angle"][OTHER_SIDE] * COXA,
        "speed": pose["speed"][OTHER_SIDE] * COXA,
    }
    here, _ = landed(Plant(core, robot, **pose), lambda command: command)
    there, _ = landed(Plant(core, robot, **other), mirrored_command)
    assert here.solver.touchdowns == there.solver.touchdowns >= 3
    assert there.torso.position * POLAR == pytest.approx(here.torso.position, abs=MIRRORED)
    assert there.torso.quaternion * TURN == pytest.approx(here.torso.quaternion, abs=MIRRORED)
    assert there.torso.angular_velocity * AXIAL == pytest.approx(
        here.torso.angular_velocity, abs=100.0 * MIRRORED
    )
    assert there.angle[OTHER_SIDE] * COXA == pytest.approx(here.angle, abs=MIRRORED)
    assert there.torque[OTHER_SIDE] * COXA == pytest.approx(here.torque, abs=1e3 * MIRRORED)


def test_turning_the_world_turns_the_motion(core: ct.CDLL) -> None:
    """The robot starts turned about the vertical on flat ground; no law depends on the direction of
    x.
    """
    robot, turn = changed(load_robot("athena"), solver=FIXED), 0.7
    z = np.array([math.cos(turn / 2.0), 0.0, 0.0, math.sin(turn / 2.0)])
    R = np.array(
        [
            [math.cos(turn), -math.sin(turn), 0.0],
            [math.sin(turn), math.cos(turn), 0.0],
            [0.0, 0.0, 1.0],
        ]
    )
    pose = landing(robot, 8)
    other = pose | {name: R @ pose[name] for name in ("position", "velocity", "angular_velocity")}
    w, x, y, v = pose["quaternion"]
    other["quaternion"] = np.array(
        [z[0] * w - z[3] * v, z[0] * x - z[3] * y, z[0] * y + z[3] * x, z[0] * v + z[3] * w]
    )

    def turned(command: Command) -> Command:
        return replace(
            command, push_force=R @ command.push_force, push_torque=R @ command.push_torque
        )

    here, bodies = landed(Plant(core, robot, **pose), lambda command: command)
    there, others = landed(Plant(core, robot, **other), turned)
    assert there.angle == pytest.approx(here.angle, abs=MIRRORED)
    for part in (slice(0, 3), slice(7, 10), slice(10, 13)):
        gap: Array = others[:, part] - bodies[:, part] @ R.T
        assert float(np.max(np.abs(gap))) < 1e3 * MIRRORED
