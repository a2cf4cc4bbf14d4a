"""Reads studies from TOML files and checks every key and factor before the first run.

README.md documents the keys.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from hexapod_cosim.cosim.scenario.controls import Control, control_beside, parse_controls
from hexapod_cosim.cosim.scenario.reading import scenario_from_table
from hexapod_cosim.cosim.scenario.records import COMPARED
from hexapod_cosim.cosim.scenario.tables import read_tables, with_values
from hexapod_cosim.cosim.scenario.variation import STANDARD
from hexapod_cosim.extensions.study import rules
from hexapod_cosim.extensions.study.checks import (
    check_scenario,
    check_settable,
    check_study,
    placed,
)
from hexapod_cosim.extensions.study.extension import list_studies
from hexapod_cosim.extensions.study.factors import read_factors, read_optimise
from hexapod_cosim.extensions.study.records import (
    DESIGNS,
    DRAWN,
    GRID,
    SCENARIO_FACTOR,
    Case,
    Study,
    StudyError,
)
from hexapod_cosim.extensions.study.rules import Rules, read_table, require
from hexapod_cosim.models import HexapodError
from hexapod_cosim.models.errors import refuse_path
from hexapod_cosim.models.files import parse_toml, path_of, read_text, reading_toml
from hexapod_cosim.models.schema import Choice, Flag, Text, Whole, expect_table

OF_A_SWEEP = ("factors", "design", "points", "seeds", "controls")  # not of an optimisation


def load_study(path_or_name: str | Path, *, controls: Sequence[str] = ()) -> Study:
    """Reads a study file, or a bundled one by name.

    `controls`: texts of controls that replace the file's; relative paths in them start from the
    current folder. Raises StudyError, and ScenarioError for its scenarios.
    """
    refuse_path(path_or_name, "the study", StudyError)
    bundled = list_studies()
    path = path_of(path_or_name, "study", bundled, StudyError)
    with reading_toml(path, kind="study", name="the study", names=list_studies, error=StudyError):
        table = parse_toml(read_text(path))
    where = path.name if path in bundled.values() else str(path)
    what, fix = "an empty study", 'write one, for example scenario = "walk_flat"'
    require(bool(table), None, "at least one key", where, what=what, fix=fix)
    return study_from_table(table, where=where, folder=path.parent, controls=controls)


def study_from_table(
    table: Mapping[str, Any],
    *,
    where: str,
    folder: Path = Path(),
    controls: Sequence[str] = (),
    scenarios: Mapping[str, Mapping[str, Any]] | None = None,
) -> Study:
    """Makes a checked study from the tables of its file. Raises StudyError.

    Args:
        where: name of the file, for messages.
        folder: folder of the file, which paths of scenario files are relative to.
        controls: texts that replace the controls of the file.
        scenarios: the scenarios by name, when no file shall be read and nothing be checked again.
    """
    what, fix = "not a key of an optimisation", "leave it out: [optimise] says what is run"
    for key in OF_A_SWEEP if "optimise" in table else ():
        require(key not in table, key, "[optimise] alone", where, what=what, fix=fix)
    read = read_table(table, STUDY, where)
    optimise, factors = read["optimise"] or (None, read["factors"])
    laws = _controls(read, folder, controls, where)
    if optimise is not None:
        what, fix = "an optimisation has one control", "run it for each, into folders of their own"
        require(len(laws) == 1, len(laws), "one --control", where, what=what, fix=fix)
        optimise = replace(optimise, control=laws[0].label)
        table = {**table, "optimise": {**table["optimise"], "control": laws[0].text}}
    else:
        table = {**table, "controls": [law.text for law in laws]}
    study = Study(
        title=read["title"] or Path(where).stem,
        cases={},
        factors=factors,
        design=read["design"],
        points=read["points"] or 1,
        seeds=read["seeds"],
        laws=laws,
        seed=read["seed"],
        optimise=optimise,
        source=dict(table),
        where=where,
    )
    _check_points(read["points"], study)
    if scenarios is not None:
        cases = {name: Case(name=name, table=one, where=where) for name, one in scenarios.items()}
        return replace(study, cases=cases)
    study = replace(study, cases=_cases(study, folder))
    check_study(study)
    return study


def _controls(
    read: Mapping[str, Any], folder: Path, given: Sequence[str], where: str
) -> tuple[Control, ...]:
    """Returns the given controls, or else those of a study's file. Raises ScenarioError."""
    if given:
        return parse_controls(given, where="--control")
    texts = [read["optimise"][0].control] if read["optimise"] else read["controls"]
    place = f"{where}: {'optimise.control' if read['optimise'] else 'controls'}"
    return parse_controls([control_beside(text, folder) for text in texts], where=place)


def _check_points(points: int | None, study: Study) -> None:
    """Checks that drawn designs have a number of points, and only they."""
    drawn, place = study.design in DRAWN, f"{study.where}: points"
    expected = f"a number of points for the designs {', '.join(DRAWN)} alone"
    fix = "write points = 100" if drawn else "leave it out"
    require((points is not None) == drawn, points, expected, place, fix=fix)


def _scenario(value: Any, where: str) -> Any:
    named = isinstance(value, str | Mapping)
    require(named, value, "a scenario's name or table", where)
    return value


STUDY: Rules = {
    "title": (Text().read, ""),
    "scenario": (_scenario, "walk_flat"),
    "set": (expect_table, {}),
    "seed": (Whole().read, 0),
    "variation": (Flag().read, None),
    "optimise": (read_optimise, None),
    "factors": (read_factors, ()),
    "design": (Choice(DESIGNS).read, GRID),
    "points": (rules.count, None),
    "seeds": (rules.seeds, range(1)),
    "controls": (rules.texts, list(COMPARED)),
}


def _cases(study: Study, folder: Path) -> dict[str, Case]:
    """Returns the scenarios of a study by name.

    They are the study's own one, those of the factor `scenario` and those of an optimisation.
    """
    own, asked = study.source.get("scenario", "walk_flat"), study.optimise
    inline = {study.title: dict(own)} if isinstance(own, Mapping) else {}
    varied = [factor.values for factor in study.factors if factor.name == SCENARIO_FACTOR]
    names = [*(inline or [own]), *(str(value) for values in varied for value in values)]
    names += [*asked.training.cases, *asked.held_out.cases] if asked is not None else []
    return {name: _case(name, inline.get(name), study, folder) for name in dict.fromkeys(names)}


def _case(name: str, table: dict[str, Any] | None, study: Study, folder: Path) -> Case:
    """Makes a case from its tables, or those of a file beside the study or of a bundled scenario.

    Raises StudyError.
    """
    changes, beside = _changes(study), folder / name
    try:
        if table is None:
            table, place = read_tables(beside if os.path.isfile(beside) else name)
        else:
            place = "scenario"
        table = with_values(table, changes)
        scenario = scenario_from_table(table, where=place, given=changes, option="[set] ")
        check_scenario(scenario)
    except HexapodError as error:
        raise placed(error, f"{study.where}: {error.where or name}") from error
    several = len(study.seeds) > 1 or study.optimise is not None
    if study.source.get("variation", several) and "variation" not in table:
        table["variation"] = asdict(STANDARD)
    table["outputs"] = {"plots": False}  # a study keeps no recordings
    return Case(name=name, table=table, where=place)


def _changes(study: Study) -> dict[str, Any]:
    """Returns the settings of [set] by name.

    A setting that is a factor as well is refused. For a variable of an optimiser it is allowed: it
    is the value before the optimisation.
    """
    changes: dict[str, Any] = {}
    varied = [] if study.optimise else [factor.name for factor in study.factors]
    what, fix = "set and varied", "take one of them away: the factor would replace it"
    for name, value, place in rules.named_once(study.source.get("set", {}), f"{study.where}: set"):
        check_settable(name, place)
        expected = "each name in [set] or [factors]"
        require(name not in varied, name, expected, place, what=what, fix=fix)
        changes[name] = value
    return changes
