"""Tests robot files: the robots of valid files and the messages for invalid ones."""

from __future__ import annotations

import copy
import dataclasses
import math
import pickle
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hexapod_cosim import models
from hexapod_cosim.models import HexapodError, RobotError, check_robot, load_robot, robot_from_table
from hexapod_cosim.models.kinematics import foot_positions

FIGURES = 5e-4  # relative; the reference figures are printed with four digits
Table = dict[str, Any]


def athena_table() -> Table:
    path = Path(models.__file__).parent / "athena.toml"
    return tomllib.loads(path.read_text(encoding="utf-8"))


def put(table: Table, key: str, value: Any) -> None:
    *path, last = key.split(".")
    for name in path:
        table = table.setdefault(name, {})
    table[last] = value


def drop(table: Table, key: str) -> None:
    *path, last = key.split(".")
    for name in path:
        table = table[name]
    del table[last]


@pytest.mark.parametrize("name", models.list_robots())
def test_bundled_robots_load_and_are_named_after_their_file(name: str) -> None:
    assert load_robot(name).name == name
    assert load_robot(Path(models.__file__).parent / f"{name}.toml") == load_robot(name)


def test_athena_has_the_reference_figures() -> None:
    robot = load_robot("athena")
    assert robot.total_mass == pytest.approx(5.60, abs=1e-12)
    assert robot.torso.inertia[:3] == pytest.approx((0.010053, 0.029467, 0.036747), rel=FIGURES)
    assert robot.contact.stiffness == pytest.approx(1.07e6, rel=5e-3)
    assert np.degrees(robot.legs[0].stance) == pytest.approx((0.0, 22.0, 180.0 - 78.0), abs=0.5)
    tripod_share = robot.total_mass * 9.81 / 3.0
    assert (tripod_share / robot.contact.stiffness) ** (2.0 / 3.0) == pytest.approx(
        0.66e-3, rel=1e-2
    )


def test_phantomx_has_the_reference_figures() -> None:
    robot = load_robot("phantomx_mk4")
    assert robot.total_mass == pytest.approx(3.216, abs=5e-4)
    assert robot.torso.com == (0.001522, 0.000302, 0.015345)
    assert robot.legs[3].links[1].tip == (0.06, 0.0, -0.015)
    assert robot.legs[5].links[2].tip == (0.095, 0.0, -0.09)
    assert (robot.servo.torque_max, robot.servo.speed_max) == (3.0, math.pi)


@pytest.mark.parametrize(
    ("name", "radius", "depth"), [("athena", 0.18, 0.12), ("phantomx_mk4", 0.15, 0.10)]
)
def test_the_computed_numbers_of_a_robot_file_follow_from_the_others(
    name: str, radius: float, depth: float
) -> None:
    """The stance puts each foot's centre at a radius from its hip and a depth below it [m]."""
    robot = load_robot(name)
    half = np.array(robot.torso.size) / 2.0
    assert robot.body.torso_box == pytest.approx(half - robot.body.corner_radius, abs=1e-12)
    hips = np.array([leg.hip_position for leg in robot.legs])
    away = foot_positions(robot, robot.stance) - hips
    assert np.hypot(away[:, 0], away[:, 1]) == pytest.approx(np.full(6, radius), abs=1e-12)
    assert away[:, 2] == pytest.approx(np.full(6, -depth), abs=1e-12)


def test_a_leg_may_differ_from_the_others() -> None:
    table = athena_table()
    put(table, "legs.RM.tibia", {"mass": 0.2})
    robot = robot_from_table(table, where="mine.toml")
    assert [leg.links[2].mass for leg in robot.legs] == [0.11, 0.11, 0.11, 0.11, 0.2, 0.11]
    assert robot.hash != load_robot("athena").hash


def test_hash_follows_the_content_and_not_the_provenance() -> None:
    table = athena_table()
    assert robot_from_table(table, where="a").hash == load_robot("athena").hash
    put(table, "source.robot", "measured")
    assert robot_from_table(table, where="a").hash == load_robot("athena").hash
    put(table, "torso.mass", 2.61)
    assert robot_from_table(table, where="a").hash != load_robot("athena").hash


def test_equal_robots_hash_equal() -> None:
    """Integers and minus zero, which a caller may write, are the same numbers as 1.0 and 0.0. A
    mass of 2.6 kg and one of 0.26 kg differ.
    """
    robot = load_robot("athena")
    assert robot.torso.com == (0.0, 0.0, 0.0)
    for com in ((0, 0, 0), (-0.0, 0.0, 0.0)):
        same = dataclasses.replace(robot, torso=dataclasses.replace(robot.torso, com=com))
        assert same == robot
        assert same.hash == robot.hash
    assert dataclasses.replace(robot, gravity=(0, 0, -9.81)).hash == robot.hash
    assert (
        dataclasses.replace(robot, torso=dataclasses.replace(robot.torso, mass=0.26)).hash
        != robot.hash
    )


def test_the_motor_constant_is_the_data_sheets_or_else_an_ideal_motors() -> None:
    """MX-64: 6.0 N m at stall from 12 V and 4.1 A. At stall an ideal motor draws its stall torque
    times its no-load speed.
    """
    assert load_robot("athena").servo.motor_constant == pytest.approx(
        6.0 / math.sqrt(12.0 * 4.1), rel=1e-3
    )
    table = athena_table()
    del table["servo"]["motor_constant"]
    put(table, "servo.torque_max", 5.0)
    put(table, "servo.speed_max", 3.2)
    assert robot_from_table(table, where="a").servo.motor_constant == pytest.approx(
        1.25
    )  # sqrt(5.0 / 3.2)


def test_robots_are_frozen_comparable_and_picklable() -> None:
    robot = load_robot("athena")
    with pytest.raises(dataclasses.FrozenInstanceError):
        robot.name = "other"  # type: ignore[misc]
    assert pickle.loads(pickle.dumps(robot)) == robot
    assert copy.deepcopy(robot) == robot
    assert hash(dataclasses.replace(robot)) == hash(robot)


BAD: list[tuple[str, Callable[[Table], None], list[str]]] = [
    ("unknown key", lambda t: put(t, "torso.mas", 1.0), ["torso", "'mas'", "did you mean 'mass'?"]),
    ("unknown leg", lambda t: put(t, "legs.FL", {}), ["legs", "'FL'", "LF, LM, LR"]),
    (
        "unknown law",
        lambda t: put(t, "contact.law", "floris"),
        ["contact.law", "did you mean 'flores'?"],
    ),
    ("missing section", lambda t: drop(t, "servo"), ["servo", "missing section", "[servo]"]),
    ("missing key", lambda t: drop(t, "servo.kp"), ["servo.kp", "missing key", "N m/rad"]),
    ("missing leg", lambda t: drop(t, "legs.RR"), ["legs.RR", "missing leg", "add [legs.RR]"]),
    (
        "missing stance",
        lambda t: drop(t, "links.femur.stance"),
        ["legs.LF.femur.stance", "missing key"],
    ),
    (
        "text for number",
        lambda t: put(t, "torso.mass", "2.6 km"),
        ["torso.mass", "'2.6 km'", "kg or g"],
    ),
    ("number for table", lambda t: put(t, "torso", 3.0), ["torso", "expected a table"]),
    ("number for vector", lambda t: put(t, "torso.com", 0.0), ["torso.com", "3 numbers [m]"]),
    ("not finite", lambda t: put(t, "servo.kp", math.nan), ["servo.kp", "got nan", "finite"]),
    (
        "zero mass",
        lambda t: put(t, "links.coxa.mass", 0.0),
        ["links.coxa.mass", "got 0.0", "> 0 [kg]"],
    ),
    (
        "negative moment",
        lambda t: put(t, "links.tibia.inertia", [1e-5, -1e-5, 1e-5, 0, 0, 0]),
        ["tibia.inertia", "not positive definite"],
    ),
    (
        "wrong unit",
        lambda t: put(t, "links.femur.inertia", [0.0675, 0.2004, 0.2004, 0, 0, 0]),
        ["femur.inertia", "radius of gyration"],
    ),
    (
        "com in mm",
        lambda t: put(t, "links.femur.com", [65.0, 0.0, 0.0]),
        ["femur.com", "check the unit (m)"],
    ),
    (
        "limits swapped",
        lambda t: put(t, "links.coxa.angle_min", 1.5),
        ["coxa.angle_min", "not ordered", "angle_min < angle_max"],
    ),
    (
        "stance outside",
        lambda t: put(t, "legs.RF.coxa", {"stance": 1.2}),
        ["legs.RF.coxa.stance", "outside the joint's limits"],
    ),
    (
        "one foot in the air",
        lambda t: put(t, "legs.RM.femur", {"stance": 0.9}),
        ["legs.RM.stance", "does not reach the ground"],
    ),
    ("no length", lambda t: put(t, "links.femur.length", 0.0), ["femur.length", "without extent"]),
    (
        "friction order",
        lambda t: put(t, "friction.mu_static", 0.1),
        ["friction.mu_static", "at least mu = 0.7"],
    ),
    (
        "continuous torque",
        lambda t: put(t, "servo.torque_continuous", 7.0),
        ["servo.torque_continuous", "torque_max = 6"],
    ),
    (
        "joints' names",
        lambda t: t.update(joints={"names": ["hip"] * 18}),
        ["joints", "18 names, 1 of them", "give all of them, or leave [joints] out"],
    ),
    (
        "reversed joints",
        lambda t: t.update(joints={"reversed": ["hip"]}),
        ["joints", "reversed ones of these"],
    ),
]


@pytest.mark.parametrize(
    ("change", "words"), [case[1:] for case in BAD], ids=[case[0] for case in BAD]
)
def test_a_bad_robot_is_refused_with_file_key_and_remedy(
    change: Callable[[Table], None], words: list[str]
) -> None:
    table = athena_table()
    change(table)
    with pytest.raises(RobotError) as caught:
        robot_from_table(table, where="mine.toml")
    message = str(caught.value)
    assert message.startswith("mine.toml: ")
    assert caught.value.fix
    assert [word for word in words if word not in message] == []


def test_a_missing_file_is_refused_with_its_path_and_the_known_names(tmp_path: Path) -> None:
    with pytest.raises(
        RobotError, match=r"none\.toml: cannot read .*phantomx_mk4, sts3215_hexapod"
    ):
        load_robot(tmp_path / "none.toml")


def test_an_unknown_name_proposes_the_nearest() -> None:
    with pytest.raises(RobotError, match="did you mean 'athena'"):
        load_robot("atena")


@pytest.mark.parametrize("content", [b"name = ", b"\xff\xfe"], ids=["syntax", "encoding"])
def test_a_file_that_is_no_toml_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "broken.toml"
    path.write_bytes(content)
    with pytest.raises(RobotError, match=r"broken\.toml: not a TOML file"):
        load_robot(path)


def test_a_robot_changed_in_python_is_judged_by_the_same_rules() -> None:
    robot = load_robot("athena")
    lighter = dataclasses.replace(robot, torso=dataclasses.replace(robot.torso, mass=-1.0))
    with pytest.raises(RobotError, match=r"athena: torso\.mass: .*got -1\.0"):
        check_robot(lighter)
    with pytest.raises(RobotError, match="legs LF LM LR RF RM RR"):
        check_robot(dataclasses.replace(robot, legs=robot.legs[::-1]))


def test_errors_keep_their_data_and_survive_pickling() -> None:
    error = RobotError("no", got=1, expected="2", fix="do", where="file")
    copied = pickle.loads(pickle.dumps(error))
    assert isinstance(copied, RobotError)
    assert isinstance(copied, HexapodError)
    assert (copied.what, copied.got, copied.expected, copied.fix, copied.where) == (
        "no",
        1,
        "2",
        "do",
        "file",
    )
    assert str(copied) == "file: no: got 1, expected 2; do"
