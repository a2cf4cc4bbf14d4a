"""What a study says, as frozen records."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from hexapod_cosim.models import HexapodError

Value = float | int | bool | str

VALUES, UNIFORM, LOGUNIFORM, NORMAL, INTEGERS = (
    "values",
    "uniform",
    "loguniform",
    "normal",
    "integers",
)
GRID, LIST, RANDOM, LATIN_HYPERCUBE, SOBOL = DESIGNS = (
    "grid",
    "list",
    "random",
    "latin_hypercube",
    "sobol",
)
DRAWN = (RANDOM, LATIN_HYPERCUBE, SOBOL)  # designs of a number of points that the file gives
SCENARIO_FACTOR = "scenario"
GAINS = "gains."  # what begins so is a gain of the compliant control
FRONT = 8  # members of a front that are tried on the held-out runs
SAMPLERS = ("tpe", "nsga2", "random")


class StudyError(HexapodError):
    """A study that cannot be run, or cannot go on."""


@dataclass(frozen=True, kw_only=True)
class Factor:
    """What a study varies: a setting by its name as --set knows it, a gain (gains.slip.kp), or
    the scenario itself.
    """

    name: str
    kind: str  # VALUES, or a distribution
    values: tuple[Value, ...] = ()  # of kind VALUES
    low: float = math.nan  # of a distribution; the mean of a normal one
    high: float = math.nan  # its standard deviation
    unit: str = ""  # of all of these; "": the setting's own
    relative: bool = False  # to the designed gain

    def setting(self, value: Value) -> Value:
        """The value as a scenario takes it."""
        return f"{value!r} {self.unit}" if self.unit else value


@dataclass(frozen=True, kw_only=True)
class Case:
    """A scenario of a study, as the tables of its file with what the study sets."""

    name: str
    table: Mapping[str, Any]
    where: str


@dataclass(frozen=True, kw_only=True)
class Judging:
    """Scenarios, by name, and seeds that an optimiser's settings are judged on."""

    cases: tuple[str, ...]
    seeds: Sequence[int]

    @property
    def runs(self) -> int:
        """For one control."""
        return len(self.cases) * len(self.seeds)


@dataclass(frozen=True, kw_only=True)
class Bound:
    """What a mean metric has to keep to."""

    metric: str  # or WALKED, the share of runs that walked to the end
    at_least: float = -math.inf
    at_most: float = math.inf

    def excess(self, value: float) -> float:
        """How far the value is out of bounds; not above 0 within them, infinite for NaN."""
        return math.inf if math.isnan(value) else max(self.at_least - value, value - self.at_most)


@dataclass(frozen=True, kw_only=True)
class Optimise:
    """What an optimiser is asked."""

    metrics: tuple[str, ...]
    constraints: tuple[Bound, ...]
    trials: int
    batch: int  # asked at once, before any of them is known
    sampler: str
    control: str
    training: Judging
    held_out: Judging

    @property
    def chosen(self) -> int:
        """How many trials are tried on the held-out runs, at most."""
        return 1 if len(self.metrics) == 1 else FRONT

    @property
    def trained(self) -> int:
        """Training runs: those of all trials and of what they began from."""
        return (self.trials + 1) * self.training.runs

    @property
    def most(self) -> int:
        """Runs in all, at most."""
        return self.trained + (1 + self.chosen) * self.held_out.runs


@dataclass(frozen=True, kw_only=True)
class Study:
    """A study, complete: cases hold all that their files said."""

    title: str
    cases: Mapping[str, Case]  # by name; the first is the one without a factor SCENARIO_FACTOR
    factors: tuple[Factor, ...]  # the optimiser's variables, if there is one
    design: str
    points: int  # of a drawn design
    seeds: Sequence[int]
    controls: tuple[str, ...]
    seed: int  # of the design and the optimiser
    optimise: Optimise | None
    source: Mapping[str, Any]  # the tables of the file
    where: str

    @property
    def run_controls(self) -> tuple[str, ...]:
        """Those that its runs have."""
        return self.controls if self.optimise is None else (self.optimise.control,)


@dataclass(frozen=True, kw_only=True)
class Order:
    """One run of a study."""

    run: int
    point: int
    case: str
    values: tuple[
        Value | None, ...
    ]  # of the factors, in their order; None leaves a setting as it is
    seed: int
    control: str
