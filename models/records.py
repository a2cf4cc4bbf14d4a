"""What the robot is: frozen records with units and ranges.

Frames and conventions: docs/architecture.md. Records hold tuples of floats, so a robot is hashable,
picklable and comparable; `dataclasses.replace` makes a changed one, `check_robot` judges it by the
rules that files are judged by.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.models.schema import Choice, Number, Vector

Array = NDArray[np.float64]
Vector3 = tuple[float, float, float]
Vector6 = tuple[float, float, float, float, float, float]

LEG_NAMES = ("LF", "LM", "LR", "RF", "RM", "RR")
JOINT_NAMES = ("coxa", "femur", "tibia")
CONTACT_LAWS = (
    "exact_restitution",
    "flores",
    "lankarani_nikravesh",
    "hunt_crossley",
    "constant_damping",
    "hertz",
)
FRICTION_LAWS = ("tanh", "none", "bristle")
STATIC_LAWS = ("bristle",)  # friction laws that tell static from kinetic friction
SERVO_MODES = ("position", "torque", "kinematic")
METHODS = ("rosw3", "ros2", "dp54", "bs32", "rk4")
PROJECTIONS = ("none", "step")
TERRAINS = ("flat", "slope")
GAITS = ("tripod", "ripple", "wave", "amble")


@dataclass(frozen=True, kw_only=True)
class Torso:
    """The main body; its frame's origin is the one hip positions are measured from."""

    mass: Annotated[float, Number("kg", above=0.0)]
    size: Annotated[
        Vector3, Vector("m", 3, above=0.0)
    ]  # box, for drawing and for the default inertia
    com: Annotated[Vector3, Vector("m", 3, default=(0.0, 0.0, 0.0))]
    inertia: Annotated[
        Vector6, Vector("kg m2", 6)
    ]  # about the com: xx yy zz xy xz yz; absent in a file: of the box


@dataclass(frozen=True, kw_only=True)
class Link:
    """One moving segment; its frame sits at its own joint and equals the parent's at angle 0."""

    mass: Annotated[float, Number("kg", above=0.0)]
    length: Annotated[float, Number("m")]  # next joint (tibia: foot centre) along x
    offset_y: Annotated[float, Number("m", default=0.0)]
    offset_z: Annotated[float, Number("m", default=0.0)]
    com: Annotated[Vector3, Vector("m", 3)]
    inertia: Annotated[Vector6, Vector("kg m2", 6)]  # about the com: xx yy zz xy xz yz
    axis: Annotated[Vector3, Vector("1", 3)]  # in the parent frame (coxa: hip frame), unit length
    angle_min: Annotated[float, Number("rad", at_least=-math.pi, at_most=math.pi)]
    angle_max: Annotated[float, Number("rad", at_least=-math.pi, at_most=math.pi)]

    @property
    def tip(self) -> Vector3:
        """Next joint or foot centre in the link frame [m]."""
        return (self.length, self.offset_y, self.offset_z)


@dataclass(frozen=True, kw_only=True)
class Leg:
    """Three links on a hip."""

    name: str
    hip_position: Annotated[Vector3, Vector("m", 3)]  # in the torso frame
    hip_yaw: Annotated[float, Number("rad", at_least=-math.pi, at_most=math.pi)]
    links: tuple[Link, Link, Link]
    stance: Annotated[Vector3, Vector("rad", 3)]  # joint angles of the standing pose


@dataclass(frozen=True, kw_only=True)
class Foot:
    radius: Annotated[float, Number("m", above=0.0)]
    youngs_modulus: Annotated[float, Number("Pa", above=0.0)]
    poisson: Annotated[float, Number("1", above=-1.0, at_most=0.5)]


@dataclass(frozen=True, kw_only=True)
class Contact:
    law: Annotated[str, Choice(CONTACT_LAWS)]
    stiffness: Annotated[
        float, Number("N/m^1.5", above=0.0)
    ]  # absent in a file: Hertz, sphere on rigid ground
    restitution: Annotated[float, Number("1", at_least=0.0, at_most=1.0)]
    damping_factor: Annotated[float, Number("s/m", at_least=0.0)]  # c of the constant law
    impact_speed_floor: Annotated[float, Number("m/s", above=0.0)]


@dataclass(frozen=True, kw_only=True)
class Friction:
    law: Annotated[str, Choice(FRICTION_LAWS)]
    mu: Annotated[float, Number("1", at_least=0.0)]
    # of a foot that sticks, bristle law; 0 or absent: mu
    mu_static: Annotated[float, Number("1", at_least=0.0, default=0.0)] = 0.0
    slope: Annotated[float, Number("s/m", above=0.0)]  # k_t of eq. 15, tanh law
    presliding: Annotated[
        float, Number("m", at_least=1e-7, at_most=1.0)
    ]  # b_max of eq. 16, bristle law; absent in a file: Mindlin
    bristle_damping: Annotated[
        float, Number("s", at_least=0.0, at_most=10.0, default=0.005)
    ]  # tau of eq. 17, bristle law
    # v_s of eq. 18, bristle law
    stribeck_speed: Annotated[float, Number("m/s", at_least=1e-6, at_most=100.0, default=0.005)] = (
        0.005
    )


@dataclass(frozen=True, kw_only=True)
class Servo:
    mode: Annotated[str, Choice(SERVO_MODES)]
    kp: Annotated[float, Number("N m/rad", at_least=0.0)]
    kd: Annotated[float, Number("N m s/rad", at_least=0.0)]
    torque_max: Annotated[float, Number("N m", above=0.0)]  # at stall
    speed_max: Annotated[float, Number("rad/s", above=0.0)]  # no-load
    rotor_inertia: Annotated[float, Number("kg m2", at_least=0.0)]  # seen at the joint
    coulomb_friction: Annotated[float, Number("N m", at_least=0.0)]
    torque_continuous: Annotated[float, Number("N m", above=0.0)]  # above it, a warning
    # at the joint: torque over the root of the copper loss; absent in a file: of an ideal motor
    motor_constant: Annotated[float, Number("N m/sqrt(W)", above=0.0)]


@dataclass(frozen=True, kw_only=True)
class Baumgarte:
    alpha: Annotated[float, Number("1/s", at_least=0.0)]
    beta: Annotated[float, Number("1/s", at_least=0.0)]


@dataclass(frozen=True, kw_only=True)
class Solver:
    method: Annotated[str, Choice(METHODS)]
    step: Annotated[float, Number("s", at_least=0.0)]  # 0: error control
    tolerance: Annotated[float, Number("1", above=0.0, below=1.0)]
    step_max: Annotated[float, Number("s", above=0.0)]
    projection: Annotated[str, Choice(PROJECTIONS, default="none")]


@dataclass(frozen=True, kw_only=True)
class Terrain:
    kind: Annotated[str, Choice(TERRAINS)]
    height: Annotated[float, Number("m", default=0.0)]
    incline: Annotated[float, Number("rad", above=-math.pi / 2, below=math.pi / 2, default=0.0)]
    heading: Annotated[float, Number("rad", default=0.0)]


@dataclass(frozen=True, kw_only=True)
class Gait:
    name: Annotated[str, Choice(GAITS)]
    period: Annotated[float, Number("s", above=0.0)]
    duty: Annotated[float, Number("1", above=0.0, below=1.0)]
    stride: Annotated[float, Number("m", at_least=0.0)]  # the body's way in one period
    step_height: Annotated[float, Number("m", above=0.0)]


def _plain(content: Any) -> Any:
    """Nested content in which equal numbers are written alike: 0 and -0.0 as 0.0."""
    if isinstance(content, dict):
        return {key: _plain(value) for key, value in content.items()}
    if isinstance(content, tuple | list):
        return [_plain(value) for value in content]
    if isinstance(content, int | float) and not isinstance(content, bool):
        return float(content) + 0.0
    return content


@dataclass(frozen=True, kw_only=True)
class Robot:
    """A six-legged robot with its laws and settings; `source` says where its numbers come from."""

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
    source: Mapping[str, str] = field(default_factory=dict, compare=False)

    @property
    def total_mass(self) -> float:
        """kg"""
        return self.torso.mass + sum(link.mass for leg in self.legs for link in leg.links)

    @property
    def weight(self) -> float:
        """N"""
        return self.total_mass * float(np.linalg.norm(self.gravity))

    @property
    def stance(self) -> Array:
        """(6, 3) joint angles of the standing pose [rad]."""
        return np.array([leg.stance for leg in self.legs])

    @property
    def angle_min(self) -> Array:
        """(6, 3) lower joint limits [rad]."""
        return np.array([[link.angle_min for link in leg.links] for leg in self.legs])

    @property
    def angle_max(self) -> Array:
        """(6, 3) upper joint limits [rad]."""
        return np.array([[link.angle_max for link in leg.links] for leg in self.legs])

    @cached_property
    def hash(self) -> str:
        """sha256 of everything but the provenance texts, in hex: equal robots, equal hash."""
        content = _plain(asdict(self))
        del content["source"]
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
