"""The inverse dynamics as a linear function of inertial parameters: the regressor agrees with the
dense equations of motion, and base parameters are those that its rank allows.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from secret_robots import Secret, secret_robot
from states import lopsided, random_bodies, random_command

from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.extensions.identify.identify import make_experiment
from hexapod_cosim.extensions.identify.log import Log
from hexapod_cosim.extensions.identify.rigid.base_parameters import (
    Base,
    base_of,
    group_parameters,
    least_squares_base,
)
from hexapod_cosim.extensions.identify.rigid.linear_start import linear_start
from hexapod_cosim.extensions.identify.rigid.regressor import (
    EQUATIONS,
    Motion,
    body_wrenches,
    foot_equations,
    frames,
    regressor,
)
from hexapod_cosim.extensions.identify.rigid.samples import lacking
from hexapod_cosim.extensions.identify.unknowns import ROBOT, chosen_unknowns
from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.contact.geometry import foot_contacts, foot_force
from hexapod_cosim.models.dynamics import Command, accelerations
from hexapod_cosim.models.ground.faces import ground_normal
from hexapod_cosim.models.kinematics import (
    cross,
    joint_angles,
    joint_models,
    joint_speeds,
    rotation_matrix,
)

Array = np.ndarray
DAMPING = 1.0  # s/m    of feet in the ground
EXACT = 1e-9  # of the largest term: sums of some hundred products


def own_motion(robot: Robot, body: Array, dv: Array) -> Motion:
    """Returns the motion of one instant from bodies (19, 13) and their accelerations (19, 6)."""
    turn = rotation_matrix(body[0, 3:7])
    spin, rate = body[0, 10:13], dv[0, 3:6]
    arm = -turn @ np.array(robot.torso.com)
    lift = dv[0, 0:3] - np.array(robot.gravity)
    lift = lift + cross(rate, arm) + cross(spin, cross(spin, arm))
    acceleration = [
        rotation_matrix(body[one.parent, 3:7]) @ one.s_i @ (dv[one.child, 3:] - dv[one.parent, 3:])
        for one in joint_models(robot)
    ]
    return Motion(
        angle=joint_angles(robot, body)[None],
        speed=joint_speeds(robot, body)[None],
        acceleration=np.array(acceleration).reshape(1, 6, 3),
        spin=(spin @ turn)[None],
        spin_rate=(rate @ turn)[None],
        lift=(lift @ turn)[None],
        turn=turn[None],
    )


def instant(robot: Robot, seed: int) -> tuple[Motion, Array, Array]:
    """Returns a motion under contact forces and motors by the dense equations, the feet's forces
    (6, 3) and what motors and gears exert, less rotors, in the 24 equations.
    """
    body, wanted = random_bodies(robot, seed), random_command(robot, seed)
    command = Command(angle_ref=wanted.angle_ref, torque_ref=wanted.torque_ref)
    damping = np.full(6, DAMPING)
    found = accelerations(robot, body, command, damping)
    motion = own_motion(robot, body, found.dv)
    feet = foot_contacts(robot, body)
    forces = np.array(
        [
            foot_force(robot, foot, DAMPING) if foot.penetration > 0.0 else np.zeros(3)
            for foot in feet
        ]
    )
    exerted = np.zeros(EQUATIONS)
    rotors = robot.servo.rotor_inertia * motion.acceleration[0]
    exerted[6:] = (found.drive_torque + found.gear_torque - rotors).ravel()
    return motion, forces, exerted


@pytest.mark.parametrize("which", ["athena", "lopsided"])
def test_the_regressor_satisfies_the_dense_equations_of_motion(which: str) -> None:
    """Feet, motors and gears exert what the parameters of the bodies say (eq. 1)."""
    robot = load_robot("athena") if which == "athena" else lopsided()
    for seed in range(3):
        motion, forces, exerted = instant(robot, seed)
        assert np.abs(forces).max() > 1.0
        bodies = frames(robot, motion)
        feet = foot_equations(robot, bodies, motion, ground_normal(robot.terrain))
        right = exerted + feet[0] @ forces.ravel()
        own = body_wrenches(robot, bodies)[0]
        assert own == pytest.approx(right, abs=EXACT * np.abs(feet).max() * np.abs(forces).max())


def test_the_links_of_all_legs_add_up_in_the_columns_of_one() -> None:
    robot = load_robot("athena")
    motion, _, _ = instant(robot, 3)
    bodies = frames(robot, motion)
    own = body_wrenches(robot, bodies)
    assert regressor(bodies) @ group_parameters(robot) == pytest.approx(own, abs=1e-10)


def test_base_parameters_are_as_many_as_the_joints_allow() -> None:
    """Closed form: 10 of the torso and 7 of each link; of a link's 10, 3 add to its parent's."""
    base = base_of(load_robot("athena"))
    assert len(base.columns) == 31
    assert base.names()[0] == "torso.m + 6 coxa.m + 6 femur.m + 6 tibia.m"
    assert "tibia.mx" in base.names()
    assert "femur.mx + 0.1 tibia.m" in base.names()


def test_a_mass_on_an_axis_may_be_in_either_body() -> None:
    """The origin of a link lies on its parent too: a point mass there belongs to both, so that the
    base parameters do not change when it moves from one to the other.
    """
    robot, point = load_robot("athena"), 0.05
    base, own = base_of(robot), group_parameters(robot)
    moved = own.copy()
    moved[30] += point  # tibia.m at its joint
    place = np.array(robot.legs[0].links[1].tip)
    moved[20] -= point  # from the femur's tip
    moved[21:24] -= point * place
    moved[24:27] -= point * (place @ place - place**2)
    moved[27:30] -= -point * np.array(
        [place[0] * place[1], place[0] * place[2], place[1] * place[2]]
    )
    assert base.values(moved) == pytest.approx(base.values(own), abs=1e-12)
    moved[30] += 0.01
    assert np.abs(base.values(moved) - base.values(own)).max() > 1e-3


def changed() -> Robot:
    robot = load_robot("athena")
    for row in ROBOT:
        if row.group == "mass" and row.write is not None and row.read is not None:
            robot = row.write(robot, 1.1 * row.read(robot) + 0.004 * (not row.positive))
    return robot


@pytest.fixture(scope="module")
def equations() -> tuple[Array, Array]:
    """The equations that motions of another robot are for the robot file."""
    robot, other = load_robot("athena"), changed()
    matrix, right = [], []
    for seed in range(20):
        motion, forces, exerted = instant(other, seed)
        bodies = frames(robot, motion)
        feet = foot_equations(robot, bodies, motion, ground_normal(robot.terrain))
        matrix.append(regressor(bodies)[0])
        right.append(exerted + feet[0] @ forces.ravel() - body_wrenches(robot, bodies)[0])
    return np.vstack(matrix), np.concatenate(right)


def test_exact_motions_tell_all_base_parameters_of_another_robot_exactly(
    equations: tuple[Array, Array],
) -> None:
    robot, other = load_robot("athena"), changed()
    base: Base = base_of(robot)
    matrix, right = equations
    found = least_squares_base(base, robot, matrix, right)
    true = base.values(group_parameters(other))
    assert np.abs(true - found.before).max() > 0.1
    assert found.values == pytest.approx(true, rel=1e-6, abs=1e-7)


def test_noisy_motions_tell_base_parameters_within_their_deviations(
    equations: tuple[Array, Array],
) -> None:
    """The mean of (found - true)^2/deviation^2 over 31 numbers is 1 within 0.76, three deviations
    of a chi-square variable over its degrees of freedom.
    """
    robot, other = load_robot("athena"), changed()
    base = base_of(robot)
    matrix, right = equations
    noisy = right + 0.02 * np.random.default_rng(1).standard_normal(len(right))
    found = least_squares_base(base, robot, matrix / 0.02, noisy / 0.02)
    true = base.values(group_parameters(other))
    ratio = (found.values - true) / found.deviations
    assert float(np.mean(ratio**2)) == pytest.approx(1.0, abs=0.76)


@pytest.fixture(scope="module")
def secret(plant_build: Path, tmp_path_factory: pytest.TempPathFactory) -> Secret:
    folder = tmp_path_factory.mktemp("secret")
    return secret_robot(5, folder, duration=2.0, groups=("servo", "mass"))


def clean_log(secret: Secret) -> Log:
    """Returns the log without noise."""
    data = secret.log.recording.data.copy()
    for k, name in enumerate(secret.columns):
        data[:, secret.log.recording.names.index(name)] = secret.clean[:, k]
    return Log(Recording(secret.log.recording.names, data), "clean")


@pytest.mark.parametrize(("noisy", "share"), [(False, 0.001), (True, 0.01)])
def test_a_log_tells_servos_and_masses_without_a_simulation(
    secret: Secret, noisy: bool, share: float
) -> None:
    """The share is that of kp and of the whole mass; differences of readings in rows of 5 ms tell
    the rest less exactly.
    """
    robot, log = load_robot("athena"), secret.log if noisy else clean_log(secret)
    rows = chosen_unknowns(robot, [log], ("servo", "mass"))
    found, missing = linear_start([make_experiment(log, 0, 0.0)], robot, rows)
    assert missing == ""
    assert found is not None
    assert found.values["servo.kp"] == pytest.approx(secret.values["servo.kp"], rel=share)
    assert found.values["servo.kd"] == pytest.approx(secret.values["servo.kd"], rel=0.03)
    true = base_of(robot).values(group_parameters(secret.robot))
    assert true[0] < 0.92 * found.base.before[0]
    assert found.base.values[0] == pytest.approx(true[0], rel=share)
    for key in ("servo.rotor_inertia", "servo.coulomb_friction"):
        assert found.values[key] == pytest.approx(secret.values[key], rel=0.1), key


def test_a_start_is_that_of_possible_bodies(secret: Secret) -> None:
    """Of a log that contradicts itself, too: with its torques turned round, bodies would have to be
    lighter than nothing.
    """
    robot = load_robot("athena")
    data = secret.log.recording.data.copy()
    for k, name in enumerate(secret.log.recording.names):
        if name.endswith((".torque", ".normal_force")):
            data[:, k] *= -1.0
    log = Log(Recording(secret.log.recording.names, data), "turned round")
    rows = chosen_unknowns(robot, [log], ("mass",))
    found, _ = linear_start([make_experiment(log, 0, 0.0)], robot, rows)
    assert found is not None
    assert found.base.values[0] < 0.0
    for key, value in found.values.items():
        assert value > 0.0 or not key.endswith(".mass"), key


def test_what_a_log_lacks_for_its_inverse_dynamics_is_named(secret: Secret) -> None:
    log = secret.log.without(["torso.roll", "torso.pitch", "torso.yaw", "imu.specific_force[1]"])
    assert lacking(log) == "the attitude, an IMU"
    robot = load_robot("athena")
    found = linear_start([make_experiment(log, 0, 0.0)], robot, ())
    assert found == (None, "the attitude, an IMU")
