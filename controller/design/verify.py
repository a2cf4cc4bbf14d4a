"""Verifies a design in discrete time with python-control: its margins against the requirements."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache

import numpy as np

from hexapod_cosim.controller.design.closed import closed_loop, spectral_radius
from hexapod_cosim.controller.design.laws import Laws
from hexapod_cosim.controller.design.loci import (
    SLOWEST,
    FindLoci,
    Loci,
    LoopMargins,
    Plants,
    Response,
    eigenloci,
    frequencies,
    loop_margins,
    quick_margins,
)
from hexapod_cosim.controller.design.standing import StandingPlant
from hexapod_cosim.controller.gains import GainsError, Margins, Requirements
from hexapod_cosim.controller.size import requirements_for, size_of
from hexapod_cosim.models import Robot

JUDGED = 400  # frequencies
STEADY = 1e-2  # rad/s    slow against every creep; scaled by the robot's size
NOMINAL = (0.8, 1.25)  # 1    range of mean loads for which the steady slip is computed
CRITERIA = ("gain", "phase", "delay")


def verify(
    robot: Robot,
    plants: Plants,
    finder: MarginFinder,
    vertical: Loci,
    laws: Laws,
    needs: Requirements,
    *,
    slip: LoopMargins,
    binding: str,
) -> tuple[Margins, tuple[str, ...]]:
    """Returns the margins of the worst loops, and texts on default requirements that are not met.

    slip: margins of the tangential loops; vertical: loci of the search. Raises GainsError for an
    unstable loop, for missed margins, and for a missed bandwidth or slip rejection that differs
    from the default for the robot's size.
    """
    suspension = finder.worst(vertical, 1, laws)
    margins = Margins(
        slip_crossover=slip.crossover,
        slip_phase_margin=slip.phase,
        slip_gain_margin=slip.gain,
        slip_delay_margin=slip.delay,
        slip_rejection=steady_slip(robot, plants, laws),
        suspension_phase_margin=suspension.phase,
        suspension_gain_margin=suspension.gain,
        support_torque=support_torque(robot, plants),
        spectral_radius=_slowest(robot, plants, laws),
        binding=binding,
    )
    for what, reached, asked in (
        ("phase_margin of the tangential loop", slip.phase, needs.phase_margin),
        ("gain_margin of the tangential loop", slip.gain, needs.gain_margin),
        ("phase_margin of the suspension", suspension.phase, needs.phase_margin),
        ("gain_margin of the suspension", suspension.gain, needs.gain_margin),
    ):
        if not reached >= asked:
            raise _missed(robot, what, got=round(reached, 2), expected=f"at least {asked:g}")
    return margins, tuple(_shortfalls(robot, margins, needs))


def _shortfalls(robot: Robot, margins: Margins, needs: Requirements) -> Iterator[str]:
    """Yields texts on default requirements that the slip PID does not meet.

    A robot walks without the PID, so only requirements that a user has set raise GainsError. Legs
    whose feet creep as fast as the PID responds have no crossover and little rejection.
    """
    usual = requirements_for(robot)
    for name, reached, asked, met in (
        (
            "bandwidth",
            margins.slip_crossover,
            needs.bandwidth,
            margins.slip_crossover >= needs.bandwidth,
        ),
        (
            "slip_rejection",
            margins.slip_rejection,
            needs.slip_rejection,
            margins.slip_rejection <= needs.slip_rejection,
        ),
    ):
        least = "at least" if name == "bandwidth" else "at most"
        if not met and asked != getattr(usual, name):
            raise _missed(robot, name, got=round(reached, 3), expected=f"{least} {asked:g}")
        if not met:
            known = f"the design's {name} is {reached:.3g}, {least} {asked:g} is usual"
            yield f"{known}: on these legs the law against slip does little"


def support_torque(robot: Robot, plants: Plants) -> float:
    """Returns the largest feed-forward torque of a servo in stances near the nominal load [N m]."""
    return max(
        float(np.abs(plant.torque).max()) for plant in plants.values() if nominal(robot, plant)
    )


def nominal(robot: Robot, plant: StandingPlant) -> bool:
    """Returns whether the feet of a plant carry about the robot's own weight."""
    return bool(NOMINAL[0] <= plant.load(robot).mean() <= NOMINAL[1])


def _slowest(robot: Robot, plants: Plants, laws: Laws) -> float:
    """Returns the largest spectral radius of the closed loops.

    Raises GainsError for an unstable loop.
    """
    worst = 0.0
    for name, plant in plants.items():
        radius = spectral_radius(closed_loop(robot, plant, laws), feet=int(plant.standing.sum()))
        if not radius < 1.0:
            raise _missed(
                robot,
                f"stability ({name})",
                got=f"spectral radius {radius:.6f}",
                expected="less than 1",
            )
        worst = max(worst, radius)
    return worst


def _missed(robot: Robot, what: str, *, got: object, expected: str) -> GainsError:
    fix = "shorten the period or the delays, allow less deflection, or ask for less margin"
    return GainsError(
        f"the design misses its {what}",
        got=got,
        expected=expected,
        fix=fix,
        where=f"robot {robot.name}",
    )


class MarginFinder:
    """Computes margins by python-control, for those loops that a quick estimate finds worst."""

    def __init__(
        self, robot: Robot, plants: Plants, *, period: float, of: FindLoci = eigenloci
    ) -> None:
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


def steady_slip(robot: Robot, plants: Plants, laws: Laws) -> float:
    """Returns the steady slip with the slip PID over that without it [1].

    It is the worst of all squeezes of all plants near the nominal load.
    """
    omega = np.array([STEADY / size_of(robot).time])
    law = laws.responses(omega)[0]
    worst = 0.0
    for plant in plants.values():
        if nominal(robot, plant):
            loops = (eigenloci(robot, plant, omega)[0] * law)[:, 0]
            worst = max(worst, float(np.abs(1.0 / (1.0 + loops)).max()))
    return worst
