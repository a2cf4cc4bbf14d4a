"""Commands, disturbances and faults of a scenario, laid out by macro-step before the run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.controller import BodyCommand
from hexapod_cosim.cosim.scenario.records import FAULTS, Command, Fault, Push, Scenario
from hexapod_cosim.models import LEG_NAMES

ROUND_OFF = 5e-10  # s    of a macro-step's time


@dataclass(frozen=True)
class Schedule:
    """What is commanded and what pushes, step by step."""

    times: NDArray[np.float64]  # s    (steps + 1,) start + k h, never a running sum
    rows: NDArray[
        np.float64
    ]  # (steps + 1, 6) the same, the last one twice: vx vy yaw_rate height roll pitch
    pushes: (
        NDArray[np.float64] | None
    )  # (steps, 6) force [N] and torque [N m] on the torso, world axes; None: never any
    faults: (
        NDArray[np.int8] | None
        # (steps + 1, 6) of the force sensors: 0 none, else the number in FAULTS, from 1; None:
        # never any
    )

    @cached_property
    def commands(self) -> tuple[BodyCommand, ...]:
        """(steps,) the rows as commands, equal ones the same object."""
        rows = list(map(tuple, self.rows[:-1].tolist()))
        distinct = {row: BodyCommand(*row) for row in set(rows)}
        return tuple(distinct[row] for row in rows)


def make_schedule(scenario: Scenario) -> Schedule:
    """Lays a scenario's commands and events out over its macro-steps."""
    times = scenario.macro_step * np.arange(scenario.steps + 1, dtype=np.float64)
    begins, h = times[:-1], scenario.macro_step
    rows = command_rows(scenario.commands, begins)
    pushes = push_rows(scenario.pushes, begins, h) if scenario.pushes else None
    faults = fault_rows(scenario.faults, times) if scenario.faults else None
    return Schedule(scenario.start + times, np.vstack([rows, rows[-1:]]), pushes, faults)


def command_rows(commands: Sequence[Command], times: NDArray[np.float64]) -> NDArray[np.float64]:
    """(steps, 6) the command in force at each time [s] from the start: the last one that has
    begun, but for round-off.
    """
    begins = [command.time for command in commands]
    values = np.array([astuple(command)[1:] for command in commands])
    return np.asarray(
        values[np.maximum(np.searchsorted(begins, times + ROUND_OFF, side="right") - 1, 0)]
    )


def push_rows(events: Sequence[Push], times: NDArray[np.float64], h: float) -> NDArray[np.float64]:
    """(steps, 6) mean push over each step of h [s], so that the impulse is exact even when a
    push begins within a step.
    """
    rows = np.zeros((len(times), 6))
    for event in events:
        overlap = np.minimum(times + h, event.time + event.duration) - np.maximum(times, event.time)
        rows += np.outer(np.clip(overlap / h, 0.0, 1.0), [*event.force, *event.torque])
    return rows


def fault_rows(faults: Sequence[Fault], times: NDArray[np.float64]) -> NDArray[np.int8]:
    """(times, 6) the fault of each foot's force sensor at each time [s] from the start; of
    several at once the last one in the list.
    """
    rows = np.zeros((len(times), len(LEG_NAMES)), dtype=np.int8)
    for fault in faults:
        begin, end = np.searchsorted(
            times, [fault.time - ROUND_OFF, fault.time + fault.duration - ROUND_OFF]
        )
        rows[begin:end, LEG_NAMES.index(fault.leg)] = FAULTS.index(fault.fault) + 1
    return rows
