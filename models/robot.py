"""Reads robot files: `load_robot("athena")` returns a checked `Robot`.

A robot file contains the link data that all legs share in [links.coxa], [links.femur] and
[links.tibia]. A leg can override any of their keys in [legs.LF.femur] and so on, so legs can
differ.

Three values are computed if a file omits them: torso.inertia (homogeneous box of torso.size),
contact.stiffness (Hertz, from the foot's radius and material) and friction.presliding (Mindlin,
from the same and the weight).

A URDF is a robot file too. A robot file can also refer to one by [urdf] file = "my.urdf" and
override its data (urdf/). records.py defines the records.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from hexapod_cosim.models.arrays import Vector3, Vector6
from hexapod_cosim.models.contact.law import BodyContact, Contact
from hexapod_cosim.models.errors import RobotError, refuse_path
from hexapod_cosim.models.files import parse_toml, path_of, read_text, reading_toml
from hexapod_cosim.models.friction import Friction
from hexapod_cosim.models.ground.surface import Terrain
from hexapod_cosim.models.ground.table import read_terrain, terrain_beside
from hexapod_cosim.models.records import (
    JOINT_NAMES,
    LEG_NAMES,
    Foot,
    JointNames,
    Leg,
    Link,
    Robot,
    Servo,
    Torso,
)
from hexapod_cosim.models.schema import (
    Number,
    Text,
    Vector,
    expect_table,
    missing_key,
    read_given,
    refuse_unknown_keys,
    require,
)
from hexapod_cosim.models.servos.presets import servo_table
from hexapod_cosim.models.soil.presets import Soil, soil_table
from hexapod_cosim.models.urdf.table import SECTIONS, element_named, side_table, urdf_table
from hexapod_cosim.models.validation import check_robot

LEAST_PRESLIDING = 1e-6  # m  default without load or friction
STANCE = Number("rad", at_least=-math.pi, at_most=math.pi)


def list_robots() -> list[str]:
    """Returns the names of the robots in this package."""
    return sorted(path.stem for path in Path(__file__).parent.glob("*.toml"))


def load_robot(path_or_name: str | Path) -> Robot:
    """Reads and checks a robot file, or a robot of `list_robots()` by name. Raises RobotError."""
    refuse_path(path_or_name, "the robot file", RobotError)
    path = robot_path(path_or_name)
    if path.suffix.lower() == ".urdf":
        return _robot_from_urdf(urdf_table(path), str(path))
    with reading_toml(
        path, kind="robot", name="the robot file", names=list_robots, error=RobotError
    ):
        text = read_text(path)
        alone = _robot_from_text(text, str(path))
    if alone is not None:
        return alone
    table = terrain_beside(parse_toml(text), path.parent)
    if "urdf" in table:
        return _robot_from_urdf(side_table(table, path.parent, str(path)), str(path))
    return robot_from_table(table, where=str(path))


@lru_cache(maxsize=64)
def _robot_from_text(text: str, where: str) -> Robot | None:
    """Returns the robot of a file's text, or None if it refers to a URDF or a height map.

    Results are cached by the text; the other file can change without it.
    """
    table = parse_toml(text)
    terrain = table.get("terrain")
    if "urdf" in table or (isinstance(terrain, dict) and "file" in terrain):
        return None
    return robot_from_table(table, where=where)


def _robot_from_urdf(table: Mapping[str, Any], where: str) -> Robot:
    """Returns the robot of a URDF's tables. Error messages name the URDF's elements."""
    try:
        return robot_from_table(table, where=where)
    except RobotError as error:
        raise element_named(error, table) from error


def robot_path(path_or_name: str | Path) -> Path:
    """Returns the path of a robot file, given by path or by name."""
    own = {name: Path(__file__).parent / f"{name}.toml" for name in list_robots()}
    return path_of(path_or_name, "robot", own, RobotError)


def robot_from_table(table: Mapping[str, Any], *, where: str) -> Robot:
    """Returns a checked robot from the nested tables of a robot file. Raises RobotError.

    where: name of the file for messages.
    """
    expect_table(table, where)
    refuse_unknown_keys(table, ["name", "gravity", "source", "links", "legs", *SECTIONS], where)
    sections = {
        name: _read_section(table, name, f"{where}: {name}")
        for name in SECTIONS
        if name != "friction"
    }
    given = table.get("gravity", (0.0, 0.0, -9.81))
    x, y, z = Vector("m/s2", 3).read(given, f"{where}: gravity")
    legs = _read_legs(table, where)
    mass = sections["torso"].mass + sum(link.mass for leg in legs for link in leg.links)
    standing = mass * math.hypot(x, y, z) / 3.0  # N  load of a foot of a tripod
    robot = Robot(
        name=Text().read(table.get("name"), f"{where}: name"),
        gravity=(x, y, z),
        legs=legs,
        friction=_read_friction(
            table, f"{where}: friction", sections["foot"], sections["contact"], standing
        ),
        source={
            key: Text().read(text, f"{where}: source.{key}")
            for key, text in expect_table(table.get("source", {}), f"{where}: source").items()
        },
        **sections,
    )
    check_robot(robot, where=where)
    return robot


def _section(table: Mapping[str, Any], name: str, where: str) -> Mapping[str, Any]:
    if name not in table:
        raise RobotError(
            "missing section", expected=f"a table [{name}]", fix=f"add [{name}]", where=where
        )
    return expect_table(table[name], where)


def _read_friction(
    table: Mapping[str, Any], where: str, foot: Foot, contact: Contact, load: float
) -> Friction:
    given = read_given(Friction, _section(table, "friction", where), where)
    if "presliding" not in given and "mu" in given:
        given["presliding"] = mindlin_presliding(
            foot, contact.stiffness, max(given["mu"], given.get("mu_static", 0.0)), load
        )
    return Friction(**require(Friction, given, where))


def _read_section(table: Mapping[str, Any], name: str, where: str) -> Any:
    record = SECTIONS[name]
    if record in (BodyContact, JointNames) and name not in table:
        return record()
    if record is Terrain:
        return read_terrain(_section(table, name, where), where)
    if record is Soil:  # no section: rigid ground
        section = soil_table(table.get(name, {}), where)
    else:
        section = _section(table, name, where)
    if record is Servo:
        section = servo_table(section, where)
    given = read_given(record, section, where)
    if record is Torso and {"mass", "size"} <= given.keys():
        given.setdefault("inertia", box_inertia(given["mass"], given["size"]))
    if record is Contact and "stiffness" not in given:
        given["stiffness"] = hertz_stiffness(
            _read_section(table, "foot", where.replace("contact", "foot"))
        )
    if record is Servo and {"torque_max", "speed_max"} <= given.keys():
        constant = ideal_motor_constant(given["torque_max"], given["speed_max"])
        given.setdefault("motor_constant", constant)
    return record(**require(record, given, where))


def _read_legs(table: Mapping[str, Any], where: str) -> tuple[Leg, ...]:
    shared = expect_table(table.get("links", {}), f"{where}: links")
    legs = expect_table(table.get("legs", {}), f"{where}: legs")
    refuse_unknown_keys(shared, list(JOINT_NAMES), f"{where}: links")
    refuse_unknown_keys(legs, list(LEG_NAMES), f"{where}: legs")
    common = {
        joint: _read_link(shared.get(joint, {}), f"{where}: links.{joint}") for joint in JOINT_NAMES
    }
    return tuple(_read_leg(name, legs, common, f"{where}: legs.{name}") for name in LEG_NAMES)


def _read_link(table: Any, where: str) -> dict[str, Any]:
    given = read_given(Link, table, where, extra=("stance",))
    if "stance" in table:
        given["stance"] = STANCE.read(table["stance"], f"{where}.stance")
    return given


def _read_leg(
    name: str, legs: Mapping[str, Any], common: Mapping[str, dict[str, Any]], where: str
) -> Leg:
    if name not in legs:
        expected = "legs " + " ".join(LEG_NAMES)
        raise RobotError("missing leg", expected=expected, fix=f"add [legs.{name}]", where=where)
    table = expect_table(legs[name], where)
    refuse_unknown_keys(table, ["hip_position", "hip_yaw", *JOINT_NAMES], where)
    placed = {key: value for key, value in table.items() if key not in JOINT_NAMES}
    links, stance = [], []
    for joint in JOINT_NAMES:
        values = common[joint] | _read_link(table.get(joint, {}), f"{where}.{joint}")
        if "stance" not in values:
            raise missing_key("stance", STANCE, f"{where}.{joint}.stance")
        stance.append(values.pop("stance"))
        links.append(Link(**require(Link, values, f"{where}.{joint}")))
    given = read_given(Leg, placed, where) | {"stance": tuple(stance)}
    return Leg(name=name, links=(links[0], links[1], links[2]), **require(Leg, given, where))


def box_inertia(mass: float, size: Vector3) -> Vector6:
    """Returns the inertia of a homogeneous box about its centre [kg m2]: xx yy zz xy xz yz."""
    x2, y2, z2 = (edge * edge for edge in size)
    return (
        mass / 12.0 * (y2 + z2),
        mass / 12.0 * (x2 + z2),
        mass / 12.0 * (x2 + y2),
        0.0,
        0.0,
        0.0,
    )


def ideal_motor_constant(torque_max: float, speed_max: float) -> float:
    """Returns the motor constant of an ideal motor, k_m = T_s/sqrt(T_s w_0) [N m/sqrt(W)].

    It is the stall torque over the root of the stall power of a direct-current motor that has
    copper losses only, from its stall torque [N m] and no-load speed [rad/s].
    """
    return math.sqrt(torque_max / speed_max)


def hertz_stiffness(foot: Foot) -> float:
    """Returns K of F = K delta^1.5 for the foot's sphere on a rigid half-space [N/m^1.5]."""
    return 4.0 / 3.0 * math.sqrt(foot.radius) * foot.youngs_modulus / (1.0 - foot.poisson**2)


def mindlin_presliding(foot: Foot, stiffness: float, mu: float, load: float) -> float:
    """Returns the tangential displacement [m] at which the loaded foot slides (Mindlin 1949).

    3 mu f_n (2 - nu)/(16 G a) with the load f_n [N], the radius of the contact a = sqrt(R delta),
    and delta = (f_n/K)^(2/3).
    """
    shear_modulus = foot.youngs_modulus / (2.0 * (1.0 + foot.poisson))
    per_root_depth = 16.0 / 3.0 * shear_modulus * math.sqrt(foot.radius) / (2.0 - foot.poisson)
    return max(mu * math.cbrt(load * load * stiffness) / per_root_depth, LEAST_PRESLIDING)
