"""Computes the margins of a design in discrete time with python-control."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np

from hexapod_cosim.controller.design.laws import Laws
from hexapod_cosim.controller.design.loci import (
    SLOWEST,
    FindLoci,
    Loci,
    LoopMargins,
    Plants,
    Response,
    frequencies,
    loop_margins,
    quick_margins,
)
from hexapod_cosim.controller.design.standing import StandingPlant
from hexapod_cosim.controller.size import size_of
from hexapod_cosim.models import Robot

JUDGED = 400  # frequencies
NOMINAL = (0.8, 1.25)  # 1    range of mean loads that are about the robot's own
CRITERIA = ("gain", "phase", "delay")


def support_torque(robot: Robot, plants: Plants) -> float:
    """Returns the largest feed-forward torque of a servo in stances near the nominal load [N m]."""
    return max(
        float(np.abs(plant.torque).max()) for plant in plants.values() if nominal(robot, plant)
    )


def nominal(robot: Robot, plant: StandingPlant) -> bool:
    """Returns whether the feet of a plant carry about the robot's own weight."""
    return bool(NOMINAL[0] <= plant.load(robot).mean() <= NOMINAL[1])


class MarginFinder:
    """Computes margins by python-control, for those loops that a quick estimate finds worst."""

    def __init__(self, robot: Robot, plants: Plants, *, period: float, of: FindLoci) -> None:
        """of: the function that computes the loci of one plant; period [s]."""
        self._omega = frequencies(period, JUDGED, slowest=SLOWEST / size_of(robot).time)
        self._loci = cache(lambda name: of(robot, plants[name], self._omega))

    def worst(self, loci: Loci, which: int, laws: Laws) -> LoopMargins:
        """Returns the least margins of the tangential (which = 0) or the vertical (1) loops.

        loci: those of the search.
        """
        law, fine = laws.responses(loci.omega)[which], laws.responses(self._omega)[which]
        found = [quick_margins(locus * law, loci.omega) for locus in loci.values]
        # one loop is often the worst by several criteria, and its margins take long
        chosen = {
            self._worst_loop(loci.names[_least(found, criterion)], which, fine, criterion)
            for criterion in CRITERIA
        }
        computed = [
            loop_margins(self._loci(name)[which][number] * fine, self._omega)
            for name, number in sorted(chosen)
        ]
        least = {
            criterion: min(getattr(margins, criterion) for margins in computed)
            for criterion in CRITERIA
        }
        return LoopMargins(**least, crossover=max(margins.crossover for margins in computed))

    def _worst_loop(self, name: str, which: int, law: Response, criterion: str) -> tuple[str, int]:
        """Returns a plant's name and the number of its loop that is worst by a criterion."""
        loops = self._loci(name)[which] * law
        return name, _least([quick_margins(loop, self._omega) for loop in loops], criterion)


def _least(found: Sequence[LoopMargins], criterion: str) -> int:
    return int(np.argmin([getattr(margins, criterion) for margins in found]))
