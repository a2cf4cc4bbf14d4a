"""Units and signs of whole channels, of IMU and pose are named, and nothing else is; a log whose
pose is wrong starts on its legs; names and units of columns that a file should not have are named.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from secret_robots import GROUPS, Secret, secret_robot

from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.results.recordings import write_csv
from hexapod_cosim.extensions.identify.channel_screening import turned_after_the_fit
from hexapod_cosim.extensions.identify.experiment import Experiment
from hexapod_cosim.extensions.identify.identify import TOLERANCE, screen
from hexapod_cosim.extensions.identify.log import CHANNELS, Log, LogError, log_of, read_log
from hexapod_cosim.extensions.identify.log_plant import LogPlant
from hexapod_cosim.extensions.identify.replay import replay
from hexapod_cosim.extensions.identify.screening import left_out
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
def plant(athena_fmu: Path) -> LogPlant:
    return LogPlant(athena_fmu, TOLERANCE)


def changed(log: Log, names: tuple[str, ...], change: Change) -> Log:
    data, all_names = log.recording.data.copy(), log.recording.names
    for name in names:
        data[:, all_names.index(name)] = change(data[:, all_names.index(name)])
    return Log(Recording(all_names, data), log.where)


def thousandfold(column: np.ndarray) -> np.ndarray:
    return 1000.0 * column


def in_g(column: np.ndarray) -> np.ndarray:
    return column / 9.81


WRONG: dict[str, tuple[tuple[str, ...], Change, str]] = {
    "torques in mN m": (COLUMNS["torque"], thousandfold, "not in N m: "),
    "turned torques": (COLUMNS["torque"], np.negative, "wrong sign"),
    "turned forces": (COLUMNS["normal_force"], np.negative, "wrong sign"),
    "turned speeds": (COLUMNS["speed"], np.negative, "wrong sign"),
    "gyroscope in degrees": (COLUMNS["gyroscope"], np.degrees, "in degrees"),
    "accelerometer in g": (COLUMNS["accelerometer"], in_g, "reads 1.01 m/s2 instead of 9.8"),
    "turned accelerometer": (COLUMNS["accelerometer"], np.negative, "upwards"),
    "z of the accelerometer": (("imu.specific_force[3]",), np.negative, "upwards"),
    "position in mm": (COLUMNS["position"], thousandfold, "not in m: "),
    "attitude in degrees": (COLUMNS["attitude"], np.degrees, "in degrees"),
    "turned pitch": (("torso.pitch",), np.negative, "wrong sign"),
    "turned x": (("torso.position[1]",), np.negative, "wrong sign"),
    "turned z": (("torso.position[3]",), np.negative, "m at rest, where the legs hold"),
    "turned yaw": (("torso.yaw",), np.negative, "wrong sign"),
    "turned turning": (("imu.angular_velocity[3]",), np.negative, "wrong sign"),
    "roll in degrees": (("torso.roll",), np.degrees, "in degrees"),
}


def named(plant: LogPlant, log: Log) -> dict[str, str]:
    _, bad = screen(plant, load_robot("athena"), [log], groups=GROUPS)
    return {column.name: column.why for _, column in bad}


@pytest.mark.parametrize("what", WRONG)
def test_a_wrong_unit_or_sign_is_named_and_nothing_else(
    what: str, secret: Secret, plant: LogPlant
) -> None:
    names, change, why = WRONG[what]
    found = named(plant, changed(secret.log, names, change))
    assert set(found) == set(names)
    assert all(why in text for text in found.values()), found


def test_a_good_log_has_no_wrong_channel(secret: Secret, plant: LogPlant) -> None:
    assert named(plant, secret.log) == {}


def test_columns_of_the_body_are_judged_again_after_the_fit(secret: Secret) -> None:
    """Before it the simulation of another robot tells too little of quick or small motions."""
    columns = secret.columns
    whole = slice(0, len(secret.log.time))
    for name in ("imu.angular_velocity[1]", "imu.specific_force[2]", "torso.position[2]"):
        log = changed(secret.log, (name,), np.negative)
        one = Experiment(log=log, number=0, columns=columns, fitted=whole, held_out=slice(0, 0))
        (bad,) = turned_after_the_fit(one, secret.clean)
        assert bad.name == name
        assert bad.why.startswith("wrong sign: its correlation with the simulation is -")


@pytest.mark.parametrize("change", [thousandfold, np.negative, lambda y: np.full_like(y, np.nan)])
def test_a_wrong_height_does_not_move_the_start(secret: Secret, change: Change) -> None:
    robot = load_robot("athena")
    sound = initial_state(secret.log, robot)
    start = initial_state(changed(secret.log, ("torso.position[3]",), change), robot)
    assert start["initial.position[3]"] == pytest.approx(sound["initial.position[3]"], abs=0.02)
    assert start["initial.position[1]"] == sound["initial.position[1]"]


def test_a_wrong_attitude_does_not_move_the_start(secret: Secret) -> None:
    robot = load_robot("athena")
    gap = changed(secret.log, COLUMNS["attitude"], lambda y: np.full_like(y, np.nan))
    leaning = changed(secret.log, ("torso.roll",), lambda y: y + 1.0)
    for log in (gap, leaning):
        start = initial_state(log, robot)
        assert start["initial.quaternion[1]"] == pytest.approx(1.0, abs=1e-3)


def test_gaps_at_the_start_are_filled_by_the_rows_around_them(secret: Secret) -> None:
    def gap(column: np.ndarray) -> np.ndarray:
        return np.where(np.arange(len(column)) < 3, np.nan, column)

    names = (*COLUMNS["position"], *COLUMNS["attitude"])
    start = initial_state(changed(secret.log, names, gap), load_robot("athena"))
    sound = initial_state(secret.log, load_robot("athena"))
    assert list(start.values()) == pytest.approx(list(sound.values()), abs=1e-4)


def test_a_replay_says_of_a_whole_channel_one_sentence(secret: Secret, athena_fmu: Path) -> None:
    log = changed(secret.log, COLUMNS["normal_force"], np.negative)
    (text,) = replay(log, load_robot("athena"), fmu=athena_fmu).warnings
    assert text.startswith(
        "All 6 columns of 'Normal forces of feet' cannot be the robot's: wrong sign"
    )
    assert left_out([]) == []


def test_unknown_names_are_left_out_and_said(secret: Secret) -> None:
    names = [name.replace("coxa.torque", "coxa.torqe") for name in secret.log.recording.names]
    names[names.index("torso.roll")] = "battery"
    log = log_of(Recording(tuple(names), secret.log.recording.data), "x.csv")
    assert log.warnings == [
        "Columns of x.csv with unknown names are left out: "
        "LF.coxa.torqe (did you mean LF.coxa.torque?), "
        "LM.coxa.torqe (did you mean LM.coxa.torque?), "
        "LR.coxa.torqe (did you mean LR.coxa.torque?), "
        "RF.coxa.torqe (did you mean RF.coxa.torque?), "
        "RM.coxa.torqe (did you mean RM.coxa.torque?) and 2 more."
    ]
    assert log.part(slice(0, 20)).without(["RR.tibia.torque"]).unknown == log.unknown
    assert secret.log.warnings == []


def test_a_missing_command_names_the_column_that_may_be_meant(secret: Secret) -> None:
    names = [name.replace(".angle_ref", "_angle_ref") for name in secret.log.recording.names]
    with pytest.raises(LogError, match=r"the file has 'LF\.coxa_angle_ref'"):
        log_of(Recording(tuple(names), secret.log.recording.data), "x.csv")


def test_milliseconds_are_named(secret: Secret) -> None:
    data = secret.log.recording.data.copy()
    data[:, 0] *= 1000.0
    with pytest.raises(LogError, match=r"5 s from row to row.*divide milliseconds by 1000"):
        log_of(Recording(secret.log.recording.names, data), "x.csv")


def test_a_heading_in_another_unit_is_refused(secret: Secret, tmp_path: Path) -> None:
    write_csv(secret.log.part(slice(0, 20)).recording, tmp_path / "log.csv", units=True)
    text = (tmp_path / "log.csv").read_text(encoding="utf-8")
    for spelling in ("[N m]", "[Nm]"):
        (tmp_path / "same.csv").write_text(text.replace("[N.m]", spelling), encoding="utf-8")
        assert read_log(tmp_path / "same.csv").has(COLUMNS["torque"])
    wrong = text.replace("RM.femur.angle [rad]", "RM.femur.angle [deg]")
    (tmp_path / "wrong.csv").write_text(wrong, encoding="utf-8")
    with pytest.raises(HexapodError, match=r"RM\.femur\.angle \[deg\].*RM\.femur\.angle \[rad\]"):
        read_log(tmp_path / "wrong.csv")
