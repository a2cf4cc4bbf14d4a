"""Converts a URDF to the tables of a robot file.

Data that the URDF lacks come, in this order, from a side file, from the URDF's <hexapod> element,
or from defaults.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass, is_dataclass
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.errors import RobotError
from hexapod_cosim.models.files import merged_tables, read_bytes
from hexapod_cosim.models.ground.table import patch_specs, read_keys, terrain_beside, terrain_specs
from hexapod_cosim.models.kinematics import axis_rotation
from hexapod_cosim.models.records import JOINT_NAMES, LEG_NAMES, Leg, Link, Robot
from hexapod_cosim.models.schema import (
    Choice,
    Flag,
    Number,
    Text,
    Vector,
    expect_table,
    read_given,
    read_record,
    refuse_unknown_keys,
    specs,
)
from hexapod_cosim.models.servos.presets import servo_table
from hexapod_cosim.models.soil.presets import soil_table
from hexapod_cosim.models.urdf.assumed import SIZES, add_damping, complete, equivalent_box
from hexapod_cosim.models.urdf.bodies import Body, root_body
from hexapod_cosim.models.urdf.elements import Urdf, extension_tables, parse_urdf
from hexapod_cosim.models.urdf.legs import (
    FoundLeg,
    find_legs,
    inertia_entries,
    refuse_footless,
    turned_leg,
)

Table = dict[str, Any]

JOINTS = "read: joints "  # a leg's, in source

# the torso's yaw in the root link
FORWARD = {"x": 0.0, "y": 0.5 * np.pi, "-x": np.pi, "-y": -0.5 * np.pi}
WHOLE = ("contact", "friction", "baumgarte", "solver", "terrain")  # sections that URDF lacks
# the records of a robot, by the names of their tables
SECTIONS: dict[str, type[Any]] = {
    name: kind
    for name, kind in get_type_hints(Robot).items()
    if isinstance(kind, type) and is_dataclass(kind)
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

    file: Annotated[str, Text()]
    forward: Annotated[str, Choice(tuple(FORWARD))] = "x"
    keep_frames: Annotated[bool, Flag()] = False


def side_table(side: Mapping[str, Any], folder: Path, where: str) -> Table:
    """Returns all tables of a robot file that names a URDF under [urdf], relative to its folder.

    Raises RobotError.
    """
    options = read_record(Options, side["urdf"], f"{where}: urdf")
    rest = {key: value for key, value in side.items() if key != "urdf"}
    return urdf_table(folder / options.file, side=rest, options=options, where=where)


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
    options, side = options or Options(str(path)), {} if side is None else side
    try:
        urdf = parse_urdf(read_bytes(path), where=str(path))
    except OSError as error:
        what, fix = "cannot read the URDF", "give the path of a URDF"
        raise RobotError(what, got=error.strerror, fix=fix, where=str(path)) from error
    own = extension_tables(urdf, EXTENSION_FIELDS, EXTENSION_ENTRIES)
    own = terrain_beside(own, path.parent)
    keep = options.keep_frames or (
        urdf.extension is not None and urdf.extension.get("frames") == "ours"
    )
    root = root_body(urdf)
    torso, legs = _found(root, urdf, options.forward, keep_frames=keep)
    legs = [turned_leg(leg, own.get(leg.name, {}).get("signs", (1.0, 1.0, 1.0))) for leg in legs]
    above = merged_tables(_shaped(own), _spread(side, where or str(path)))
    table = merged_tables(merged_tables(_assumed(), _measured(urdf, torso, legs)), above)
    refuse_footless(legs, table, urdf.where)
    assumed = [name for name in WHOLE if name not in own and name not in side]
    assumed += complete(table, legs, urdf)
    bare = "body" not in own and "body" not in side
    source = _source(urdf, legs, assumed, bare=bare) | add_damping(table, legs, assumed)
    table["source"] = source | dict(side.get("source", {}))
    return table


def _assumed() -> Table:
    return tomllib.loads((Path(__file__).parent / "assumed.toml").read_text(encoding="utf-8"))


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
    R_BT = np.round(axis_rotation(np.array([0.0, 0.0, 1.0]), FORWARD[forward])) + 0.0
    torso = {
        "mass": inertial.mass,
        "com": (R_BT.T @ (inertial.com - origin) + 0.0).tolist(),
        "inertia": inertia_entries(R_BT.T @ inertial.inertia @ R_BT + 0.0),
    }
    torso["size"] = _box(root, R_BT, torso) or equivalent_box(torso["mass"], torso["inertia"])
    return torso, find_legs(root, origin, R_BT, keep_frames=keep_frames, where=urdf.where)


def _box(root: Body, R_BT: Array, torso: Table) -> list[float] | None:
    """Returns the extents [m] of the torso's largest box, if it can contain its matter."""
    boxes = [
        np.abs(R_BT.T @ member.R_BL) @ member.link.box
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
