"""Writes the robot file of an identified robot: the file it came from with the new numbers.

Comments and all other keys stay. [source] says which numbers come from which log, with their
intervals. Of a URDF a robot file is written that refers to it.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import tomlkit

from hexapod_cosim.cosim.common.files import write_text
from hexapod_cosim.cosim.identify.identified import Estimate, Identified
from hexapod_cosim.models import JOINT_NAMES, HexapodError, Robot, load_robot
from hexapod_cosim.models.robot import robot_path

SECTIONS = ("servo", "contact", "friction")
BODY_KEYS = ("mass", "com", "inertia")
SENSORS = "sensors.toml"


def robot_text(found: Identified, file: str, folder: Path, logs: Sequence[str]) -> str:
    """Returns the text of the robot file.

    Args:
        found: the identified robot.
        file: the robot file it was identified from, or its name.
        folder: where the new file will stand; a URDF is named relative to it.
        logs: the names of the logs.

    Raises HexapodError when the file cannot be read again.
    """
    path = robot_path(file)
    document = _document(path, folder)
    document["name"] = f"{found.robot.name}-identified"
    source = document.setdefault("source", tomlkit.table())
    source["identified"] = f"hexapod identify {' '.join(Path(log).name for log in logs)}"
    for one in found.estimates:
        if one.group in ("servo", "mass", "contact"):
            source[one.key] = _sentence(one)
    for name in SECTIONS:
        _set_changed(document, name, getattr(found.file, name), getattr(found.robot, name))
    _set_bodies(document, found.file, found.robot)
    _set_defaults(document, found.robot)
    return tomlkit.dumps(document)


def _document(path: Path, folder: Path) -> Any:
    """Returns the tables of a robot file, to be changed; paths in it are made right for `folder`.

    Raises HexapodError for a file that cannot be read.
    """
    try:
        if path.suffix.lower() == ".urdf":
            document = tomlkit.document()
            document["urdf"] = {"file": _relative(path, folder)}
            return document
        document = tomlkit.parse(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise HexapodError("cannot read", got=error.strerror, where=str(path)) from error
    for section in ("urdf", "terrain"):
        table: Any = document.get(section, {})
        if "file" in table:
            table["file"] = _relative(path.parent / str(table["file"]), folder)
    return document


def _relative(path: Path, folder: Path) -> str:
    """Returns a path from a folder, with slashes."""
    return Path(os.path.relpath(path.resolve(), folder.resolve())).as_posix()


def _sentence(one: Estimate) -> str:
    """Returns where a number comes from."""
    interval = f"95 % interval {one.interval} {one.unit}"
    if one.told:
        return f"identified from the log: {interval}; before {one.before:.6g}"
    return f"not told by the log: {interval} with what was known; before {one.before:.6g}"


def _set_changed(document: Any, name: str, before: Any, after: Any) -> None:
    """Sets the keys of a section that have changed."""
    changed = [
        item.name
        for item in fields(after)
        if getattr(before, item.name) != getattr(after, item.name)
    ]
    if not changed:
        return
    section = document.setdefault(name, tomlkit.table())
    for key in changed:
        section[key] = getattr(after, key)


def _set_defaults(document: Any, after: Robot) -> None:
    """Sets what a file leaves to a default that depends on numbers which may have changed."""
    for section, key in (("servo", "motor_constant"), ("friction", "presliding")):
        table = document.setdefault(section, tomlkit.table())
        if key not in table:
            table[key] = getattr(getattr(after, section), key)


def _set_bodies(document: Any, before: Robot, after: Robot) -> None:
    """Sets mass, centre of mass and inertia of the bodies that have changed."""
    if before.torso != after.torso:
        torso = document.setdefault("torso", tomlkit.table())
        for key in BODY_KEYS:
            torso[key] = _plain(getattr(after.torso, key))
    for joint, name in enumerate(JOINT_NAMES):
        pairs = [
            (leg.name, old.links[joint], leg.links[joint])
            for old, leg in zip(before.legs, after.legs, strict=True)
        ]
        if all(old == new for _, old, new in pairs):
            continue
        links = document.setdefault("links", tomlkit.table())
        shared = links.setdefault(name, tomlkit.table())
        for key in BODY_KEYS:
            common = _plain(getattr(pairs[0][2], key))
            shared[key] = common
            for leg, _, new in pairs:
                own = _leg_table(document, leg, name)
                value = _plain(getattr(new, key))
                if value != common:
                    own = document.setdefault("legs", tomlkit.table())
                    own = own.setdefault(leg, tomlkit.table()).setdefault(name, tomlkit.table())
                    own[key] = value
                elif own is not None and key in own:
                    own[key] = value


def _leg_table(document: Any, leg: str, joint: str) -> Any:
    """Returns a leg's own table of a link; None without one."""
    return document.get("legs", {}).get(leg, {}).get(joint)


def _plain(value: Any) -> Any:
    """Returns a number or a list of numbers for TOML."""
    return list(value) if isinstance(value, tuple) else value


def sensors_table(found: Identified) -> Mapping[str, Any]:
    """Returns the numbers of the sensors, by key, with their intervals."""
    return {
        one.key: {
            "value": one.value,
            "low": one.low,
            "high": one.high,
            "unit": one.unit,
            "told": one.told,
        }
        for one in found.estimates
        if one.group in ("sensor", "zero")
    }


def write_robot(found: Identified, file: str, path: Path, logs: Sequence[str]) -> None:
    """Writes the robot file and checks that it is read as the identified robot.

    Raises HexapodError.
    """
    write_text(path, robot_text(found, file, path.parent, logs))
    again = load_robot(path)
    for name in ("torso", "legs", *SECTIONS):
        if getattr(again, name) != getattr(found.robot, name):
            raise HexapodError(
                "the robot file does not hold the identified robot",
                got=f"another [{name}]",
                expected="the numbers that were found",
                fix="report this with the robot file",
                where=str(path),
            )
