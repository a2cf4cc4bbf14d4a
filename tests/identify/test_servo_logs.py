"""Logs of measured servos and of elastic gears: which readings determine their numbers, what is
found, and a wrong friction model is rejected.
"""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import tomlkit
from secret_robots import NOISE, SEEN, Secret, secret_robot

from hexapod_cosim.cosim.export.plant import export_fmu
from hexapod_cosim.extensions.identify.experiment import Experiment
from hexapod_cosim.extensions.identify.fitting.judging import fit
from hexapod_cosim.extensions.identify.fitting.misfit import DETERMINED
from hexapod_cosim.extensions.identify.fitting.problem import Problem
from hexapod_cosim.extensions.identify.identify import (
    TOLERANCE,
    Identified,
    identify,
    make_experiment,
)
from hexapod_cosim.extensions.identify.identify_files import open_text, warnings
from hexapod_cosim.extensions.identify.log_plant import LogPlant
from hexapod_cosim.extensions.identify.numbers.servo import GEAR, TERMS, with_friction_model
from hexapod_cosim.extensions.identify.robot_file import write_robot
from hexapod_cosim.extensions.identify.unknowns import ROBOT, chosen_unknowns
from hexapod_cosim.models import JOINT_NAMES, Robot, load_robot
from hexapod_cosim.models.robot import robot_path
from hexapod_cosim.models.servos.motor import back_emf_damping
from hexapod_cosim.models.servos.presets import measured_servo

GROUPS = ("servo",)
MOTOR = ("servo.torque_constant", "servo.resistance")
FORGOTTEN = 1.0  # s    a period of the gait
ALL_WITHIN = 3.0  # deviations: all of six numbers are, but for one robot in sixty


def measured(model: str) -> Robot:
    """Returns athena with a measured servo."""
    return replace(load_robot("athena"), servo=measured_servo(f"mx64_{model}").servo)


@pytest.fixture(scope="module")
def secret(plant_build: Path, tmp_path_factory: pytest.TempPathFactory) -> Secret:
    """A robot whose gears have the friction M6."""
    folder = tmp_path_factory.mktemp("m6")
    seen = (*SEEN, "current")
    return secret_robot(61, folder, duration=2.5, groups=GROUPS, file=measured("m6"), seen=seen)


@pytest.fixture(scope="module")
def blind(secret: Secret) -> Identified:
    """What a log without currents says."""
    names = [name for name in secret.log.measured if name.endswith(".current")]
    return identify([secret.log.without(names)], measured("m6"), groups=GROUPS)


def test_a_log_without_currents_determines_the_damping_of_the_motor_alone(
    secret: Secret, blind: Identified, tmp_path: Path
) -> None:
    """The back-EMF's k_t^2/R; the torque constant and the resistance need currents."""
    own = {one.key: one for one in blind.estimates}
    assert [own[key].determined for key in MOTOR] == [False, False]
    (stays,) = [key for key in MOTOR if not own[key].depends]
    (carries,) = [key for key in MOTOR if own[key].depends]
    assert own[stays].value == own[stays].before
    assert own[carries].depends == (stays,)
    true = back_emf_damping(secret.robot.servo)
    assert back_emf_damping(blind.robot.servo) == pytest.approx(true, rel=0.05)
    inside = [one.low <= secret.values[one.key] <= one.high for one in own.values()]
    assert all(inside), [key for key, good in zip(own, inside, strict=True) if not good]
    text = open_text(blind)
    assert f"of {carries} holds as long as {stays} have the file's" in text
    assert "Currents would determine both" in text
    write_robot(blind, str(written(tmp_path)), tmp_path / "robot.toml", ["log.csv"])
    source = tomllib.loads((tmp_path / "robot.toml").read_text(encoding="utf-8"))["source"]
    assert source[stays] == "not determined by log.csv: as before"
    assert source[carries] == f"identified from log.csv as long as {stays} have the file's values"


def written(folder: Path) -> Path:
    """Writes athena's robot file with a measured servo."""
    document = tomlkit.parse(robot_path("athena").read_text(encoding="utf-8"))
    document["servo"] = {"model": "mx64_m6"}
    path = folder / "measured.toml"
    path.write_text(tomlkit.dumps(document), encoding="utf-8")
    return path


def test_a_wrong_friction_model_determines_no_number(secret: Secret) -> None:
    log = secret.log.part(slice(0, 440))
    wrong = identify([log], measured("m1"), groups=GROUPS)
    assert wrong.rejected
    assert not any(one.determined for one in wrong.estimates)
    assert wrong.robot == measured("m1")
    assert [one.value for one in wrong.estimates] == [one.before for one in wrong.estimates]
    (text,) = warnings(wrong)
    assert "reject the model" in text
    assert "--friction" in text
    assert open_text(wrong) == "The logs reject the model, so they determine no number."


def test_numbers_of_a_measured_servo_are_written_and_read_back(
    blind: Identified, tmp_path: Path
) -> None:
    path = written(tmp_path)
    file = load_robot(path)
    changed = file
    for row in ROBOT:
        if row.group == "servo" and row.applies(file):
            changed = row.write(changed, 1.1 * row.read(changed))
    assert changed.servo.torque_max == pytest.approx(file.servo.torque_max, rel=1e-12)
    write_robot(replace(blind, robot=changed), str(path), tmp_path / "robot.toml", ["x.csv"])
    again = load_robot(tmp_path / "robot.toml").servo
    assert again == changed.servo
    assert again.torque_constant == pytest.approx(1.1 * file.servo.torque_constant, rel=1e-12)


def test_currents_of_a_measured_servo_are_those_of_its_motor(
    secret: Secret, tmp_path: Path
) -> None:
    """The plant's motor predicts them: torque over the torque constant that is tried (eq. 48)."""
    file, log = measured("m6"), secret.log.part(slice(0, 120))
    rows = chosen_unknowns(file, [log], ("servo", "sensor"))
    keys = [row.key for row in rows]
    assert not {"sensor.torque_constant", "servo.torque_max"} & set(keys)
    place = keys.index("servo.torque_constant")
    experiment = make_experiment(log, 0, 0.0)
    with LogPlant(export_fmu(file, tmp_path / "file.fmu")) as plant:
        problem = Problem(plant, file, [experiment], rows)
        z = np.zeros(len(rows))
        z[place] = rows[place].distance(
            1.1 * file.servo.torque_constant, problem.before[keys[place]]
        )
        (readings,) = problem.predictions(z)
    channels = np.array(experiment.channels)
    current, torque = readings[:, channels == "current"], readings[:, channels == "torque"]
    assert np.abs(current).max() > 0.1
    assert current * 1.1 * file.servo.torque_constant == pytest.approx(torque, rel=1e-9, abs=1e-12)


def test_a_term_near_0_moves() -> None:
    """On a scale that begins at 0: the Coulomb friction of mx64_m6 is 6e-7 N m."""
    robot = measured("m6")
    rows = {row.key: row for row in chosen_unknowns(robot, [], GROUPS)}
    row = rows["servo.coulomb_friction"]
    assert row.value(1.0, robot.servo.coulomb_friction) > 0.1
    assert row.value(-1.0, robot.servo.coulomb_friction) == 0.0


def test_the_terms_of_a_model_are_those_of_equation_50() -> None:
    """From M1, whose file has Coulomb and viscous friction alone."""
    variants = {model: with_friction_model(measured("m1"), model) for model in TERMS}
    rows = {model: chosen_unknowns(robot, [], GROUPS) for model, robot in variants.items()}
    keys = {model: {row.key for row in own} for model, own in rows.items()}
    both = {"servo.load_friction", "servo.stribeck_load_friction"}
    speeds = {"servo.stribeck_speed", "servo.stribeck_exponent"}
    assert keys["m2"] - keys["m1"] == {"servo.stribeck_friction", *speeds}
    assert keys["m3"] - keys["m1"] == {"servo.load_friction"}
    assert keys["m4"] - keys["m2"] == both
    assert keys["m5"] - keys["m2"] == {
        "servo.motor_load_friction", "servo.external_load_friction",
        "servo.stribeck_motor_load_friction", "servo.stribeck_external_load_friction",
    }  # fmt: skip
    assert keys["m6"] - keys["m5"] == {
        "servo.quadratic_motor_friction", "servo.quadratic_external_friction"
    }  # fmt: skip
    # one coefficient of M3 is that of both torques
    row = next(row for row in rows["m3"] if row.key == "servo.load_friction")
    servo = row.write(variants["m3"], 0.3).servo
    assert (servo.motor_load_friction, servo.external_load_friction) == (0.3, 0.3)


@pytest.fixture(scope="module")
def elastic() -> Robot:
    """The robot as it is known: with elastic gears and play."""
    robot = load_robot("athena")
    servo = replace(robot.servo, gear_stiffness=300.0, gear_damping=0.1, backlash=0.004)
    return replace(robot, servo=servo)


@pytest.fixture(scope="module")
def rotors(plant_build: Path, elastic: Robot, tmp_path_factory: pytest.TempPathFactory) -> Secret:
    """A robot with elastic gears, with the angles of rotors in its log."""
    folder, seen = tmp_path_factory.mktemp("elastic"), (*SEEN, "motor_angle")
    return secret_robot(1, folder, duration=1.8, groups=GROUPS, file=elastic, seen=seen)


@pytest.fixture(scope="module")
def plant(elastic: Robot, tmp_path_factory: pytest.TempPathFactory) -> LogPlant:
    return LogPlant(export_fmu(elastic, tmp_path_factory.mktemp("file") / "file.fmu"), TOLERANCE)


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


def test_angles_of_rotors_say_most_of_the_elasticity_and_a_pose_too_little(
    plant: LogPlant, elastic: Robot, rotors: Secret
) -> None:
    """Links' angles alone determine it as well where all but the servo is known."""
    whole = make_experiment(rotors.log, 0, 0.0, forget=FORGOTTEN)
    links = tuple(f".{joint}.angle" for joint in JOINT_NAMES)
    with_rotors, with_links, with_pose = (
        deviations(
            plant,
            elastic,
            rotors,
            whole.without([name for name in whole.columns if not name.endswith(ends)]),
        )
        for ends in ((*links, ".motor_angle"), links, ("torso.roll", "torso.pitch", "torso.yaw"))
    )
    for key in GEAR:
        assert with_rotors[key] < DETERMINED, key
        assert 2.0 * with_rotors[key] < with_links[key] < 0.5 * with_pose[key], key
    assert with_pose["servo.gear_damping"] > DETERMINED


def test_stiffness_and_play_of_gears_are_found(
    plant: LogPlant, elastic: Robot, rotors: Secret
) -> None:
    rows = chosen_unknowns(elastic, [rotors.log], GROUPS)
    experiment = make_experiment(rotors.log, 0, 0.0, forget=FORGOTTEN)
    found = fit(Problem(plant, elastic, [experiment], rows))
    assert found.unexplained == {}
    for row in rows:
        if row.key in (*GEAR, "servo.kp", "servo.kd", "servo.coulomb_friction"):
            deviation = found.deviations[row.key]
            low, high = row.interval(found.values[row.key], ALL_WITHIN * deviation)
            assert low < rotors.values[row.key] < high, row.key
            assert deviation < 0.2 * DETERMINED, row.key


def test_gears_that_the_robot_file_has_rigid_are_not_sought(rotors: Secret) -> None:
    keys = {row.key for row in chosen_unknowns(load_robot("athena"), [rotors.log], GROUPS)}
    assert not keys & set(GEAR)
