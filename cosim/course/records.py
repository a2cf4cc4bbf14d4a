"""The records of the course: cases, and the quantities by which controls are judged."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from hexapod_cosim.cosim.results.metrics import METRICS, PER_RADIAN
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.models import HexapodError

JUDGE, TUNE = SPLITS = ("judge", "tune")


class CourseError(HexapodError):
    """A case file, or a choice of cases, that is not valid."""


@dataclass(frozen=True)
class Case:
    """One case of the course in one split."""

    name: str
    kind: str  # the class: the name of the case's file
    about: str
    split: str
    scenario: Scenario
    sweep: str = ""  # name of the sweep over heights that it belongs to, "": none
    height: float = math.nan  # m    nominal height of the sweep


@dataclass(frozen=True)
class Course:
    """The cases of a split, and how they are run."""

    version: int
    split: str
    cases: tuple[Case, ...]
    seeds: tuple[int, ...]
    arrive: float  # largest path error, or yaw drift of turns on the spot, of a success
    hash: str  # SHA-256 of all case files of both splits


@dataclass(frozen=True)
class Quantity:
    """A figure of a run by which controls are judged; less of it is better."""

    name: str
    title: str
    short: str  # title of a narrow column
    metric: str  # whose floor and unit it has
    shown: bool = True  # in tables and in the picture

    @property
    def unit(self) -> str:
        """The unit of the metric."""
        return METRICS[self.metric][0]

    def value(self, metrics: Mapping[str, float]) -> float:
        """Returns the value of a run; per radian where the robot turns on the spot."""
        if self.name == "tilt":
            return math.hypot(metrics["roll_rms"], metrics["pitch_rms"])
        value = metrics[self.metric]
        radian = PER_RADIAN.get(self.metric)
        return metrics[radian] if radian is not None and math.isnan(value) else value


QUANTITIES = (
    Quantity("slip", "slip", "slip", "slip_per_metre"),
    Quantity("slip_net", "net slip", "net slip", "slip_net_per_metre", shown=False),
    Quantity("peak", "peak force", "peak", "peak_force"),
    Quantity("loading", "loading rate", "loading", "loading_rate"),
    Quantity("tilt", "tilt", "tilt", "roll_rms"),
    Quantity("roll", "roll", "roll", "roll_rms", shown=False),
    Quantity("path", "path error", "path", "path_error"),
    Quantity("work", "mechanical energy", "mech.", "cost_of_transport"),
    Quantity("electrical", "electrical energy", "electr.", "electrical_cost"),
    Quantity("torque", "joint torque", "torque", "torque_rms", shown=False),
    Quantity("heat", "heat", "heat", "heat"),
    Quantity("load", "hottest servo", "servo", "servo_load_max"),
)
SHOWN = tuple(quantity for quantity in QUANTITIES if quantity.shown)
BY_NAME = {quantity.name: quantity for quantity in QUANTITIES}
