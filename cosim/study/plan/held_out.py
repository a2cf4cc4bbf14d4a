"""Checks that an optimiser's held-out scenarios and seeds are not among those of training.

Scenarios are compared by their walks: robot, ground, gait, commands, events, sensors and
parameters, after [set] and the optimiser's variables. Scenarios that differ only in title, file,
seed, variation, duration or numerics are the same: without variation the one walk would be a part
of the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from hexapod_cosim.cosim.interface.plant_interface import load_interface
from hexapod_cosim.cosim.scenario.records import Outputs
from hexapod_cosim.cosim.scenario.scenario import scenario_from_table, scenario_robot
from hexapod_cosim.cosim.scenario.tables import list_scenarios, read_tables, with_values
from hexapod_cosim.cosim.study.plan.factors import samples
from hexapod_cosim.cosim.study.plan.keys import flat
from hexapod_cosim.cosim.study.plan.records import (
    GAINS,
    Case,
    Evaluation,
    Optimise,
    Study,
    StudyError,
)
from hexapod_cosim.models import HexapodError, load_robot

MAX_SUGGESTIONS = 3  # scenarios that a message suggests


def check_held_out_seeds(training: Evaluation, held_out: Evaluation, where: str) -> None:
    """Raises StudyError for a held-out seed that is one of training.

    A seed draws the same changes in every scenario.
    """
    shared = sorted(set(training.seeds) & set(held_out.seeds))
    if shared:
        expected = "seeds that the optimiser never sees"
        fix = (
            f"write seeds = {{ first = {max(training.seeds) + 1}, count = {len(held_out.seeds)} }}"
        )
        raise StudyError(
            "held-out seeds that are trained on",
            got=shared,
            expected=expected,
            fix=fix,
            where=f"{where}.held_out.seeds",
        )


def check_held_out_scenarios(study: Study, asked: Optimise) -> None:
    """Raises StudyError for a held-out scenario with the same walk as one of training."""
    trained = {name: walk_of(study.cases[name], study) for name in asked.training.cases}
    for name in asked.held_out.cases:
        walk = walk_of(study.cases[name], study)
        same = next((other for other, item in trained.items() if item == walk), None)
        if same is not None:
            raise StudyError(
                "a held-out scenario that is trained on",
                got=name if same == name else f"{name}, the same walk as {same}",
                expected="walks that the optimiser never sees, with any seed",
                fix=_fix(study, asked, list(trained.values())),
                where=f"{study.where}: optimise.held_out.scenarios",
            )


def walk_of(case: Case, study: Study) -> Any:
    """Returns a value that is equal for scenarios with the same walk."""
    settings = {
        factor.name: factor.setting(samples(factor)[0])
        for factor in study.factors
        if not factor.name.startswith(GAINS)
    }
    scenario = scenario_from_table(with_values(case.table, settings), where=case.where)
    own = load_robot(scenario.robot)
    gait = replace(own.gait, **dict(scenario.settings.get("gait", {})))
    robot = replace(scenario_robot(scenario), name="", gait=gait, solver=own.solver)
    start = (
        {entry.name: entry.start for entry in load_interface(own).of_causality("parameter")}
        if scenario.parameters
        else {}
    )
    parameters = {
        name: value for name, value in scenario.parameters.items() if start.get(name) != value
    }
    plain = replace(
        scenario,
        title="",
        robot="",
        where="",
        control="kinematic",
        start=0.0,
        duration=1.0,
        macro_step=1.0,
        seed=0,
        settings={},
        variation=None,
        outputs=Outputs(),
        parameters=parameters,
    )
    return robot, plain


def _fix(study: Study, asked: Optimise, trained: Sequence[Any]) -> str:
    """Suggests scenarios of the same robot that walk and are not among those of training."""
    settings = flat(study.source.get("set", {}), study.where)
    robot, names = study.cases[asked.training.cases[0]].table.get("robot"), []
    for name in list_scenarios():
        table, where = read_tables(name)
        try:
            case = Case(name=name, table=with_values(table, settings), where=where)
            other = walk_of(case, study) not in trained
        except HexapodError:
            continue
        if other and case.table.get("robot") == robot and _walks(case):
            names.append(f'"{name}"')
    if not names:
        return "name other scenarios"
    return f"write scenarios = [{', '.join(names[:MAX_SUGGESTIONS])}], or files of your own"


def _walks(case: Case) -> bool:
    commands = scenario_from_table(case.table, where=case.where).commands
    return any(command.vx or command.vy for command in commands)
