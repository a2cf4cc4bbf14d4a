"""Events of a run as frozen records: pushes, faults, lost commands, changed parameters."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated, Any

from hexapod_cosim.models import JOINT_NAMES, LEG_NAMES
from hexapod_cosim.models.schema import Choice, Number, Text, Vector

FAULTS = ("dead", "stuck", "nan", "late")  # of sensors
NOISY = "noisy"  # a further one of force sensors
ANGLE, ATTITUDE = "angle", "attitude"  # sensors inside the robot
SERVO_FAULTS = ("weak", "limp", "locked")
WHOLE_LEG = "all"  # joints
LOST = ("command", "step")
DELAY = Number("s", at_least=0.0, at_most=1.0)  # of late readings
ZERO = (0.0, 0.0, 0.0)
SENSOR_TEXTS = {
    "dead": "reads zero",
    "stuck": "repeats its last reading",
    "nan": "reads NaN",
    "late": "is late by {delay:g} ms",
    "noisy": "has a noise of {noise:g} %",
}
LOST_TEXTS = {
    "command": "the joint commands are lost, and the last one holds",
    "step": "macro-steps are dropped: the last readings and joint commands hold",
}
SERVO_TEXTS = {"weak": "gives {share:g} of its torque", "limp": "is limp", "locked": "is locked"}


@dataclass(frozen=True, kw_only=True)
class Push:
    """A force and torque on the torso, world axes, from `time` [s from the start of the run] on."""

    time: Annotated[float, Number("s", at_least=0.0)]
    duration: Annotated[float, Number("s", above=0.0)]
    force: Annotated[tuple[float, ...], Vector("N", 3)] = ZERO
    torque: Annotated[tuple[float, ...], Vector("N m", 3)] = ZERO


@dataclass(frozen=True, kw_only=True)
class Fault:
    """A fault of a foot's force sensor from `time` [s from the start of the run].

    A dead sensor reads zero, a stuck one repeats its last reading, and nan is no number. A late one
    reads what it should have read `delay` earlier, rounded up to whole macro-steps, or else at the
    start of the run. A noisy one has this noise: a standard deviation, as a share of the force.
    """

    time: Annotated[float, Number("s", at_least=0.0)]
    leg: Annotated[str, Choice(LEG_NAMES)]
    fault: Annotated[str, Choice((*FAULTS, NOISY))]
    delay: Annotated[float, DELAY] = 0.0
    noise: Annotated[float, Number("1", at_least=0.0)] = 0.1
    duration: Annotated[float, Number("s", above=0.0)] = math.inf


@dataclass(frozen=True, kw_only=True)
class AngleFault:
    """A fault of a joint's sensor, which gives angle and speed, as a `Fault`. The joint itself
    moves as before.
    """

    time: Annotated[float, Number("s", at_least=0.0)]
    leg: Annotated[str, Choice(LEG_NAMES)]
    joint: Annotated[str, Choice(JOINT_NAMES)]
    sensor: Annotated[str, Choice((ANGLE,))]
    fault: Annotated[str, Choice(FAULTS)]
    delay: Annotated[float, DELAY] = 0.0
    duration: Annotated[float, Number("s", above=0.0)] = math.inf


@dataclass(frozen=True, kw_only=True)
class AttitudeFault:
    """A fault of the torso's sensor of attitude and rotation rate, as a `Fault`. A dead one reads
    the level attitude with yaw 0, at rest.
    """

    time: Annotated[float, Number("s", at_least=0.0)]
    sensor: Annotated[str, Choice((ATTITUDE,))]
    fault: Annotated[str, Choice(FAULTS)]
    delay: Annotated[float, DELAY] = 0.0
    duration: Annotated[float, Number("s", above=0.0)] = math.inf


@dataclass(frozen=True, kw_only=True)
class ServoFault:
    """A fault of a joint's servo from `time` [s from the start of the run].

    A weak servo gives a share of its largest torque, a limp one none; a locked joint stays at the
    angle that it has when the fault begins (the plant's inputs `weakness` and `lock`).
    """

    time: Annotated[float, Number("s", at_least=0.0)]
    leg: Annotated[str, Choice(LEG_NAMES)]
    joint: Annotated[str, Choice((*JOINT_NAMES, WHOLE_LEG))]
    fault: Annotated[str, Choice(SERVO_FAULTS)]
    share: Annotated[float, Number("1", at_least=0.0, at_most=1.0)] = 0.5  # of a weak one
    duration: Annotated[float, Number("s", above=0.0)] = math.inf


@dataclass(frozen=True, kw_only=True)
class Lost:
    """Lost joint commands or dropped macro-steps from `time` [s from the start of the run].

    Where commands are lost, the controller is called, but the servos keep the last command that
    arrived. Where a whole macro-step is dropped, the readings do not arrive either: the controller
    is called with the last ones, because its time goes on. The first macro-step cannot be lost.
    """

    time: Annotated[float, Number("s", above=0.0)]
    duration: Annotated[float, Number("s", above=0.0)]
    lost: Annotated[str, Choice(LOST)]


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """A tunable parameter of the plant FMU that has a new value from `time` [s from the start]."""

    time: Annotated[float, Number("s", at_least=0.0)]
    parameter: Annotated[str, Text()]
    value: Annotated[float, Number("")]


SensorFault = Fault | AngleFault | AttitudeFault
Event = Push | SensorFault | ServoFault | Lost | Tuning


def event_log(events: Iterable[Event], simulated: float) -> list[dict[str, Any]]:
    """Returns time [s from the start] and text of the events that began within `simulated` [s], in
    order of time.
    """
    begun = [event for event in events if event.time < simulated]
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
            which = f"servo of {event.leg}.{event.joint}"
            if event.joint == WHOLE_LEG:
                which = f"leg {event.leg}"
            text = f"the {which} {SERVO_TEXTS[event.fault].format(share=event.share)}"
        case Lost():
            text = LOST_TEXTS[event.lost]
        case Tuning():
            return f"{event.parameter} becomes {event.value:g}"
    return text if math.isinf(event.duration) else f"{text}, for {event.duration:g} s"


def _reading(event: SensorFault) -> str:
    """Returns what a faulty sensor reads."""
    if isinstance(event, AttitudeFault) and event.fault == "dead":
        return "reads level and at rest"
    noise = 100.0 * event.noise if isinstance(event, Fault) else 0.0
    return SENSOR_TEXTS[event.fault].format(delay=1000.0 * event.delay, noise=noise)


def _vector(values: tuple[float, ...]) -> str:
    return f"[{', '.join(f'{value:g}' for value in values)}]"
