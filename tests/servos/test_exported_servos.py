"""What URDF and MJCF files say of a robot's servos, and what `hexapod export` says is left out."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import pytest
from test_measured_servos import with_servo

from hexapod_cosim.cosim.cli.exporting import FORMATS, left_out
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


def test_an_ideal_servo_loses_nothing_and_rotors_their_spin() -> None:
    ideal = load_robot("athena").servo
    assert [left_out(ideal, form) for form in FORMATS.values()] == [[], []]
    measured = with_servo(load_robot("athena"), "mx64_m1", gear_ratio=200.0).servo
    limits, friction = (
        "the limits of the motor's voltage",
        "friction that depends on load and speed",
    )
    spin = "the rotors' angular momentum"
    assert left_out(measured, FORMATS["urdf"]) == [friction, limits, spin]
    assert left_out(measured, FORMATS["mjcf"]) == [limits, spin]
