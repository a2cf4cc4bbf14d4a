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
from hexapod_cosim.cosim.study.plan.bundled import list_studies
from hexapod_cosim.cosim.study.plan.checks import check_scenario, check_settable, check_study
from hexapod_cosim.cosim.study.plan.factors import plain_name, read_factors
from hexapod_cosim.cosim.study.plan.keys import (
    boolean_of,
    check_plain,
    flat,
    names_of,
    read_seeds,
    text_of,
    whole,
)
from hexapod_cosim.cosim.study.plan.objective import read_optimise
from hexapod_cosim.cosim.study.plan.records import (
    DESIGNS,
    DRAWN,
    GRID,
    SCENARIO_FACTOR,
    VALUES,
    Case,
    Factor,
    Optimise,
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
    if len(full) != 1:
        raise StudyError(
            "an optimisation has one control",
            got=len(full),
            expected="one --control",
            fix="run the optimisation for each control, into folders of their own",
            where="--control",
        )
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
    for key in table:
        if key not in KEYS:
            raise unknown_name("key", key, KEYS, where=where, error=StudyError)
    factors = read_factors(table.get("factors", {}), f"{where}: factors")
    optimise = (
        read_optimise(table["optimise"], f"{where}: optimise") if "optimise" in table else None
    )
    if optimise is not None:
        _refuse_keys(table, ("factors", "design", "points", "seeds", "controls"), where)
    controls = _controls(table, optimise, folder, where)
    if optimise is not None:
        optimise = replace(optimise[0], control=controls[0].label), optimise[1]
    study = Study(
        title=text_of(table, "title", Path(where).stem, where),
        cases={},
        factors=factors if optimise is None else optimise[1],
        design=_design(table, where),
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
    if not isinstance(texts, list) or not texts or not all(isinstance(one, str) for one in texts):
        raise StudyError(
            "wrong type",
            got=texts,
            expected="a list of controls",
            fix='write controls = ["kinematic", "law.py:Class"]',
            where=place,
        )
    return parse_controls([control_beside(text, folder) for text in texts], where=place)


def _refuse_keys(table: Mapping[str, Any], keys: Sequence[str], where: str) -> None:
    """Raises StudyError for keys that an optimisation does not have."""
    for key in keys:
        if key in table:
            fix = "leave it out: the variables, training and held_out of [optimise] say what is run"
            raise StudyError(
                "not a key of an optimisation",
                got=key,
                expected="[optimise] alone",
                fix=fix,
                where=where,
            )


def _design(table: Mapping[str, Any], where: str) -> str:
    return names_of([table.get("design", GRID)], DESIGNS, f"{where}: design")[0]


def _points(table: Mapping[str, Any], where: str) -> int:
    drawn = table.get("design") in DRAWN
    if drawn and "points" not in table:
        raise StudyError(
            "missing key",
            expected="a number of points",
            fix="write points = 100",
            where=f"{where}: points",
        )
    if not drawn and "points" in table:
        fix = f'leave it out, or write design = "{DRAWN[-1]}" (or {", ".join(DRAWN[:-1])})'
        raise StudyError(
            "a number of points for a design that has its own",
            got=table["points"],
            fix=fix,
            where=f"{where}: points",
        )
    return whole(table.get("points", 1), f"{where}: points", least=1, most=MAX_POINTS)


def _cases(study: Study, folder: Path) -> dict[str, Case]:
    """Returns the scenarios of a study by name.

    They are the study's own one, those of the factor `scenario` and those of an optimisation.
    """
    source, where = study.source, study.where
    own = source.get("scenario", "walk_flat")
    changes = source.get("set", {})
    if not isinstance(changes, Mapping):
        raise StudyError(
            "wrong type",
            got=changes,
            expected="a table of settings",
            fix="write [set]",
            where=f"{where}: set",
        )
    changed = flat(changes, f"{where}: set")
    for name in changed:
        check_settable(plain_name(name), f"{where}: set.{name}", kind="setting")
        _refuse_twice(name, study)
    vary = boolean_of(
        source, "variation", len(study.seeds) > 1 or study.optimise is not None, where
    )
    names = [
        own if isinstance(own, str) else study.title,
        *_named_scenarios(study.factors, study.optimise),
    ]
    tables: dict[str, Mapping[str, Any] | None] = dict.fromkeys(names)
    if isinstance(own, Mapping):
        if names[0] in names[1:]:
            fix = "give the study another title"
            raise StudyError(
                "two scenarios of one name",
                got=names[0],
                expected="different names",
                fix=fix,
                where=f"{where}: scenario",
            )
        tables[names[0]] = own
    elif not isinstance(own, str):
        raise StudyError(
            "wrong type",
            got=own,
            expected="a scenario's name, file or table",
            where=f"{where}: scenario",
        )
    return {
        name: _case(name, inline, changed, folder, where, vary=vary, key=_key_of(name, study))
        for name, inline in tables.items()
    }


def _key_of(name: str, study: Study) -> str:
    """Returns the key of the study file that names a scenario."""
    if any(factor.name == SCENARIO_FACTOR and name in factor.values for factor in study.factors):
        return "factors.scenario"
    if study.optimise is not None:
        for part, evaluation in (
            ("training", study.optimise.training),
            ("held_out", study.optimise.held_out),
        ):
            if name in evaluation.cases:
                return f"optimise.{part}.scenarios"
    return "scenario"


def _refuse_twice(name: str, study: Study) -> None:
    """Raises StudyError for a setting that is a factor as well.

    For a variable of an optimiser the setting is allowed: it is the value before the optimisation.
    """
    if study.optimise is None and plain_name(name) in {factor.name for factor in study.factors}:
        fix = "take one of them away: the factor's values would replace it in every run"
        raise StudyError(
            "set and varied",
            got=name,
            expected="each name in [set] or [factors]",
            fix=fix,
            where=f"{study.where}: set.{name}",
        )


def _named_scenarios(factors: Sequence[Factor], optimise: Optimise | None) -> list[str]:
    values = [
        str(value)
        for factor in factors
        if factor.name == SCENARIO_FACTOR and factor.kind == VALUES
        for value in factor.values
    ]
    return (
        values
        if optimise is None
        else [*values, *optimise.training.cases, *optimise.held_out.cases]
    )


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
    table, place = _scenario_tables(name, inline, folder, where, key)
    scenario = scenario_from_table(table, where=place)
    check_scenario(scenario, names=list(scenario.parameters))
    try:
        table = with_values(table, changes)
        check_scenario(
            scenario_from_table(table, where=place, given=list(changes)),
            names=[plain_name(name) for name in changes],
        )
    except HexapodError as error:
        raise StudyError(
            error.what,
            got=error.got,
            expected=error.expected,
            fix=error.fix,
            where=_place(error, where),
        ) from error
    if vary and "variation" not in table:
        table["variation"] = dict(STANDARD_TABLE)
    table["outputs"] = {"plots": False}  # a study keeps no recordings
    return Case(name=name, table=table, where=place)


def _scenario_tables(
    name: str, inline: Mapping[str, Any] | None, folder: Path, where: str, key: str
) -> tuple[dict[str, Any], str]:
    """Returns the tables of a scenario and their place, for messages."""
    if inline is not None:
        return dict(inline), f"{where}: scenario"
    beside = folder / name  # a scenario file beside the study file
    if len(beside.name.encode()) > MAX_FILE_NAME:
        raise StudyError(
            "no file has such a name",
            got=name,
            expected=f"a name of at most {MAX_FILE_NAME} bytes",
            fix="name a scenario",
            where=f"{where}: scenario",
        )
    return _read(beside, name, f"{where}: {key}")


def _read(beside: Path, name: str, where: str) -> tuple[dict[str, Any], str]:
    """Reads a scenario's tables and its place, from a file beside the study if there is one.

    Raises HexapodError; for an unknown name it cites the place in the study file.
    """
    try:
        return read_tables(beside if beside.is_file() else name)
    except HexapodError as error:
        if error.where:
            raise
        raise StudyError(
            error.what, got=error.got, expected=error.expected, fix=error.fix, where=where
        ) from error


def _place(error: HexapodError, where: str) -> str:
    """Returns the place in [set] of an error in a scenario."""
    key = (error.where or "").rpartition(": ")[2].removeprefix("--set ")
    return f"{where}: set.{plain_name(key)}"
