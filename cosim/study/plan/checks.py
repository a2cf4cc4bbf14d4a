"""Checks the factors of a study: each value is tried in its scenarios before anything is run."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import fields, is_dataclass
from typing import Any, get_type_hints

from hexapod_cosim.controller import Gains
from hexapod_cosim.controller.gains import POSITIVE
from hexapod_cosim.cosim.interface.plant_interface import Interface, load_interface
from hexapod_cosim.cosim.scenario.controls import LAW
from hexapod_cosim.cosim.scenario.quantities import QUANTITY
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.cosim.scenario.scenario import scenario_from_table
from hexapod_cosim.cosim.scenario.tables import with_values
from hexapod_cosim.cosim.study.plan.factors import PARAMETERS, samples
from hexapod_cosim.cosim.study.plan.held_out import check_held_out_scenarios
from hexapod_cosim.cosim.study.plan.points import check_design
from hexapod_cosim.cosim.study.plan.records import (
    DRAWN,
    GAINS,
    GRID,
    LIST,
    SCENARIO_FACTOR,
    VALUES,
    Case,
    Factor,
    Study,
    StudyError,
    Value,
)
from hexapod_cosim.models import HexapodError, load_robot, unknown_name

# settings that a study gives its runs itself, and what to write instead
ELSEWHERE = {
    "control": 'controls = ["kinematic", "compliant"]',
    "seed": "seeds = 10",
    "title": "title at the top",
    "events": "a scenario",
    "outputs": "nothing: a study keeps no recordings",
}
MAX_TRIED = 200  # values of a factor that are tried, evenly chosen, with both extremes
MAX_RUNS = 10**8
UNBOUNDED = 1e30  # bounds of this size are not shown in messages


def check_study(study: Study) -> None:
    """Raises StudyError for a factor that scenarios or the design do not accept."""
    if study.optimise is None:
        check_design(study)
    _check_size(study)
    table = "factors" if study.optimise is None else "optimise.variables"
    for factor in study.factors:
        _check_factor(factor, study, f"{study.where}: {table}.{factor.name}")
    if study.optimise is not None:
        check_held_out_scenarios(study, study.optimise)


def _check_factor(factor: Factor, study: Study, where: str) -> None:
    check_settable(factor.name, where)
    repeated = len(set(factor.values)) < len(factor.values)
    if repeated and (study.design != LIST or study.optimise is not None):
        raise StudyError(
            "value not allowed",
            got=list(factor.values),
            expected="different values",
            fix="correct it",
            where=where,
        )
    if factor.name.startswith(GAINS):
        _check_gain(factor, study, where)
    elif factor.relative:
        raise StudyError(
            "a relative factor that is no gain",
            got=factor.name,
            expected=f"a gain, {GAINS}...",
            fix="leave out relative",
            where=where,
        )
    elif factor.name != SCENARIO_FACTOR:
        _check_setting(factor, study, where)
    elif factor.kind != VALUES:
        raise StudyError("not scenarios", got=factor.kind, expected="a list of names", where=where)


def check_settable(name: str, where: str, *, kind: str = "factor") -> None:
    """Raises StudyError for a setting that a study gives its runs itself.

    Parameters of the user's control, such as control.lift, may be set and varied.
    """
    first, _, key = name.partition(".")
    if first in ELSEWHERE and not (first == "control" and key not in ("", LAW)):
        raise StudyError(
            f"not a {kind}", got=name, fix=f"write {ELSEWHERE[first]} instead", where=where
        )


def _check_size(study: Study) -> None:
    """Raises StudyError for more than MAX_RUNS runs."""
    if study.optimise is not None:
        count = study.optimise.most
    else:
        lengths = [len(factor.values) for factor in study.factors]
        points = (
            study.points
            if study.design in DRAWN
            else math.prod(lengths)
            if study.design == GRID
            else lengths[0]
        )
        count = points * len(study.seeds) * len(study.controls)
    if count > MAX_RUNS:
        fix = "take fewer points, seeds or trials, or split the study by seeds"
        got, expected = (
            f"{count:,} runs" if count < MAX_RUNS**2 else f"{float(count):.3g} runs",
            f"at most {MAX_RUNS:,} runs",
        )
        raise StudyError("too many runs", got=got, expected=expected, fix=fix, where=study.where)


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
    if factor.unit or not all(
        isinstance(value, int | float) and not isinstance(value, bool) for value in samples(factor)
    ):
        raise StudyError(
            "not a gain's value",
            got=samples(factor)[0],
            expected="numbers without a unit",
            fix="leave the unit out",
            where=where,
        )
    part, _, name = factor.name.removeprefix(GAINS).partition(".")
    positive = name in POSITIVE[part]
    for value in map(float, samples(factor)):
        if not (value > 0.0 if positive else value >= 0.0):
            raise StudyError(
                "not a gain's value",
                got=value,
                expected="numbers > 0" if positive else "numbers >= 0",
                fix="correct it",
                where=where,
            )
    if study.gains_text is None:
        fix = 'add "compliant" to the controls, or take the gain away: kinematic control has none'
        raise StudyError(
            "a gain that no run has",
            got=factor.name,
            expected="compliant or paper among the controls",
            fix=fix,
            where=where,
        )


def _check_setting(factor: Factor, study: Study, where: str) -> None:
    """Tries the values in the first scenario, and the first and last one in all others."""
    values = _spread(samples(factor))
    for value in values:
        if isinstance(value, str) and factor.name != "robot" and QUANTITY.fullmatch(value):
            fix = 'write { values = [5, 10], unit = "deg" }'
            raise StudyError(
                "a number in a text",
                got=value,
                expected="numbers, and their unit beside them",
                fix=fix,
                where=where,
            )
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
        raise StudyError(
            error.what, got=error.got, expected=error.expected, fix=error.fix, where=where
        ) from error


def check_scenario(scenario: Scenario, *, names: Sequence[str]) -> None:
    """Checks that a scenario's robot exists and that parameters of its FMU may have their values.

    Raises HexapodError.

    Args:
        names: the parameters to check.
    """
    try:
        robot = load_robot(scenario.robot)
    except HexapodError as error:
        where = error.where or f"{scenario.where}: robot"
        raise StudyError(
            error.what, got=error.got, expected=error.expected, fix=error.fix, where=where
        ) from error
    for name in names:
        if name in scenario.parameters:
            _check_parameter(
                load_interface(robot),
                name,
                scenario.parameters[name],
                f"{scenario.where}: {PARAMETERS}{name}",
            )


def _check_parameter(interface: Interface, name: str, value: Any, where: str) -> None:
    """Raises StudyError unless the value is a number in range, or the name of a choice."""
    variable = interface.by_name[name]
    choices = (
        [item for item, _ in interface.enumerations[variable.enumeration].items]
        if variable.enumeration
        else []
    )
    if isinstance(value, str) and choices:
        if value not in choices:
            raise unknown_name(f"choice for {name}", value, choices, where=where, error=StudyError)
        return
    low, high = (math.nan if end is None else end for end in (variable.minimum, variable.maximum))
    if isinstance(value, bool) or not isinstance(value, int | float) or value < low or value > high:
        unit = f" in {variable.unit}" if variable.unit else ""
        ends = [
            f"{sign} {end:g}" for sign, end in ((">=", low), ("<=", high)) if abs(end) < UNBOUNDED
        ]
        expected = (
            f"one of {', '.join(choices)}"
            if choices
            else " ".join([f"a number{unit}", " and ".join(ends)]).strip()
        )
        fix = "parameters of the FMU take plain numbers of their own unit"
        raise StudyError("value not allowed", got=value, expected=expected, fix=fix, where=where)
