"""Logs of measured servos: which readings determine their numbers, what is found, and a wrong
friction model is warned of.
"""

from __future__ import annotations

import tomllib
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import tomlkit
from secret_robots import SEEN, Secret, secret_robot
from test_bench import made_log

from benchmarks.identify.servos import with_kept
from hexapod_cosim.cosim.export.plant import export_fmu
from hexapod_cosim.extensions.identify.bench.choice import choose
from hexapod_cosim.extensions.identify.bench.command import (
    error_rows,
    result_table,
    servo_text,
    worth,
)
from hexapod_cosim.extensions.identify.fitting.problem import Problem
from hexapod_cosim.extensions.identify.identification import Identified, identify, make_experiment
from hexapod_cosim.extensions.identify.numbers.servo import TERMS, with_friction_model
from hexapod_cosim.extensions.identify.plant import LogPlant
from hexapod_cosim.extensions.identify.results import open_text, warnings
from hexapod_cosim.extensions.identify.robot_file import write_robot
from hexapod_cosim.extensions.identify.unknowns import ROBOT, chosen_unknowns
from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.robot import robot_path
from hexapod_cosim.models.servos.motor import back_emf_damping
from hexapod_cosim.models.servos.presets import measured_servo, servo_table

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
    (stays,) = [key for key in MOTOR if own[key].value == own[key].before]
    (carries,) = [key for key in MOTOR if key != stays]
    true = back_emf_damping(secret.robot.servo)
    assert back_emf_damping(blind.robot.servo) == pytest.approx(true, rel=0.05)
    inside = [one.low <= secret.values[one.key] <= one.high for one in own.values()]
    assert all(inside), [key for key, good in zip(own, inside, strict=True) if not good]
    assert "Currents would determine both" in open_text(blind)
    write_robot(blind, str(written(tmp_path)), tmp_path / "robot.toml", ["log.csv"])
    source = tomllib.loads((tmp_path / "robot.toml").read_text(encoding="utf-8"))["source"]
    assert source[stays] == "not determined by log.csv: as before"
    assert source[carries].startswith("not determined by log.csv alone")


def written(folder: Path) -> Path:
    """Writes athena's robot file with a measured servo."""
    document = tomlkit.parse(robot_path("athena").read_text(encoding="utf-8"))
    document["servo"] = {"model": "mx64_m6"}
    path = folder / "measured.toml"
    path.write_text(tomlkit.dumps(document), encoding="utf-8")
    return path


def test_a_wrong_friction_model_is_warned_of(secret: Secret) -> None:
    log = secret.log.part(slice(0, 440))
    (text,) = warnings(identify([log], measured("m1"), groups=GROUPS))
    assert "does not explain this log" in text
    assert "--friction" in text


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
        problem = Problem([plant], file, [experiment], rows)
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


def test_a_start_that_no_model_beats_is_said_to_be_better() -> None:
    """The start made the logs, and friction alone is fitted to few noisy rows."""
    time = 0.005 * np.arange(200)
    true = replace(measured_servo("xl330_m4").servo, current_max=0.9)
    logs = [made_log(true, np.sin(3.0 * time), gain=gain) for gain in (0.6, 2.4)]
    robot = replace(load_robot("athena"), servo=true)
    with ThreadPoolExecutor(1) as pool:
        found = choose(logs, robot, pool, models=["m1"])
    assert found.start.angle < 0.01 < found.models["m1"].angle
    assert [row[0] for row in error_rows(found)] == ["start", "m1"]
    assert result_table(found)["start"]["servo"] == "xl330_m4"
    assert "xl330_m4, errs by 0.00 degrees, and no model errs less: keep" in worth(found, "gain")
    text = servo_text(found, "gain")
    table = tomllib.loads(text)["servo"]
    assert text.startswith("# xl330, ")
    assert "Logs: made, made" in text
    assert not [key for key in table if "stribeck" in key]
    assert table["duty_gain"] == 2.4
    digits = [len(f"{one!r}".partition("e")[0].replace(".", "").lstrip("0")) for one in
              table.values() if isinstance(one, float)]  # fmt: skip
    assert max(digits) == 7
    kept = servo_table(table, "servo")
    assert kept["torque_constant"] == pytest.approx(found.fit.robot.servo.torque_constant, rel=1e-6)


def test_rows_of_motors_without_logs_are_kept(tmp_path: Path) -> None:
    before = ["xl330_m1", "xl330, m1 fitted", "sts3215_m1", "sts3215", "sts3250, m6 fitted"]
    text = "\n".join(["servo,logs", *(f'"{name}",1' for name in before)])
    (tmp_path / "servos.csv").write_text(text, encoding="utf-8")
    rows = [{"servo": "sts3215_12v", "logs": "2"}, {"servo": "sts3215, m1 fitted", "logs": "2"}]
    kept = with_kept(rows, tmp_path / "servos.csv")
    assert [(row["servo"], row["logs"]) for row in kept] == [
        ("xl330_m1", "1"), ("xl330, m1 fitted", "1"), ("sts3215_12v", "2"),
        ("sts3215, m1 fitted", "2"), ("sts3250, m6 fitted", "1"),
    ]  # fmt: skip
    assert with_kept(rows, tmp_path / "none.csv") == rows
