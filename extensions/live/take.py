"""Records what a live robot was told, so that it can be repeated and saved as a scenario.

A take begins with a robot at its start and holds the command and the push of each macro-step, equal
ones once, and the changes of gait, control and friction. A plant and a controller that get the same
inputs at the same macro-steps repeat the walk bit for bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import TypeVar

import tomlkit

from hexapod_cosim.controller import BodyCommand
from hexapod_cosim.cosim.scenario import records
from hexapod_cosim.cosim.scenario.records import Command, Scenario
from hexapod_cosim.extensions.live.protocol import Change

LONGEST = 600.0  # s    of a take
MOST_CHANGES = 20_000  # of commands and pushes in a take
Value = TypeVar("Value")
Force = tuple[float, float, float]
NO_FORCE: Force = (0.0, 0.0, 0.0)


@dataclass
class Take:
    """Commands, forces [N] and changes by the macro-step from which they hold.

    `steps` were recorded.
    """

    scenario: Scenario  # with the settings of the take
    commands: list[tuple[int, BodyCommand]] = field(default_factory=list)
    forces: list[tuple[int, Force]] = field(default_factory=list)
    changes: list[tuple[int, Change]] = field(default_factory=list)
    steps: int = 0

    def note(self, command: BodyCommand, force: Force) -> None:
        """Adds a macro-step, with the command and the force [N] that hold in it."""
        if not self.commands or self.commands[-1][1] != command:
            self.commands.append((self.steps, command))
        if force != (self.forces[-1][1] if self.forces else NO_FORCE):
            self.forces.append((self.steps, force))
        self.steps += 1

    def note_change(self, change: Change) -> None:
        """Adds a change that is made before the next macro-step."""
        self.changes.append((self.steps, change))

    def changes_at(self, step: int) -> list[Change]:
        """Returns the changes that are made before a macro-step."""
        return [change for k, change in self.changes if k == step]

    @property
    def duration(self) -> float:
        """Recorded time [s]."""
        return self.steps * self.scenario.macro_step

    @property
    def kept(self) -> int:
        """Macro-steps before the first change, which a scenario can repeat."""
        return self.changes[0][0] if self.changes else self.steps

    @property
    def full(self) -> bool:
        """Whether the take is as long as one may be."""
        changes = len(self.commands) + len(self.forces) + len(self.changes)
        return self.duration >= LONGEST or changes >= MOST_CHANGES

    def input(self, step: int) -> tuple[BodyCommand, Force]:
        """Returns command and force of a macro-step."""
        return _value(self.commands, step, BodyCommand()), _value(self.forces, step, NO_FORCE)

    def as_scenario(self) -> Scenario:
        """Returns the scenario that repeats the take up to its first change.

        `hexapod simulate` runs it; it has one gait, control and friction.
        """
        h, last = self.scenario.macro_step, self.kept
        commands = [
            Command(time=k * h, **_fields(command)) for k, command in self.commands if k < last
        ]
        ends = [*((k, force) for k, force in self.forces if k < last), (last, NO_FORCE)]
        pushes = [
            records.Push(time=k * h, duration=(end - k) * h, force=force)
            for (k, force), (end, _) in pairwise(ends)
            if force != NO_FORCE
        ]
        return replace(
            self.scenario,
            title=f"{self.scenario.title}, driven by hand",
            duration=last * h,
            commands=tuple(commands),
            events=tuple(pushes),
        )

    def as_toml(self) -> str:
        """Returns the text of the scenario file."""
        return tomlkit.dumps(self.as_scenario().to_table())


def _fields(command: BodyCommand) -> dict[str, float]:
    return {key: float(value) for key, value in vars(command).items()}


def _value(changes: Sequence[tuple[int, Value]], step: int, before: Value) -> Value:
    """Returns the value that holds at a step: that of the last change at or before it."""
    low, high = 0, len(changes)
    while low < high:
        middle = (low + high) // 2
        if changes[middle][0] <= step:
            low = middle + 1
        else:
            high = middle
    return changes[low - 1][1] if low else before
