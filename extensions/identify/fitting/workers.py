"""Simulates logs for several sets of numbers at once, in worker processes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.run.worker_pool import WorkerPool
from hexapod_cosim.extensions.identify.experiment import Experiment, first_part, simulated
from hexapod_cosim.extensions.identify.log import LogError
from hexapod_cosim.extensions.identify.log_plant import LogPlant
from hexapod_cosim.extensions.identify.unknowns import ROBOT
from hexapod_cosim.models import FmuError, Robot

Array = NDArray[np.float64]


class _Own:
    """What a worker process opens once."""

    plant: LogPlant
    robot: Robot
    experiments: Sequence[Experiment]


def _open(
    fmu: Path, robot: Robot, experiments: Sequence[Experiment], parameters: Mapping[str, Any]
) -> None:
    _Own.plant, _Own.robot, _Own.experiments = LogPlant(fmu, parameters), robot, experiments


def simulate(
    values: Mapping[str, float], seconds: float, parameters: Mapping[str, float]
) -> list[Array] | None:
    """Returns the outputs of each experiment in a worker process; None where the plant refuses.

    Args:
        values: the numbers, by key.
        seconds: of each log that are simulated.
        parameters: further ones of the FMU, by name.
    """
    parts = [first_part(one, seconds) for one in _Own.experiments]
    try:
        return [simulated(_Own.plant, one, _Own.robot, ROBOT, values, parameters) for one in parts]
    except (LogError, FmuError):
        return None


@contextmanager
def simulating_workers(
    size: int,
    fmu: Path,
    robot: Robot,
    experiments: Sequence[Experiment],
    parameters: Mapping[str, Any],
) -> Iterator[Executor | None]:
    """Opens worker processes for `simulate`; none where `size` is 1.

    Args:
        size: number of processes.
        fmu: the robot's FMU.
        robot: as the robot file has it.
        experiments: the logs.
        parameters: of all simulations.
    """
    if size == 1:
        yield None
        return
    scratch = fmu.parent / "workers"
    scratch.mkdir(exist_ok=True)
    initialise = partial(_open, fmu, robot, tuple(experiments), dict(parameters))
    with WorkerPool(size, initialise=initialise, scratch=scratch) as pool:
        yield pool
