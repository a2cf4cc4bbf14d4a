"""Friction models of measured servos: a wrong one is rejected and none of its numbers is told, the
right one is named, and a term that is 0 in the robot file moves.
"""

from __future__ import annotations

import json
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest
import tomlkit
from command import Call
from secret_robots import SEEN, Secret, secret_robot

from hexapod_cosim.cosim.logs.mcap_writer import write_mcap
from hexapod_cosim.extensions.identify.fitting.friction_search import FrictionTrial
from hexapod_cosim.extensions.identify.identified import Identified
from hexapod_cosim.extensions.identify.identify import identify
from hexapod_cosim.extensions.identify.identify_tables import friction_text, untold_text, warnings
from hexapod_cosim.extensions.identify.numbers.friction_models import with_friction_model
from hexapod_cosim.extensions.identify.unknowns import chosen_unknowns
from hexapod_cosim.models import HexapodError, Robot, load_robot
from hexapod_cosim.models.robot import robot_path
from hexapod_cosim.models.servos.presets import measured_servo

DURATION = 2.2  # s


def measured(model: str) -> Robot:
    """Returns athena with a measured servo."""
    return replace(load_robot("athena"), servo=measured_servo(f"mx64_{model}").servo)


@pytest.fixture(scope="module")
def secret(plant_build: Path, tmp_path_factory: pytest.TempPathFactory) -> Secret:
    folder = tmp_path_factory.mktemp("m6")
    seen = (*SEEN, "current")
    return secret_robot(
        61, folder, duration=DURATION, groups=("servo",), file=measured("m6"), seen=seen
    )


@pytest.fixture(scope="module")
def wrong(secret: Secret) -> Identified:
    return identify([secret.log], measured("m1"), groups=("servo",))


def test_a_wrong_friction_model_tells_no_number(wrong: Identified) -> None:
    """Before, Coulomb and viscous friction were told far from any that the servo has."""
    assert wrong.rejected
    assert not any(one.told for one in wrong.estimates)
    assert wrong.robot == measured("m1")
    assert [one.value for one in wrong.estimates] == [one.before for one in wrong.estimates]
    (text,) = warnings(wrong)
    assert "reject the model" in text
    assert "--friction best" in text
    assert untold_text(wrong) == "The logs reject the model, so they tell no number."


def test_the_criterion_counts_numbers() -> None:
    one = FrictionTrial("m4", 10, 100.0, 150.0)
    assert friction_text([one, FrictionTrial("m6", 14, 99.0, 165.0)]).startswith(
        "Of the friction models M1 to M6, M4 explains the logs best; the next one, M6, has a "
        "criterion larger by 15.0"
    )


def test_the_command_writes_the_friction_model_that_it_tried(
    call: Call, secret: Secret, tmp_path: Path
) -> None:
    """Of the log of an M6 servo, from a file with M1."""
    log, file, place = tmp_path / "log.mcap", tmp_path / "m1.toml", tmp_path / "out"
    write_mcap(secret.log.recording, log)
    document = tomlkit.parse(robot_path("athena").read_text(encoding="utf-8"))
    document["servo"] = {"model": "mx64_m1"}
    file.write_text(tomlkit.dumps(document), encoding="utf-8")
    code, out, err = call(
        "identify", log, "--robot", file, "--find", "servo", "--friction", "best",
        "--no-propose", "--workers", 1, "-o", place, "--json",
    )  # fmt: skip
    assert code == 0, err
    assert "reject the model" not in err
    trials = json.loads(out)["friction_models"]
    assert trials[0]["model"] in ("m5", "m6")
    criteria = [one["criterion"] for one in trials]
    assert criteria == sorted(criteria)
    of_m1 = next(one["criterion"] for one in trials if one["model"] == "m1")
    assert of_m1 > criteria[0] + 100.0
    told = friction_text([FrictionTrial(**one) for one in trials])
    assert f"{trials[0]['model'].upper()} explains" in told
    servo = load_robot(place / "robot.toml").servo
    # terms that the file's M1 does not have
    assert servo.external_load_friction == pytest.approx(
        secret.robot.servo.external_load_friction, rel=0.1
    )
    assert (servo.motor_load_friction, servo.stribeck_friction) != (0.0, 0.0)
    written = tomllib.loads((place / "robot.toml").read_text(encoding="utf-8"))
    assert "log.mcap" in written["source"]["servo.external_load_friction"]


def test_a_term_near_0_moves() -> None:
    """On a scale that begins at 0: the Coulomb friction of mx64_m6 is 6e-7 N m."""
    robot = measured("m6")
    rows = {row.key: row for row in chosen_unknowns(robot, [], ("servo",))}
    row = rows["servo.coulomb_friction"]
    assert row.value(1.0, robot.servo.coulomb_friction) > 0.1
    assert row.value(-1.0, robot.servo.coulomb_friction) == 0.0


def test_the_terms_of_a_model_are_those_of_equation_50() -> None:
    """From M1, whose file has Coulomb and viscous friction alone."""
    keys = {
        model: {
            row.key
            for row in chosen_unknowns(with_friction_model(measured("m1"), model), [], ("servo",))
        }
        for model in ("m1", "m2", "m3", "m4", "m5", "m6")
    }
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
    assert with_friction_model(measured("m6"), "m6") != measured("m6")  # its external load moves


def test_one_coefficient_of_m3_is_that_of_both_torques() -> None:
    robot = with_friction_model(measured("m1"), "m3")
    row = next(
        row for row in chosen_unknowns(robot, [], ("servo",)) if row.key == "servo.load_friction"
    )
    assert row.write is not None
    servo = row.write(robot, 0.3).servo
    assert (servo.motor_load_friction, servo.external_load_friction) == (0.3, 0.3)


def test_an_ideal_servo_has_no_friction_model() -> None:
    with pytest.raises(HexapodError, match="friction models are those of measured servos"):
        with_friction_model(load_robot("athena"), "m6")
