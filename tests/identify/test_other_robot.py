"""A log of another robot is named by its height and its weight, one of the same robot is not."""

from __future__ import annotations

from pathlib import Path

import pytest

import hexapod_cosim
from hexapod_cosim.cosim.interface.names import foot_names, joint_names, vector_names
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.extensions.identify.log import Log, LogError, log_of
from hexapod_cosim.extensions.identify.other_robot import other_robot
from hexapod_cosim.extensions.identify.replay import replay
from hexapod_cosim.models import load_robot

HEIGHT, FORCES = vector_names("torso.position"), foot_names("normal_force")
COLUMNS = ("time", *joint_names("angle_ref"), *joint_names("speed_ref"), *joint_names("angle"))


@pytest.fixture(scope="module")
def logs(plant_build: Path) -> dict[str, Log]:
    found = {}
    for robot in ("athena", "phantomx_mk4"):
        settings = {"robot": robot, "duration": 1.0, "outputs.plots": False}
        recording = hexapod_cosim.simulate("walk_flat", "kinematic", settings=settings).recording
        names = (*COLUMNS, *HEIGHT, *FORCES)
        found[robot] = log_of(Recording(names, recording.columns(names)), f"{robot}.csv")
    return found


def test_another_robot_is_named_by_height_and_weight(logs: dict[str, Log]) -> None:
    athena = load_robot("athena")
    text = other_robot(logs["phantomx_mk4"], athena)
    assert text.startswith(
        "phantomx_mk4.csv may be the log of another robot than athena: its torso"
    )
    assert "athena weighs 54.9 N" in text
    assert "--robot" in text
    # the legs of a PhantomX hold athena's joint angles at the same height
    text = other_robot(logs["athena"], load_robot("phantomx_mk4"))
    assert "torso" not in text
    assert "weighs 31.6 N" in text


def test_the_own_robot_is_not_named(logs: dict[str, Log]) -> None:
    for name, log in logs.items():
        assert other_robot(log, load_robot(name)) == ""


def test_joint_angles_alone_say_nothing(logs: dict[str, Log]) -> None:
    log = logs["phantomx_mk4"].without([*HEIGHT, *FORCES])
    assert other_robot(log, load_robot("athena")) == ""


def test_a_replay_names_another_robot(logs: dict[str, Log], athena_fmu: Path) -> None:
    athena = load_robot("athena")
    # at the height of a PhantomX the torso of athena starts in the ground
    with pytest.raises(LogError, match="may be the log of another robot than athena"):
        replay(logs["phantomx_mk4"], athena, fmu=athena_fmu)
    assert replay(logs["athena"], athena, fmu=athena_fmu).other == ""
