"""Runners for tests, which compute metrics from the scenario without a simulation.

Workers import this module.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from hexapod_cosim.controller import Gains
from hexapod_cosim.cosim.master.loop import COMPLETED, INTERRUPTED, Progress
from hexapod_cosim.cosim.results.metric_table import METRICS
from hexapod_cosim.cosim.results.summary import NO_FIGURES, REFUSED, Summary
from hexapod_cosim.cosim.scenario.records import Scenario

# values of friction.mu with which the process ends, the run is refused, or the robot falls
DEADLY, REFUSING, FALLING = 0.13, 0.17, 0.19
SLOW = 0.02  # s    duration of a run of Slow

DEATHS_FILE = "HEXAPOD_TEST_DEATHS"


def figure(seed: int, mu: float, control: str, place: int) -> float:
    """Returns a metric that depends on every setting."""
    return (place + 1) * (1.0 + 0.1 * seed + mu * mu) * (0.5 if control == "compliant" else 1.0)


def die(who: str) -> None:
    """Ends the process, after a line about it to the file that DEATHS_FILE names, if any."""
    if DEATHS_FILE in os.environ:
        with Path(os.environ[DEATHS_FILE]).open("a") as file:
            file.write(f"{who}\n")
    os._exit(9)


UNTYPED: Any = object  # so that the fake stands for a Runner


class Fake(UNTYPED):  # type: ignore[misc]
    """Returns metrics without a simulation."""

    pause = 0.0  # s

    def __init__(self, *, fmu: Path | None) -> None:
        assert fmu is None or fmu.is_file()

    def summary(self, scenario: Scenario, *, gains: Gains | None, progress: Progress) -> Summary:
        """Implements Runner.summary()."""
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
        kp = 1.0 if gains is None else gains.hold.path_rate
        metrics = {
            name: figure(seed, mu, control, place) * kp for place, name in enumerate(METRICS)
        }
        metrics["energy_residual"] *= 2.0**-22  # less than what is warned of
        return Summary(
            control=control, seed=seed, status=COMPLETED, upright=mu != FALLING, metrics=metrics
        )

    def close(self) -> None:
        """Implements Runner.close(): there is nothing to free."""


class Brief(Fake):
    """Returns no metrics in the ripple gait, as for a walk that is too short."""

    def summary(self, scenario: Scenario, **options: Any) -> Summary:
        """Implements Runner.summary()."""
        found = super().summary(scenario, **options)
        return (
            replace(found, metrics=NO_FIGURES)
            if scenario.settings["gait"]["name"] == "ripple"
            else found
        )


class Leaky(Fake):
    """Returns an energy residual of 4 % under compliant control, and of 12 % for seed 1."""

    def summary(self, scenario: Scenario, **options: Any) -> Summary:
        """Implements Runner.summary()."""
        found = super().summary(scenario, **options)
        residual = {"kinematic": 0.0099}.get(found.control, 0.12 if found.seed == 1 else 0.04)
        return replace(found, metrics={**found.metrics, "energy_residual": residual})


class SourError(Exception):
    """An exception that cannot be pickled."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self.cause = lambda: text


ERRORS: dict[float, Callable[[], object]] = {
    0.21: lambda: np.linalg.inv(np.zeros((2, 2))),
    0.23: lambda: _raise(MemoryError("no more")),
    0.24: lambda: _raise(SourError(f"nobody can send {object()}")),
    0.25: lambda: sys.exit("enough"),
}


def _raise(error: Exception) -> None:
    raise error


class Buggy(Fake):
    """Raises errors; it must not be used again after one."""

    broken = False

    def summary(self, scenario: Scenario, **options: Any) -> Summary:
        """Implements Runner.summary(), except for the errors."""
        assert not self.broken
        mu = scenario.settings["friction"]["mu"]
        self.broken = mu in ERRORS
        ERRORS.get(mu, lambda: None)()
        return super().summary(scenario, **options)


class Counting(Fake):
    """Keeps a list of its runs in this process."""

    asked: ClassVar[list[tuple[str, int]]] = []

    def summary(self, scenario: Scenario, **options: Any) -> Summary:
        """Implements Runner.summary()."""
        self.asked.append((scenario.control, scenario.seed))
        return super().summary(scenario, **options)


class Slow(Fake):
    """Takes some time for each run, in which it can be killed."""

    pause = SLOW
