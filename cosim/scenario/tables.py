"""Finds and reads the tables of scenario files, and changes their keys by name, as --set does.

Nothing is checked here but that the file is TOML and that the keys exist.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Mapping
from copy import deepcopy
from pathlib import Path
from typing import Any

from hexapod_cosim.cosim.scenario import list_scenarios
from hexapod_cosim.cosim.scenario.controls import LAW, control_beside
from hexapod_cosim.cosim.scenario.records import KEYS, SECTIONS, SETTINGS
from hexapod_cosim.models import ScenarioError, unknown_name
from hexapod_cosim.models.errors import check_type, refuse_path
from hexapod_cosim.models.files import parse_toml, path_of, read_text, reading_toml
from hexapod_cosim.models.ground.table import terrain_beside
from hexapod_cosim.models.schema import specs

POINTED = re.compile(r"[+-]?(?:\d+\.|\.\d+)(?:[eE][+-]?\d+)?")  # .1 or 1.


def read_tables(path_or_name: str | Path) -> tuple[dict[str, Any], str]:
    """Returns the unchecked tables of a scenario file, or of a bundled one by name.

    The second value is the file's name for messages. Raises ScenarioError.
    """
    refuse_path(path_or_name, "the scenario", ScenarioError)
    path = path_of(path_or_name, "scenario", list_scenarios(), ScenarioError)
    if path.suffix == ".fmu":
        raise ScenarioError(
            "an FMU is no scenario",
            got=str(path),
            expected="a scenario file or the name of one",
            fix=f"in simulate and compare write --fmu {path}",
        )
    with reading_toml(
        path, kind="scenario", name="the scenario", names=list_scenarios, error=ScenarioError
    ):
        table = parse_toml(read_text(path))
    if not table:
        what, fix = "an empty scenario", "write one, for example `command.vx = 0.08`"
        raise ScenarioError(what, expected="at least one key", fix=fix, where=str(path))
    table = terrain_beside(table, path.parent)
    refuse_path(str(table.get("robot", "")), "the robot file", ScenarioError)
    if "control" in table:
        table["control"] = control_beside(table["control"], path.parent)
    near = path.parent / str(table.get("robot", ""))
    if "robot" in table and near.is_file():  # a robot file beside the scenario
        table["robot"] = str(near.resolve())
    return table, path.name if path in list_scenarios().values() else str(path)


def read_overrides(overrides: Iterable[str], where: str = "--set") -> dict[str, Any]:
    """Returns the values of texts "NAME=VALUE" by name. Raises ScenarioError.

    where: the option or what it sets, for the message.
    """
    values: dict[str, Any] = {}
    for text in overrides:
        name, equals, value = (part.strip() for part in text.partition("="))
        if not equals or not name or not value:
            fix = f"write {name or 'NAME'}=VALUE without a space"
            raise ScenarioError(
                "not a setting", got=text, expected="NAME=VALUE", fix=fix, where=where
            )
        values[name] = parse_value(value)
    return values


def with_values(
    table: Mapping[str, Any], values: Mapping[str, Any], where: str = "--set"
) -> dict[str, Any]:
    """Returns a copy of the tables with each value set by name, as --set does.

    where: the option or argument with the values, for the message. Raises ScenarioError.
    """
    changed = deepcopy(dict(table))
    for name, value in values.items():
        check_type(name, str, "the name of a setting", where=where, error=ScenarioError)
        _set(changed, name, value, where)
    return changed


def parse_value(value: str) -> Any:
    """Returns the value as TOML reads it; other text is a string, so names need no quotes.

    Numbers may begin or end with their point, as .1 and 1., which TOML refuses.
    """
    try:
        return parse_toml(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        return float(value) if POINTED.fullmatch(value) else value


def _set(table: dict[str, Any], name: str, value: Any, where: str) -> None:
    """Sets a key of the scenario or an FMU parameter by its dotted name, in place."""
    section, dot, key = name.partition(".")
    if name == "control" and isinstance(table.get(name), dict):
        table[name] = {**table[name], LAW: value}  # another law, with the same parameters
    elif dot and section in SECTIONS:
        if section == "control" and isinstance(table.get(section), str):
            table[section] = {LAW: table[section]}
        inner = table.setdefault(section, {})
        if section == "gains" and "." in key:  # gains.hold.path_rate
            part, _, key = key.partition(".")
            inner = inner.setdefault(part, {})
        if not isinstance(inner, dict):
            fix = f"set the whole list: --set '{section}=[...]'"
            raise ScenarioError(
                "the scenario has a list here",
                got=name,
                expected=f"a table [{section}]",
                fix=fix,
                where=where,
            )
        inner[key] = value
    elif dot or "[" in name:
        table.setdefault("parameters", {})[name] = value
    elif name in SETTINGS and not isinstance(value, dict) and name != "soil":  # has presets
        raise ScenarioError(
            "a section, which has keys",
            got=f"{name}={value}",
            expected=f"{name}.KEY=VALUE",
            fix=f"write {name}.{next(iter(specs(SETTINGS[name])))}={value}",
            where=where,
        )
    elif name in KEYS:
        table[name] = value
    else:
        raise unknown_name("setting", name, KEYS, where=where, error=ScenarioError)
