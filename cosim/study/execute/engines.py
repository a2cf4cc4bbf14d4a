"""Engines: the ways to compute the summary of a scenario's run."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Protocol, cast

from hexapod_cosim.controller import Gains
from hexapod_cosim.cosim.master.loop import Progress
from hexapod_cosim.cosim.results.summary import Summary, refused_summary, summarise
from hexapod_cosim.cosim.run.single_run import simulate
from hexapod_cosim.cosim.run.walker import Walker
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.cosim.study.plan.records import StudyError
from hexapod_cosim.models import HexapodError, unknown_name


class Engine(Protocol):
    """Runs scenarios on one robot's FMU."""

    def summary(self, scenario: Scenario, *, gains: Gains | None, progress: Progress) -> Summary:
        """Runs a scenario and returns its summary, also of a run that is refused.

        `progress` is called every few steps with the simulated time [s]. When it raises
        KeyboardInterrupt, the run ends with the status INTERRUPTED.
        """
        ...

    def close(self) -> None:
        """Frees the engine's resources."""
        ...


EngineFactory = Callable[[Path, Path], Engine]  # of a plant FMU and a controller FMU


def compiled_engine(fmu: Path, controller: Path) -> Engine:
    """Returns the engine that runs both FMUs in the master loop in C."""
    return Walker(fmu=fmu, controller=controller)


class PythonEngine:
    """Runs the master and the controller in Python, as `hexapod simulate` does."""

    def __init__(self, fmu: Path, _controller: Path) -> None:
        self._fmu = fmu

    def summary(self, scenario: Scenario, *, gains: Gains | None, progress: Progress) -> Summary:
        """Implements Engine.summary()."""
        try:
            return summarise(simulate(scenario, fmu=self._fmu, gains=gains, progress=progress))
        except HexapodError as error:
            return refused_summary(scenario, error)

    def close(self) -> None:
        """Implements Engine.close(): there is nothing to free."""


ENGINES: dict[str, EngineFactory] = {"compiled": compiled_engine, "python": PythonEngine}
DEFAULT_ENGINE = "compiled"


def find_engine(name: str) -> EngineFactory:
    """Returns an engine's factory by its name in ENGINES, or as MODULE:NAME.

    All workers must be able to import the module. Raises StudyError.
    """
    module, colon, factory = name.partition(":")
    if not colon:
        if name not in ENGINES:
            raise unknown_name("engine", name, ENGINES, where="--engine", error=StudyError)
        return ENGINES[name]
    try:
        return cast(EngineFactory, getattr(import_module(module), factory))
    except (ImportError, AttributeError) as error:
        raise StudyError(
            "no such engine",
            got=name,
            expected="MODULE:NAME that Python can import",
            fix=str(error),
            where="--engine",
        ) from error
