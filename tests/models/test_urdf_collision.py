"""Tests the contact of torso, knees and shanks in URDF and MJCF files."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from hexapod_cosim.models import BodyContact, RobotError, load_robot
from hexapod_cosim.models.mjcf import robot_to_mjcf
from hexapod_cosim.models.records import Robot
from hexapod_cosim.models.urdf.writer import robot_to_urdf
from hexapod_cosim.models.validation.bodies import check_robot


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


def test_collision_shapes_alone_give_the_outer_box_and_the_largest_radii(tmp_path: Path) -> None:
    robot = reread(without_body(robot_to_urdf(load_robot("athena"))), tmp_path)
    assert robot.body.torso_box == pytest.approx((0.18, 0.10, 0.04), abs=1e-15)
    assert robot.body.torso_centre == pytest.approx((0.0, 0.0, 0.0), abs=1e-15)
    assert (robot.body.corner_radius, robot.body.contact) == (0.0, "on")
    assert (robot.body.knee_radius, robot.body.shank_radius) == (0.0105, 0.0105)
    assert robot.body.shank_position == pytest.approx(0.5, abs=1e-15)
    assert "torso's box encloses" in robot.source["URDF, body"]


def test_cylinders_capsules_and_spheres_are_read(tmp_path: Path) -> None:
    root = without_body(robot_to_urdf(load_robot("athena")))
    for link in root.findall("link"):
        name = link.get("name", "")
        for shape in link.findall("collision"):
            if not name.endswith("foot"):
                link.remove(shape)
        if name == "torso":
            add(link, "sphere", "0.1 0 0.05", radius="0.04")
            add(link, "capsule", "-0.1 0 0", radius="0.03", length="0.1")
        if name.endswith("femur"):
            add(link, "cylinder", "0.05 0 0", radius="0.02", length="0.1")
        if name.endswith("tibia"):
            add(link, "capsule", "0.04 0 0", radius="0.012", length="0.06")
    body = reread(root, tmp_path).body
    assert body.torso_box == pytest.approx((0.135, 0.04, 0.085), abs=1e-15)
    assert body.torso_centre == pytest.approx((0.005, 0.0, 0.005), abs=1e-15)
    assert (body.knee_radius, body.shank_radius) == (0.02, 0.012)
    assert body.shank_position == pytest.approx(0.25, abs=1e-15)


def add(link: ET.Element, kind: str, place: str, **size: str) -> None:
    shape = ET.SubElement(link, "collision")
    ET.SubElement(shape, "origin", xyz=place)
    ET.SubElement(ET.SubElement(shape, "geometry"), kind, size)


def test_an_upturned_robot_rests_on_its_torso_in_mujoco_too() -> None:
    model = mujoco.MjModel.from_xml_string(robot_to_mjcf(load_robot("athena")))
    data = mujoco.MjData(model)
    angles = np.tile([0.0, -0.3, 0.2], 6)
    data.qpos = [0.0, 0.0, 0.06, 0.0, 1.0, 0.0, 0.0, *angles]
    data.ctrl = angles
    mujoco.mj_step(model, data, 2000)
    assert data.qpos[2] == pytest.approx(0.04, abs=1e-3)


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
