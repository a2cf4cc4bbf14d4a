"""Reads the sections of a scenario that are no plain records.

Every reader takes the table and its name for messages, and raises RobotError or ScenarioError.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from hexapod_cosim.controller.gains import SECTIONS
from hexapod_cosim.cosim.scenario.events import (
    ANGLE,
    ATTITUDE,
    AngleFault,
    AttitudeFault,
    Event,
    Fault,
    Lost,
    Push,
    SensorFault,
    ServoFault,
    Tuning,
)
from hexapod_cosim.cosim.scenario.records import (
    GRAVITY,
    GRAVITY_VECTOR,
    SETTINGS,
    STANCE_CHANGE,
    STANCES,
    UNUSED,
    WALK_KEYS,
    Command,
)
from hexapod_cosim.models import RobotError, ScenarioError
from hexapod_cosim.models.ground.table import read_keys
from hexapod_cosim.models.records import Servo
from hexapod_cosim.models.schema import (
    Choice,
    expect_table,
    read_given,
    read_record,
    refuse_unknown_keys,
    specs,
)
from hexapod_cosim.models.servos.presets import servo_table
from hexapod_cosim.models.soil.presets import Soil, soil_table

# the parts of a gains file that a controller reads
GAINS = {part: SECTIONS[part] for part in ("support", "hold", "limits", "paper")}


@contextmanager
def errors_of(file: str) -> Iterator[None]:
    """Adds the file's name to errors of the shared readers, and makes them ScenarioErrors."""
    try:
        yield
    except (RobotError, ScenarioError) as error:
        key = (error.where or "").removeprefix(".")  # keys in no section begin with a dot
        where = f"{file}: {key}" if key else file
        raise ScenarioError(
            error.what, got=error.got, expected=error.expected, fix=error.fix, where=where
        ) from error


def read_setting(name: str, table: Any, where: str) -> dict[str, Any]:
    """Reads a section of settings that robot files have as well."""
    if name == "terrain":
        return read_keys(table, where)
    record = SETTINGS[name]
    if record is Soil:
        table = soil_table(table, where)
    if record is Servo:
        table = servo_table(table, where)
    keys = [key for key in specs(record) if key not in UNUSED.get(name, ())]
    refuse_unknown_keys(expect_table(table, where), keys, where)
    return read_given(record, table, where)


def read_stance(table: Any, where: str) -> str | tuple[float, float] | None:
    """Reads [walk]: the stance by its name, or as two lengths."""
    refuse_unknown_keys(expect_table(table, where), list(WALK_KEYS), where)
    value, key = table.get("stance"), f"{where}.stance"
    if isinstance(value, list | tuple):
        outward, deeper = STANCE_CHANGE.read(value, key)
        return outward, deeper
    return None if value is None else Choice(STANCES).read(value, key)


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


def read_gains(table: Any, where: str) -> dict[str, dict[str, Any]]:
    """Reads [gains]: some of the gains of a gains file, by part and name."""
    refuse_unknown_keys(expect_table(table, where), list(GAINS), where)
    return {
        part: read_given(GAINS[part], values, f"{where}.{part}") for part, values in table.items()
    }


def read_gravity(value: Any, where: str) -> tuple[float, float, float]:
    """Reads a vector in world axes, or a number for gravity along -z [m/s2]."""
    if isinstance(value, list | tuple):
        x, y, z = GRAVITY_VECTOR.read(value, where)
        return x, y, z
    return 0.0, 0.0, -GRAVITY.read(value, where)


def read_events(value: Any) -> tuple[Event, ...]:
    """Reads the entries [[events]]. Raises ScenarioError."""
    if not isinstance(value, list | tuple):
        fix = "write [[events]] with two brackets"
        raise ScenarioError(
            "wrong type", got=value, expected="entries [[events]]", fix=fix, where="events"
        )
    return tuple(_read_event(entry, f"events[{k}]") for k, entry in enumerate(value))


def _read_event(table: Any, where: str) -> Event:
    """Reads an event, whose keys say what it is: `lost`, `parameter`, `sensor` (angle or
    attitude), `joint` (of a servo), `leg` or `fault` (of a force sensor), or else a push.
    """
    kinds = (Push, Fault, AngleFault, AttitudeFault, ServoFault, Lost, Tuning)
    known = [key for kind in kinds for key in specs(kind)]
    refuse_unknown_keys(expect_table(table, where), list(dict.fromkeys(known)), where)
    event: Event = read_record(_kind_of_event(table, f"{where}.sensor"), table, where)
    _check_delay(event, where)
    return event


def _kind_of_event(table: Mapping[str, Any], where: str) -> type[Event]:
    """Returns the record that the keys of an event belong to; `where` names its sensor."""
    if "lost" in table:
        return Lost
    if "parameter" in table:
        return Tuning
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
