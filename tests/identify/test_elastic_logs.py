"""Elastic gears and the torso's inertia in logs: which readings tell them, and what is found."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from secret_robots import NOISE, SEEN, Secret, secret_robot

from hexapod_cosim.cosim.export.plant_export import export_fmu
from hexapod_cosim.extensions.identify.experiment import Experiment
from hexapod_cosim.extensions.identify.fitting.output_error import fit
from hexapod_cosim.extensions.identify.fitting.problem import Problem
from hexapod_cosim.extensions.identify.fitting.rank import TOLD
from hexapod_cosim.extensions.identify.identify import TOLERANCE, make_experiment
from hexapod_cosim.extensions.identify.log_plant import LogPlant
from hexapod_cosim.extensions.identify.numbers.servo import GEAR
from hexapod_cosim.extensions.identify.numbers.unknown import Unknown
from hexapod_cosim.extensions.identify.unknowns import ROBOT, chosen_unknowns
from hexapod_cosim.models import JOINT_NAMES, Robot, load_robot

DURATION = 1.8  # s
FORGOTTEN = 1.0  # s    a period of the gait
GROUPS = ("servo",)
ALL_WITHIN = 3.0  # deviations: all of six numbers are, but for one robot in sixty


@pytest.fixture(scope="module")
def file() -> Robot:
    """The robot as it is known: with elastic gears and play."""
    robot = load_robot("athena")
    servo = replace(robot.servo, gear_stiffness=300.0, gear_damping=0.1, backlash=0.004)
    return replace(robot, servo=servo)


@pytest.fixture(scope="module")
def secret(plant_build: Path, file: Robot, tmp_path_factory: pytest.TempPathFactory) -> Secret:
    folder, seen = tmp_path_factory.mktemp("elastic"), (*SEEN, "motor_angle")
    return secret_robot(1, folder, duration=DURATION, groups=GROUPS, file=file, seen=seen)


@pytest.fixture(scope="module")
def plant(file: Robot, tmp_path_factory: pytest.TempPathFactory) -> LogPlant:
    return LogPlant(export_fmu(file, tmp_path_factory.mktemp("file") / "file.fmu"), TOLERANCE)


def deviations(plant: LogPlant, robot: Robot, secret: Secret, one: Experiment) -> dict[str, float]:
    """Returns the deviations of a log's numbers by key, in priors, near the secret ones."""
    rows = chosen_unknowns(robot, [secret.log], GROUPS)
    problem = Problem(plant, robot, [one], rows)
    z = np.array([
        row.distance(secret.values[row.key], problem.before[row.key])
        if row.key in secret.values else 0.0
        for row in rows
    ])  # fmt: skip
    problem.noise = {key: NOISE[key] for key in one.channels}
    problem.leave_out_jumps(z)
    jacobian = problem.jacobian(z)
    covariance = np.linalg.inv(jacobian.T @ jacobian)  # the last rows are the priors
    return dict(zip((row.key for row in rows), np.sqrt(np.diag(covariance)).tolist(), strict=True))


def kept(one: Experiment, *ends: str) -> Experiment:
    """Returns an experiment with the columns that end so."""
    return one.without([name for name in one.columns if not name.endswith(ends)])


def test_angles_of_rotors_tell_most_of_the_elasticity_and_a_pose_too_little(
    plant: LogPlant, file: Robot, secret: Secret
) -> None:
    """Links' angles alone tell it as well where all but the servo is known."""
    both = make_experiment(secret.log, 0, 0.0, forget=FORGOTTEN)
    links = kept(both, *(f".{joint}.angle" for joint in JOINT_NAMES))
    rotors = kept(both, *(f".{joint}.angle" for joint in JOINT_NAMES), ".motor_angle")
    pose = kept(both, "torso.roll", "torso.pitch", "torso.yaw")
    with_rotors = deviations(plant, file, secret, rotors)
    with_links = deviations(plant, file, secret, links)
    with_pose = deviations(plant, file, secret, pose)
    for key in GEAR:
        assert with_rotors[key] < TOLD, key
        assert 2.0 * with_rotors[key] < with_links[key] < 0.5 * with_pose[key], key
    assert with_pose["servo.gear_damping"] > TOLD


def test_stiffness_and_play_of_gears_are_found(
    plant: LogPlant, file: Robot, secret: Secret
) -> None:
    rows = chosen_unknowns(file, [secret.log], GROUPS)
    found = fit(Problem(plant, file, [make_experiment(secret.log, 0, 0.0, forget=FORGOTTEN)], rows))
    assert found.unexplained == {}
    for row in rows:
        if row.key in (*GEAR, "servo.kp", "servo.kd", "servo.coulomb_friction"):
            deviation = found.deviations[row.key]
            low, high = row.interval(found.values[row.key], ALL_WITHIN * deviation)
            assert low < secret.values[row.key] < high, row.key
            assert deviation < 0.2 * TOLD, row.key


def test_gears_that_the_robot_file_has_rigid_are_not_sought(secret: Secret) -> None:
    keys = {row.key for row in chosen_unknowns(load_robot("athena"), [secret.log], GROUPS)}
    assert not keys & set(GEAR)


def row_of(key: str) -> Unknown:
    return next(row for row in ROBOT if row.key == key)


def test_the_radius_of_gyration_scales_the_inertia_of_the_torso_by_its_square() -> None:
    robot, row = load_robot("athena"), row_of("torso.gyration_radius")
    assert row.read is not None
    assert row.write is not None
    assert 2.0 * robot.torso.mass * row.read(robot) ** 2 == pytest.approx(
        sum(robot.torso.inertia[:3]), rel=1e-12
    )
    wider = row.write(robot, 1.5 * row.read(robot))
    assert wider.torso.inertia == pytest.approx(
        [2.25 * value for value in robot.torso.inertia], rel=1e-12, abs=1e-15
    )
    assert wider.torso.mass == pytest.approx(robot.torso.mass, rel=1e-15)
    assert wider.torso.com == robot.torso.com
