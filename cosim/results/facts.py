"""The facts of a run: what run.json holds besides recording and metrics."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any

from hexapod_cosim.cosim.common.files import why_unreadable
from hexapod_cosim.cosim.master.loop import COMPLETED, Outcome
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.models import HexapodError
from hexapod_cosim.models.ground.surface import Surface

MAIN = ("slip_per_metre", "peak_force", "path_error", "cost_of_transport")  # of a repr

OF_FMU = "controller FMU"  # a stance that is read from such an FMU
OWN_CONTROLLER = "own controller"  # of the user, which plans a walk that is not known here
LEAST_LENGTH = 5e-4  # m    a smaller change of the stance is not named


@dataclass(frozen=True, kw_only=True)
class RobotIdentity:
    """The robot of a run."""

    name: str
    hash: str  # of all its numbers


@dataclass(frozen=True, kw_only=True)
class FmuIdentity:
    """The plant FMU of a run."""

    file: str  # name without folder
    guid: str
    sha256: str


@dataclass(frozen=True, kw_only=True)
class Locomotion:
    """How a robot got ahead in the judged window; NaN where it has none."""

    distance: float  # m    walked
    mean_speed: float  # m/s
    upright: bool  # in the whole run
    # share of time in which the controller fell back to kinematic control; None: not reported
    fallback: float | None = None
    missed: str = ""  # how it missed the end of its commanded path; "" when it arrived


PYTHON, COMPILED = ENGINES = ("python", "compiled")  # loop and controller of a run


@dataclass(frozen=True, kw_only=True)
class RunFacts:
    """The content of run.json."""

    status: str  # of cosim/master/loop.py
    reason: str  # a sentence; "" when completed
    title: str
    control: str  # label
    engine: str  # of ENGINES
    simulated: float  # s
    wall: float  # s
    realtime_factor: float  # simulated over wall time
    finished: str  # date and time, ISO 8601
    robot: RobotIdentity
    gait_period: float  # s
    fmu: FmuIdentity
    versions: Mapping[str, str]  # of the software, by package
    platform: str  # system and processor
    controller: Mapping[str, Any]  # kind, text, SHA-256 and parameters of the control
    warnings: tuple[str, ...]
    events: tuple[Mapping[str, Any], ...]  # time [s] and text of those that the run reached
    gains: Mapping[str, Any] | None  # None: kinematic control
    walk: Locomotion
    drawn: Mapping[str, Any] | None  # small changes of the seed; None: nothing is varied
    walking: GaitChoice
    terrain: Mapping[str, Any]  # keys of [terrain] that made the surface; empty for a plane
    parameters: Mapping[str, float]  # of the FMU during the run
    command: str = ""  # that repeats the run

    def as_table(self) -> dict[str, Any]:
        """Returns the content of run.json, which `facts_from_table` reads."""
        return {"kind": "simulate", **asdict(self)}


def facts_from_table(table: Mapping[str, Any], *, where: str) -> RunFacts:
    """Reads the content of run.json. Raises HexapodError when facts are missing or damaged."""
    try:
        given = {item.name: table[item.name] for item in fields(RunFacts) if item.name in table}
        walk = table["walk"]
        known = {name: _number(walk[name]) for name in ("distance", "mean_speed")}
        records = {
            "robot": RobotIdentity(**table["robot"]),
            "fmu": FmuIdentity(**table["fmu"]),
            "warnings": tuple(table["warnings"]),
            "events": tuple(table["events"]),
            "walk": Locomotion(**{**walk, **known}),
            "walking": GaitChoice(**table["walking"]),
        }
        return RunFacts(**{**given, **records})
    except (KeyError, TypeError) as error:
        raise HexapodError(
            "damaged or foreign results",
            got=why_unreadable(error, "description of a run"),
            expected="all facts of a run",
            fix="run the scenario again",
            where=where,
        ) from error


def _number(value: float | None) -> float:
    """Returns a number of a JSON file, where null stands for NaN."""
    return math.nan if value is None else float(value)


@dataclass(frozen=True, kw_only=True)
class Result:
    """A run's scenario, outcome, metrics and facts."""

    scenario: Scenario
    outcome: Outcome
    metrics: Mapping[str, float]
    facts: RunFacts
    surface: Surface | None = None  # that the FMU read from its resources; None: a plane

    def __repr__(self) -> str:
        """Returns title, control, status, simulated time and the main metrics that there are."""
        outcome = self.outcome
        found = {name: self.metrics.get(name, math.nan) for name in MAIN}
        figures = [f"{name}={value:.4g}" for name, value in found.items() if math.isfinite(value)]
        parts = [
            f"{self.scenario.title!r}",
            f"control={self.facts.control!r}",
            f"status={outcome.status!r}",
            f"simulated={outcome.simulated:.4g}",
            *figures,
        ]
        return f"Result({', '.join(parts)})"

    @property
    def recording(self) -> Recording:
        """The recorded rows: time, the plant's outputs and inputs, commands."""
        return self.outcome.recording

    @property
    def parameters(self) -> Mapping[str, float]:
        """The FMU's parameters during the run."""
        return self.facts.parameters

    @property
    def completed(self) -> bool:
        """Whether the run reached its end."""
        return self.outcome.status == COMPLETED


@dataclass(frozen=True, kw_only=True)
class GaitChoice:
    """Gait and stance of a run."""

    gait: str
    period: float  # s
    duty: float  # 1
    stance: str  # its name, or OF_FMU
    outward: float  # m    by which the feet stand further out from the hips than the robot's
    deeper: float  # m    and deeper below them
    narrowing: float  # m    by which the feet are set nearer together at speed
    chosen_by: str  # scenario, control, robot file or OWN_CONTROLLER

    @property
    def brief(self) -> str:
        """Gait and stance; of an own controller, the cycle that figures are taken over."""
        if self.chosen_by == OWN_CONTROLLER:
            return f"{OWN_CONTROLLER}, figures over cycles of {self.period:.3g} s"
        return f"{self.gait}, period {self.period:.3g} s, {self._feet()}"

    @property
    def text(self) -> str:
        """Gait and stance, and whose choice they were."""
        by = "" if self.chosen_by == OWN_CONTROLLER else f", chosen by the {self.chosen_by}"
        return f"{self.brief}{by}"

    def _feet(self) -> str:
        """Returns the stance against the robot file's, or that it is a controller FMU's."""
        if self.stance == OF_FMU:
            return f"the stance of the {OF_FMU}"
        changes = (
            (self.outward, "further out from the hips", "nearer to the hips"),
            (self.deeper, "deeper below them", "less deep below them"),
        )
        parts = [
            f"{1e3 * abs(length):.0f} mm {more if length > 0.0 else less}"
            for length, more, less in changes
            if abs(length) > LEAST_LENGTH
        ]
        return f"feet {' and '.join(parts)}" if parts else "the robot file's stance"


def gait_differences(choices: Mapping[str, GaitChoice]) -> list[str]:
    """Returns a sentence for each gait and stance, with its controls, if there are several.

    choices: by the labels of the controls.
    """
    groups: dict[str, list[str]] = {}
    for label, choice in choices.items():
        groups.setdefault(choice.brief, []).append(label)
    if len(groups) < 2:
        return []
    return [f"{', '.join(labels)}: {choices[labels[0]].text}" for labels in groups.values()]
