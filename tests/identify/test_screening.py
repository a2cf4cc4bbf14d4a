"""Dead and wrong columns of a log are named, and nothing else is; a log whose pose is wrong starts
on its legs; names and units that a file should not have are named.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from secret_robots import DAMAGES, GROUPS, Secret, secret_robot, with_column

from hexapod_cosim.cosim.interface.names import joint_names
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.results.recordings import write_csv
from hexapod_cosim.extensions.identify.identification import TOLERANCE, screen
from hexapod_cosim.extensions.identify.log import (
    CHANNELS,
    Log,
    LogError,
    log_of,
    read_log,
    with_speed_references,
)
from hexapod_cosim.extensions.identify.plant import LogPlant
from hexapod_cosim.extensions.identify.screening import BadColumn, left_out
from hexapod_cosim.extensions.identify.start import initial_state
from hexapod_cosim.models import HexapodError, load_robot

Change = Callable[[np.ndarray], np.ndarray]
COLUMNS = {channel.key: channel.names for channel in CHANNELS}
DURATION = 5.0  # s    the walk turns, and leans forwards and sideways


@pytest.fixture(scope="module")
def secret(plant_build: Path, tmp_path_factory: pytest.TempPathFactory) -> Secret:
    folder = tmp_path_factory.mktemp("secret")
    return secret_robot(3, folder, duration=DURATION, groups=GROUPS)


@pytest.fixture(scope="module")
def log(secret: Secret) -> Log:
    return secret.log


@pytest.fixture(scope="module")
def plant(athena_fmu: Path) -> LogPlant:
    return LogPlant(athena_fmu, TOLERANCE)


def changed(log: Log, names: tuple[str, ...], change: Change) -> Log:
    for name in names:
        log = with_column(log, name, change)
    return log


def thousandfold(column: np.ndarray) -> np.ndarray:
    return 1000.0 * column


WRONG: dict[str, tuple[tuple[str, ...], Change, str]] = {
    "nothing": ((), np.negative, ""),
    "torques in mN m": (COLUMNS["torque"], thousandfold, "not in N m: "),
    "turned torques": (COLUMNS["torque"], np.negative, "wrong sign"),
    "turned forces": (COLUMNS["normal_force"], np.negative, "wrong sign"),
    "turning in degrees": (("imu.angular_velocity[3]",), np.degrees, "in degrees"),
    "position in mm": (COLUMNS["position"][:2], thousandfold, "not in m: "),
    "attitude in degrees": (COLUMNS["attitude"], np.degrees, "in degrees"),
    "dead torque": (("LF.femur.torque",), lambda y: np.full_like(y, 0.3), "dead: 0.3 in every row"),
    "turned torque": (("RM.tibia.torque",), np.negative, "wrong sign"),
    "angle in degrees": (("LR.coxa.angle",), np.degrees, "in degrees: 5"),
    "gaps": (("RR.tibia.angle",), DAMAGES["missing"], "no number in "),
    "stuck force": (("LM.foot.normal_force",), DAMAGES["stuck"], "stuck at"),
}


@pytest.mark.parametrize("what", WRONG)
def test_a_dead_or_wrong_reading_is_named_and_nothing_else(
    what: str, log: Log, plant: LogPlant
) -> None:
    names, change, why = WRONG[what]
    _, bad = screen(plant, load_robot("athena"), [changed(log, names, change)], groups=GROUPS)
    assert {column.name for _, column in bad} == set(names)
    assert all(re.search(why, column.why) for _, column in bad), bad


def test_a_channel_that_is_dead_as_a_whole_is_one_sentence() -> None:
    """Ideal servos report no currents."""
    bad = [BadColumn(name, "dead: 0 in every row") for name in COLUMNS["current"]]
    own = BadColumn("LF.coxa.angle", "wrong sign")
    assert left_out([*bad, own]) == [
        "All 18 columns of 'Servo currents' are left out: dead: 0 in every row.",
        "LF.coxa.angle is left out: wrong sign.",
    ]
    assert len(left_out(bad[:17])) == 17


def test_gaps_at_the_start_are_filled_by_the_rows_around_them(log: Log) -> None:
    def gap(column: np.ndarray) -> np.ndarray:
        return np.where(np.arange(len(column)) < 3, np.nan, column)

    names = (*COLUMNS["position"], *COLUMNS["attitude"])
    start = initial_state(changed(log, names, gap), load_robot("athena"))
    sound = initial_state(log, load_robot("athena"))
    assert list(start.values()) == pytest.approx(list(sound.values()), abs=1e-4)


@pytest.mark.parametrize("wrong", [np.degrees, np.negative, lambda y: np.full_like(y, np.nan)])
def test_a_joint_whose_angle_is_wrong_starts_where_it_is_commanded(log: Log, wrong: Change) -> None:
    robot = load_robot("athena")
    start = initial_state(with_column(log, "LF.tibia.angle", wrong), robot)
    sound = initial_state(log, robot)
    commanded = log.recording.column("LF.tibia.angle_ref")[0]
    assert start["initial.LF.tibia.angle"] == pytest.approx(commanded, abs=1e-9)
    assert abs(sound["initial.LF.tibia.angle"] - commanded) > 1e-4
    assert start["initial.LM.tibia.angle"] == sound["initial.LM.tibia.angle"]


def test_unknown_names_are_left_out_and_said(log: Log) -> None:
    names = [name.replace("coxa.torque", "coxa.torqe") for name in log.recording.names]
    names[names.index("torso.roll")] = "battery"
    found = log_of(Recording(tuple(names), log.recording.data), "x.csv")
    (text,) = found.warnings
    assert text.startswith("Columns of x.csv with unknown names are left out: LF.coxa.torqe, LM.")
    assert found.part(slice(0, 20)).without(["RR.tibia.torque"]).warnings == found.warnings
    assert log.warnings == ()


def test_unusable_logs_are_refused(log: Log, tmp_path: Path) -> None:
    recording, data = log.recording, log.recording.data
    names = [name.replace(".angle_ref", "_angle_ref") for name in recording.names]
    with pytest.raises(LogError, match=r"no column 'LF\.coxa\.angle_ref' and 17 more"):
        log_of(Recording(tuple(names), data), "x.csv")
    with pytest.raises(LogError, match="3 rows"):
        log_of(Recording(recording.names, data[:3]), "x.csv")
    slow, twice = data.copy(), data.copy()
    slow[:, 0] *= 1000.0
    twice[5, 0] = twice[4, 0]
    with pytest.raises(LogError, match=r"5 s from row 0 to row 1.*divide milliseconds by 1000"):
        log_of(Recording(recording.names, slow), "x.csv")
    with pytest.raises(LogError, match="0 s from row 4 to row 5"):
        log_of(Recording(recording.names, twice), "x.csv")
    gap = with_column(
        log, "RM.tibia.angle_ref", lambda y: np.where(np.arange(len(y)) == 7, np.nan, y)
    )
    with pytest.raises(LogError, match=r"RM\.tibia\.angle_ref at 0\.035 s"):
        log_of(gap.recording, "x.csv")
    degrees = with_column(log, "LF.tibia.angle_ref", np.degrees)
    with pytest.raises(LogError, match=r"LF\.tibia\.angle_ref up to .*convert degrees"):
        log_of(degrees.recording, "x.csv")
    with pytest.raises(LogError, match="name the log's file, not its folder"):
        read_log(tmp_path)


def test_a_heading_in_another_unit_is_refused(log: Log, tmp_path: Path) -> None:
    write_csv(log.part(slice(0, 20)).recording, tmp_path / "log.csv", units=True)
    text = (tmp_path / "log.csv").read_text(encoding="utf-8")
    for spelling in ("[N m]", "[Nm]"):
        (tmp_path / "same.csv").write_text(text.replace("[N.m]", spelling), encoding="utf-8")
        assert read_log(tmp_path / "same.csv").has(COLUMNS["torque"])
    wrong = text.replace("RM.femur.angle [rad]", "RM.femur.angle [deg]")
    (tmp_path / "wrong.csv").write_text(wrong, encoding="utf-8")
    with pytest.raises(HexapodError, match=r"RM\.femur\.angle \[deg\].*RM\.femur\.angle \[rad\]"):
        read_log(tmp_path / "wrong.csv")


def test_missing_speed_commands_are_the_rates_of_the_angles_where_kd_needs_them(log: Log) -> None:
    """Speed commands of 0 would make the angles' error of a replay more than twice as large."""
    robot, speeds = load_robot("athena"), joint_names("speed_ref")
    assert with_speed_references(log, robot) is log
    found = with_speed_references(log.without(speeds[:2]), robot)
    assert np.array_equal(found.recording.column(speeds[2]), log.recording.column(speeds[2]))
    rates = np.gradient(log.recording.column("LF.coxa.angle_ref"), log.time)
    assert found.recording.column(speeds[0]) == pytest.approx(rates, abs=1e-12)
    assert "speed commands of 2 joints" in found.warnings[0]
    (text,) = with_speed_references(log.without(speeds), robot).warnings
    assert "has no speed commands (LF.coxa.speed_ref [rad/s], ...)" in text
