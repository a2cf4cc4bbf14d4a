"""What MJCF files say of a robot's servos."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import pytest
from test_measured_servos import with_servo

from hexapod_cosim.models import load_robot
from hexapod_cosim.models.mjcf import robot_to_mjcf


def test_mjcf_has_viscous_friction_and_the_damping_of_the_back_emf() -> None:
    robot = with_servo(load_robot("athena"), "mx64_m1")
    root = ET.fromstring(robot_to_mjcf(robot))
    joints = root.findall(".//joint[@type='hinge']")
    damping = [float(joint.get("damping", "")) for joint in joints]
    assert damping == pytest.approx([0.01169] * 18, abs=1e-5)
    assert {float(joint.get("frictionloss", "")) for joint in joints} == {
        robot.servo.coulomb_friction
    }
    motors = root.findall("actuator/position")
    back_emf = 0.66656  # k_t^2/R
    assert [float(motor.get("kv", "")) for motor in motors] == pytest.approx(
        [back_emf] * 18, rel=1e-3
    )
