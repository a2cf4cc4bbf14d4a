"""Reads scenarios from TOML files and checks them key by key.

A value is a number in SI units or a quantity with its unit ("5 ms"). The settings of gait, terrain,
contact, friction, servo, solver and baumgarte are those of robot files; a scenario gives only what
differs from the robot's own.

`gravity` is a number, along -z, or a vector in world axes [m/s2]. Plant and controller both use it:
the pose of rest, the gains' design, the planned loads and the weight in the metrics follow from it.
The FMU's parameters gravity[1] to gravity[3] are entries of the same key.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from hexapod_cosim.controller import SWITCHES, Parts
from hexapod_cosim.cosim.scenario.checks import check_interval, check_parameters, check_steps
from hexapod_cosim.cosim.scenario.controls import LAW, control_beside, read_control
from hexapod_cosim.cosim.scenario.quantities import to_si
from hexapod_cosim.cosim.scenario.records import (
    ANGLE,
    ATTITUDE,
    CONTROLS,
    FORMATS,
    GRAVITY,
    GRAVITY_NAMES,
    GRAVITY_VECTOR,
    KEYS,
    PLAIN_KEYS,
    SECTIONS,
    SETTINGS,
    SQUEEZE,
    STANCE_CHANGE,
    STANCES,
    UNUSED,
    WALK_KEYS,
    AngleFault,
    AttitudeFault,
    Command,
    Event,
    Fault,
    Lost,
    Outputs,
    Push,
    Scenario,
    SensorFault,
    Sensors,
    ServoFault,
    Variation,
    Walk,
    default_formats,
)
from hexapod_cosim.models import (
    Robot,
    RobotError,
    ScenarioError,
    load_robot,
    nearest_name,
    unknown_name,
)
from hexapod_cosim.models.errors import refuse_path
from hexapod_cosim.models.ground.table import (
    beside,
    merged_terrain,
    patch_specs,
    read_keys,
    terrain_specs,
)
from hexapod_cosim.models.records import STATIC_LAWS, Servo, Soil, Terrain
from hexapod_cosim.models.schema import (
    Choice,
    Number,
    expect_table,
    parse_toml,
    read_given,
    refuse_unknown_keys,
    require,
    specs,
)
from hexapod_cosim.models.servos.presets import GAIN, changed_servo, servo_table
from hexapod_cosim.models.soil.presets import soil_table
from hexapod_cosim.models.terrain import ground_normal
from hexapod_cosim.models.validation import check_settings

POINTED = re.compile(r"[+-]?(?:\d+\.|\.\d+)(?:[eE][+-]?\d+)?")  # .1 or 1.
NUMBER = Number(GRAVITY.unit)


def list_scenarios() -> dict[str, Path]:
    """Returns the bundled scenarios by name."""
    found = {path.stem: path for path in (Path(__file__).parent / "scenarios").rglob("*.toml")}
    return dict(sorted(found.items()))


def load_scenario(path_or_name: str | Path, *, overrides: Sequence[str] = ()) -> Scenario:
    """Reads a scenario file, or a bundled scenario by name, and applies "NAME=VALUE" overrides.

    Raises ScenarioError.
    """
    table, where = read_tables(path_or_name)
    given = [text.partition("=")[0].strip() for text in overrides]
    return scenario_from_table(with_overrides(table, overrides), where=where, given=given)


def read_tables(path_or_name: str | Path) -> tuple[dict[str, Any], str]:
    """Returns the unchecked tables of a scenario file, or of a bundled one by name.

    The second value is the file's name for messages. Raises ScenarioError.
    """
    refuse_path(path_or_name, "the scenario", ScenarioError)
    path = _scenario_path(path_or_name)
    try:
        table = parse_toml(path.read_text(encoding="utf-8"))
    except OSError as error:
        fix = "give the path of a scenario file, or one of: " + ", ".join(list_scenarios())
        raise ScenarioError(
            "cannot read the scenario", got=error.strerror, fix=fix, where=str(path)
        ) from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ScenarioError(
            "not a TOML file",
            got=str(error),
            expected="TOML 1.0 in UTF-8",
            fix="correct that line",
            where=str(path),
        ) from error
    if isinstance(table.get("terrain"), dict):
        table["terrain"] = beside(table["terrain"], path.parent)
    refuse_path(str(table.get("robot", "")), "the robot file", ScenarioError)
    if "control" in table:
        table["control"] = control_beside(table["control"], path.parent)
    near = path.parent / str(table.get("robot", ""))
    if "robot" in table and near.is_file():  # a robot file beside the scenario
        table["robot"] = str(near.resolve())
    return table, path.name if path in list_scenarios().values() else str(path)


def _scenario_path(path_or_name: str | Path) -> Path:
    path, bundled = Path(path_or_name), list_scenarios()
    if path.suffix or len(path.parts) != 1 or path.is_file():
        return path
    if str(path_or_name) not in bundled:
        raise unknown_name("scenario", str(path_or_name), bundled, error=ScenarioError)
    return bundled[str(path_or_name)]


def with_overrides(table: Mapping[str, Any], overrides: Iterable[str]) -> dict[str, Any]:
    """Returns a copy of the tables with each "NAME=VALUE" set.

    NAME is a key of the scenario or else an FMU parameter. Raises ScenarioError.
    """
    values: dict[str, Any] = {}
    for text in overrides:
        name, equals, value = (part.strip() for part in text.partition("="))
        if not equals or not name or not value:
            fix = "write --set gait.period=0.8"
            raise ScenarioError(
                "not a setting", got=text, expected="NAME=VALUE", fix=fix, where="--set"
            )
        values[name] = parse_value(value)
    return with_values(table, values)


def with_values(table: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """Returns a copy of the tables with each value set by name, as --set does.

    Raises ScenarioError.
    """
    changed = deepcopy(dict(table))
    for name, value in values.items():
        _set(changed, name, value)
    return changed


def parse_value(value: str) -> Any:
    """Returns the value as TOML reads it; other text is a string, so names need no quotes.

    Numbers may begin or end with their point, as .1 and 1., which TOML refuses.
    """
    try:
        return parse_toml(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        return float(value) if POINTED.fullmatch(value) else value


def _set(table: dict[str, Any], name: str, value: Any) -> None:
    """Sets a key of the scenario or an FMU parameter by its dotted name, in place."""
    section, dot, key = name.partition(".")
    if name == "control" and isinstance(table.get(name), dict):
        table[name] = {**table[name], LAW: value}  # another law, with the same parameters
    elif dot and section in SECTIONS:
        if section == "control" and isinstance(table.get(section), str):
            table[section] = {LAW: table[section]}
        inner = table.setdefault(section, {})
        if not isinstance(inner, dict):
            fix = f"set the whole list: --set '{section}=[...]'"
            raise ScenarioError(
                "the scenario has a list here",
                got=name,
                expected=f"a table [{section}]",
                fix=fix,
                where="--set",
            )
        inner[key] = value
    elif dot or "[" in name:
        table.setdefault("parameters", {})[name] = value
    elif name in KEYS:
        table[name] = value
    else:
        raise unknown_name("setting", name, KEYS, where="--set", error=ScenarioError)


def scenario_from_table(
    table: Mapping[str, Any], *, where: str, given: Collection[str] = ()
) -> Scenario:
    """Returns the checked scenario in the tables of a file.

    `where` names the file in messages; `given` are the names set with --set. Raises ScenarioError.
    """
    with _errors_of(where):
        refuse_unknown_keys(table, list(KEYS), "")
        plain_keys = {key: value for key, value in table.items() if key in PLAIN_KEYS}
        plain = require(Scenario, _read(Scenario, plain_keys, ""), "")
        control, parameters = read_control(table.get("control", CONTROLS[0]), "control")
        scenario = Scenario(
            title=_text(table, "title", Path(where).stem),
            robot=_text(table, "robot", "athena"),
            control=control.text,
            control_settings=parameters,
            seed=_seed(table.get("seed", 0)),
            gravity=_read_gravity(table["gravity"], "gravity") if "gravity" in table else None,
            settings={
                name: _read_setting(name, table[name], name) for name in SETTINGS if name in table
            },
            commands=_read_commands(table.get("command", {}), "command"),
            events=_read_events(table.get("events", [])),
            sensors=_record(Sensors, table.get("sensors", {}), "sensors"),
            walk=_read_walk(table.get("walk", {}), "walk"),
            compliance=_read_parts(table.get("compliance", {}), "compliance"),
            variation=_record(Variation, table["variation"], "variation")
            if "variation" in table
            else None,
            outputs=_read_outputs(table.get("outputs", {}), "outputs"),
            parameters=dict(expect_table(table.get("parameters", {}), "parameters")),
            where=where,
            **plain,
        )
    scenario = _with_gravity_of_parameters(scenario)
    check_steps(scenario)
    check_interval(scenario)
    check_parameters(scenario, given=given)
    return scenario


def _read_gravity(value: Any, where: str) -> tuple[float, float, float]:
    """Reads a vector in world axes, or a number for gravity along -z [m/s2]."""
    if isinstance(value, list | tuple):
        x, y, z = GRAVITY_VECTOR.read(to_si(value, GRAVITY_VECTOR, where), where)
        return x, y, z
    return 0.0, 0.0, -GRAVITY.read(to_si(value, GRAVITY, where), where)


def _with_gravity_of_parameters(scenario: Scenario) -> Scenario:
    """Moves the FMU parameters gravity[1] to gravity[3] of a scenario into its `gravity`."""
    names = [name for name in GRAVITY_NAMES if name in scenario.parameters]
    if not names:
        return scenario
    gravity = list(
        load_robot(scenario.robot).gravity if scenario.gravity is None else scenario.gravity
    )
    with _errors_of(scenario.where):
        for name in names:
            value = to_si(scenario.parameters[name], NUMBER, f"parameters.{name}")
            gravity[GRAVITY_NAMES.index(name)] = NUMBER.read(value, f"parameters.{name}")
    rest = {name: value for name, value in scenario.parameters.items() if name not in names}
    return replace(scenario, gravity=(gravity[0], gravity[1], gravity[2]), parameters=rest)


@contextmanager
def _errors_of(file: str) -> Iterator[None]:
    """Adds the file's name to errors of the shared readers, and makes them ScenarioErrors."""
    try:
        yield
    except (RobotError, ScenarioError) as error:
        key = (error.where or "").removeprefix(".")  # keys in no section begin with a dot
        where = f"{file}: {key}" if key else file
        raise ScenarioError(
            error.what, got=error.got, expected=error.expected, fix=error.fix, where=where
        ) from error


def _read(record: type[Any], table: Any, where: str) -> dict[str, Any]:
    """Reads the keys that a table gives of a record, with quantities converted to SI."""
    known = specs(record)
    values = {
        key: to_si(value, known[key], f"{where}.{key}") if key in known else value
        for key, value in expect_table(table, where).items()
    }
    return read_given(record, values, where)


def _record(record: type[Any], table: Any, where: str) -> Any:
    return record(**require(record, _read(record, table, where), where))


def _read_setting(name: str, table: Any, where: str) -> dict[str, Any]:
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
    return _read(record, table, where)


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


def _read_walk(table: Any, where: str) -> Walk:
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


def _read_commands(value: Any, where: str) -> tuple[Command, ...]:
    """Reads one [command] or several [[command]] entries; the robot stands until the first."""
    entries = value if isinstance(value, list | tuple) else [value]
    commands = [
        _record(Command, entry, f"{where}[{k}]" if len(entries) > 1 else where)
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


def _read_events(value: Any) -> tuple[Event, ...]:
    entries = _list(value, "events")
    return tuple(_read_event(entry, f"events[{k}]") for k, entry in enumerate(entries))


def _read_event(table: Any, where: str) -> Event:
    """Reads an event, whose keys tell what it is: `lost`, `sensor` (angle or attitude), `joint` (of
    a servo), `leg` or `fault` (of a force sensor), or else a push.
    """
    kinds = (Push, Fault, AngleFault, AttitudeFault, ServoFault, Lost)
    known = [key for kind in kinds for key in specs(kind)]
    refuse_unknown_keys(expect_table(table, where), list(dict.fromkeys(known)), where)
    event: Event = _record(_kind_of_event(table, f"{where}.sensor"), table, where)
    _check_delay(event, where)
    return event


def _kind_of_event(table: Mapping[str, Any], where: str) -> type[Event]:
    """Returns the record that the keys of an event belong to; `where` names its sensor."""
    if "lost" in table:
        return Lost
    if "sensor" in table:
        sensor = Choice((ANGLE, ATTITUDE)).read(table["sensor"], where)
        return AngleFault if sensor == ANGLE else AttitudeFault
    if "joint" in table:
        return ServoFault
    return Fault if {"leg", "fault"} & set(table) else Push


def _check_delay(event: Event, where: str) -> None:
    """Raises ScenarioError for a late reading without a delay, and for a delay of other faults."""
    if not isinstance(event, SensorFault):
        return
    if (event.fault == "late") != (event.delay > 0.0):
        late = event.fault == "late"
        raise ScenarioError(
            "a late reading without a delay" if late else "a delay of readings that are not late",
            got=f"fault = {event.fault!r} and delay = {event.delay:g} s",
            expected="a delay above 0 with the fault late, and none with others",
            fix='add delay = "20 ms"' if late else "delete delay, or write fault = 'late'",
            where=where,
        )


def _read_parts(table: Any, where: str) -> Parts:
    """Reads which parts of the compliant control are active, and the weight of the squeeze."""
    refuse_unknown_keys(expect_table(table, where), [item.name for item in fields(Parts)], where)
    for key in SWITCHES:
        if key in table:
            _boolean(table[key], f"{where}.{key}")
    given = dict(table)
    if "squeeze" in given:
        given["squeeze"] = SQUEEZE.read(given["squeeze"], f"{where}.squeeze")
    return Parts(**given)


def _read_outputs(table: Any, where: str) -> Outputs:
    refuse_unknown_keys(expect_table(table, where), [item.name for item in fields(Outputs)], where)
    plain = {key: table[key] for key in specs(Outputs) if key in table}
    return Outputs(
        csv=_patterns(table.get("csv", ["*"]), f"{where}.csv"),
        formats=_formats(table.get("formats", default_formats()), f"{where}.formats"),
        plots=_boolean(table.get("plots", True), f"{where}.plots"),
        interval=_record(Outputs, plain, where).interval,
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


def _boolean(value: Any, where: str) -> bool:
    if not isinstance(value, bool):
        raise ScenarioError("wrong type", got=value, expected="true or false", where=where)
    return value


def _text(table: Mapping[str, Any], key: str, default: str) -> str:
    value = table.get(key, default)
    if not isinstance(value, str):
        raise ScenarioError("wrong type", got=value, expected="a text in quotes", where=key)
    return value


def _list(value: Any, key: str) -> Sequence[Any]:
    if not isinstance(value, list | tuple):
        fix = f"write [[{key}]] with two brackets"
        raise ScenarioError(
            "wrong type", got=value, expected=f"entries [[{key}]]", fix=fix, where=key
        )
    return value


def _seed(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise ScenarioError(
            "value not allowed", got=value, expected="a whole number >= 0", where="seed"
        )
    return value


def scenario_robot(scenario: Scenario) -> Robot:
    """Returns the robot with the scenario's settings applied, but for the gait.

    The controller makes the gait. Raises RobotError when the settings do not fit together.
    """
    own = load_robot(scenario.robot)
    changes = {
        name: replace(getattr(own, name), **dict(values))
        for name, values in scenario.settings.items()
        if name not in ("gait", "terrain", "servo")
    }
    with _errors_of(scenario.where):
        changes["servo"] = changed_servo(own.servo, scenario.settings.get("servo", {}), "servo")
    changes["terrain"] = scenario_terrain(scenario, own)
    friction = changes.get("friction", own.friction)
    if "mu_static" not in scenario.settings.get("friction", {}) and (
        friction.law not in STATIC_LAWS or friction.mu_static < friction.mu
    ):
        # the robot file's mu_static belongs to another law or to a smaller mu
        changes["friction"] = replace(friction, mu_static=0.0)
    gravity = own.gravity if scenario.gravity is None else scenario.gravity
    robot = replace(own, **changes, gravity=gravity)
    if robot == own:
        return own
    if scenario.gravity is not None:
        _check_gravity(robot, where=f"{scenario.where}: gravity")
    check_settings(robot, where=f"{scenario.where} with robot {robot.name}")
    return robot


def scenario_terrain(scenario: Scenario, own: Robot) -> Terrain:
    """Returns the ground of a scenario with its robot. Raises ScenarioError."""
    with _errors_of(scenario.where):
        return merged_terrain(own.terrain, scenario.settings.get("terrain", {}), "terrain")


def _check_gravity(robot: Robot, *, where: str) -> None:
    """Raises ScenarioError for gravity that does not press the robot onto the ground."""
    if np.array(robot.gravity) @ ground_normal(robot.terrain) < 0.0:
        return
    fix = "write gravity = 1.62, or a vector that points down: [0, 0, -1.62]"
    expected = "gravity that presses the robot onto the ground [m/s2]"
    raise ScenarioError(
        "the robot cannot stand under this gravity",
        got=list(robot.gravity),
        expected=expected,
        fix=fix,
        where=where,
    )
