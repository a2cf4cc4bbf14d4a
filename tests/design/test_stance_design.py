"""Tests the search of the stance of least heat, and the robot file that it writes."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from hexapod_cosim.controller import GainsError, make_gait
from hexapod_cosim.cosim.design.stance import (
    StanceDesign,
    find_stance,
    walked,
    with_stance,
    write_robot,
)
from hexapod_cosim.models import load_robot
from hexapod_cosim.models.robot import robot_path

ATHENA = load_robot("athena")


@cache
def found() -> StanceDesign:
    return find_stance(ATHENA)


def test_the_stance_of_least_heat_brings_the_feet_nearer_to_the_hips() -> None:
    design = found()
    assert design.outward == pytest.approx(-0.05265)
    assert design.deeper == pytest.approx(0.0189)
    assert design.after.heat < 0.8 * design.before.heat
    assert design.after.hottest < ATHENA.servo.torque_continuous < design.before.hottest


def test_the_found_stance_is_as_firm_and_as_slow_as_required() -> None:
    after = found().after
    assert after.firmness >= 0.25
    assert after.lifts
    assert after.speed <= 0.8 * ATHENA.servo.speed_max
    assert after == walked(found().robot, make_gait(ATHENA))


def test_the_written_file_is_the_robot_with_the_stance(tmp_path: Path) -> None:
    moved = with_stance(ATHENA, -0.02, 0.01)
    file = write_robot(robot_path("athena"), moved, tmp_path / "low.toml", name="low")
    read = load_robot(file)
    assert read.name == "low"
    np.testing.assert_array_equal(read.stance, moved.stance)
    assert replace(read, name="athena", legs=ATHENA.legs) == replace(ATHENA, legs=ATHENA.legs)


def test_a_urdf_is_not_written_and_a_stance_without_reach_is_refused(tmp_path: Path) -> None:
    with pytest.raises(GainsError, match="URDF is not written"):
        write_robot(Path("robot.urdf"), ATHENA, tmp_path / "x.toml", name="x")
    assert not list(tmp_path.iterdir())
    far = replace(ATHENA, gait=replace(ATHENA.gait, stride=0.6))
    with pytest.raises(GainsError, match="do not reach the steps"):
        find_stance(far)
