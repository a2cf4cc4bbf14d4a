"""What worker processes do: they simulate the logs of an identification for sets of numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.extensions.identify.experiment import Experiment, first_part, simulated
from hexapod_cosim.extensions.identify.log import LogError
from hexapod_cosim.extensions.identify.log_plant import LogPlant
from hexapod_cosim.extensions.identify.unknowns import ROBOT
from hexapod_cosim.models import FmuError, Robot

_own: list[tuple[LogPlant, Robot, Sequence[Experiment]]] = []  # what a worker process opened


def open_plant(
    fmu: Path, robot: Robot, experiments: Sequence[Experiment], parameters: Mapping[str, Any]
) -> None:
    """Opens a robot's plant in a worker process. parameters: of all simulations."""
    _own.append((LogPlant(fmu, parameters), robot, experiments))


def simulate(
    values: Mapping[str, float], seconds: float, parameters: Mapping[str, float]
) -> list[NDArray[np.float64]] | None:
    """Returns the outputs of each experiment in a worker process; None where the plant refuses.

    Args:
        values: the numbers, by key.
        seconds: of each log that are simulated.
        parameters: further ones of the FMU, by name.
    """
    ((plant, robot, experiments),) = _own
    parts = [first_part(one, seconds) for one in experiments]
    try:
        return [simulated(plant, one, robot, ROBOT, values, parameters) for one in parts]
    except (LogError, FmuError):
        return None
