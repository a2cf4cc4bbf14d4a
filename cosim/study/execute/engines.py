"""How one run's figures are made, behind one small protocol: whatever turns a scenario into a
Summary can take part.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Protocol, cast

from hexapod_cosim.controller import Gains
from hexapod_cosim.cosim.master.loop import Progress
from hexapod_cosim.cosim.results.summary import Summary, refused_summary, summarise
from hexapod_cosim.cosim.run.run import simulate
from hexapod_cosim.cosim.run.walker import Walker
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.cosim.study.plan.records import StudyError
from hexapod_cosim.models import HexapodError, unknown_name


class Engine(Protocol):
    """Runs scenarios of one robot's FMU."""

    def summary(self, scenario: Scenario, *, gains: Gains | None, progress: Progress) -> Summary:
        """What a run came to; never raises HexapodError. A KeyboardInterrupt that `progress`
        raises ends it as INTERRUPTED.
        """
        ...

    def close(self) -> None:
        """Frees what it holds."""
        ...


Maker = Callable[[Path, Path], Engine]  # from a robot's FMU and a controller's


def compiled_engine(fmu: Path, controller: Path) -> Engine:
    """The loop in C, driving both FMUs: no Python between a walk's first step and its last."""
    return Walker(fmu=fmu, controller=controller)


class PythonEngine:
    """The master and the controller in Python: the walk that `hexapod simulate` walks."""

    def __init__(self, fmu: Path, _controller: Path) -> None:
        self._fmu = fmu

    def summary(self, scenario: Scenario, *, gains: Gains | None, progress: Progress) -> Summary:
        """As Engine says."""
        try:
            return summarise(simulate(scenario, fmu=self._fmu, gains=gains, progress=progress))
        except HexapodError as error:
            return refused_summary(scenario, error)

    def close(self) -> None:
        """Nothing to free."""


ENGINES: dict[str, Maker] = {"compiled": compiled_engine, "python": PythonEngine}
DEFAULT_ENGINE = "compiled"


def engine_named(name: str) -> Maker:
    """One of ENGINES, or MODULE:NAME of one's own, which all workers must be able to import.
    Raises StudyError.
    """
    module, colon, maker = name.partition(":")
    if not colon:
        if name not in ENGINES:
            raise unknown_name("engine", name, ENGINES, where="--engine", error=StudyError)
        return ENGINES[name]
    try:
        return cast(Maker, getattr(import_module(module), maker))
    except (ImportError, AttributeError) as error:
        raise StudyError(
            "no such engine",
            got=name,
            expected="MODULE:NAME that Python can import",
            fix=str(error),
            where="--engine",
        ) from error
