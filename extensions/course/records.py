"""The cases of the course, read from the TOML files of the folder `cases`, and the quantities by
which controls are judged.
"""

from __future__ import annotations

import hashlib
import math
import tomllib
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

from hexapod_cosim.cosim.results.metric_table import METRICS, PER_RADIAN
from hexapod_cosim.cosim.scenario.controls import Control
from hexapod_cosim.cosim.scenario.reading import scenario_from_table
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.cosim.scenario.tables import read_overrides, with_values
from hexapod_cosim.models import HexapodError, unknown_name
from hexapod_cosim.models.files import merged_tables
from hexapod_cosim.models.ground.table import CATALOGUE

FOLDER = Path(__file__).parent / "cases"
COMMON = "course.toml"  # holds version, seeds and what all cases share
# the order of the classes in tables
CLASSES = (
    "flat",
    "rough",
    "stairs",
    "slope",
    "soil",
    "friction",
    "payload",
    "servos",
    "sensors",
    "late",
    "pushes",
    "loss",
    "commands",
    "fast",
    "robots",
)
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
    settings: tuple[str, ...] = ()  # NAME=VALUE, on top of every case


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


@cache
def _files() -> dict[str, bytes]:
    """Returns the content of all case files by name."""
    names = [COMMON, *(f"{kind}.toml" for kind in CLASSES)]
    return {name: (FOLDER / name).read_bytes() for name in names}


def course_hash() -> str:
    """Returns the SHA-256 of all case files."""
    digest = hashlib.sha256()
    for name, content in _files().items():
        digest.update(f"{name} {len(content)}\n".encode() + content)
    return digest.hexdigest()


def load_course(
    split: str,
    *,
    names: Collection[str] = (),
    seeds: int | None = None,
    quick: bool = False,
    settings: Sequence[str] = (),
) -> Course:
    """Returns the course of a split. Raises HexapodError.

    Args:
        split: one of SPLITS; they share no case and no seed.
        names: cases and classes to choose; by default all.
        seeds: number of runs of each case and control; by default that of the course.
        quick: whether the course's smaller number of seeds is the default.
        settings: NAME=VALUE, set in every case as by --set.
    """
    if split not in SPLITS:
        raise unknown_name("split", split, SPLITS, where="--split", error=CourseError)
    common = tomllib.loads(_files()[COMMON].decode())
    table = common["seeds"]
    count = seeds or table["quick" if quick else "count"]
    first = table[split]
    cases = tuple(
        case
        for kind in CLASSES
        for case in _cases_of(kind, split, common["scenario"], settings=settings)
    )
    return Course(
        version=common["version"],
        split=split,
        cases=_chosen(cases, names),
        seeds=tuple(range(first, first + count)),
        arrive=common["arrive"],
        hash=course_hash(),
        settings=tuple(settings),
    )


def _chosen(cases: Sequence[Case], names: Collection[str]) -> tuple[Case, ...]:
    """Returns the cases with these names or classes. Raises CourseError for an unknown name."""
    known = [*CLASSES, *(case.name for case in cases)]
    for name in names:
        if name not in known:
            raise unknown_name("case", name, known, where="--case", error=CourseError)
    return tuple(case for case in cases if not names or {case.name, case.kind} & set(names))


def _cases_of(
    kind: str, split: str, common: Mapping[str, Any], *, settings: Sequence[str]
) -> Iterator[Case]:
    """Yields the cases of a class in a split."""
    table = tomllib.loads(_files()[f"{kind}.toml"].decode())
    base = merged_tables(common, table.get("scenario", {}))
    for entry in table["case"]:
        where = f"{kind}.toml: {entry['name']}, {split}"
        content = with_values(base, {**entry.get("set", {}), **entry[split]})
        content = with_values(content, read_overrides(settings))
        content["title"] = f"{entry['name']}: {entry['about']}"
        yield Case(
            name=entry["name"],
            kind=kind,
            about=entry["about"],
            split=split,
            scenario=scenario_from_table(content, where=where),
            **{key: entry[key] for key in ("sweep", "height") if key in entry},
        )


def run_scenario(case: Case, *, control: Control, seed: int) -> Scenario:
    """Returns the scenario of a run; a random surface gets the run's seed."""
    settings = dict(case.scenario.settings)
    terrain = settings.get("terrain", {})
    if "seed" in getattr(CATALOGUE.get(terrain.get("kind", "")), "parameters", {}):
        settings["terrain"] = {**terrain, "seed": seed}
    return replace(case.scenario, control=control.text, seed=seed, settings=settings)
