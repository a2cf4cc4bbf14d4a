"""Writes the robot file of an identified robot: the file it came from with the new numbers.

[source] says from which log a new number is, with its interval; all other keys and their comments
stay. Of a URDF a robot file is written that refers to it.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import tomlkit
import tomlkit.items

from hexapod_cosim.cosim.common.files import write_text
from hexapod_cosim.extensions.identify.identification import Estimate, Identified
from hexapod_cosim.extensions.identify.unknowns import OF_FILE
from hexapod_cosim.models import JOINT_NAMES, Robot, load_robot
from hexapod_cosim.models.robot import robot_path

SECTIONS = ("servo", "contact", "friction")
BODY_KEYS = ("mass", "com", "inertia")
COMMENT = "identified, see [source]"  # beside a new number


def robot_text(found: Identified, file: str, folder: Path, logs: Sequence[str]) -> str:
    """Returns the text of the robot file.

    Args:
        found: the identified robot.
        file: the robot file it was identified from, or its name.
        folder: where the new file will stand; a URDF is named relative to it.
        logs: the names of the logs.

    Raises RobotError when the file cannot be read again.
    """
    before, after = load_robot(file), found.robot
    document = _document(robot_path(file), folder)
    document["name"] = f"{found.robot.name}-identified"
    source = document.setdefault("source", tomlkit.table())
    names = " ".join(Path(log).name for log in logs)
    source["identified"] = f"hexapod identify {names}"
    own = [one for one in found.estimates if one.group in OF_FILE]
    for one in own:
        source[one.key] = _sentence(one, names)
    for name in SECTIONS:
        _set_changed(document, name, getattr(before, name), getattr(after, name))
    _set_bodies(document, before, after)
    _set_defaults(document, after)
    return tomlkit.dumps(document)


def _document(path: Path, folder: Path) -> Any:
    """Returns the tables of a robot file, to be changed, with its paths right for `folder`."""
    if path.suffix.lower() == ".urdf":
        document = tomlkit.document()
        document["urdf"] = {"file": _relative(path, folder)}
        return document
    document = tomlkit.parse(path.read_text(encoding="utf-8"))
    for section in ("urdf", "terrain"):
        table: Any = document.get(section, {})
        if "file" in table:
            table["file"] = _relative(path.parent / str(table["file"]), folder)
    return document


def _relative(path: Path, folder: Path) -> str:
    """Returns a path from a folder, with slashes."""
    return Path(os.path.relpath(path.resolve(), folder.resolve())).as_posix()


def _sentence(one: Estimate, logs: str) -> str:
    """Returns where a number comes from."""
    if one.determined:
        interval = f"95 % interval {one.interval} {one.unit}"
        return f"identified from {logs}: {interval}; before {one.before:.6g}"
    if one.value != one.before:
        return f"not determined by {logs} alone, but only with other numbers as in the file"
    return f"not determined by {logs}: as before"


def _put(table: Any, key: str, value: Any) -> None:
    """Sets a number of a table; the comment beside the old one would be wrong."""
    item = tomlkit.item(value)
    if not isinstance(table, tomlkit.items.InlineTable):
        item.comment(COMMENT)
    table[key] = item


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
        _put(section, key, getattr(after, key))


def _set_defaults(document: Any, after: Robot) -> None:
    """Sets what a file leaves to a default that depends on numbers which may have changed."""
    for section, key in (("servo", "motor_constant"), ("friction", "presliding")):
        table = document.setdefault(section, tomlkit.table())
        if key not in table:
            table[key] = getattr(getattr(after, section), key)


def _set_bodies(document: Any, before: Robot, after: Robot) -> None:
    """Sets mass, centre of mass and inertia of the bodies where they have changed."""
    for key in BODY_KEYS:
        if getattr(before.torso, key) != getattr(after.torso, key):
            torso = document.setdefault("torso", tomlkit.table())
            _put(torso, key, _plain(getattr(after.torso, key)))
    for joint, name in enumerate(JOINT_NAMES):
        for key in BODY_KEYS:
            old, new = (
                {leg.name: _plain(getattr(leg.links[joint], key)) for leg in robot.legs}
                for robot in (before, after)
            )
            if old != new:
                _set_links(document, name, key, new)


def _set_links(document: Any, name: str, key: str, values: Mapping[str, Any]) -> None:
    """Sets a key of the links of all legs.

    values: by name of the leg. Of a leg that has its own value, or needs one, its own table is set.
    """
    links = document.setdefault("links", tomlkit.table())
    common = next(iter(values.values()))
    _put(links.setdefault(name, tomlkit.table()), key, common)
    for leg, value in values.items():
        own = document.get("legs", {}).get(leg, {}).get(name, {})
        if value != common or key in own:
            legs = document.setdefault("legs", tomlkit.table())
            own = legs.setdefault(leg, tomlkit.table()).setdefault(name, tomlkit.table())
            _put(own, key, value)


def _plain(value: Any) -> Any:
    """Returns a number or a list of numbers for TOML."""
    return list(value) if isinstance(value, tuple) else value


def write_robot(found: Identified, file: str, path: Path, logs: Sequence[str]) -> None:
    """Writes the robot file and checks that it can be read again. Raises HexapodError."""
    write_text(path, robot_text(found, file, path.parent, logs))
    load_robot(path)
