"""The facts of a run: what run.json holds besides recording and metrics."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any

from hexapod_cosim.cosim.results.drop import Bounce, Drop
from hexapod_cosim.cosim.results.gait_choice import GaitChoice
from hexapod_cosim.models import HexapodError


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


@dataclass(frozen=True, kw_only=True)
class RunFacts:
    """The content of run.json."""

    status: str  # of cosim/master/loop.py
    reason: str  # a sentence; "" when completed
    title: str
    control: str  # label
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
    drop: Drop | None  # None: the run is no drop
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
            "drop": _drop(table["drop"]),
            "walking": GaitChoice(**table["walking"]),
        }
        return RunFacts(**{**given, **records})
    except (KeyError, TypeError) as error:
        raise HexapodError(
            "damaged or foreign results",
            got=f"{type(error).__name__}: {error}",
            expected="all facts of a run",
            fix="run the scenario again",
            where=where,
        ) from error


def _drop(table: Mapping[str, Any] | None) -> Drop | None:
    """Returns the drop of a table; None for None."""
    if table is None:
        return None
    bounces = tuple(Bounce(**bounce) for bounce in table["bounces"])
    return Drop(table["asked"], table["of_the_law"], bounces)


def _number(value: float | None) -> float:
    """Returns a number of a JSON file, where null stands for NaN."""
    return math.nan if value is None else float(value)
