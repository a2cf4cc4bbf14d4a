"""Defines the records of a robot as frozen dataclasses with units and ranges.

Frames and conventions: docs/architecture.md. Records contain tuples of floats, so that robots are
hashable, picklable and comparable. Use `dataclasses.replace` to change one and `check_robot` to
check it by the rules for files.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cached_property
from typing import Annotated, Any

import numpy as np

from hexapod_cosim.models.arrays import Array, Vector3, Vector6
from hexapod_cosim.models.contact.law import BodyContact, Contact
from hexapod_cosim.models.friction import Friction
from hexapod_cosim.models.ground.surface import Terrain
from hexapod_cosim.models.method import Baumgarte, Solver
from hexapod_cosim.models.schema import Choice, Number, Texts, Vector
from hexapod_cosim.models.soil.presets import Soil

LEG_NAMES = ("LF", "LM", "LR", "RF", "RM", "RR")
JOINT_NAMES = ("coxa", "femur", "tibia")
SERVO_MODES = ("position", "torque", "kinematic")
SERVO_DRIVES = ("line", "motor")
GAITS = ("tripod", "ripple", "wave", "amble")


@dataclass(frozen=True, kw_only=True)
class Torso:
    """The main body. Hip positions are relative to the origin of its frame."""

    mass: Annotated[float, Number("kg", above=0.0)]
    # box, for pictures and for the default inertia
    size: Annotated[Vector3, Vector("m", 3, above=0.0)]
    com: Annotated[Vector3, Vector("m", 3)] = (0.0, 0.0, 0.0)
    # about the com: xx yy zz xy xz yz; default of a file: homogeneous box
    inertia: Annotated[Vector6, Vector("kg m2", 6)]


@dataclass(frozen=True, kw_only=True)
class Link:
    """A moving segment. Its frame lies at its joint and equals the parent's at angle 0."""

    mass: Annotated[float, Number("kg", above=0.0)]
    length: Annotated[float, Number("m")]  # next joint (tibia: foot centre) along x
    offset_y: Annotated[float, Number("m")] = 0.0
    offset_z: Annotated[float, Number("m")] = 0.0
    com: Annotated[Vector3, Vector("m", 3)]
    inertia: Annotated[Vector6, Vector("kg m2", 6)]  # about the com: xx yy zz xy xz yz
    axis: Annotated[Vector3, Vector("1", 3)]  # in the parent frame (coxa: hip frame), unit length
    angle_min: Annotated[float, Number("rad", at_least=-math.pi, at_most=math.pi)]
    angle_max: Annotated[float, Number("rad", at_least=-math.pi, at_most=math.pi)]

    @property
    def tip(self) -> Vector3:
        """Position of the next joint or the foot's centre in the link frame [m]."""
        return (self.length, self.offset_y, self.offset_z)

    @property
    def turned(self) -> Link:
        """The same link with its angle counted the other way round."""
        x, y, z = (0.0 - value for value in self.axis)
        low, high = -self.angle_max, -self.angle_min
        return replace(self, axis=(x, y, z), angle_min=low, angle_max=high)


@dataclass(frozen=True, kw_only=True)
class Leg:
    """A hip with three links."""

    name: str
    hip_position: Annotated[Vector3, Vector("m", 3)]  # in the torso frame
    hip_yaw: Annotated[float, Number("rad", at_least=-math.pi, at_most=math.pi)]
    links: tuple[Link, Link, Link]
    stance: Annotated[Vector3, Vector("rad", 3)]  # joint angles of the standing pose


@dataclass(frozen=True, kw_only=True)
class JointNames:
    """What the owner calls the joints, legs slowest, and which of them the owner counts the other
    way round. Files for other tools have these names and signs.
    """

    names: Annotated[tuple[str, ...], Texts()] = tuple(
        f"{leg}_{joint}_joint" for leg in LEG_NAMES for joint in JOINT_NAMES
    )
    reversed: Annotated[tuple[str, ...], Texts()] = ()

    @property
    def signs(self) -> Array:
        """Angles of the owner over those of this project (18,): 1 or -1."""
        return np.array([-1.0 if name in self.reversed else 1.0 for name in self.names])


@dataclass(frozen=True, kw_only=True)
class Foot:
    """Radius and material of all feet."""

    radius: Annotated[float, Number("m", above=0.0)]
    # flat round pad on soil; 0: the sphere itself
    pad_radius: Annotated[float, Number("m", at_least=0.0)] = 0.0
    youngs_modulus: Annotated[float, Number("Pa", above=0.0)]
    poisson: Annotated[float, Number("1", above=-1.0, at_most=0.5)]


@dataclass(frozen=True, kw_only=True)
class Servo:
    """Servo of every joint (eq. 12) and the joints' stops (eq. 39)."""

    mode: Annotated[str, Choice(SERVO_MODES)] = "position"
    kp: Annotated[float, Number("N m/rad", at_least=0.0)]
    kd: Annotated[float, Number("N m s/rad", at_least=0.0)]
    torque_max: Annotated[float, Number("N m", above=0.0)]  # at stall
    speed_max: Annotated[float, Number("rad/s", above=0.0)]  # no-load
    rotor_inertia: Annotated[float, Number("kg m2", at_least=0.0)]  # seen at the joint
    coulomb_friction: Annotated[float, Number("N m", at_least=0.0)]
    torque_continuous: Annotated[float, Number("N m", above=0.0)]  # a larger one gives a warning
    # torque over the root of the copper loss, at the joint; default of a file: ideal motor
    motor_constant: Annotated[float, Number("N m/sqrt(W)", above=0.0)]
    # stops at the links' angle_min and angle_max; 0: none
    stop_stiffness: Annotated[float, Number("N m/rad", at_least=0.0, at_most=1e8)] = 0.0
    stop_damping: Annotated[float, Number("N m s/rad", at_least=0.0, at_most=1e8)] = 0.0
    # line: PD torque within the torque-speed line; motor: PD voltage on a motor with back-EMF
    drive: Annotated[str, Choice(SERVO_DRIVES)] = "line"
    # of the drive motor (eq. 48); torque constant and resistance are seen at the joint
    voltage: Annotated[float, Number("V", at_least=0.0, at_most=1e4)] = 0.0
    duty_max: Annotated[float, Number("1", above=0.0, at_most=1.0)] = 1.0
    torque_constant: Annotated[float, Number("N m/A", at_least=0.0, at_most=1e6)] = 0.0
    resistance: Annotated[float, Number("ohm", at_least=0.0, at_most=1e6)] = 0.0
    # friction of gear and motor besides coulomb_friction (eq. 49, 50); all 0: none
    viscous_friction: Annotated[float, Number("N m s/rad", at_least=0.0, at_most=1e6)] = 0.0
    stribeck_friction: Annotated[float, Number("N m", at_least=0.0, at_most=1e6)] = 0.0
    motor_load_friction: Annotated[float, Number("1", at_least=0.0, at_most=1.0)] = 0.0
    external_load_friction: Annotated[float, Number("1", at_least=0.0, at_most=1.0)] = 0.0
    stribeck_motor_load_friction: Annotated[float, Number("1", at_least=0.0, at_most=1.0)] = 0.0
    stribeck_external_load_friction: Annotated[float, Number("1", at_least=0.0, at_most=1.0)] = 0.0
    quadratic_motor_friction: Annotated[float, Number("1/(N m)", at_least=0.0, at_most=1e6)] = 0.0
    quadratic_external_friction: Annotated[float, Number("1/(N m)", at_least=0.0, at_most=1e6)] = (
        0.0
    )
    stribeck_speed: Annotated[float, Number("rad/s", at_least=1e-6, at_most=1e6)] = 1.0
    stribeck_exponent: Annotated[float, Number("1", above=0.0, at_most=16.0)] = 1.0
    # speed at which the dry friction saturates: it is regularised by tanh(speed / friction_speed)
    friction_speed: Annotated[float, Number("rad/s", at_least=1e-5, at_most=1e3)] = 0.05
    # heat of a motor (eq. 52); a winding without capacity keeps its temperature
    winding_capacity: Annotated[float, Number("J/K", at_least=0.0, at_most=1e6)] = 0.0
    housing_capacity: Annotated[float, Number("J/K", at_least=0.0, at_most=1e6)] = 0.0
    winding_to_housing: Annotated[float, Number("K/W", at_least=1e-6, at_most=1e6)] = 1.0
    housing_to_air: Annotated[float, Number("K/W", at_least=1e-6, at_most=1e6)] = 1.0
    air_temperature: Annotated[float, Number("K", at_least=0.0, at_most=1e4)] = 298.15
    start_temperature: Annotated[float, Number("K", at_least=0.0, at_most=1e4)] = 298.15
    # hotter windings lower the duty limit, to 0 at temperature_max
    derate_temperature: Annotated[float, Number("K", at_least=0.0, at_most=1e4)] = 343.15
    temperature_max: Annotated[float, Number("K", at_least=0.0, at_most=2e4)] = 353.15
    # of battery and cables, which all servos share (eq. 53)
    supply_resistance: Annotated[float, Number("ohm", at_least=0.0, at_most=1e6)] = 0.0
    # how commands reach the servos, but in kinematic mode: transmissions, rounding of angles
    bus_period: Annotated[float, Number("s", at_least=0.0, at_most=1e3)] = 0.0
    command_step: Annotated[float, Number("rad", at_least=0.0, at_most=1.0)] = 0.0
    # what a firmware limits besides the duty (eq. 48, 57, 58); 0: it does not
    current_max: Annotated[float, Number("A", at_least=0.0, at_most=1e6)] = 0.0
    goal_speed_max: Annotated[float, Number("rad/s", at_least=0.0, at_most=1e3)] = 0.0
    # a duty above overload_duty for overload_time leaves overload_left
    overload_time: Annotated[float, Number("s", at_least=0.0, at_most=1e3)] = 0.0
    overload_duty: Annotated[float, Number("1", at_least=1e-6, at_most=1.0)] = 1.0
    overload_left: Annotated[float, Number("1", at_least=0.0, at_most=1.0)] = 0.0
    # turns of the rotor for one of the joint, < 0: against it (eq. 54); 0: no angular momentum
    gear_ratio: Annotated[float, Number("1", at_least=-1e6, at_most=1e6)] = 0.0

    @property
    def drag(self) -> float:
        """Torque that the joint's speed takes from a command [N m s/rad]: back-EMF (eq. 48) of a
        motor, and viscous friction (eq. 49).
        """
        motor = self.drive == "motor"
        back_emf = self.torque_constant**2 / self.resistance if motor else 0.0
        return back_emf + self.viscous_friction

    @property
    def torque_limit(self) -> float:
        """Largest torque at rest, within the current that the firmware of a motor allows [N m]."""
        if self.drive != "motor" or self.current_max == 0.0:
            return self.torque_max
        return min(self.torque_max, self.torque_constant * self.current_max)


def _unused_fields(servo: Servo) -> list[str]:
    """Returns the names of the fields from `drive` on if all have their defaults, else none."""
    names = [item.name for item in fields(Servo)]
    later = fields(Servo)[names.index("drive") :]
    usual = all(getattr(servo, item.name) == item.default for item in later)
    return [item.name for item in later] if usual else []


@dataclass(frozen=True, kw_only=True)
class Gait:
    """Parameters of the gait."""

    name: Annotated[str, Choice(GAITS)]
    period: Annotated[float, Number("s", above=0.0)]
    duty: Annotated[float, Number("1", above=0.0, below=1.0)]
    stride: Annotated[float, Number("m", at_least=0.0)]  # of the body in one period
    step_height: Annotated[float, Number("m", above=0.0)]


def _plain(content: Any) -> Any:
    """Converts nested content to lists and floats, in which 0 and -0.0 are both 0.0."""
    if isinstance(content, dict):
        return {key: _plain(value) for key, value in content.items()}
    if isinstance(content, tuple | list):
        return [_plain(value) for value in content]
    if isinstance(content, int | float) and not isinstance(content, bool):
        return float(content) + 0.0
    return content


@dataclass(frozen=True, kw_only=True)
class Robot:
    """A six-legged robot with its laws and settings; `source` gives the numbers' provenance."""

    name: str
    gravity: Annotated[Vector3, Vector("m/s2", 3)]
    torso: Torso
    legs: tuple[Leg, ...]
    foot: Foot
    contact: Contact
    friction: Friction
    servo: Servo
    baumgarte: Baumgarte
    solver: Solver
    terrain: Terrain
    gait: Gait
    body: BodyContact = field(default_factory=BodyContact)
    soil: Soil = field(default_factory=Soil)
    joints: JointNames = field(default=JointNames(), compare=False)
    source: Mapping[str, str] = field(default_factory=dict, compare=False)

    @property
    def total_mass(self) -> float:
        """Mass of all bodies [kg]."""
        return self.torso.mass + sum(link.mass for leg in self.legs for link in leg.links)

    @property
    def weight(self) -> float:
        """Weight of all bodies [N]."""
        return self.total_mass * float(np.linalg.norm(self.gravity))

    @property
    def stance(self) -> Array:
        """Joint angles (6, 3) of the standing pose [rad]."""
        return np.array([leg.stance for leg in self.legs])

    @property
    def angle_min(self) -> Array:
        """Lower joint limits (6, 3) [rad]."""
        return np.array([[link.angle_min for link in leg.links] for leg in self.legs])

    @property
    def angle_max(self) -> Array:
        """Upper joint limits (6, 3) [rad]."""
        return np.array([[link.angle_max for link in leg.links] for leg in self.legs])

    def owner_links(self, leg: int) -> list[tuple[str, Link]]:
        """Returns the joints' names and the links of a leg as the owner counts their angles."""
        own = slice(3 * leg, 3 * leg + 3)
        names, signs = self.joints.names[own], self.joints.signs[own]
        return [
            (name, link.turned if sign < 0.0 else link)
            for name, sign, link in zip(names, signs, self.legs[leg].links, strict=True)
        ]

    @cached_property
    def hash(self) -> str:
        """SHA-256 in hexadecimal of all fields but `joints`, `source`, a body without contact and
        the parameters of measured servos where all have their defaults; equal robots have equal
        hashes.
        """
        surface = self.terrain.surface if self.terrain.kind == "grid" else None
        content = _plain(asdict(replace(self, terrain=replace(self.terrain, surface=None))))
        del content["joints"], content["source"], content["terrain"]["surface"]
        if self.body.contact == "off":
            del content["body"]
        for name in _unused_fields(self.servo):
            del content["servo"][name]
        if surface is not None:
            content["terrain"]["surface"] = surface.digest
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
