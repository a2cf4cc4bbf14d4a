"""Checks a study: each value of a factor is tried in its scenarios before anything is run."""

from __future__ import annotations

import math
from typing import Any

from hexapod_cosim.controller.gains import SECTIONS
from hexapod_cosim.cosim.interface.plant import load_interface
from hexapod_cosim.cosim.interface.records import Interface
from hexapod_cosim.cosim.scenario.controls import LAW
from hexapod_cosim.cosim.scenario.reading import scenario_from_table
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.cosim.scenario.tables import with_values
from hexapod_cosim.extensions.study.factors import samples
from hexapod_cosim.extensions.study.orders import count_runs
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
from hexapod_cosim.extensions.study.rules import is_number, require, require_known
from hexapod_cosim.models import HexapodError, load_robot
from hexapod_cosim.models.schema import Number, Spec, specs

# settings that a study gives its runs itself: it has keys `controls`, `seeds` and `title`, takes
# events from scenarios, and keeps no recordings
ELSEWHERE = ("control", "seed", "title", "events", "outputs")
MAX_TRIED = 200  # values of a factor that are tried, evenly chosen, with both extremes
MAX_RUNS = 10**7  # some 1 kB of memory each in the report


def check_study(study: Study) -> None:
    """Raises StudyError for a factor that scenarios or the design do not accept."""
    table = "factors" if study.optimise is None else "optimise.variables"
    if study.optimise is None:
        _check_design(study)
    count, fix = count_runs(study), "take fewer points, seeds or trials, or split it by seeds"
    expected = f"at most {MAX_RUNS:,} runs"
    require(count <= MAX_RUNS, count, expected, study.where, what="too many runs", fix=fix)
    for factor in study.factors:
        _check_factor(factor, study, f"{study.where}: {table}.{factor.name}")


def _check_design(study: Study) -> None:
    """Raises StudyError for factors that the design cannot take."""
    where, design = f"{study.where}: factors", study.design
    spread = [factor.name for factor in study.factors if factor.kind != VALUES]
    fix = f'write design = "{RANDOM}" (or another of {", ".join(DRAWN)}) and points = 100'
    what = f"a distribution in a design {design!r}"
    require(design in DRAWN or not spread, spread[:1], "values", where, what=what, fix=fix)
    lengths = {factor.name: len(factor.values) for factor in study.factors}
    alike = design != LIST or len(set(lengths.values())) <= 1
    fix = f'make them as long as each other, or write design = "{GRID}" for all combinations'
    expected, what = "one value of each factor per point", "lists of different lengths"
    require(alike, lengths, expected, where, what=what, fix=fix)
    some = design == GRID or len(lengths) > 0
    fix, got = "leave design out to run the seeds alone", f"design {design!r}"
    require(some, got, "factors", where, what="nothing to vary", fix=fix)


def _check_factor(factor: Factor, study: Study, where: str) -> None:
    check_settable(factor.name, where)
    is_gain = factor.name.startswith(GAINS)
    what, expected = "a relative factor that is no gain", f"a gain, {GAINS}..."
    require(is_gain or not factor.relative, factor.name, expected, where, what=what)
    if is_gain:
        _check_gain(factor, study, where)
    elif factor.name == SCENARIO_FACTOR:
        require(factor.kind == VALUES, factor.kind, "a list of names of scenarios", where)
    else:
        _check_setting(factor, study, where)


def check_settable(name: str, where: str) -> None:
    """Raises StudyError for a setting that a study gives its runs itself.

    Parameters of the user's control, such as control.lift, may be set and varied.
    """
    first, _, key = name.partition(".")
    own = first in ELSEWHERE and not (first == "control" and key not in ("", LAW))
    expected, what = f"none of {', '.join(ELSEWHERE)}", "a setting that a study gives its runs"
    require(not own, name, expected, where, what=what, fix="see the keys of a study")


def gain_specs() -> dict[str, Spec]:
    """Returns what all gains may be by their names as factors, such as gains.hold.path_rate."""
    parts = {name: SECTIONS[name] for name in SECTIONS if name not in ("requirements", "margins")}
    return {
        f"{GAINS}{part}.{name}": spec
        for part, record in parts.items()
        for name, spec in specs(record).items()
    }


def _check_gain(factor: Factor, study: Study, where: str) -> None:
    gains = gain_specs()
    require_known([factor.name], gains, where, "gain")
    allowed = gains[factor.name]
    assert isinstance(allowed, Number)
    what, fix = "not a gain's value", "correct it, or leave the unit out"
    for value in samples(factor):
        holds = is_number(value) and not factor.unit and allowed.holds(float(value))
        require(holds, value, allowed.expected, where, what=what, fix=fix)
    fix = 'add "compliant" to the controls, or take the gain away: kinematic control has none'
    expected, what = "compliant or paper among the controls", "a gain that no run has"
    require(study.gains_text is not None, factor.name, expected, where, what=what, fix=fix)


def _check_setting(factor: Factor, study: Study, where: str) -> None:
    """Tries the values in the first scenario, and the first and last one in all others."""
    every = samples(factor)
    values = [*every[:: math.ceil(len(every) / MAX_TRIED)], min(every), max(every)]
    for k, case in enumerate(study.cases.values()):
        for value in values if k == 0 else (values[0], values[-1]):
            _try(case, factor, value, where)


def _try(case: Case, factor: Factor, value: Value, where: str) -> None:
    try:
        table = with_values(case.table, {factor.name: factor.setting(value)})
        scenario = scenario_from_table(table, where=case.where, given=[factor.name])
        check_scenario(scenario)
    except HexapodError as error:
        raise placed(error, where) from error


def placed(error: HexapodError, where: str) -> StudyError:
    """Returns an error of a scenario with the place in the study file that causes it."""
    return StudyError(
        error.what, got=error.got, expected=error.expected, fix=error.fix, where=where
    )


def check_scenario(scenario: Scenario) -> None:
    """Checks that a scenario's robot exists and that parameters of its FMU may have their values.

    Raises HexapodError.
    """
    interface = load_interface(load_robot(scenario.robot))
    for name, value in scenario.parameters.items():
        _check_parameter(interface, name, value, f"{scenario.where}: parameters.{name}")


def _check_parameter(interface: Interface, name: str, value: Any, where: str) -> None:
    """Raises StudyError unless the value is a number in range, or the name of a choice."""
    variable = interface.by_name[name]
    if variable.enumeration and isinstance(value, str):
        choices = [item for item, _ in interface.enumerations[variable.enumeration].items]
        require_known([value], choices, where, f"choice for {name}")
        return
    low = -math.inf if variable.minimum is None else variable.minimum
    high = math.inf if variable.maximum is None else variable.maximum
    allowed = Number(variable.unit or "1", at_least=low, at_most=high)
    fix = "parameters of the FMU take plain numbers of their own unit"
    holds = is_number(value) and allowed.holds(value)
    require(holds, value, allowed.expected, where, fix=fix)
