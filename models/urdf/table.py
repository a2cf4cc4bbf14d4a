"""Converts a URDF to the tables of a robot file.

Data that the URDF lacks come, in this order, from a side file, from the URDF's <hexapod> element,
or from defaults.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.contact.law import BodyContact, Contact
from hexapod_cosim.models.errors import RobotError
from hexapod_cosim.models.files import merged_tables, read_bytes
from hexapod_cosim.models.friction import Friction
from hexapod_cosim.models.ground.surface import Terrain
from hexapod_cosim.models.ground.table import beside, patch_specs, read_keys, terrain_specs
from hexapod_cosim.models.kinematics import axis_rotation
from hexapod_cosim.models.method import Baumgarte, Solver
from hexapod_cosim.models.records import (
    JOINT_NAMES,
    LEG_NAMES,
    Foot,
    Gait,
    JointNames,
    Leg,
    Link,
    Servo,
    Torso,
)
from hexapod_cosim.models.schema import (
    Choice,
    Number,
    Text,
    Vector,
    expect_table,
    read_given,
    refuse_unknown_keys,
    specs,
    wrong_type,
)
from hexapod_cosim.models.servos.presets import servo_table
from hexapod_cosim.models.soil.presets import Soil, soil_table
from hexapod_cosim.models.urdf.assumed import (
    assume_gait,
    assume_servo,
    assume_stances,
    equivalent_box,
)
from hexapod_cosim.models.urdf.bodies import Body, root_body
from hexapod_cosim.models.urdf.elements import Urdf, extension_tables, parse_urdf
from hexapod_cosim.models.urdf.legs import FoundLeg, find_legs, inertia_entries

Table = dict[str, Any]

JOINTS = "read: joints "  # a leg's, in source

# the torso's yaw in the root link
FORWARD = {"x": 0.0, "y": 0.5 * np.pi, "-x": np.pi, "-y": -0.5 * np.pi}
# keys of the servo, and of a joint in the URDF
SIZES = {"torque_max": "effort", "speed_max": "velocity", "coulomb_friction": "friction"}
WHOLE = ("contact", "friction", "baumgarte", "solver", "terrain")  # sections that URDF lacks
SECTIONS: dict[str, type[Any]] = {
    "torso": Torso,
    "foot": Foot,
    "contact": Contact,
    "friction": Friction,
    "servo": Servo,
    "baumgarte": Baumgarte,
    "solver": Solver,
    "terrain": Terrain,
    "soil": Soil,
    "gait": Gait,
    "body": BodyContact,
    "joints": JointNames,
}
EXTENSION_FIELDS: dict[str, dict[str, Any]] = {
    **{name: dict(specs(record)) for name, record in SECTIONS.items() if name != "joints"},
    "terrain": terrain_specs(),
    "world": {"gravity": Vector("m/s2", 3)},
    **{name: {"stance": Vector("rad", 3), "signs": Vector("1", 3)} for name in LEG_NAMES},
}


# elements within a section of <hexapod>
EXTENSION_ENTRIES = {"terrain": {"patch": {**patch_specs(), "size": Vector("m", 2)}}}


@dataclass(frozen=True)
class Options:
    """The [urdf] table of a side file."""

    forward: str = "x"
    keep_frames: bool = False

    @classmethod
    def read(cls, table: Mapping[str, Any], where: str) -> Options:
        """Returns the options of a table. Raises RobotError for keys and values not allowed."""
        refuse_unknown_keys(table, ["file", "forward", "keep_frames"], where)
        forward = Choice(tuple(FORWARD)).read(table.get("forward", "x"), f"{where}.forward")
        keep = table.get("keep_frames", False)
        if not isinstance(keep, bool):
            raise wrong_type(keep, "true or false", "correct it", f"{where}.keep_frames")
        return cls(forward, keep)


def side_table(side: Mapping[str, Any], folder: Path, where: str) -> Table:
    """Returns all tables of a robot file that names a URDF under [urdf], relative to its folder.

    Raises RobotError.
    """
    given = expect_table(side["urdf"], f"{where}: urdf")
    file = Text().read(given.get("file"), f"{where}: urdf.file")
    rest = {key: value for key, value in side.items() if key != "urdf"}
    options = Options.read(given, f"{where}: urdf")
    return urdf_table(folder / file, side=rest, options=options, where=where)


def urdf_table(
    path: Path,
    *,
    side: Mapping[str, Any] | None = None,
    options: Options | None = None,
    where: str | None = None,
) -> Table:
    """Returns the tables of a robot file from a URDF and the tables that override it.

    Raises RobotError.

    where: name of the side file for messages.
    """
    options, side = options or Options(), {} if side is None else side
    urdf = parse_urdf(_read(path), where=str(path))
    own = extension_tables(urdf, EXTENSION_FIELDS, EXTENSION_ENTRIES)
    own = _terrain_beside(own, path.parent)
    keep = options.keep_frames or (
        urdf.extension is not None and urdf.extension.get("frames") == "ours"
    )
    root = root_body(urdf)
    torso, legs = _found(root, urdf, options.forward, keep_frames=keep)
    legs = [_turned(leg, own.get(leg.name, {}).get("signs", (1.0, 1.0, 1.0))) for leg in legs]
    above = merged_tables(_shaped(own), _spread(side, where or str(path)))
    table = merged_tables(merged_tables(_assumed(), _measured(urdf, torso, legs)), above)
    _refuse_footless(legs, table, urdf.where)
    assumed = [name for name in WHOLE if name not in own and name not in side]
    assumed += _complete(table, legs, urdf)
    bare = "body" not in own and "body" not in side
    source = _source(urdf, legs, assumed, bare=bare) | _damped(table, legs, assumed)
    table["source"] = source | dict(side.get("source", {}))
    return table


def _terrain_beside(own: Table, folder: Path) -> Table:
    """Returns the tables with the path of a height map relative to a folder resolved."""
    return own | {"terrain": beside(own["terrain"], folder)} if "terrain" in own else own


def _read(path: Path) -> bytes:
    try:
        return read_bytes(path)
    except OSError as error:
        what, fix = "cannot read the URDF", "give the path of a URDF"
        raise RobotError(what, got=error.strerror, fix=fix, where=str(path)) from error


def _assumed() -> Table:
    return tomllib.loads((Path(__file__).parent / "assumed.toml").read_text(encoding="utf-8"))


def _turned(leg: FoundLeg, signs: Sequence[float]) -> FoundLeg:
    """Returns a leg with the joints of negative sign counted against the URDF's axes."""
    other_way = [k for k, sign in enumerate(signs) if sign < 0.0]
    table = dict(leg.table)
    for joint in (JOINT_NAMES[k] for k in other_way):
        link = table[joint]
        limits = {"angle_min": -link["angle_max"], "angle_max": -link["angle_min"]}
        table[joint] = link | {"axis": [0.0 - value for value in link["axis"]]} | limits
    return replace(leg, table=table, reversed=(*leg.reversed, *(leg.joints[k] for k in other_way)))


def _found(
    root: Body, urdf: Urdf, forward: str, *, keep_frames: bool
) -> tuple[Table, list[FoundLeg]]:
    """Returns the table of the torso, and the legs.

    The torso's frame lies at its heaviest link, with the root link's axes rotated to the forward
    direction.
    """
    inertial = root.inertial(urdf.where)
    heaviest = max(
        root.members, key=lambda member: member.link.inertial.mass if member.link.inertial else 0.0
    )
    origin = heaviest.position
    axes = np.round(axis_rotation(np.array([0.0, 0.0, 1.0]), FORWARD[forward])) + 0.0
    torso = {
        "mass": inertial.mass,
        "com": (axes.T @ (inertial.com - origin) + 0.0).tolist(),
        "inertia": inertia_entries(axes.T @ inertial.inertia @ axes + 0.0),
    }
    torso["size"] = _box(root, axes, torso) or equivalent_box(torso["mass"], torso["inertia"])
    return torso, find_legs(root, origin, axes, keep_frames=keep_frames, where=urdf.where)


def _refuse_footless(legs: list[FoundLeg], table: Table, where: str) -> None:
    """Raises RobotError for a leg of which no file gives the foot."""
    for leg in legs:
        if "length" not in table["legs"][leg.name]["tibia"]:
            raise RobotError(
                "a leg without a foot",
                expected="a foot",
                fix="give it a collision sphere where it touches the ground, or a fixed link "
                "there; or give length and offsets under [links.tibia]",
                where=f"{where}: link {leg.servo[2].body.name!r}",
            )


def _box(root: Body, axes: Array, torso: Table) -> list[float] | None:
    """Returns the extents [m] of the torso's largest box, if it can contain its matter."""
    boxes = [
        np.abs(axes.T @ member.rotation) @ member.link.box
        for member in root.members
        if member.link.box is not None
    ]
    largest = max(boxes, key=lambda size: float(np.prod(size)), default=np.zeros(3))
    gyration = np.sqrt(sum(torso["inertia"][:3]) / (2.0 * torso["mass"]))
    return [float(edge) for edge in largest] if np.linalg.norm(largest) > gyration else None


def _measured(urdf: Urdf, torso: Table, legs: list[FoundLeg]) -> Table:
    """Returns the data of the URDF."""
    table: Table = {
        "name": urdf.name,
        "torso": torso,
        "body": {},
        "legs": {leg.name: leg.table for leg in legs},
        "joints": {
            "names": [name for leg in legs for name in leg.joints],
            "reversed": [name for leg in legs for name in leg.reversed],
        },
        "servo": {},
        "foot": {},
    }
    if all(leg.radius is not None for leg in legs):
        table["foot"]["radius"] = [leg.radius for leg in legs]
    for key, name in SIZES.items():
        table["servo"][key] = [getattr(branch.joint, name) for leg in legs for branch in leg.servo]
    return table


def _shaped(own: Table) -> Table:
    """Returns the tables of the <hexapod> element in the form of a robot file."""
    table: Table = {
        key: value for key, value in own.items() if key not in ("world", *LEG_NAMES)
    } | own.get("world", {})
    for name in LEG_NAMES:
        if "stance" in own.get(name, {}):
            stance = {
                joint: {"stance": angle}
                for joint, angle in zip(JOINT_NAMES, own[name]["stance"], strict=True)
            }
            table.setdefault("legs", {})[name] = stance
    return table


def _spread(side: Mapping[str, Any], where: str) -> Table:
    """Returns a side file's tables with [links.*] copied to every leg, so that they override the
    URDF's.
    """
    _check_side(side, where)
    table = deepcopy(dict(side))
    if "servo" in table:  # a measured servo's numbers override the URDF's
        table["servo"] = dict(servo_table(table["servo"], f"{where}: servo"))
    links, legs = table.pop("links", {}), table.get("legs", {})
    table["legs"] = {name: merged_tables(links, legs.get(name, {})) for name in LEG_NAMES}
    return table


def _check_side(side: Mapping[str, Any], where: str) -> None:
    """Raises RobotError for keys and types that are invalid in a robot file."""
    refuse_unknown_keys(side, ["name", "gravity", "source", "links", "legs", *SECTIONS], where)
    readers = {"soil": soil_table, "servo": servo_table}
    for name, record in SECTIONS.items():
        at, value = f"{where}: {name}", side.get(name, {})
        if name == "terrain":
            read_keys(value, at)
        else:
            read_given(record, readers.get(name, expect_table)(value, at), at)
    at = f"{where}: legs"
    legs = expect_table(side.get("legs", {}), at)
    refuse_unknown_keys(legs, LEG_NAMES, at)
    for name, leg in legs.items():
        read_given(Leg, leg, f"{at}.{name}", extra=JOINT_NAMES)
        _check_links({key: leg[key] for key in JOINT_NAMES if key in leg}, f"{at}.{name}")
    _check_links(expect_table(side.get("links", {}), f"{where}: links"), f"{where}: links")
    expect_table(side.get("source", {}), f"{where}: source")


def _check_links(links: Mapping[str, Any], where: str) -> None:
    refuse_unknown_keys(links, JOINT_NAMES, where)
    for joint, link in links.items():
        read_given(Link, link, f"{where}.{joint}", extra=("stance",))
        Number("rad").read(link.get("stance", 0.0), f"{where}.{joint}.stance")


def _complete(table: Table, legs: list[FoundLeg], urdf: Urdf) -> list[str]:
    """Fills in missing values, in place; returns the names of assumed ones."""
    _unify(table, legs, urdf)
    assumed = ["foot.radius"] if any(leg.radius is None for leg in legs) else []
    assumed += [f"servo.{key}" for key in assume_servo(table["servo"])]
    stances = assume_stances(table["legs"])
    assumed += ["stance"] if stances else []
    return assumed + [f"gait.{key}" for key in assume_gait(table["gait"], _height(table))]


def _damped(table: Table, legs: list[FoundLeg], assumed: list[str]) -> Table:
    """Adds the mean damping of the joints to an assumed kd, in place; returns the note about it."""
    damping = float(np.mean([branch.joint.damping for leg in legs for branch in leg.servo]))
    if damping == 0.0:
        return {}
    if "servo.kd" in assumed:
        table["servo"]["kd"] += damping
    done = "added to" if "servo.kd" in assumed else "without effect beside the given"
    return {"URDF, damping": f"{damping:.6g} N m s/rad of the joints, {done} servo.kd"}


def _unify(table: Table, legs: list[FoundLeg], urdf: Urdf) -> None:
    """Replaces lists of one number per joint or foot by a single number, in place."""
    joints = [name for leg in legs for name in leg.joints]
    for key, name in SIZES.items():
        _unify_one(table, f"servo.{key}", joints, name, urdf.where)
    _unify_one(table, "foot.radius", [leg.joints[2] for leg in legs], "radius", urdf.where)


def _unify_one(table: Table, key: str, owners: list[str], name: str, where: str) -> None:
    """Replaces a list of equal numbers; side files give one number. Raises RobotError."""
    section, _, last = key.partition(".")
    values = table[section].get(last)
    if not isinstance(values, list):
        return
    odd = next((k for k, value in enumerate(values) if value is None or value != values[0]), 0)
    if values[odd] is None or values[odd] != values[0]:
        raise RobotError(
            f"no {name}" if values[odd] is None else f"another {name}",
            got=values[odd],
            expected=f"{values[0]!r} as at {owners[0]!r}: all joints have the same servo, all feet "
            "the same radius",
            fix=f"give {key} for all in a robot file with [urdf] file",
            where=f"{where}: joint {owners[odd]!r}",
        )
    table[section][last] = values[0]


def _height(table: Table) -> float:
    """Returns the approximate height of the hips above the feet [m]."""
    legs = table["legs"].values()
    return float(np.mean([_drop(leg) for leg in legs]))


def _drop(leg: Table) -> float:
    """Returns how far a foot is below its hip in the standing pose [m]."""
    R, z = np.eye(3), 0.0
    for joint in JOINT_NAMES:
        link = leg[joint]
        R = R @ axis_rotation(np.array(link["axis"]), link["stance"])
        z -= float(R[2] @ [link["length"], link.get("offset_y", 0.0), link.get("offset_z", 0.0)])
    return max(z, 1e-3)


def _source(urdf: Urdf, legs: list[FoundLeg], assumed: list[str], *, bare: bool) -> Table:
    source = {"robot": f"read from the URDF of {urdf.name!r}"}
    source |= {f"leg {leg.name}": f"{JOINTS}{', '.join(leg.joints)}" for leg in legs}
    other_way = [name for leg in legs for name in leg.reversed]
    if other_way:
        source["URDF, angles"] = f"counted against the URDF's axes: {', '.join(other_way)}"
    if assumed:
        source["URDF, assumed"] = f"the URDF does not say, so assumed: {', '.join(assumed)}"
    if bare:
        source["URDF, body"] = "only the feet touch the ground; [body] of a robot file gives more"
    counts = [f"{count} {name}" for name, count in sorted(urdf.ignored.items()) if count]
    ignored = ", ".join(counts)
    return source | (
        {"URDF, ignored": f"in the URDF, without effect here: {ignored}"} if ignored else {}
    )


def element_named(error: RobotError, table: Mapping[str, Any]) -> RobotError:
    """Returns the same exception with the URDF's names of legs and links."""
    where = error.where or ""
    leg = next((name for name in LEG_NAMES if f"legs.{name}" in where), None)
    joints = table["source"].get(f"leg {leg}", "").removeprefix(JOINTS).split(", ")
    link = next((k for k, joint in enumerate(JOINT_NAMES) if f".{joint}" in where), None)
    named = [joint for k, joint in enumerate(joints) if joint and link in (None, k)]
    at = f"{where} (joint {', '.join(named)})" if named else where
    return RobotError(error.what, got=error.got, expected=error.expected, fix=error.fix, where=at)
