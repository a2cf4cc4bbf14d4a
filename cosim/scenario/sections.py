"""Reads the sections of a scenario key by key.

Every reader takes the table and its name for messages, and raises ScenarioError or RobotError.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from hexapod_cosim.controller import SWITCHES, Parts
from hexapod_cosim.cosim.scenario.records import (
    FORMATS,
    GRAVITY,
    GRAVITY_VECTOR,
    SETTINGS,
    SQUEEZE,
    STANCE_CHANGE,
    STANCES,
    UNUSED,
    WALK_KEYS,
    Command,
    Outputs,
    Walk,
    default_formats,
)
from hexapod_cosim.cosim.scenario.values import read_boolean, read_given_keys, read_record, to_si
from hexapod_cosim.models import ScenarioError, nearest_name
from hexapod_cosim.models.ground.table import patch_specs, read_keys, terrain_specs
from hexapod_cosim.models.records import Servo, Soil
from hexapod_cosim.models.schema import Number, expect_table, refuse_unknown_keys, specs
from hexapod_cosim.models.servos.presets import GAIN, servo_table
from hexapod_cosim.models.soil.presets import soil_table


def read_setting(name: str, table: Any, where: str) -> dict[str, Any]:
    """Reads a section of settings that robot files have as well."""
    if name == "terrain":
        return read_terrain_keys(table, where)
    record = SETTINGS[name]
    if record is Soil:
        table = soil_table(table, where)
    if record is Servo:
        table = servo_table(_servo_in_si(table, where), where)
    keys = [key for key in specs(record) if key not in UNUSED.get(name, ())]
    refuse_unknown_keys(expect_table(table, where), keys, where)
    return read_given_keys(record, table, where)


def _servo_in_si(table: Any, where: str) -> dict[str, Any]:
    """Returns the table of a servo with its quantities converted to SI."""
    keys = {**specs(Servo), GAIN: Number("1/rad")}
    return {
        key: to_si(value, keys[key], f"{where}.{key}") if key in keys else value
        for key, value in expect_table(table, where).items()
    }


def read_terrain_keys(table: Any, where: str) -> dict[str, Any]:
    """Reads [terrain]: the keys of a plane or of a surface, and patches."""
    given, keys = dict(expect_table(table, where)), terrain_specs()
    for key, value in given.items():
        if key in keys:
            given[key] = to_si(value, keys[key], f"{where}.{key}")
    patches = given.get("patch")
    if isinstance(patches, list | tuple):
        given["patch"] = [_patch_in_si(one, f"{where}.patch[{k}]") for k, one in enumerate(patches)]
    return read_keys(given, where)


def _patch_in_si(table: Any, where: str) -> Any:
    """Returns a patch with its quantities converted to SI."""
    if not isinstance(table, Mapping):
        return table
    keys = patch_specs()
    return {
        key: [to_si(item, keys[key], f"{where}.{key}") for item in value]
        if isinstance(value, list)
        else to_si(value, keys[key], f"{where}.{key}")
        if key in keys
        else value
        for key, value in table.items()
    }


def read_walk(table: Any, where: str) -> Walk:
    """Reads [walk]: the stance by its name, or as two lengths."""
    refuse_unknown_keys(expect_table(table, where), list(WALK_KEYS), where)
    value = table.get("stance")
    if isinstance(value, list | tuple):
        key = f"{where}.stance"
        outward, deeper = STANCE_CHANGE.read(to_si(value, STANCE_CHANGE, key), key)
        return Walk(stance=(outward, deeper))
    if value is not None and value not in STANCES:
        near = nearest_name(str(value), STANCES)
        raise ScenarioError(
            "unknown stance",
            got=value,
            expected=f"{', '.join(STANCES)}, or two lengths [m]",
            fix=f"did you mean {near!r}?" if near else "write stance = [-0.05, 0.02]",
            where=f"{where}.stance",
        )
    return Walk(stance=value)


def read_commands(value: Any, where: str) -> tuple[Command, ...]:
    """Reads one [command] or several [[command]] entries; the robot stands until the first."""
    entries = value if isinstance(value, list | tuple) else [value]
    commands = [
        read_record(Command, entry, f"{where}[{k}]" if len(entries) > 1 else where)
        for k, entry in enumerate(entries)
    ]
    times = [command.time for command in commands]
    if times != sorted(set(times)):
        raise ScenarioError(
            "commands out of order",
            got=times,
            expected="increasing times",
            fix="sort the [[command]] entries by time",
            where=where,
        )
    return tuple(commands) if times and times[0] == 0.0 else (Command(), *commands)


def read_parts(table: Any, where: str) -> Parts:
    """Reads which parts of the compliant control are active, and the weight of the squeeze."""
    refuse_unknown_keys(expect_table(table, where), [item.name for item in fields(Parts)], where)
    for key in SWITCHES:
        if key in table:
            read_boolean(table[key], f"{where}.{key}")
    given = dict(table)
    if "squeeze" in given:
        given["squeeze"] = SQUEEZE.read(given["squeeze"], f"{where}.squeeze")
    return Parts(**given)


def read_outputs(table: Any, where: str) -> Outputs:
    """Reads [outputs]: variables, formats and figures of the recording, and its interval."""
    refuse_unknown_keys(expect_table(table, where), [item.name for item in fields(Outputs)], where)
    plain = {key: table[key] for key in specs(Outputs) if key in table}
    return Outputs(
        csv=_patterns(table.get("csv", ["*"]), f"{where}.csv"),
        formats=_formats(table.get("formats", default_formats()), f"{where}.formats"),
        plots=read_boolean(table.get("plots", True), f"{where}.plots"),
        interval=read_record(Outputs, plain, where).interval,
    )


def _patterns(value: Any, where: str) -> tuple[str, ...]:
    if not isinstance(value, list | tuple) or not all(isinstance(item, str) for item in value):
        raise ScenarioError(
            "wrong type",
            got=value,
            expected="a list of name patterns",
            fix='write csv = ["torso.*", "*.foot.normal_force"]',
            where=where,
        )
    return tuple(value)


def _formats(value: Any, where: str) -> tuple[str, ...]:
    known = isinstance(value, list | tuple) and all(item in FORMATS for item in value)
    if not known or not value:
        raise ScenarioError(
            "value not allowed",
            got=value,
            expected="a list of some of " + ", ".join(FORMATS),
            fix='write formats = ["parquet"]',
            where=where,
        )
    return tuple(item for item in FORMATS if item in value)


def read_gravity(value: Any, where: str) -> tuple[float, float, float]:
    """Reads a vector in world axes, or a number for gravity along -z [m/s2]."""
    if isinstance(value, list | tuple):
        x, y, z = GRAVITY_VECTOR.read(to_si(value, GRAVITY_VECTOR, where), where)
        return x, y, z
    return 0.0, 0.0, -GRAVITY.read(to_si(value, GRAVITY, where), where)
