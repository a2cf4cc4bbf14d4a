"""The records of a study: factors, cases, optimisation, orders and their results."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from hexapod_cosim.cosim.results.summary import Summary
from hexapod_cosim.cosim.scenario.controls import Control
from hexapod_cosim.models import HexapodError

Value = float | int | bool | str

KINDS = ("values", "uniform", "loguniform", "normal", "integers")
VALUES, UNIFORM, LOGUNIFORM, NORMAL, INTEGERS = KINDS
DESIGNS = ("grid", "list", "random", "latin_hypercube", "sobol")
GRID, LIST, RANDOM, LATIN_HYPERCUBE, SOBOL = DESIGNS
DRAWN = (RANDOM, LATIN_HYPERCUBE, SOBOL)  # designs with a given number of points
SCENARIO_FACTOR = "scenario"
GAINS = "gains."  # prefix of factors that are gains of the compliant control
WALKED = "walked"  # the share of runs that walked to the end, as a metric


class StudyError(HexapodError):
    """A study cannot be run or continued."""


@dataclass(frozen=True, kw_only=True)
class Factor:
    """A quantity that a study varies: a setting, a gain, or the scenario.

    Settings have the names that --set accepts; gains have names like gains.hold.path_rate.
    """

    name: str
    kind: str  # VALUES, or a distribution
    values: tuple[Value, ...] = ()  # of kind VALUES
    low: float = math.nan  # of a distribution; the mean of a normal one
    high: float = math.nan  # its standard deviation
    unit: str = ""  # of the values; empty: the unit of the setting
    relative: bool = False  # whether values are multiples of the designed gain

    @property
    def label(self) -> str:
        """The name with the unit."""
        return f"{self.name} [{self.shown_unit}]" if self.shown_unit else self.name

    @property
    def shown_unit(self) -> str:
        """The unit of the values."""
        return "designed gain" if self.relative else self.unit

    def setting(self, value: Value) -> Value:
        """Returns the value as a scenario accepts it, with its unit."""
        return f"{value!r} {self.unit}" if self.unit else value


def shown_value(value: Value | None) -> str:
    """Returns the value of a factor as text."""
    return "-" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)


@dataclass(frozen=True, kw_only=True)
class Case:
    """A scenario of a study: the tables of its file with the settings of the study."""

    name: str
    table: Mapping[str, Any]
    where: str


@dataclass(frozen=True, kw_only=True)
class Evaluation:
    """The runs that settings are evaluated on: names of scenarios, and seeds."""

    cases: tuple[str, ...]
    seeds: Sequence[int]

    @property
    def runs(self) -> int:
        """Number of runs."""
        return len(self.cases) * len(self.seeds)


@dataclass(frozen=True, kw_only=True)
class Bound:
    """A constraint on the mean of a metric."""

    metric: str  # or WALKED, the share of runs that walked to the end
    at_least: float = -math.inf
    at_most: float = math.inf

    def excess(self, value: float) -> float:
        """Returns by how much a value exceeds the bounds: <= 0 within them, infinite for NaN."""
        return math.inf if math.isnan(value) else max(self.at_least - value, value - self.at_most)


@dataclass(frozen=True, kw_only=True)
class Optimise:
    """An optimisation: the objective, constraints and the runs for them."""

    metric: str
    constraints: tuple[Bound, ...]
    trials: int
    batch: int  # trials that are proposed before the result of any of them is known
    control: str
    training: Evaluation
    held_out: Evaluation

    @property
    def metrics(self) -> list[str]:
        """The metrics of the objective and the constraints, each once."""
        return list(dict.fromkeys([self.metric, *(bound.metric for bound in self.constraints)]))

    @property
    def trained(self) -> int:
        """Number of training runs, of all trials and of the unchanged settings."""
        return (self.trials + 1) * self.training.runs

    @property
    def count(self) -> int:
        """Number of all runs; the unchanged and the best settings have held-out runs."""
        return self.trained + 2 * self.held_out.runs


@dataclass(frozen=True, kw_only=True)
class Study:
    """A complete study: its cases hold the content of their files."""

    title: str
    cases: Mapping[str, Case]  # by name; without SCENARIO_FACTOR all runs use the first
    factors: tuple[Factor, ...]  # with an optimiser, its variables
    design: str
    points: int  # of a drawn design
    seeds: Sequence[int]
    laws: tuple[Control, ...]  # its controls; an optimisation has one
    seed: int  # of the design and the optimiser
    optimise: Optimise | None
    source: Mapping[str, Any]  # the tables of the file
    where: str

    @property
    def controls(self) -> tuple[str, ...]:
        """The labels of its controls."""
        return tuple(control.label for control in self.laws)

    @property
    def gains_text(self) -> str | None:
        """The text of the first control that has gains; None without one."""
        builtin = (control for control in self.laws if control.is_builtin)
        return next((one.text for one in builtin if one.name != "kinematic"), None)


@dataclass(frozen=True, kw_only=True)
class Order:
    """One run of a study."""

    run: int
    point: int
    case: str
    # of the factors, in their order; None leaves a setting as the scenario has it
    values: tuple[Value | None, ...]
    seed: int
    control: str


@dataclass(frozen=True)
class RunResult:
    """A run that has ended, with its summary."""

    order: Order
    summary: Summary
    wall: float  # s    elapsed time
