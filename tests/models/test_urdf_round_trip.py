"""Tests that a robot written as a URDF and read again is the same robot, and contacts of torso,
knees and shanks in URDF and MJCF files.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import pytest
from disguised_urdf import differences, disguised, random_robot, stances
from foreign_urdf import SIDE, spider, spider_urdf

from hexapod_cosim.cosim.cli.catalogue import servos
from hexapod_cosim.models import BodyContact, RobotError, check_robot, list_robots, load_robot
from hexapod_cosim.models.records import Robot
from hexapod_cosim.models.urdf.writer import robot_to_urdf

ROUNDING = (
    # kg, m, kg m2, rad: about 1e4 times the rounding of quantities that are turned, shifted and
    # added
    1e-12
)
SEEDS = range(4)


def written(text: str, folder: Path, name: str = "robot.urdf") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("name", list_robots())
def test_a_bundled_robot_comes_back_to_the_last_bit(name: str, tmp_path: Path) -> None:
    robot = load_robot(name)
    again = load_robot(written(robot_to_urdf(robot), tmp_path))
    assert again == robot
    assert again.hash == robot.hash


def test_the_effort_of_a_joint_is_the_torque_that_the_servo_can_give() -> None:
    """The STS3215's firmware allows 1.59315 A, 3.32 N m of a stall torque of 7.50 N m."""
    root = ET.fromstring(robot_to_urdf(load_robot("sts3215_hexapod")))
    efforts = {float(one.attrib["effort"]) for one in root.iter("limit")}
    assert list(efforts) == pytest.approx([3.31633], rel=1e-5)
    (own,) = [one for one in servos() if one["name"] == "sts3215_12v"]
    assert own["stall"] == pytest.approx(3.31633, rel=1e-5)


@pytest.mark.parametrize("pattern", [True, False], ids=["controller's axes", "any axes"])
@pytest.mark.parametrize("seed", SEEDS)
def test_a_random_robot_comes_back_to_the_last_bit(
    seed: int, pattern: bool, tmp_path: Path
) -> None:
    robot = random_robot(seed, pattern=pattern)
    check_robot(robot)
    assert load_robot(written(robot_to_urdf(robot), tmp_path)) == robot


@pytest.mark.parametrize("seed", SEEDS)
def test_a_robot_in_other_frames_names_and_parts_is_the_same_robot(
    seed: int, tmp_path: Path
) -> None:
    robot = random_robot(seed, pattern=True)
    again = load_robot(written(disguised(robot, seed, stances(robot)), tmp_path))
    apart = {
        name: difference
        for name, difference in differences(again, robot).items()
        if difference > ROUNDING
    }
    assert apart == {}
    # quantities that a URDF does not contain are assumed
    torque, constant = (
        0.2 * robot.servo.torque_max,
        math.sqrt(robot.servo.torque_max / robot.servo.speed_max),
    )
    servo = replace(robot.servo, torque_continuous=torque, motor_constant=constant)
    assert (again.servo, again.foot.radius) == (servo, robot.foot.radius)


def test_a_urdf_by_hand_is_the_robot_it_describes(tmp_path: Path) -> None:
    written(spider_urdf(), tmp_path, "spider.urdf")
    robot = load_robot(written(SIDE, tmp_path, "spider.toml"))
    apart = {
        name: difference
        for name, difference in differences(robot, spider()).items()
        if difference > ROUNDING
    }
    assert apart == {}
    assert robot.foot == spider().foot
    assert robot.servo.torque_max == 5.5
    assert robot.servo.kp == pytest.approx(spider().servo.kp, rel=ROUNDING)
    assert robot.source["leg LF"] == "read: joints j_c3, j_f3, j_t3"
    assert (
        robot.source["URDF, angles"]
        == "counted against the URDF's axes: j_c6, j_f6, j_t6, j_c1, j_f1, j_t1, j_c4, j_f4, j_t4"
    )
    assert (
        robot.source["URDF, ignored"]
        == "in the URDF, without effect here: 1 gazebo, 6 mesh, 6 transmission"
    )


# Tests the contact of torso, knees and shanks in URDF and MJCF files.


def without_body(text: str) -> ET.Element:
    """Returns the URDF without this project's element for the body."""
    root = ET.fromstring(text)
    own = root.find("hexapod")
    assert own is not None
    body = own.find("body")
    assert body is not None
    own.remove(body)
    return root


def reread(root: ET.Element, tmp_path: Path) -> Robot:
    path = tmp_path / "robot.urdf"
    path.write_bytes(ET.tostring(root))
    return load_robot(path)


def test_without_its_table_the_body_touches_nothing(tmp_path: Path) -> None:
    robot = reread(without_body(robot_to_urdf(load_robot("athena"))), tmp_path)
    assert robot.body == BodyContact()
    assert robot.source["URDF, body"] == (
        "only the feet touch the ground; [body] of a robot file gives more"
    )


@pytest.mark.parametrize(
    ("body", "message"),
    [
        (BodyContact(contact="on"), "body contact without a body"),
        (BodyContact(torso_box=(0.1, -0.1, 0.1)), "a box with negative edges"),
        (BodyContact(knee_radius=-1.0), "value not allowed"),
    ],
)
def test_an_impossible_body_is_refused(body: BodyContact, message: str) -> None:
    with pytest.raises(RobotError, match=message):
        check_robot(replace(load_robot("athena"), body=body))
