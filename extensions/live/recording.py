"""Records commands, pushes and limp legs of a live robot, to save them as a scenario.

A recording begins with the robot at its start. A plant and a controller that get the same inputs at
the same macro-steps repeat the walk.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from itertools import pairwise

import tomlkit

from hexapod_cosim.controller import BodyCommand
from hexapod_cosim.cosim.scenario.records import (
    WHOLE_LEG,
    Command,
    Push,
    Scenario,
    ServoFault,
)
from hexapod_cosim.models import LEG_NAMES

LONGEST = 600.0  # s
MOST_CHANGES = 20_000  # of commands and pushes
Force = tuple[float, float, float]  # N    world axes
NO_FORCE: Force = (0.0, 0.0, 0.0)


@dataclass
class Recording:
    """Commands, forces and limp legs by their first macro-steps; `steps` were recorded."""

    scenario: Scenario  # with the settings of the walk
    commands: list[tuple[int, BodyCommand]] = field(default_factory=list)
    forces: list[tuple[int, Force]] = field(default_factory=lambda: [(0, NO_FORCE)])
    limp: list[tuple[int, tuple[int, ...]]] = field(default_factory=lambda: [(0, ())])
    steps: int = 0

    def note(self, command: BodyCommand, force: Force, limp: tuple[int, ...] = ()) -> None:
        """Adds a macro-step, with the command, the force and the limp legs that hold in it."""
        if not self.commands or self.commands[-1][1] != command:
            self.commands.append((self.steps, command))
        if self.forces[-1][1] != force:
            self.forces.append((self.steps, force))
        if self.limp[-1][1] != limp:
            self.limp.append((self.steps, limp))
        self.steps += 1

    @property
    def duration(self) -> float:
        """Recorded time [s]."""
        return self.steps * self.scenario.macro_step

    @property
    def is_full(self) -> bool:
        """Whether the recording is as long as one may be."""
        changes = len(self.commands) + len(self.forces) + len(self.limp)
        return self.duration >= LONGEST or changes >= MOST_CHANGES

    def as_toml(self) -> str:
        """Returns the text of the scenario that repeats the walk; `hexapod simulate` runs it."""
        h = self.scenario.macro_step
        scenario = replace(
            self.scenario,
            title=f"{self.scenario.title}, driven by hand",
            duration=self.duration,
            commands=tuple(Command(time=k * h, **asdict(one)) for k, one in self.commands),
            events=(*self._pushes(h), *self._faults(h)),
        )
        return tomlkit.dumps(scenario.to_table())

    def _pushes(self, h: float) -> list[Push]:
        return [
            Push(time=k * h, duration=(end - k) * h, force=force)
            for (k, force), (end, _) in pairwise([*self.forces, (self.steps, NO_FORCE)])
            if force != NO_FORCE
        ]

    def _faults(self, h: float) -> list[ServoFault]:
        return [
            ServoFault(
                time=k * h,
                duration=(end - k) * h,
                leg=LEG_NAMES[leg],
                joint=WHOLE_LEG,
                fault="limp",
            )
            for (k, limp), (end, _) in pairwise([*self.limp, (self.steps, ())])
            for leg in limp
        ]
