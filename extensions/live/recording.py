"""Records commands, pushes and limp legs of a live robot, to save them as a scenario.

A recording begins with the robot at its start. A plant and a controller that get the same inputs at
the same macro-steps repeat the walk.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from itertools import groupby
from typing import TypeVar

import tomlkit

from hexapod_cosim.controller import BodyCommand
from hexapod_cosim.cosim.scenario.events import WHOLE_LEG, Push, ServoFault
from hexapod_cosim.cosim.scenario.records import Command, Scenario
from hexapod_cosim.models import LEG_NAMES

LONGEST = 600.0  # s
Force = tuple[float, float, float]  # N    world axes
NO_FORCE: Force = (0.0, 0.0, 0.0)
Limp = tuple[int, ...]  # legs
Value = TypeVar("Value", bound=Hashable)


@dataclass
class Recording:
    """The inputs of each macro-step."""

    scenario: Scenario  # with the settings of the walk
    steps: list[tuple[BodyCommand, Force, Limp]] = field(default_factory=list)

    def note(self, command: BodyCommand, force: Force, limp: Limp = ()) -> None:
        """Adds a macro-step, with the command, the force and the limp legs that hold in it."""
        self.steps.append((command, force, limp))

    @property
    def duration(self) -> float:
        """Recorded time [s]."""
        return len(self.steps) * self.scenario.macro_step

    def as_toml(self) -> str:
        """Returns the text of the scenario that repeats the walk; `hexapod simulate` runs it."""
        commands, forces, limp = zip(*self.steps, strict=True)
        pushes = [
            Push(time=time, duration=duration, force=force)
            for time, duration, force in self._spans(forces)
            if force != NO_FORCE
        ]
        faults = [
            ServoFault(
                time=time, duration=duration, leg=LEG_NAMES[leg], joint=WHOLE_LEG, fault="limp"
            )
            for time, duration, legs in self._spans(limp)
            for leg in legs
        ]
        scenario = replace(
            self.scenario,
            title=f"{self.scenario.title}, driven by hand",
            duration=self.duration,
            commands=tuple(
                Command(time=time, **asdict(one)) for time, _, one in self._spans(commands)
            ),
            events=(*pushes, *faults),
        )
        return tomlkit.dumps(scenario.to_table())

    def _spans(self, values: Sequence[Value]) -> Iterator[tuple[float, float, Value]]:
        """Yields begin [s], duration [s] and value of the times in which a value holds."""
        h, begin = self.scenario.macro_step, 0
        for value, steps in groupby(values):
            count = len(list(steps))
            yield begin * h, count * h, value
            begin += count
