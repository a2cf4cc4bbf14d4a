"""Makes the gains and plant FMUs that runs share, each of them once."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass
from pathlib import Path

from hexapod_cosim.controller import Gains
from hexapod_cosim.cosim.export.export import export_fmu
from hexapod_cosim.cosim.run.run import chosen_gains, known_robot
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.models import load_robot

MAX_DESIGNS = 64  # sets of gains that are kept; the least recently used one goes first


@dataclass(frozen=True)
class PreparationKey:
    """What gains depend on: scenarios with equal keys share them."""

    robot: str  # hash of the robot as its controller knows it
    control: str
    macro_step: float  # s


def preparation_key(scenario: Scenario) -> PreparationKey:
    """Returns the key of a scenario. Raises HexapodError when its robot cannot be read."""
    return PreparationKey(known_robot(scenario).hash, scenario.control, scenario.macro_step)


class Preparation:
    """Gains and plant FMUs, made when they are first asked for and kept for later runs.

    Gains are kept by PreparationKey. FMUs are kept by the hash of the robot file's content: a
    run sets the laws and settings of its scenario itself.

    Args:
        folder: where FMUs are exported to.
        fmu: the FMU of all runs; by default one is exported for each robot.
        gains: the gains of all compliant runs; by default they are designed.
    """

    def __init__(
        self, folder: Path, *, fmu: Path | None = None, gains: Gains | None = None
    ) -> None:
        self._folder, self._given_fmu, self._given_gains = folder, fmu, gains
        self._designs: OrderedDict[PreparationKey, Gains] = OrderedDict()
        self._fmus: dict[str, Path] = {}

    def gains(self, scenario: Scenario) -> Gains | None:
        """Returns the gains of a scenario, None under kinematic control.

        Raises GainsError when no gains can be designed, HexapodError for a robot that cannot be
        read.
        """
        if scenario.control == "kinematic" or self._given_gains is not None:
            return chosen_gains(scenario, self._given_gains)
        key = preparation_key(scenario)
        if key not in self._designs:
            gains = chosen_gains(scenario)
            assert gains is not None  # only kinematic control has none
            self._designs[key] = gains
            if len(self._designs) > MAX_DESIGNS:
                self._designs.popitem(last=False)
        self._designs.move_to_end(key)
        return self._designs[key]

    def fmu(self, robot: str) -> Path:
        """Returns the plant FMU of a robot, given by its name or file. Raises HexapodError."""
        if self._given_fmu is not None:
            return self._given_fmu
        own = load_robot(robot)
        if own.hash not in self._fmus:
            path = self._folder / f"{len(self._fmus)}.fmu"
            self._fmus[own.hash] = export_fmu(own, path)
        return self._fmus[own.hash]
