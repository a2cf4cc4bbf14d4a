"""Engines that make figures of nothing but the scenario, at once: for tests of what lies around
them. A module that workers import.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import numpy as np

from hexapod_cosim.controller import Gains
from hexapod_cosim.cosim.master.loop import COMPLETED, INTERRUPTED, Progress
from hexapod_cosim.cosim.results.metrics import METRICS
from hexapod_cosim.cosim.results.summary import NO_FIGURES, REFUSED, Summary
from hexapod_cosim.cosim.scenario.records import Scenario

DEADLY, REFUSING, FALLING, SLOW = (
    0.13,
    0.17,
    0.19,
    0.02,
)  # friction.mu that ends the process, is refused, falls; s a run takes

DEATHS_FILE = "HEXAPOD_TEST_DEATHS"


def figure(seed: int, mu: float, control: str, place: int) -> float:
    """A metric: something that every setting shows in."""
    return (place + 1) * (1.0 + 0.1 * seed + mu * mu) * (0.5 if control == "compliant" else 1.0)


def die(who: str) -> None:
    """Ends the process; where DEATHS_FILE names a file, a line of it says who did."""
    if DEATHS_FILE in os.environ:
        with Path(os.environ[DEATHS_FILE]).open("a") as file:
            file.write(f"{who}\n")
    os._exit(9)


class Fake:
    """Figures at once."""

    pause = 0.0  # s

    def __init__(self, fmu: Path, controller: Path) -> None:
        assert fmu.is_file()
        assert controller.is_file()

    def summary(self, scenario: Scenario, *, gains: Gains | None, progress: Progress) -> Summary:
        """As Engine says."""
        mu, control, seed = scenario.settings["friction"]["mu"], scenario.control, scenario.seed
        if mu == DEADLY:
            die(f"{control} {seed}")
        if mu == REFUSING:
            return Summary(
                control=control,
                seed=seed,
                status=REFUSED,
                reason=f"no walk with {seed}",
                metrics=NO_FIGURES,
            )
        time.sleep(self.pause)
        try:
            progress(0.0)
        except KeyboardInterrupt:
            return Summary(control=control, seed=seed, status=INTERRUPTED, metrics=NO_FIGURES)
        kp = 1.0 if gains is None else gains.slip.kp
        metrics = {
            name: figure(seed, mu, control, place) * kp for place, name in enumerate(METRICS)
        }
        return Summary(
            control=control, seed=seed, status=COMPLETED, upright=mu != FALLING, metrics=metrics
        )

    def close(self) -> None:
        """Nothing to free."""


class Brief(Fake):
    """Too short for figures in the ripple gait."""

    def summary(self, scenario: Scenario, *, gains: Gains | None, progress: Progress) -> Summary:
        """As Engine says."""
        found = super().summary(scenario, gains=gains, progress=progress)
        return (
            replace(found, metrics=NO_FIGURES)
            if scenario.settings["gait"]["name"] == "ripple"
            else found
        )


class SourError(Exception):
    """What cannot be sent to another process."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self.cause = lambda: text


MISTAKES: dict[float, Callable[[], object]] = {
    0.21: lambda: np.linalg.inv(np.zeros((2, 2))),
    0.22: lambda: np.zeros(2) + np.zeros(3),
    0.23: lambda: _raise(MemoryError("no more")),
    0.24: lambda: _raise(SourError(f"nobody can send {object()}")),
    0.25: lambda: sys.exit("enough"),
    0.26: lambda: _raise(BadTextError()),
}


class BadTextError(Exception):
    """What cannot even say what it is."""

    def __str__(self) -> str:
        raise RuntimeError


def _raise(error: Exception) -> None:
    raise error


class Buggy(Fake):
    """Makes mistakes; each time it is used once after one it says so, which it must not be."""

    broken = False

    def summary(self, scenario: Scenario, *, gains: Gains | None, progress: Progress) -> Summary:
        """As Engine says, but for the mistakes."""
        assert not self.broken
        mu = scenario.settings["friction"]["mu"]
        if mu == 0.27:
            return "walked"  # type: ignore[return-value]
        self.broken = mu in MISTAKES
        MISTAKES.get(mu, lambda: None)()
        return super().summary(scenario, gains=gains, progress=progress)


class Counting(Fake):
    """Keeps in this process what it was asked."""

    asked: ClassVar[list[tuple[str, int]]] = []

    def summary(self, scenario: Scenario, *, gains: Gains | None, progress: Progress) -> Summary:
        """As Engine says."""
        self.asked.append((scenario.control, scenario.seed))
        return super().summary(scenario, gains=gains, progress=progress)


class Slow(Fake):
    """The same, and time to be killed in."""

    pause = SLOW
