"""Describes the events of a scenario that a run has reached, for its facts and the report."""

from __future__ import annotations

import math
from typing import Any

from hexapod_cosim.cosim.scenario.records import (
    AngleFault,
    AttitudeFault,
    Event,
    Fault,
    Lost,
    Push,
    Scenario,
    SensorFault,
    ServoFault,
)

SENSOR_TEXTS = {
    "dead": "reads zero",
    "stuck": "repeats its last reading",
    "nan": "reads NaN",
    "late": "is late by {delay:g} ms",
}
LOST_TEXTS = {
    "command": "the joint commands are lost, and the last one holds",
    "step": "macro-steps are dropped: the last readings and joint commands hold",
}
SERVO_TEXTS = {
    "dead": "is dead: it follows the joint without torque",
    "stuck": "is stuck: it holds the angle of that moment",
}


def event_log(scenario: Scenario, simulated: float) -> list[dict[str, Any]]:
    """Returns time [s from the start] and text of the events that began within `simulated` [s], in
    order of time.
    """
    begun = [event for event in scenario.events if event.time < simulated]
    begun.sort(key=lambda event: event.time)
    return [{"time": event.time, "text": describe_event(event)} for event in begun]


def describe_event(event: Event) -> str:
    """Returns what happens at an event, and for how long."""
    match event:
        case Push():
            text = f"a push of {_vector(event.force)} N and {_vector(event.torque)} N m"
        case Fault():
            text = f"the force sensor of {event.leg} {_reading(event)}"
        case AngleFault():
            text = f"the angle sensor of {event.leg}.{event.joint} {_reading(event)}"
        case AttitudeFault():
            text = f"the attitude sensor {_reading(event)}"
        case ServoFault():
            text = f"the servo of {event.leg}.{event.joint} {SERVO_TEXTS[event.fault]}"
        case Lost():
            text = LOST_TEXTS[event.lost]
    return text if math.isinf(event.duration) else f"{text}, for {event.duration:g} s"


def _reading(event: SensorFault) -> str:
    """Returns what a faulty sensor reads."""
    if isinstance(event, AttitudeFault) and event.fault == "dead":
        return "reads level and at rest"
    return SENSOR_TEXTS[event.fault].format(delay=1000.0 * event.delay)


def _vector(values: tuple[float, ...]) -> str:
    return f"[{', '.join(f'{value:g}' for value in values)}]"
