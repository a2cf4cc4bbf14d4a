"""Replays a log: drives the FMU with its commands and compares all readings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hexapod_cosim.cosim.common.temporary import TemporaryFolder
from hexapod_cosim.cosim.export.plant_export import export_fmu
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.extensions.identify.channel_screening import screened
from hexapod_cosim.extensions.identify.commands.command_screening import (
    wrong_commands,
    wrong_commands_error,
)
from hexapod_cosim.extensions.identify.commands.speed_references import with_speed_references
from hexapod_cosim.extensions.identify.comparison import (
    Difference,
    channel_differences,
    column_differences,
)
from hexapod_cosim.extensions.identify.experiment import Experiment
from hexapod_cosim.extensions.identify.log import Log, LogError, without_readings
from hexapod_cosim.extensions.identify.log_plant import LogPlant
from hexapod_cosim.extensions.identify.other_robot import other_robot
from hexapod_cosim.extensions.identify.screening import BadColumn, left_out
from hexapod_cosim.extensions.identify.start import initial_state
from hexapod_cosim.models import FmuError, Robot


@dataclass(frozen=True)
class Replay:
    """A log and the simulation of it."""

    log: Log
    simulated: Recording  # time, commands and the outputs of the log's columns
    names: tuple[str, ...]  # the columns that are compared
    columns: tuple[Difference, ...]
    commands: tuple[BadColumn, ...]  # that the servos cannot have got
    readings: tuple[BadColumn, ...]  # dead or wrong; none are named where commands are wrong
    other: str = ""  # why the log is another robot's, as a sentence

    @property
    def warnings(self) -> list[str]:
        """What a user must know of the columns, as sentences."""
        return [
            *self.log.warnings,
            *([self.other] if self.other else []),
            *(
                f"The robot cannot have got {one.name}: {one.why}. The simulated robot got it, so "
                "that the differences are not those of the robot file."
                for one in self.commands
            ),
            *left_out(self.readings, *2 * ("cannot be the robot's",)),
        ]

    @property
    def channels(self) -> list[Difference]:
        """The difference of each channel."""
        return channel_differences(self.columns)


def replay(
    log: Log,
    robot: Robot,
    *,
    fmu: Path | None = None,
    parameters: Mapping[str, Any] | None = None,
) -> Replay:
    """Simulates a robot from the log's first row on, with the log's commands.

    Args:
        log: commands and the readings to compare.
        robot: the robot that is simulated.
        fmu: its FMU; by default it is exported.
        parameters: further parameters of the FMU, by name.

    Wrong commands are simulated all the same, and named in the result.

    Raises HexapodError for a log without readings and where the plant cannot follow the commands.
    """
    wrong = wrong_commands(log)
    log = with_speed_references(log, robot)
    with TemporaryFolder("replay") as folder:
        path = fmu or export_fmu(robot, folder / "robot.fmu")
        with LogPlant(path, parameters) as plant:
            names = plant.known(log.measured)
            if not names:
                raise without_readings(log)
            try:
                found = plant.simulate(log, names, initial_state(log, robot))
            except (LogError, FmuError) as error:
                if wrong:
                    raise wrong_commands_error(log, wrong) from error
                other = other_robot(log, robot)
                if other:
                    raise LogError(other, got=str(error), where=log.where) from error
                raise
    inputs = log.commands
    data = np.column_stack([log.time, *inputs.values(), found])
    simulated = Recording(("time", *inputs, *names), data)
    whole = Experiment(
        log=log,
        number=0,
        columns=tuple(names),
        fitted=slice(0, len(log.time)),
        held_out=slice(len(log.time), len(log.time)),
    )
    return Replay(
        log=log,
        simulated=simulated,
        names=tuple(names),
        columns=tuple(column_differences(log, names, found)),
        commands=tuple(wrong),
        readings=() if wrong else tuple(screened(whole, found)),
        other=other_robot(log, robot),
    )
