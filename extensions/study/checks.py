"""Checks a study: each value of a factor is tried in its scenarios before anything is run."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import fields, is_dataclass
from typing import Any, get_type_hints

from hexapod_cosim.controller import Gains
from hexapod_cosim.controller.gains import PARTS
from hexapod_cosim.cosim.interface.plant import Interface, load_interface
from hexapod_cosim.cosim.scenario.controls import LAW
from hexapod_cosim.cosim.scenario.reading import scenario_from_table
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.cosim.scenario.tables import with_values
from hexapod_cosim.extensions.study.factors import PARAMETERS, samples
from hexapod_cosim.extensions.study.records import (
    DRAWN,
    GAINS,
    GRID,
    LIST,
    RANDOM,
    SCENARIO_FACTOR,
    VALUES,
    Case,
    Factor,
    Study,
    StudyError,
    Value,
)
from hexapod_cosim.extensions.study.rules import is_number, require
from hexapod_cosim.extensions.study.runs import count_runs
from hexapod_cosim.models import HexapodError, load_robot, unknown_name
from hexapod_cosim.models.schema import QUANTITY, Number, specs

# settings that a study gives its runs itself, and what to write instead
ELSEWHERE = {
    "control": 'controls = ["kinematic", "compliant"]',
    "seed": "seeds = 10",
    "title": "title at the top",
    "events": "a scenario",
    "outputs": "nothing: a study keeps no recordings",
}
MAX_TRIED = 200  # values of a factor that are tried, evenly chosen, with both extremes
MAX_RUNS = 10**7  # some 1 kB of memory each in the report
UNBOUNDED = 1e30  # bounds of this size are not shown in messages


def check_study(study: Study) -> None:
    """Raises StudyError for a factor that scenarios or the design do not accept."""
    if study.optimise is None:
        _check_design(study)
    count, fix = count_runs(study), "take fewer points, seeds or trials, or split it by seeds"
    got = f"{count:,} runs" if count < MAX_RUNS**2 else f"{float(count):.3g} runs"
    expected = f"at most {MAX_RUNS:,} runs"
    require(count <= MAX_RUNS, got, expected, study.where, what="too many runs", fix=fix)
    table = "factors" if study.optimise is None else "optimise.variables"
    for factor in study.factors:
        _check_factor(factor, study, f"{study.where}: {table}.{factor.name}")


def _check_design(study: Study) -> None:
    """Raises StudyError for factors that the design cannot take."""
    where, drawn = f"{study.where}: factors", study.design in DRAWN
    spread = [factor.name for factor in study.factors if factor.kind != VALUES]
    if spread and not drawn:
        fix = f'write design = "{RANDOM}" (or another of {", ".join(DRAWN)}) and points = 100'
        what = f"a distribution in a design {study.design!r}"
        raise StudyError(what, got=spread[0], expected="values", fix=fix, where=where)
    lengths = {factor.name: len(factor.values) for factor in study.factors}
    alike = study.design != LIST or len(set(lengths.values())) <= 1
    fix = f'make them as long as each other, or write design = "{GRID}" for all combinations'
    expected, what = "one value of each factor per point", "lists of different lengths"
    require(alike, lengths, expected, where, what=what, fix=fix)
    some = study.design == GRID or len(lengths) > 0
    fix, got = "leave design out to run the seeds alone", f"design {study.design!r}"
    require(some, got, "factors", where, what="nothing to vary", fix=fix)


def _check_factor(factor: Factor, study: Study, where: str) -> None:
    check_settable(factor.name, where)
    different = len(set(factor.values)) == len(factor.values)
    repeatable = study.design == LIST and study.optimise is None
    require(different or repeatable, list(factor.values), "different values", where)
    is_gain = factor.name.startswith(GAINS)
    what, expected = "a relative factor that is no gain", f"a gain, {GAINS}..."
    require(is_gain or not factor.relative, factor.name, expected, where, what=what)
    if is_gain:
        _check_gain(factor, study, where)
    elif factor.name == SCENARIO_FACTOR:
        require(factor.kind == VALUES, factor.kind, "a list of names of scenarios", where)
    else:
        _check_setting(factor, study, where)


def check_settable(name: str, where: str, *, kind: str = "factor") -> None:
    """Raises StudyError for a setting that a study gives its runs itself.

    Parameters of the user's control, such as control.lift, may be set and varied.
    """
    first, _, key = name.partition(".")
    if first in ELSEWHERE and not (first == "control" and key not in ("", LAW)):
        fix = f"write {ELSEWHERE[first]} instead"
        raise StudyError(f"not a {kind}", got=name, fix=fix, where=where)


def gain_names() -> list[str]:
    """Returns the names of all gains as factors have them, for instance gains.hold.path_rate."""
    hints = get_type_hints(Gains)
    parts = {
        name: kind
        for name, kind in hints.items()
        if is_dataclass(kind) and name not in ("requirements", "margins")
    }
    return [f"{GAINS}{name}.{item.name}" for name, kind in parts.items() for item in fields(kind)]


def _check_gain(factor: Factor, study: Study, where: str) -> None:
    if factor.name not in gain_names():
        raise unknown_name("gain", factor.name, gain_names(), where=where, error=StudyError)
    part, _, name = factor.name.removeprefix(GAINS).partition(".")
    allowed = specs(PARTS[part])[name]
    assert isinstance(allowed, Number)
    what, fix = "not a gain's value", "correct it, or leave the unit out"
    for value in samples(factor):
        plain = is_number(value) and not factor.unit
        require(plain, value, "numbers without a unit", where, what=what, fix=fix)
        require(allowed.holds(float(value)), value, allowed.expected, where, what=what)
    fix = 'add "compliant" to the controls, or take the gain away: kinematic control has none'
    expected, what = "compliant or paper among the controls", "a gain that no run has"
    require(study.gains_text is not None, factor.name, expected, where, what=what, fix=fix)


def _check_setting(factor: Factor, study: Study, where: str) -> None:
    """Tries the values in the first scenario, and the first and last one in all others."""
    values = _spread(samples(factor))
    for value in values:
        number = isinstance(value, str) and factor.name != "robot" and QUANTITY.fullmatch(value)
        expected, fix = "numbers, with a unit beside them", 'write { values = [5], unit = "deg" }'
        require(not number, value, expected, where, what="a number in a text", fix=fix)
    for k, case in enumerate(study.cases.values()):
        for value in values if k == 0 else (values[0], values[-1]):
            _try(case, factor, value, where)


def _spread(values: Sequence[Value]) -> list[Value]:
    """Returns at most about MAX_TRIED values, evenly chosen, with both extremes."""
    if len(values) <= MAX_TRIED:
        return list(values)
    step = math.ceil(len(values) / MAX_TRIED)
    return [*values[::step], min(values), max(values)]


def _try(case: Case, factor: Factor, value: Value, where: str) -> None:
    try:
        table = with_values(case.table, {factor.name: factor.setting(value)})
        check_scenario(
            scenario_from_table(table, where=case.where, given=[factor.name]), names=(factor.name,)
        )
    except HexapodError as error:
        raise placed(error, where) from error


def placed(error: HexapodError, where: str) -> StudyError:
    """Returns an error of a scenario with the place in the study file that causes it."""
    return StudyError(
        error.what, got=error.got, expected=error.expected, fix=error.fix, where=where
    )


def check_scenario(scenario: Scenario, *, names: Sequence[str]) -> None:
    """Checks that a scenario's robot exists and that parameters of its FMU may have their values.

    Raises HexapodError.

    Args:
        names: the parameters to check.
    """
    try:
        robot = load_robot(scenario.robot)
    except HexapodError as error:
        raise placed(error, error.where or f"{scenario.where}: robot") from error
    for name in names:
        if name in scenario.parameters:
            where = f"{scenario.where}: {PARAMETERS}{name}"
            _check_parameter(load_interface(robot), name, scenario.parameters[name], where)


def _check_parameter(interface: Interface, name: str, value: Any, where: str) -> None:
    """Raises StudyError unless the value is a number in range, or the name of a choice."""
    variable = interface.by_name[name]
    if variable.enumeration and isinstance(value, str):
        choices = [item for item, _ in interface.enumerations[variable.enumeration].items]
        if value not in choices:
            raise unknown_name(f"choice for {name}", value, choices, where=where, error=StudyError)
        return
    low, high = (
        sign * math.inf if end is None or abs(end) >= UNBOUNDED else end
        for end, sign in ((variable.minimum, -1.0), (variable.maximum, 1.0))
    )
    allowed = Number(variable.unit or "1", at_least=low, at_most=high)
    fix = "parameters of the FMU take plain numbers of their own unit"
    holds = is_number(value) and allowed.holds(value)
    require(holds, value, allowed.expected, where, fix=fix)
