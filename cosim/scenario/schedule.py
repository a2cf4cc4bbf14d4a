"""Computes commands, pushes and faults of a scenario for each macro-step, before the run."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import astuple, dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.controller import BodyCommand
from hexapod_cosim.cosim.scenario.events import (
    FAULTS,
    NOISY,
    WHOLE_LEG,
    AngleFault,
    AttitudeFault,
    Fault,
    Lost,
    Push,
    SensorFault,
    ServoFault,
    Tuning,
)
from hexapod_cosim.cosim.scenario.records import Command, Scenario
from hexapod_cosim.models import JOINT_NAMES, LEG_NAMES

ROUND_OFF = 5e-10  # s    of the time of a macro-step
# weakness and lock
SERVO_STATES = {"limp": (1.0, 0.0), "locked": (0.0, 1.0)}
STUCK = FAULTS.index("stuck") + 1  # the kind of a sensor that repeats its last reading


@dataclass(frozen=True)
class SensorFaults:
    """Faults of n sensors, macro-step by macro-step."""

    kind: NDArray[np.int8]  # (steps + 1, n) 0: none, else 1 + index in FAULTS
    delay: NDArray[np.int32]  # (steps + 1, n) macro-steps, of late readings
    noise: NDArray[np.float64]  # (steps + 1, n) of noisy sensors: a share of the reading


@dataclass(frozen=True)
class Schedule:
    """Commands, pushes and faults of a run, macro-step by macro-step."""

    # (steps + 1,) s    start + k h, never a running sum
    times: NDArray[np.float64]
    # (steps + 1, 6) body commands vx vy yaw_rate height roll pitch; the last row repeats
    rows: NDArray[np.float64]
    # (steps, 6) force [N] and torque [N m] on the torso, world axes; None: no pushes
    pushes: NDArray[np.float64] | None
    faults: SensorFaults | None  # of the feet's force sensors, in the order of the legs
    # (steps, 36) the plant's inputs weakness, then lock, leg by leg; None: healthy servos
    servos: NDArray[np.float64] | None = None
    lost: NDArray[np.bool_] | None = None  # (steps + 1,) the command is lost; None: none are
    # of the joints' sensors (18, leg by leg), of the attitude sensor (1)
    angle_faults: SensorFaults | None = None
    attitude_faults: SensorFaults | None = None
    # parameters that change: the step before which they do, name and value, in order
    tunings: tuple[tuple[int, str, float], ...] = ()

    @cached_property
    def commands(self) -> tuple[BodyCommand, ...]:
        """The rows as body commands (steps,); equal rows share one object."""
        rows = list(map(tuple, self.rows[:-1].tolist()))
        distinct = {row: BodyCommand(*row) for row in set(rows)}
        return tuple(distinct[row] for row in rows)


def make_schedule(scenario: Scenario) -> Schedule:
    """Returns the schedule of a scenario's commands and events."""
    times = scenario.macro_step * np.arange(scenario.steps + 1, dtype=np.float64)
    begins, h = times[:-1], scenario.macro_step
    rows = command_rows(scenario.commands, begins)
    pushes, servo_faults = scenario.events_of(Push), scenario.events_of(ServoFault)
    lost = scenario.events_of(Lost)
    dropped = lost_rows([event for event in lost if event.lost == "step"], times)
    force, angle, attitude = (
        fault_rows(faults, times, dropped, sensors)
        for faults, sensors in (
            (scenario.events_of(Fault), len(LEG_NAMES)),
            (scenario.events_of(AngleFault), len(LEG_NAMES) * len(JOINT_NAMES)),
            (scenario.events_of(AttitudeFault), 1),
        )
    )
    return Schedule(
        scenario.start + times,
        np.vstack([rows, rows[-1:]]),
        push_rows(pushes, begins, h) if pushes else None,
        force,
        servo_rows(servo_faults, begins) if servo_faults else None,
        lost_rows(lost, times) if lost else None,
        angle,
        attitude,
        tuple(
            (int(np.searchsorted(begins, event.time - ROUND_OFF)), event.parameter, event.value)
            for event in sorted(scenario.events_of(Tuning), key=lambda event: event.time)
        ),
    )


def command_rows(commands: Sequence[Command], times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the command in force at each time (steps, 6); times are in s from the start.

    That is the last command that has begun, allowing for round-off.
    """
    begins = [command.time for command in commands]
    values = np.array([astuple(command)[1:] for command in commands])
    index = np.searchsorted(begins, times + ROUND_OFF, side="right") - 1
    return np.asarray(values[np.maximum(index, 0)])


def push_rows(events: Sequence[Push], times: NDArray[np.float64], h: float) -> NDArray[np.float64]:
    """Returns the mean push over each step of h [s] (steps, 6).

    The mean keeps the impulse exact when a push begins or ends within a step.
    """
    rows = np.zeros((len(times), 6))
    for event in events:
        overlap = np.minimum(times + h, event.time + event.duration) - np.maximum(times, event.time)
        rows += np.outer(np.clip(overlap / h, 0.0, 1.0), [*event.force, *event.torque])
    return rows


def fault_rows(
    faults: Sequence[SensorFault],
    times: NDArray[np.float64],
    dropped: NDArray[np.bool_],
    sensors: int,
) -> SensorFaults | None:
    """Returns the fault of each of `sensors` at each time [s from the start]; None without any.

    Where several faults overlap, the last one in the list holds. In a dropped macro-step (times,)
    all sensors are stuck.
    """
    if not faults and not dropped.any():
        return None
    kind = np.zeros((len(times), sensors), dtype=np.int8)
    delay = np.zeros((len(times), sensors), dtype=np.int32)
    noise, h = np.zeros((len(times), sensors)), times[1] - times[0]
    for fault in faults:
        place = _span(fault, times), _sensor(fault)
        noisy = isinstance(fault, Fault) and fault.fault == NOISY
        noise[place] = fault.noise if isinstance(fault, Fault) and noisy else 0.0
        kind[place] = 0 if noisy else FAULTS.index(fault.fault) + 1
        delay[place] = math.ceil((fault.delay - ROUND_OFF) / h)
    kind[dropped] = STUCK
    return SensorFaults(kind, delay, noise)


def _sensor(fault: SensorFault) -> int:
    """Returns the index of a fault's sensor among those of its kind."""
    match fault:
        case Fault():
            return LEG_NAMES.index(fault.leg)
        case AngleFault():
            return LEG_NAMES.index(fault.leg) * len(JOINT_NAMES) + JOINT_NAMES.index(fault.joint)
        case AttitudeFault():
            return 0


def servo_rows(faults: Sequence[ServoFault], times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns weakness and lock of all servos in the steps that begin at times [s from the start]
    (times, 36). Where faults of a servo overlap, the last one in the list holds.
    """
    rows = np.zeros((len(times), 2, len(LEG_NAMES), len(JOINT_NAMES)))
    for fault in faults:
        state = SERVO_STATES.get(fault.fault, (1.0 - fault.share, 0.0))
        for j, joint in enumerate(JOINT_NAMES):
            if fault.joint in (joint, WHOLE_LEG):
                rows[_span(fault, times), :, LEG_NAMES.index(fault.leg), j] = state
    return rows.reshape(len(times), -1)


def lost_rows(events: Sequence[Lost], times: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Returns whether each time [s from the start] lies within one of the events (times,); never
    the first.
    """
    rows = np.zeros(len(times), dtype=np.bool_)
    for event in events:
        rows[_span(event, times)] = True
    rows[0] = False
    return rows


def _span(event: SensorFault | ServoFault | Lost, times: NDArray[np.float64]) -> slice:
    """Returns which times [s from the start] lie within an event."""
    begin, end = np.searchsorted(
        times, [event.time - ROUND_OFF, event.time + event.duration - ROUND_OFF]
    )
    return slice(int(begin), int(end))
