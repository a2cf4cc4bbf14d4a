"""Runs one co-simulation of a scenario: robot, plant FMU, controller, master and metrics."""

from __future__ import annotations

import platform
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from hexapod_cosim.controller import Gains
from hexapod_cosim.cosim.common.plant_files import package_version
from hexapod_cosim.cosim.control.controllers import control_facts, make_controller, text_of_law
from hexapod_cosim.cosim.control.fmu_law import FmuLaw
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.master.loop import (
    COMPLETED,
    JointController,
    Outcome,
    Progress,
    diagnostic_columns,
    run,
)
from hexapod_cosim.cosim.master.recorder import Recorder, chosen_columns
from hexapod_cosim.cosim.master.sensors import errors_of
from hexapod_cosim.cosim.master.signals import Signals
from hexapod_cosim.cosim.results.facts import PYTHON, FmuIdentity, Result, RobotIdentity, RunFacts
from hexapod_cosim.cosim.results.locomotion import (
    describe_fall,
    found_faults,
    is_sent_ahead,
    locomotion_of,
    missed_end,
)
from hexapod_cosim.cosim.results.metrics import compute_metrics, metric_columns
from hexapod_cosim.cosim.results.warnings import (
    heat_warnings,
    off_map_warnings,
    short_run_warnings,
    unused_settings,
    walk_warnings,
)
from hexapod_cosim.cosim.results.window import View
from hexapod_cosim.cosim.run.plan import RunPlan, check_arguments, make_plan
from hexapod_cosim.cosim.run.plant import initialise_plant, open_plant, run_surface
from hexapod_cosim.cosim.scenario.controls import control_of
from hexapod_cosim.cosim.scenario.events import event_log
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.models.ground.faces import surface_of
from hexapod_cosim.models.ground.surface import Surface


def simulate(
    scenario: Scenario,
    *,
    fmu: Path | None = None,
    gains: Gains | None = None,
    progress: Progress | None = None,
    begin: Callable[[], None] | None = None,
    law: Any = None,
    label: str | None = None,
) -> Result:
    """Runs a scenario and returns its recording, metrics and facts.

    Raises HexapodError for anything that keeps the run from starting. A run that has started always
    returns; `Result.outcome` tells how it ended.

    Args:
        scenario: what to run.
        fmu: the plant; by default it is exported for the scenario's robot.
        gains: of the compliant control; by default they are designed for the robot.
        progress: called now and then with the simulated time [s].
        begin: called once the run can start, before the first step.
        law: a controller object or its class, which replaces the scenario's control.
        label: of that law; by default the name of its class.
    """
    check_arguments(scenario, fmu, gains)
    if law is not None:
        scenario = replace(scenario, control=text_of_law(law, label))
    plan = make_plan(scenario, gains=gains)
    with (
        open_plant(scenario, fmu, robot=plan.robot) as plant,
        make_controller(scenario, plan.controller, law=law) as controller,
    ):
        parameters = initialise_plant(plant, plan)
        signals = Signals(plant, errors=errors_of(scenario, plan.schedule))
        recorder = _make_recorder(plan, signals, controller)
        if isinstance(controller, FmuLaw):
            start_controller(controller, plant, plan)
        if begin is not None:
            begin()
        parts = plant, signals, controller, plan.schedule, recorder
        outcome = run(*parts, h=scenario.macro_step, progress=progress)
        surface = run_surface(plant, plan.robot, parameters)
        facts = {"engine": PYTHON, "law": law, "warnings": controller.warnings}
        return make_result(plan, outcome, plant, parameters, surface=surface, **facts)


def start_controller(controller: FmuLaw, plant: Fmu, plan: RunPlan) -> None:
    """Starts a controller FMU at the plant's first outputs. Raises FmuError.

    The outputs are read without the errors of sensors, whose random numbers belong to the run.
    """
    scenario, signals = plan.scenario, Signals(plant)
    signals.read()
    stop = scenario.start + scenario.duration
    controller.start(scenario.start, stop, plan.schedule.commands[0], signals.measurement)


def _make_recorder(plan: RunPlan, signals: Signals, controller: JointController) -> Recorder:
    """Returns the recorder of a run. Raises ScenarioError for unknown columns in outputs.csv."""
    scenario = plan.scenario
    recorder = Recorder(
        signals,
        plan.schedule.times,
        plan.schedule.rows,
        extra=diagnostic_columns(controller),
        every=scenario.every,
        judged=metric_columns(bristles=True),
    )
    chosen_columns(recorder.names, scenario.outputs.csv, where=f"{scenario.where}: outputs.csv")
    return recorder


def _events(scenario: Scenario, outcome: Outcome) -> tuple[dict[str, Any], ...]:
    """Returns the events of the scenario and those that the controller found, in order of time."""
    events = [*event_log(scenario.events, outcome.simulated), *found_faults(outcome.judged)]
    return tuple(sorted(events, key=lambda event: float(event["time"])))


def make_result(
    plan: RunPlan,
    outcome: Outcome,
    plant: Fmu,
    parameters: Mapping[str, float],
    *,
    engine: str,
    law: Any = None,
    warnings: Sequence[str] = (),
    surface: Surface | None = None,
) -> Result:
    """Returns the result of a run, with its metrics and warnings.

    engine: that ran it; law: the controller object, if one was given; warnings: the controller's;
    surface: the run's, for reports.
    """
    scenario, setup = plan.scenario, plan.controller
    view = View(outcome.judged, parameters, setup.gait.period)
    fall = describe_fall(view, setup.robot)
    metrics = compute_metrics(view, servo=plan.robot.servo, realtime_factor=outcome.realtime_factor)
    arrives = outcome.status != COMPLETED or not is_sent_ahead(view)
    facts = RunFacts(
        status=outcome.status,
        reason=outcome.reason,
        title=scenario.title,
        control=control_of(scenario.control).label,
        engine=engine,
        simulated=outcome.simulated,
        wall=outcome.wall,
        realtime_factor=outcome.realtime_factor,
        finished=outcome.finished.isoformat(timespec="seconds"),
        robot=RobotIdentity(name=setup.robot.name, hash=setup.robot.hash),
        gait_period=setup.gait.period,
        fmu=FmuIdentity(file=plant.path.name, guid=plant.description.guid, sha256=plant.sha256),
        versions=dict(_versions()),
        platform=f"{sys.platform} {platform.machine()}",
        controller=control_facts(scenario, law),
        warnings=(*warnings, *_warnings(plan, outcome, view, fall)),
        events=_events(scenario, outcome),
        gains=None if setup.gains is None else setup.gains.as_facts(),
        walk=locomotion_of(view, upright=not fall, missed="" if arrives else missed_end(metrics)),
        drawn=None if plan.drawn is None else plan.drawn.as_facts(),
        walking=plan.selection.as_facts(),
        terrain={} if surface is None else dict(surface.recipe),
        parameters=dict(parameters),
    )
    return Result(scenario=scenario, outcome=outcome, metrics=metrics, facts=facts, surface=surface)


def _warnings(plan: RunPlan, outcome: Outcome, view: View, fall: str) -> Iterator[str]:
    """Yields the warnings of a run; `fall` describes its fall, "" without one."""
    robot = plan.controller.robot
    yield from unused_settings(plan.scenario, robot)
    yield from [fall] if fall else []
    yield from walk_warnings(view, robot)
    yield from off_map_warnings(view.recording, surface_of(plan.robot.terrain))
    yield from heat_warnings(view.recording, plan.robot.servo)
    if outcome.status == COMPLETED:
        yield from short_run_warnings(view)


@cache
def _versions() -> Mapping[str, str]:
    names = ("fmpy", "numpy", "scipy", "control")
    return {
        "hexapod-cosim": package_version(),
        "python": platform.python_version(),
        **{name: version(name) for name in names},
    }
