"""Tests replays of recordings, and the log of examples/05_robot_log.py,
identified as a user does.
"""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command import Call, assert_refused
from secret_robots import with_column

from hexapod_cosim.cosim.results.recordings import read_parquet, write_csv
from hexapod_cosim.extensions.identify.log import Log, read_log, roll_pitch_yaw
from hexapod_cosim.extensions.identify.replay import replay
from hexapod_cosim.extensions.identify.start import initial_state, rest_rows
from hexapod_cosim.models import load_robot

ROUND_OFF = 1e-9  # of joint angles, in rad, and of forces, in N: numbers are computed from states


@pytest.fixture(scope="module")
def log(recorded: Path) -> Log:
    return read_log(recorded / "results.parquet")


def test_a_recording_of_the_fmu_drives_it_to_the_same_readings(log: Log, athena_fmu: Path) -> None:
    done = replay(log, load_robot("athena"), fmu=athena_fmu)
    assert len(done.names) == 108
    assert {one.channel for one in done.channels} == {
        "angle", "speed", "torque", "current", "normal_force", "force",
        "gyroscope", "accelerometer", "position", "attitude",
    }  # fmt: skip
    assert max(one.largest for one in done.columns) < ROUND_OFF


def test_all_formats_of_a_log_are_replayed_alike(
    log: Log, recorded: Path, athena_fmu: Path, tmp_path: Path
) -> None:
    write_csv(read_parquet(recorded / "results.parquet"), tmp_path / "log.csv", units=True)
    robot = load_robot("athena")
    first = replay(log, robot, fmu=athena_fmu).simulated
    for path in (tmp_path / "log.csv", recorded / "results.mcap"):
        assert replay(read_log(path), robot, fmu=athena_fmu).simulated.data.tobytes() == (
            first.data.tobytes()
        )


def test_another_robot_does_not_move_as_the_log_says(log: Log) -> None:
    robot = load_robot("athena")
    done = replay(log, replace(robot, servo=replace(robot.servo, kp=30.0)))
    errors = {one.channel: one.rms for one in done.channels}
    assert errors["angle"] > 1e-3
    assert errors["torque"] > 1e-2


def test_a_log_from_the_middle_of_a_walk_begins_with_its_state(log: Log, athena_fmu: Path) -> None:
    later = log.part(slice(20, None))
    assert rest_rows(later) == 1
    done = replay(later, load_robot("athena"), fmu=athena_fmu)
    errors = {one.channel: one.rms for one in done.channels}
    # the contacts' memory of the touch-down is no reading
    assert errors["angle"] < 1e-4
    assert errors["position"] < 1e-4


def test_a_log_without_a_pose_begins_with_the_feet_on_the_ground(
    log: Log, athena_fmu: Path
) -> None:
    blind = log.without([name for name in log.recording.names if name.startswith("torso.")])
    robot = load_robot("athena")
    height = initial_state(log, robot)["initial.position[3]"]
    assert initial_state(blind, robot)["initial.position[3]"] == pytest.approx(height, abs=2e-4)
    errors = {one.channel: one.rms for one in replay(blind, robot, fmu=athena_fmu).channels}
    assert set(errors) == {
        "angle", "speed", "torque", "current", "normal_force", "force", "gyroscope", "accelerometer"
    }  # fmt: skip
    assert errors["angle"] < 1e-3


def test_roll_pitch_and_yaw_are_the_plants(recorded: Path) -> None:
    recording = read_parquet(recorded / "results.parquet")
    angles = roll_pitch_yaw(recording.vector("torso.quaternion", 4))
    expected = recording.columns(["torso.roll", "torso.pitch", "torso.yaw"])
    assert angles == pytest.approx(expected, abs=1e-12)


def test_a_replay_names_wrong_readings_and_no_others(log: Log, athena_fmu: Path) -> None:
    robot = load_robot("athena")
    assert replay(log, robot, fmu=athena_fmu).warnings == []
    dead = with_column(log, "LM.femur.torque", lambda y: np.full_like(y, 0.3))
    done = replay(dead, robot, fmu=athena_fmu)
    assert done.warnings == ["LM.femur.torque cannot be the robot's: dead: 0.3 in every row."]


def test_the_command_writes_table_rows_and_report(
    call: Call, recorded: Path, tmp_path: Path, athena_fmu: Path
) -> None:
    place = tmp_path / "out"
    code, out, err = call(
        "replay", recorded / "results.mcap", "-o", place, "--fmu", athena_fmu, "--json"
    )
    assert code == 0
    assert json.loads(out)["warnings"] == []
    assert "warning" not in err
    assert {path.name for path in place.iterdir()} == {
        "replay.csv", "results.parquet", "report.html", "run.json"
    }  # fmt: skip
    channels = {one["channel"]: one for one in json.loads(out)["channels"]}
    assert channels["torque"]["columns"] == 18
    assert channels["torque"]["rms"] < ROUND_OFF
    with (place / "replay.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["name"] for row in rows][:2] == ["LF.coxa.angle", "LF.femur.angle"]
    page = (place / "report.html").read_text(encoding="utf-8")
    assert "Servo torques" in page
    assert "LF.coxa.torque" in page
    assert_refused(call("report", place), "hexapod replay", "run it again")


# The log of examples/05_robot_log.py, identified as a user does: its secret numbers are found, the
# search ends at the optimum, and nothing is warned of.

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "05_robot_log.py"
SECRET = {
    "servo.kp": 34.0,
    "servo.coulomb_friction": 0.08,
    "friction.mu": 0.55,
    "torso.mass": 2.9,
    "contact.stiffness": 1.074e6,  # as in the robot file
}


def test_the_robot_of_the_example_is_identified(
    call: Call, tmp_path: Path, plant_build: Path
) -> None:
    log, place = tmp_path / "log.mcap", tmp_path / "out"
    subprocess.run([sys.executable, str(EXAMPLE), str(log)], check=True, capture_output=True)
    groups = [word for name in ("servo", "mass", "contact") for word in ("--find", name)]
    code, out, err = call("identify", log, "-o", place, *groups, "--json")
    assert code == 0
    assert "warning" not in err
    result = json.loads(out)
    assert result["deviations_from_optimum"] < 1.0
    own = {one["key"]: one for one in result["estimates"]}
    for key, value in SECRET.items():
        assert own[key]["determined"], key
        assert own[key]["low"] <= value <= own[key]["high"], key
    assert not own["links.coxa.mass"]["determined"]  # it adds to that of the torso
    before, after = (
        {one["channel"]: one[side] for one in result["held_out"]} for side in ("before", "after")
    )
    # the noise of the sensors is left
    assert after["torque"] < 0.031
    assert before["torque"] > 3.0 * after["torque"]
