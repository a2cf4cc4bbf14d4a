"""Tests that invalid URDFs are rejected with file, element, got value and fix."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from foreign_urdf import SIDE, spider_urdf

from hexapod_cosim.models import RobotError, load_robot

# a word of the spider's URDF and its replacement; only its first place is replaced, which for words
# in legs is leg RM (number 1)
ARM = """<link name="camera"><inertial><mass value="0.1"/>
<inertia ixx="1e-5" iyy="1e-5" izz="1e-5"/></inertial></link>
<joint name="pan" type="continuous"><parent link="body"/><child link="camera"/></joint>"""
FEMUR = """<inertial> <origin xyz="0.05 0 0"/> <mass value="0.16"/>
      <inertia ixx="5e-5" iyy="1.8e-4" izz="1.7e-4" ixy="0" ixz="0" iyz="0"/> </inertial>"""
MOMENTS = 'ixx="5e-5" iyy="1.8e-4" izz="1.7e-4"'
TIBIA = '<joint name="j_t1" type="revolute">\n    <parent link="{}"/>'
TOE = 'name="toe_joint_1" type="{}"'

CASES: dict[str, tuple[str, str, list[str]]] = {
    "unknown type": (
        'name="j_f1" type="revolute"',
        'name="j_f1" type="revolut"',
        ["joint 'j_f1'", "did you mean 'revolute'"],
    ),
    "floating leg": (
        'name="j_f1" type="revolute"',
        'name="j_f1" type="floating"',
        ["joint 'j_f1'", "floats", "femur_1"],
    ),
    "mimic": (
        '<axis xyz="0 0 2"/>',
        '<axis xyz="0 0 2"/><mimic joint="j_f1"/>',
        ["joint 'j_t1'", "follows", "j_f1", "<mimic>"],
    ),
    "seven moving joints": (
        "</robot>",
        f"{ARM}</robot>",
        ["not six legs", "7 moving joints", "that are no legs' fixed"],
    ),
    "no inertial": (FEMUR, "", ["link 'femur_1'", "without mass", "<inertial>"]),
    "no possible body": (
        'ixx="5e-5" iyy="1.8e-4"',
        'ixx="5e-5" iyy="2.8e-4"',
        ["joint j_f1", "no possible body", "sum of"],
    ),
    "limits swapped": (
        '<limit lower="-0.8" upper="0.9"',
        '<limit lower="0.9" upper="-0.8"',
        ["joint 'j_c1'", "limit", "not ordered"],
    ),
    "other effort": (
        'effort="5.5"',
        'effort="4.5"',
        ["joint 'j_c1'", "another effort", "same servo", "servo.torque_max"],
    ),
    "other feet": (
        'radius="0.012"',
        'radius="0.02"',
        ["joint 'j_t1'", "another radius", "foot.radius"],
    ),
    "no such link": (
        '<parent link="coxa_1"/>',
        '<parent link="coxa1"/>',
        ["joint 'j_f1'", "'coxa1'", "did you mean 'coxa_1'"],
    ),
    "ring": (
        "</robot>",
        '<link name="a"/><link name="b"/><joint name="ab" type="fixed"><parent link="a"/>'
        '<child link="b"/></joint>'
        '<joint name="ba" type="fixed"><parent link="b"/><child link="a"/></joint></robot>',
        ["ring", "'a'"],
    ),
    "all to one side": (
        'xyz="0.0 -0.11 0.01"',
        'xyz="0.0 0.31 0.01"',
        ["three hips left and three right", "j_c1 at (0, 0.31)", "forward"],
    ),
    "fixed to the world": (
        'name="base_footprint"/>',
        'name="world"/>',
        ["fixed to the world", "floating"],
    ),
    "xacro": (
        '<gazebo reference="body"/>',
        '<xacro:leg xmlns:xacro="http://ros.org/wiki/xacro"/>',
        ["xacro", "xacro my.urdf.xacro"],
    ),
}


def refusal(path: Path) -> str:
    with pytest.raises(RobotError) as caught:
        load_robot(path)
    assert caught.value.fix
    return str(caught.value)


@pytest.mark.parametrize(("old", "new", "words"), CASES.values(), ids=list(CASES))
def test_what_cannot_be_represented_is_refused_by_name(
    tmp_path: Path, old: str, new: str, words: list[str]
) -> None:
    text = spider_urdf()
    if "world" in new:
        text = text.replace('parent link="base_footprint"', 'parent link="world"')
    assert old in text
    path = tmp_path / "spider.urdf"
    changed = text.replace(old, new, 1)
    path.write_text(
        changed.replace(' upper="0.9" effort', " effort", 1) if new == "<limit" else changed,
        encoding="utf-8",
    )
    message = refusal(path)
    assert message.startswith(str(path))
    assert [word for word in words if word not in message] == []


def test_a_robot_with_four_legs_is_refused_because_only_six_can_be_simulated(
    tmp_path: Path,
) -> None:
    path = tmp_path / "quadruped.urdf"
    path.write_text(spider_urdf(["LF", "LR", "RF", "RR"]), encoding="utf-8")
    message = refusal(path)
    assert "4 moving joints on " in message
    assert "another number of legs cannot be simulated" in message


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\xff\xfe\x00",
        b"name = 'athena'",
        b'<?xml version="1.0" encoding="no-such"?><robot/>',
        b"<html/>",
        b"<robot/>",
    ],
)
def test_what_is_no_urdf_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "robot.urdf"
    path.write_bytes(content)
    assert refusal(path).startswith(str(path))


def test_entities_that_would_expand_for_ever_are_refused_at_once(tmp_path: Path) -> None:
    bomb = "".join(f'<!ENTITY e{k + 1} "{f"&e{k};" * 10}">' for k in range(12))
    path = tmp_path / "bomb.urdf"
    path.write_text(
        f'<!DOCTYPE robot [<!ENTITY e0 "ha">{bomb}]><robot name="&e12;"/>', encoding="utf-8"
    )
    assert "document type" in refusal(path)


def test_a_missing_urdf_is_refused_with_its_path(tmp_path: Path) -> None:
    assert "cannot read the URDF" in refusal(tmp_path / "none.urdf")
    (tmp_path / "side.toml").write_text('[urdf]\nfile = "none.urdf"\n', encoding="utf-8")
    assert str(tmp_path / "none.urdf") in refusal(tmp_path / "side.toml")


SIDES: dict[str, tuple[str, str, list[str]]] = {
    "no file": ('file = "spider.urdf"', "", ["urdf.file", "a text"]),
    "unknown option": (
        "[links]",
        "forwards = 1\n[links]",
        ["'forwards'", "did you mean 'forward'"],
    ),
    "unknown direction": ("[links]", 'forward = "z"\n[links]', ["urdf.forward", "'z'"]),
    "cannot be ignored": (
        "[links]",
        'ignore = ["mimic"]\n[links]',
        ["unknown key", "ignore", "keep_frames"],
    ),
    "section of wrong type": ("[urdf]", "servo = 3\n[urdf]", ["servo", "a table"]),
    "value of wrong type": ("[links]", '[servo]\nkp = "stiff"\n[links]', ["servo.kp", "'stiff'"]),
    "unknown joint": ("coxa.stance", "hip.stance", ["links", "'hip'"]),
    "stance beyond limits": (
        "coxa.stance = 0.0",
        "coxa.stance = 1.0",
        ["legs.LF.coxa.stance", "joint j_c3", "0.8"],
    ),
}


@pytest.mark.parametrize(("old", "new", "words"), SIDES.values(), ids=list(SIDES))
def test_a_bad_side_file_is_refused(tmp_path: Path, old: str, new: str, words: list[str]) -> None:
    assert old in SIDE
    (tmp_path / "spider.urdf").write_text(spider_urdf(), encoding="utf-8")
    path = tmp_path / "spider.toml"
    path.write_text(SIDE.replace(old, new, 1), encoding="utf-8")
    message = refusal(path)
    assert message.startswith(str(path))
    assert [word for word in words if word not in message] == []


def test_limits_beyond_half_a_turn_are_those_of_half_a_turn(tmp_path: Path) -> None:
    path = tmp_path / "spider.urdf"
    path.write_text(
        spider_urdf().replace('lower="-0.8" upper="0.9"', 'lower="-6.0" upper="6.0"'),
        encoding="utf-8",
    )
    robot = load_robot(path)
    assert (robot.legs[4].links[0].angle_min, robot.legs[4].links[0].angle_max) == (
        -math.pi,
        math.pi,
    )
    assert "3 limits beyond half a turn" in robot.source["URDF, ignored"]
