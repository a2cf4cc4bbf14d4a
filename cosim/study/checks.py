"""Whether a study's factors are what its scenarios know: each value is tried by itself before anything is run."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any, get_type_hints

from hexapod_cosim.controller import Gains
from hexapod_cosim.cosim.scenario import scenario_from_table, with_values
from hexapod_cosim.cosim.study.apart import check_scenarios_apart
from hexapod_cosim.cosim.study.design import check_design
from hexapod_cosim.cosim.study.factors import samples
from hexapod_cosim.cosim.study.records import GAINS, SCENARIO_FACTOR, VALUES, Factor, Study, StudyError, Value
from hexapod_cosim.models import HexapodError, unknown_name

ELSEWHERE = {"control": 'controls = ["kinematic", "compliant"]', "seed": "seeds = 10", "title": "title at the top", "events": "a scenario"}
MAX_TRIED = 100  # values of a factor that are tried, evenly spread


def check_study(study: Study) -> None:
    """Raises StudyError for a factor that no run could have, or that the design cannot take."""
    if study.optimise is None:
        check_design(study)
    for factor in study.factors:
        where = f"{study.where}: {'factors' if study.optimise is None else 'optimise.variables'}.{factor.name}"
        if factor.name in ELSEWHERE:
            raise StudyError("not a factor", got=factor.name, fix=f"write {ELSEWHERE[factor.name]} instead", where=where)
        if factor.name.startswith(GAINS):
            _check_gain(factor, study, where)
        elif factor.relative:
            raise StudyError("relative to what?", got=factor.name, expected=f"a gain, {GAINS}...", fix="leave out relative", where=where)
        elif factor.name != SCENARIO_FACTOR:
            _check_setting(factor, study, where)
        elif factor.kind != VALUES:
            raise StudyError("not scenarios", got=factor.kind, expected="a list of names", where=where)
    if study.optimise is not None:
        check_scenarios_apart(study, study.optimise)


def gain_names() -> list[str]:
    """All gains by the names that factors have: gains.slip.kp and so on."""
    hints = get_type_hints(Gains)
    parts = {name: kind for name, kind in hints.items() if is_dataclass(kind) and name not in ("requirements", "margins")}
    return [f"{GAINS}{name}.{item.name}" for name, kind in parts.items() for item in fields(kind)]


def _check_gain(factor: Factor, study: Study, where: str) -> None:
    if factor.name not in gain_names():
        raise unknown_name("gain", factor.name, gain_names(), where=where, error=StudyError)
    if factor.unit or not all(isinstance(value, int | float) and not isinstance(value, bool) for value in samples(factor)):
        raise StudyError("not a gain's value", got=samples(factor)[0], expected="numbers without a unit", where=where)
    if "compliant" not in study.run_controls:
        raise StudyError("a gain that no run has", got=factor.name, expected="compliant among the controls", where=where)


def _check_setting(factor: Factor, study: Study, where: str) -> None:
    values = samples(factor)
    step = max(len(values) // MAX_TRIED, 1)
    case = next(iter(study.cases.values()))
    for value in (*values[::step], values[-1]):
        _try(case.table, factor, value, case.where, where)


def _try(table: Any, factor: Factor, value: Value, told: str, where: str) -> None:
    try:
        scenario_from_table(with_values(table, {factor.name: factor.setting(value)}), where=told, given=[factor.name])
    except HexapodError as error:
        raise StudyError(error.what, got=error.got, expected=error.expected, fix=error.fix, where=where) from error
