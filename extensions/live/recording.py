"""Records commands and pushes of a live robot, to save them as a scenario.

A recording begins with the robot at its start. A plant and a controller that get the same inputs at
the same macro-steps repeat the walk.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from itertools import pairwise

import tomlkit

from hexapod_cosim.controller import BodyCommand
from hexapod_cosim.cosim.scenario.records import Command, Push, Scenario

LONGEST = 600.0  # s
MOST_CHANGES = 20_000  # of commands and pushes
Force = tuple[float, float, float]  # N    world axes
NO_FORCE: Force = (0.0, 0.0, 0.0)


@dataclass
class Recording:
    """Commands and forces by the macro-step from which they hold; `steps` were recorded."""

    scenario: Scenario  # with the settings of the walk
    commands: list[tuple[int, BodyCommand]] = field(default_factory=list)
    forces: list[tuple[int, Force]] = field(default_factory=lambda: [(0, NO_FORCE)])
    steps: int = 0

    def note(self, command: BodyCommand, force: Force) -> None:
        """Adds a macro-step, with the command and the force that hold in it."""
        if not self.commands or self.commands[-1][1] != command:
            self.commands.append((self.steps, command))
        if self.forces[-1][1] != force:
            self.forces.append((self.steps, force))
        self.steps += 1

    @property
    def duration(self) -> float:
        """Recorded time [s]."""
        return self.steps * self.scenario.macro_step

    @property
    def is_full(self) -> bool:
        """Whether the recording is as long as one may be."""
        changes = len(self.commands) + len(self.forces)
        return self.duration >= LONGEST or changes >= MOST_CHANGES

    def as_toml(self) -> str:
        """Returns the text of the scenario that repeats the walk; `hexapod simulate` runs it."""
        h = self.scenario.macro_step
        scenario = replace(
            self.scenario,
            title=f"{self.scenario.title}, driven by hand",
            duration=self.duration,
            commands=tuple(Command(time=k * h, **asdict(one)) for k, one in self.commands),
            events=tuple(
                Push(time=k * h, duration=(end - k) * h, force=force)
                for (k, force), (end, _) in pairwise([*self.forces, (self.steps, NO_FORCE)])
                if force != NO_FORCE
            ),
        )
        return tomlkit.dumps(scenario.to_table())
