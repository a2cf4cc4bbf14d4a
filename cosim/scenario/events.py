"""Reads the events of a scenario: pushes, faults and lost commands."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hexapod_cosim.cosim.scenario.records import (
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
)
from hexapod_cosim.cosim.scenario.values import read_list, read_record
from hexapod_cosim.models import ScenarioError
from hexapod_cosim.models.schema import Choice, expect_table, refuse_unknown_keys, specs


def read_events(value: Any) -> tuple[Event, ...]:
    """Reads the entries [[events]]. Raises ScenarioError."""
    entries = read_list(value, "events")
    return tuple(_read_event(entry, f"events[{k}]") for k, entry in enumerate(entries))


def _read_event(table: Any, where: str) -> Event:
    """Reads an event, whose keys say what it is: `lost`, `sensor` (angle or attitude), `joint` (of
    a servo), `leg` or `fault` (of a force sensor), or else a push.
    """
    kinds = (Push, Fault, AngleFault, AttitudeFault, ServoFault, Lost)
    known = [key for kind in kinds for key in specs(kind)]
    refuse_unknown_keys(expect_table(table, where), list(dict.fromkeys(known)), where)
    event: Event = read_record(_kind_of_event(table, f"{where}.sensor"), table, where)
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
