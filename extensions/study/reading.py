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
from hexapod_cosim.models import HexapodError, unknown_name
from hexapod_cosim.models.errors import refuse_path
from hexapod_cosim.models.files import read_text
from hexapod_cosim.models.schema import parse_toml, reading_toml

OF_A_SWEEP = ("factors", "design", "points", "seeds", "controls")  # not of an optimisation


def load_study(path_or_name: str | Path, *, controls: Sequence[str] = ()) -> Study:
    """Reads a study file, or a bundled one by name.

    `controls`: texts of controls that replace the file's; relative paths in them start from the
    current folder. Raises StudyError, and ScenarioError for its scenarios.
    """
    refuse_path(path_or_name, "the study", StudyError)
    path, bundled = Path(path_or_name), list_studies()
    if not path.suffix and len(path.parts) == 1 and not path.is_file():
        if str(path_or_name) not in bundled:
            raise unknown_name("study", str(path_or_name), bundled, error=StudyError)
        path = bundled[str(path_or_name)]
    with reading_toml(path, kind="study", name="the study", names=list_studies, error=StudyError):
        table = parse_toml(read_text(path))
    if controls:
        table = _with_controls(table, controls)
    where = path.name if path in bundled.values() else str(path)
    return study_from_table(table, where=where, folder=path.parent)


def _with_controls(table: dict[str, Any], texts: Sequence[str]) -> dict[str, Any]:
    """Returns a study's tables with other controls. Raises StudyError."""
    full = [control.text for control in parse_controls(texts, where="--control")]
    if not isinstance(table.get("optimise"), dict):
        return {**table, "controls": full}
    fix = "run the optimisation for each control, into folders of their own"
    what = "an optimisation has one control"
    require(len(full) == 1, len(full), "one --control", "--control", what=what, fix=fix)
    return {**table, "optimise": {**table["optimise"], "control": full[0]}}


def study_from_table(
    table: Mapping[str, Any],
    *,
    where: str,
    folder: Path = Path(),
    scenarios: Mapping[str, Mapping[str, Any]] | None = None,
) -> Study:
    """Makes a checked study from the tables of its file. Raises StudyError.

    Args:
        where: name of the file, for messages.
        folder: folder of the file, which paths of scenario files are relative to.
        scenarios: the scenarios by name, when no file shall be read and nothing be checked again.
    """
    what, fix = "not a key of an optimisation", "leave it out: [optimise] says what is run"
    for key in OF_A_SWEEP if "optimise" in table else ():
        require(key not in table, key, "[optimise] alone", where, what=what, fix=fix)
    read = read_table(table, STUDY, where)
    optimise, factors = read["optimise"] or (None, read["factors"])
    controls = _controls(read, folder, where)
    if optimise is not None:
        optimise = replace(optimise, control=controls[0].label)
    study = Study(
        title=read["title"] or Path(where).stem,
        cases={},
        factors=factors,
        design=read["design"],
        points=read["points"] or 1,
        seeds=read["seeds"],
        laws=controls,
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


def _controls(read: Mapping[str, Any], folder: Path, where: str) -> tuple[Control, ...]:
    """Returns the controls of a study's file. Raises ScenarioError."""
    texts, place = read["controls"], f"{where}: controls"
    if read["optimise"]:
        texts, place = [read["optimise"][0].control], f"{where}: optimise.control"
    return parse_controls([control_beside(text, folder) for text in texts], where=place)


def _check_points(points: int | None, study: Study) -> None:
    """Checks that drawn designs have a number of points, and only they."""
    drawn, place = study.design in DRAWN, f"{study.where}: points"
    expected = f"a number of points for the designs {', '.join(DRAWN)} alone"
    fix = "write points = 100" if drawn else "leave it out"
    require((points is not None) == drawn, points, expected, place, fix=fix)


STUDY: Rules = {
    "title": (rules.text, ""),
    "scenario": (
        rules.simple(lambda value: isinstance(value, str | Mapping), "a scenario's name or table"),
        "walk_flat",
    ),
    "set": (rules.table, {}),
    "seed": (rules.whole(0, 2**32 - 1), 0),  # that all random number generators accept
    "variation": (rules.boolean, None),
    "optimise": (read_optimise, None),
    "factors": (read_factors, ()),
    "design": (rules.name_of(DESIGNS), GRID),
    "points": (rules.whole(1, 10**7), None),
    "seeds": (rules.seeds(10**7), range(1)),
    "controls": (rules.texts('controls = ["kinematic", "law.py:Class"]'), list(COMPARED)),
}


def _cases(study: Study, folder: Path) -> dict[str, Case]:
    """Returns the scenarios of a study by name.

    They are the study's own one, those of the factor `scenario` and those of an optimisation.
    """
    source, where, asked = study.source, study.where, study.optimise
    own = source.get("scenario", "walk_flat")
    changes = _changes(study)
    vary = source.get("variation", len(study.seeds) > 1 or asked is not None)
    found = {}
    if isinstance(own, Mapping):
        place = f"{where}: scenario"
        found[study.title] = _case(study.title, dict(own), place, changes, where, vary=vary)
    places = {} if found else {own: f"{where}: scenario"}
    for factor in study.factors:
        if factor.name == SCENARIO_FACTOR:
            places |= dict.fromkeys(map(str, factor.values), f"{where}: factors.scenario")
    if asked is not None:
        places |= dict.fromkeys(asked.training.cases, f"{where}: optimise.training.scenarios")
        places |= dict.fromkeys(asked.held_out.cases, f"{where}: optimise.held_out.scenarios")
    for name, place in places.items():
        what, fix = "two scenarios of one name", "give the study another title"
        require(name not in found, name, "different names", place, what=what, fix=fix)
        table, file = _read(folder / name, name, place)
        found[name] = _case(name, table, file, changes, where, vary=vary)
    return found


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


def _case(
    name: str,
    table: dict[str, Any],
    place: str,
    changes: Mapping[str, Any],
    where: str,
    *,
    vary: bool,
) -> Case:
    """Makes a case. Raises ScenarioError for its scenario, StudyError for a change.

    Args:
        table: the tables of the scenario.
        place: where they come from.
        changes: the settings of [set] by name.
        vary: whether the standard variation is added.
    """
    scenario = scenario_from_table(table, where=place)
    check_scenario(scenario, names=list(scenario.parameters))
    try:
        table = with_values(table, changes)
        scenario = scenario_from_table(table, where=place, given=list(changes))
        check_scenario(scenario, names=list(changes))
    except HexapodError as error:
        raise placed(error, f"{where}: set") from error
    if vary and "variation" not in table:
        table["variation"] = asdict(STANDARD)
    table["outputs"] = {"plots": False}  # a study keeps no recordings
    return Case(name=name, table=table, where=place)


def _read(beside: Path, name: str, where: str) -> tuple[dict[str, Any], str]:
    """Reads a scenario's tables and its place, from a file beside the study if there is one.

    Raises HexapodError; for an unknown name it cites the place in the study file.
    """
    try:
        return read_tables(beside if os.path.isfile(beside) else name)
    except HexapodError as error:
        if error.where:
            raise
        raise placed(error, where) from error
