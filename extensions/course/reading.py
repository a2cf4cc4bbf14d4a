"""Reads the cases of the course from the TOML files of the folder `cases`."""

from __future__ import annotations

import hashlib
import tomllib
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.cosim.scenario.scenario import scenario_from_table
from hexapod_cosim.cosim.scenario.tables import with_overrides, with_values
from hexapod_cosim.extensions.course.records import SPLITS, Case, Course, CourseError, Entry
from hexapod_cosim.models import unknown_name
from hexapod_cosim.models.ground.table import CATALOGUE
from hexapod_cosim.models.schema import merged_tables

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
    "pushes",
    "commands",
    "robots",
)


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
        content = with_overrides(content, settings)
        content["title"] = f"{entry['name']}: {entry['about']}"
        yield Case(
            name=entry["name"],
            kind=kind,
            about=entry["about"],
            split=split,
            scenario=scenario_from_table(content, where=where),
            **{key: entry[key] for key in ("sweep", "height") if key in entry},
        )


def run_scenario(case: Case, *, entry: Entry, seed: int) -> Scenario:
    """Returns the scenario of a run; a random surface gets the run's seed."""
    settings = dict(case.scenario.settings)
    terrain = settings.get("terrain", {})
    if "seed" in getattr(CATALOGUE.get(terrain.get("kind", "")), "parameters", {}):
        settings["terrain"] = {**terrain, "seed": seed}
    return replace(entry.scenario(case.scenario), seed=seed, settings=settings)
