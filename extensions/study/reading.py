"""Reads studies from TOML files and checks every key and factor before the first run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from hexapod_cosim.cosim.scenario.controls import Control, control_beside, parse_controls
from hexapod_cosim.cosim.scenario.records import COMPARED
from hexapod_cosim.cosim.scenario.scenario import scenario_from_table
from hexapod_cosim.cosim.scenario.tables import read_tables, with_values
from hexapod_cosim.cosim.scenario.variation import STANDARD
from hexapod_cosim.extensions.study.bundled import list_studies
from hexapod_cosim.extensions.study.checks import (
    check_scenario,
    check_settable,
    check_study,
    placed,
)
from hexapod_cosim.extensions.study.factors import plain_name, read_factors
from hexapod_cosim.extensions.study.keys import (
    boolean_of,
    check_plain,
    flat,
    names_of,
    read_seeds,
    require,
    require_known,
    text_of,
    whole,
)
from hexapod_cosim.extensions.study.objective import read_optimise
from hexapod_cosim.extensions.study.records import (
    DESIGNS,
    DRAWN,
    GRID,
    SCENARIO_FACTOR,
    Case,
    Study,
    StudyError,
)
from hexapod_cosim.models import HexapodError, unknown_name
from hexapod_cosim.models.errors import refuse_path
from hexapod_cosim.models.files import read_text
from hexapod_cosim.models.schema import parse_toml, reading_toml

KEYS = (
    "title",
    "scenario",
    "set",
    "design",
    "points",
    "seeds",
    "controls",
    "seed",
    "variation",
    "factors",
    "optimise",
)
MAX_POINTS, MAX_SEEDS = 10**8, 10**7
MAX_SEED = 2**32 - 1  # that all random number generators accept
MAX_FILE_NAME = 255  # bytes
STANDARD_TABLE = {
    name: getattr(STANDARD, name) for name in ("attitude", "height", "joint_angle", "command_delay")
}


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
    return study_from_table(
        table, where=path.name if path in bundled.values() else str(path), folder=path.parent
    )


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
    check_plain(table, where)
    require_known(table, KEYS, where)
    factors = read_factors(table.get("factors", {}), f"{where}: factors")
    optimise = (
        read_optimise(table["optimise"], f"{where}: optimise") if "optimise" in table else None
    )
    if optimise is not None:
        fix = "leave it out: [optimise] says what is run"
        for key in ("factors", "design", "points", "seeds", "controls"):
            what = "not a key of an optimisation"
            require(key not in table, key, "[optimise] alone", where, what=what, fix=fix)
    controls = _controls(table, optimise, folder, where)
    if optimise is not None:
        optimise = replace(optimise[0], control=controls[0].label), optimise[1]
    study = Study(
        title=text_of(table, "title", Path(where).stem, where),
        cases={},
        factors=factors if optimise is None else optimise[1],
        design=names_of([table.get("design", GRID)], DESIGNS, f"{where}: design")[0],
        points=_points(table, where),
        seeds=read_seeds(table.get("seeds", 1), f"{where}: seeds", most=MAX_SEEDS),
        controls=tuple(control.label for control in controls),
        texts={control.label: control.text for control in controls},
        seed=whole(table.get("seed", 0), f"{where}: seed", least=0, most=MAX_SEED),
        optimise=None if optimise is None else optimise[0],
        source=dict(table),
        where=where,
    )
    if scenarios is not None:
        return replace(
            study,
            cases={
                name: Case(name=name, table=tables, where=where)
                for name, tables in scenarios.items()
            },
        )
    study = replace(study, cases=_cases(study, folder))
    check_study(study)
    return study


def _controls(
    table: Mapping[str, Any], optimise: object | None, folder: Path, where: str
) -> tuple[Control, ...]:
    """Returns the controls of a study's file. Raises ScenarioError, StudyError for no list."""
    texts, place = table.get("controls", list(COMPARED)), f"{where}: controls"
    if optimise is not None:
        texts = [table["optimise"].get("control", COMPARED[-1])]
        place = f"{where}: optimise.control"
    listed = isinstance(texts, list) and all(isinstance(one, str) for one in texts)
    fix = 'write controls = ["kinematic", "law.py:Class"]'
    require(listed and len(texts) > 0, texts, "a list of controls", place, fix=fix)
    return parse_controls([control_beside(text, folder) for text in texts], where=place)


def _points(table: Mapping[str, Any], where: str) -> int:
    drawn, place = table.get("design") in DRAWN, f"{where}: points"
    given = "points" in table
    fix, expected = "write points = 100", "a number of points"
    require(given or not drawn, None, expected, place, what="missing key", fix=fix)
    fix = f'leave it out, or write design = "{DRAWN[-1]}" (or {", ".join(DRAWN[:-1])})'
    what = "a number of points for a design that has its own"
    require(drawn or not given, table.get("points"), "no points", place, what=what, fix=fix)
    return whole(table.get("points", 1), place, least=1, most=MAX_POINTS)


def _cases(study: Study, folder: Path) -> dict[str, Case]:
    """Returns the scenarios of a study by name.

    They are the study's own one, those of the factor `scenario` and those of an optimisation.
    """
    source, where = study.source, study.where
    own = source.get("scenario", "walk_flat")
    changes = source.get("set", {})
    place = f"{where}: set"
    require(isinstance(changes, Mapping), changes, "a table of settings", place, fix="write [set]")
    changed = flat(changes, f"{where}: set")
    for name in changed:
        check_settable(plain_name(name), f"{where}: set.{name}", kind="setting")
        _refuse_twice(name, study)
    vary = boolean_of(
        source, "variation", len(study.seeds) > 1 or study.optimise is not None, where
    )
    keys = _scenario_keys(study)
    names = [own if isinstance(own, str) else study.title, *keys]
    tables: dict[str, Mapping[str, Any] | None] = dict.fromkeys(names)
    place = f"{where}: scenario"
    named = isinstance(own, str | Mapping)
    require(named, own, "a scenario's name, file or table", place)
    if isinstance(own, Mapping):
        what, fix = "two scenarios of one name", "give the study another title"
        once = names[0] not in names[1:]
        require(once, names[0], "different names", place, what=what, fix=fix)
        tables[names[0]] = own
    return {
        name: _case(name, inline, changed, folder, where, vary=vary, key=keys.get(name, "scenario"))
        for name, inline in tables.items()
    }


def _scenario_keys(study: Study) -> dict[str, str]:
    """Returns the keys of the study file that name scenarios beside `scenario`, by scenario."""
    keys = {
        str(value): "factors.scenario"
        for factor in study.factors
        if factor.name == SCENARIO_FACTOR
        for value in factor.values
    }
    if study.optimise is not None:
        keys |= dict.fromkeys(study.optimise.training.cases, "optimise.training.scenarios")
        keys |= dict.fromkeys(study.optimise.held_out.cases, "optimise.held_out.scenarios")
    return keys


def _refuse_twice(name: str, study: Study) -> None:
    """Raises StudyError for a setting that is a factor as well.

    For a variable of an optimiser the setting is allowed: it is the value before the optimisation.
    """
    twice = study.optimise is None and plain_name(name) in {item.name for item in study.factors}
    what, fix = "set and varied", "take one of them away: the factor would replace it"
    expected, place = "each name in [set] or [factors]", f"{study.where}: set.{name}"
    require(not twice, name, expected, place, what=what, fix=fix)


def _case(
    name: str,
    inline: Mapping[str, Any] | None,
    changes: Mapping[str, Any],
    folder: Path,
    where: str,
    *,
    vary: bool,
    key: str,
) -> Case:
    """Makes a case. Raises ScenarioError for its scenario, StudyError for a change.

    Args:
        inline: the tables of a scenario in the study file; None for one of a file.
        changes: the settings of [set] by name.
        folder: folder of the study file.
        vary: whether the standard variation is added.
        key: key of the study file that names the scenario.
    """
    table, place = (
        _read(folder / name, name, f"{where}: {key}")
        if inline is None
        else (dict(inline), f"{where}: scenario")
    )
    scenario = scenario_from_table(table, where=place)
    check_scenario(scenario, names=list(scenario.parameters))
    try:
        table = with_values(table, changes)
        check_scenario(
            scenario_from_table(table, where=place, given=list(changes)),
            names=[plain_name(name) for name in changes],
        )
    except HexapodError as error:
        raise placed(error, _place(error, where)) from error
    if vary and "variation" not in table:
        table["variation"] = dict(STANDARD_TABLE)
    table["outputs"] = {"plots": False}  # a study keeps no recordings
    return Case(name=name, table=table, where=place)


def _read(beside: Path, name: str, where: str) -> tuple[dict[str, Any], str]:
    """Reads a scenario's tables and its place, from a file beside the study if there is one.

    Raises HexapodError; for an unknown name it cites the place in the study file.
    """
    short, expected = len(beside.name.encode()) <= MAX_FILE_NAME, f"at most {MAX_FILE_NAME} bytes"
    require(short, name, expected, where, what="no file has such a name")
    try:
        return read_tables(beside if beside.is_file() else name)
    except HexapodError as error:
        if error.where:
            raise
        raise placed(error, where) from error


def _place(error: HexapodError, where: str) -> str:
    """Returns the place in [set] of an error in a scenario."""
    key = (error.where or "").rpartition(": ")[2].removeprefix("--set ")
    return f"{where}: set.{plain_name(key)}"
