"""Wrong columns of commands are named, with the way out, and right ones and wrong readings are
not.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from command import Call, assert_refused
from secret_robots import DAMAGES, Secret, secret_robot, with_column

from hexapod_cosim.cosim.logs.mcap_writer import write_mcap
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.extensions.identify.commands.command_screening import (
    WrongCommandsError,
    check_commands,
    wrong_commands,
)
from hexapod_cosim.extensions.identify.log import Log
from hexapod_cosim.extensions.identify.replay import replay
from hexapod_cosim.models import load_robot

Change = Callable[[np.ndarray], np.ndarray]


@pytest.fixture(scope="module")
def log(plant_build: Path, tmp_path_factory: pytest.TempPathFactory) -> Log:
    folder = tmp_path_factory.mktemp("secret")
    one: Secret = secret_robot(1, folder, duration=1.8, groups=("servo", "contact"))
    return one.log


def without(log: Log, *ends: str) -> Log:
    return log.without([name for name in log.recording.names if name.endswith(ends)])


def exchanged(log: Log, one: str, other: str) -> Log:
    data, names = log.recording.data.copy(), log.recording.names
    places = [names.index(one), names.index(other)]
    data[:, places] = data[:, places[::-1]]
    return Log(Recording(names, data), log.where)


WHY = {
    "dead": r"dead: .* in every row, while .* moves by",
    "turned": "wrong sign",
    "in degrees": "not in rad",
    "stuck": r"stuck at .* s, while .* moves by",
}


@pytest.mark.parametrize("kind", WHY)
@pytest.mark.parametrize("name", ["LF.femur.angle_ref", "RM.coxa.angle_ref", "LR.tibia.angle_ref"])
def test_a_dead_or_wrong_command_is_named_and_no_other(log: Log, name: str, kind: str) -> None:
    (bad,) = wrong_commands(with_column(log, name, DAMAGES[kind]))
    assert bad.name == name
    assert re.search(WHY[kind], bad.why), bad.why


def slowly(log: Log, joint: str, factor: float) -> Log:
    """Returns a log in which a joint moves by a part of its way, with the same torque."""
    for quantity in ("angle", "angle_ref", "speed", "speed_ref"):
        name = f"{joint}.{quantity}"
        log = with_column(log, name, lambda y: y[0] + factor * (y - y[0]))
    return log


@pytest.mark.parametrize("kind", ["dead", "stuck"])
def test_constant_commands_of_a_joint_that_moves_little_are_named(log: Log, kind: str) -> None:
    small = slowly(log, "LF.coxa", 0.4)
    assert 0.08 < np.ptp(small.recording.column("LF.coxa.angle")) < 0.15  # rad
    assert wrong_commands(small) == []
    (bad,) = wrong_commands(with_column(small, "LF.coxa.angle_ref", DAMAGES[kind]))
    assert bad.name == "LF.coxa.angle_ref"


def test_a_joint_that_a_load_bends_under_a_constant_command_is_right(log: Log) -> None:
    small = slowly(log, "LF.coxa", 0.4)
    held = with_column(small, "LF.coxa.angle_ref", DAMAGES["dead"])
    held = with_column(held, "LF.coxa.speed_ref", np.zeros_like)
    angle = held.recording.column("LF.coxa.angle")
    bent = with_column(held, "LF.coxa.torque", lambda _: -20.0 * (angle - angle[0]))
    assert wrong_commands(bent) == []


@pytest.mark.parametrize("missing", [(".speed",), (".speed", ".torque")])
def test_torques_or_commanded_speeds_tell_which_of_two_columns_is_turned(
    log: Log, missing: tuple[str, ...]
) -> None:
    bare = without(log, *missing)
    name = "RF.tibia.angle_ref"
    assert [one.name for one in wrong_commands(with_column(bare, name, np.negative))] == [name]
    assert wrong_commands(with_column(bare, "RF.tibia.angle", np.negative)) == []


@pytest.mark.parametrize(
    "pair", [("LF.femur", "LM.femur"), ("RM.femur", "RM.tibia"), ("RR.coxa", "LM.tibia")]
)
def test_exchanged_commands_are_named_both(log: Log, pair: tuple[str, str]) -> None:
    names = [f"{one}.angle_ref" for one in pair]
    bad = wrong_commands(exchanged(log, *names))
    assert {one.name for one in bad} == set(names)
    assert all("exchanged with" in one.why for one in bad)


def test_exchanged_readings_are_no_exchanged_commands(log: Log) -> None:
    assert wrong_commands(exchanged(log, "LF.femur.angle", "LM.femur.angle")) == []


@pytest.mark.parametrize("kind", DAMAGES)
def test_a_wrong_reading_makes_no_command_wrong(log: Log, kind: str) -> None:
    for name in ("LF.femur.angle", "RM.coxa.angle", "LF.femur.speed", "RR.tibia.torque"):
        assert wrong_commands(with_column(log, name, DAMAGES[kind])) == [], name


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (lambda y: np.full_like(y, 0.1), "dead, while RF.femur.angle_ref moves"),
        (lambda y: -y, "not the rate of RF.femur.angle_ref"),
        (np.degrees, "in degrees: 57 times"),
    ],
)
def test_a_wrong_commanded_speed_is_named(log: Log, change: Change, why: str) -> None:
    (bad,) = wrong_commands(with_column(log, "RF.femur.speed_ref", change))
    assert bad.name == "RF.femur.speed_ref"
    assert why in bad.why


def test_servos_that_get_no_speeds_have_no_wrong_ones(log: Log) -> None:
    still = log
    for name in log.commands:
        if name.endswith(".speed_ref"):
            still = with_column(still, name, np.zeros_like)
    assert wrong_commands(still) == []


def test_right_commands_pass_with_all_readings_and_with_few(log: Log) -> None:
    check_commands(log)
    check_commands(without(log, ".speed", ".torque", ".speed_ref"))
    check_commands(without(log, ".angle"))


def test_all_wrong_commands_are_in_the_error(log: Log) -> None:
    bad = log
    for name in ("LF.coxa.angle_ref", "RR.femur.angle_ref"):
        bad = with_column(bad, name, np.degrees)
    with pytest.raises(WrongCommandsError, match=r"and RR\.femur\.angle_ref") as caught:
        check_commands(bad)
    assert [one.name for one in caught.value.columns] == [
        "LF.coxa.angle_ref",
        "RR.femur.angle_ref",
    ]


def test_the_command_refuses_wrong_commands_with_the_way_out(
    call: Call, log: Log, tmp_path: Path
) -> None:
    bad = with_column(log, "LM.femur.angle_ref", lambda y: np.full_like(y, 0.3))
    write_mcap(bad.recording, tmp_path / "log.mcap")
    code, out, err = call("identify", tmp_path / "log.mcap", "-o", tmp_path / "out", "--no-propose")
    step, _, error = err.partition("\n")  # without a terminal each step has a line
    assert "columns of the log" in step
    assert_refused(
        (code, out, error),
        "LM.femur.angle_ref: dead: 0.3 in every row",
        "correct name, unit or sign",
    )
    assert not (tmp_path / "out").exists()


def test_a_replay_names_a_wrong_command_and_simulates_it(log: Log, athena_fmu: Path) -> None:
    name = "RM.coxa.angle_ref"
    done = replay(with_column(log, name, DAMAGES["turned"]), load_robot("athena"), fmu=athena_fmu)
    assert [one.name for one in done.commands] == [name]
    assert done.readings == ()
    (text,) = done.warnings
    assert "cannot have got RM.coxa.angle_ref: wrong sign" in text
    assert np.array_equal(done.simulated.column(name), -log.recording.column(name))
