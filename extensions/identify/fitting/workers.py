"""Simulates logs for several sets of numbers at once, in worker processes."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.run.worker_pool import WorkerDiedError, WorkerPool
from hexapod_cosim.extensions.identify.experiment import Experiment, simulated
from hexapod_cosim.extensions.identify.log import LogError
from hexapod_cosim.extensions.identify.log_plant import LogPlant
from hexapod_cosim.extensions.identify.unknowns import ROBOT
from hexapod_cosim.models import FmuError, HexapodError, Robot

Array = NDArray[np.float64]
Outputs = list[Array] | None  # of each experiment; None: the plant refuses the numbers


@dataclass(frozen=True)
class Task:
    """Numbers for which the experiments of a file are simulated."""

    file: Path
    values: Mapping[str, float]
    parameters: Mapping[str, float]  # further ones of the FMU


class _Own:
    """What a worker process holds."""

    plant: LogPlant
    robot: Robot
    file: Path | None = None  # of the experiments
    experiments: tuple[Experiment, ...] = ()


def _open(fmu: Path, robot: Robot, parameters: Mapping[str, Any]) -> None:
    _Own.plant, _Own.robot = LogPlant(fmu, parameters), robot


def _simulate(task: Task) -> Outputs:
    if _Own.file != task.file:
        # written by the parent process into a folder of its own
        _Own.experiments = pickle.loads(task.file.read_bytes())
        _Own.file = task.file
    try:
        return [
            simulated(_Own.plant, one, _Own.robot, ROBOT, task.values, task.parameters)
            for one in _Own.experiments
        ]
    except (LogError, FmuError):
        return None


class Workers:
    """Worker processes that simulate logs; see `simulating_workers`."""

    def __init__(self, pool: WorkerPool, folder: Path) -> None:
        self._pool, self._folder = pool, folder
        self.watch: Callable[[], None] = lambda: None  # called after each simulation of all logs
        self._written: dict[int, tuple[tuple[Experiment, ...], Path]] = {}

    def outputs(
        self,
        experiments: tuple[Experiment, ...],
        many: Sequence[Mapping[str, float]],
        parameters: Mapping[str, float],
    ) -> list[Outputs]:
        """Returns the outputs of the experiments for each set of numbers.

        parameters: further ones of the FMU, by name.

        Raises HexapodError when a worker process dies.
        """
        file = self._file(experiments)
        futures = [self._pool.submit(_simulate, Task(file, values, parameters)) for values in many]
        try:
            for future in as_completed(futures):
                future.result()
                self.watch()
        except WorkerDiedError as error:
            raise HexapodError(
                "a simulation of the log has no result",
                got=error.got,
                expected="outputs of the plant",
                fix="give --workers 1, which needs less memory",
            ) from error
        return [future.result() for future in futures]

    def _file(self, experiments: tuple[Experiment, ...]) -> Path:
        """Returns the file of experiments, which is written once."""
        if id(experiments) not in self._written:
            path = self._folder / f"experiments{len(self._written)}.pickle"
            path.write_bytes(pickle.dumps(experiments))
            self._written[id(experiments)] = experiments, path  # kept, so that its id stays its own
        return self._written[id(experiments)][1]


@contextmanager
def simulating_workers(
    size: int, fmu: Path, robot: Robot, parameters: Mapping[str, Any], folder: Path
) -> Iterator[Workers | None]:
    """Opens worker processes that simulate a robot; none where `size` is 1.

    Args:
        size: number of processes.
        fmu: the robot's FMU.
        robot: as the robot file has it.
        parameters: of all simulations.
        folder: an empty folder for their files.
    """
    if size == 1:
        yield None
        return
    scratch = folder / "scratch"
    scratch.mkdir(parents=True)
    initialise = partial(_open, fmu, robot, dict(parameters))
    with WorkerPool(size, initialise=initialise, scratch=scratch) as pool:
        yield Workers(pool, folder)
