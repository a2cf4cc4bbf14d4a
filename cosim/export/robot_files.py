"""Writes a robot as a URDF or as a MuJoCo model (MJCF)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from hexapod_cosim.cosim.common.files import write_text, writing_into
from hexapod_cosim.models import Robot
from hexapod_cosim.models.mjcf import robot_to_mjcf
from hexapod_cosim.models.records import Servo
from hexapod_cosim.models.servos.motor import has_measured_friction
from hexapod_cosim.models.urdf.writer import robot_to_urdf


@dataclass(frozen=True)
class Format:
    """A file format of robots."""

    name: str
    title: str
    suffix: str
    write: Callable[[Robot], str]


FORMATS = {
    "urdf": Format("urdf", "a URDF", ".urdf", robot_to_urdf),
    "mjcf": Format("mjcf", "an MJCF file", ".xml", robot_to_mjcf),
}


def left_out(servo: Servo, form: Format) -> list[str]:
    """Returns what a format cannot say of the servos, and a robot's file can."""
    viscous = form.name == "mjcf"  # which has it as the joint's damping
    load = replace(servo, viscous_friction=0.0) if viscous else servo
    facts = {
        "friction that depends on load and speed": has_measured_friction(load),
        "the limits of the motor's voltage": servo.drive == "motor",
        "heat": servo.drive == "motor" and servo.winding_capacity > 0.0,
        "the supply's resistance": servo.drive == "motor" and servo.supply_resistance > 0.0,
        "the bus and the steps of commands": servo.bus_period > 0.0 or servo.command_step > 0.0,
        "the elasticity of the gears": servo.gear_stiffness > 0.0,
        "backlash": servo.backlash > 0.0,
        "the rotors' angular momentum": servo.gear_ratio != 0.0,
    }
    return [name for name, present in facts.items() if present]


def export_description(robot: Robot, path: str | Path, form: Format) -> Path:
    """Writes a robot's file atomically and returns its path.

    Raises HexapodError when the file cannot be written.
    """
    path, text = Path(path), form.write(robot)
    with writing_into(path.parent):
        write_text(path, text)
    return path
