"""Decides which gains and plant FMUs runs share: the gains that a process designs, and the FMUs
that are exported to a folder.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from hexapod_cosim.controller import Gains
from hexapod_cosim.cosim.common.components import PLANT
from hexapod_cosim.cosim.common.plant_files import binary, fmi2_platform
from hexapod_cosim.cosim.common.temporary import TemporaryFolder
from hexapod_cosim.cosim.export.plant import export_fmu
from hexapod_cosim.cosim.run.gait_selection import select_gait
from hexapod_cosim.cosim.run.kept_designs import kept_gains
from hexapod_cosim.cosim.scenario.controls import control_of
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.models import Robot, load_robot

MAX_FMUS = 8  # of 1 MB that a process keeps; the least recently used one goes first
MAX_DESIGNS = 64  # sets of gains that are kept; the least recently used one goes first


@lru_cache(maxsize=MAX_DESIGNS)
def designed_gains(robot: Robot, period: float) -> Gains:
    """Returns the gains of a robot and a controller period [s].

    They are designed once and kept in the user's cache. Raises GainsError when no gains can be
    designed.
    """
    return kept_gains(robot, period, _designed)


def _designed(robot: Robot, period: float) -> Gains:
    """Designs gains; python-control takes a second to import."""
    from hexapod_cosim.cosim.design.gains import design_for  # noqa: PLC0415

    return design_for(robot, period)


def chosen_gains(scenario: Scenario, given: Gains | None = None) -> Gains | None:
    """Returns the gains that a scenario runs with, None unless its control needs gains.

    They are the given ones, or else designed for its robot and macro-step. Raises GainsError when
    no gains can be designed, HexapodError for a robot that cannot be read.
    """
    control = control_of(scenario.control)
    if not control.is_builtin or control.name == "kinematic":
        return None
    return designed_gains(*design_key(scenario)) if given is None else given


def law_of(control: str) -> str:
    """Returns the law of a built-in controller with gains, from the text of a control.

    Kinematic control has no gains and uses no law.
    """
    named = control_of(control)
    return "paper" if named.is_builtin and named.name == "paper" else "compliant"


def design_key(scenario: Scenario) -> tuple[Robot, float]:
    """Returns the robot, in its stance, and the period [s] that gains are designed for.

    Scenarios with equal keys share gains. Raises HexapodError for a robot that cannot be read.
    """
    return select_gait(scenario).robot, scenario.macro_step


@lru_cache(maxsize=MAX_FMUS)
def _content(robot: Robot, _binary: Path, _changed: int) -> bytes:
    """Returns the plant FMU of a robot with a binary, which was changed at that time [ns]."""
    with TemporaryFolder("export") as folder:
        return export_fmu(robot, folder / f"{robot.name}.fmu").read_bytes()


class PlantFmus:
    """Plant FMUs, exported when they are first asked for and kept for later runs.

    A process packs each of them once. They are kept by the robot file's content: a run sets the
    laws and settings of its scenario itself.

    Args:
        folder: where FMUs are exported to.
        given: the FMU of all runs; by default one is exported for each robot.
    """

    def __init__(self, folder: Path, given: Path | None = None) -> None:
        self._folder, self._given = folder, given
        self._exported: dict[str, Path] = {}

    def fmu(self, robot: str) -> Path:
        """Returns the plant FMU of a robot, given by its name or file. Raises HexapodError."""
        if self._given is not None:
            return self._given
        own = load_robot(robot)
        if own.hash not in self._exported:
            path = self._folder / str(len(self._exported)) / f"{own.name}.fmu"
            packed = binary(fmi2_platform(), PLANT)
            content = _content(own, packed, packed.stat().st_mtime_ns)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
            self._exported[own.hash] = path
        return self._exported[own.hash]
