"""Runs one co-simulation of a scenario: robot, plant FMU, controller, master and metrics."""

from __future__ import annotations

import math
import platform
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from hexapod_cosim.controller import Gains
from hexapod_cosim.cosim.common.components import PLANT
from hexapod_cosim.cosim.common.plant_files import package_version
from hexapod_cosim.cosim.common.temporary import TemporaryFolder
from hexapod_cosim.cosim.control.controllers import (
    RunController,
    control_facts,
    make_controller,
    text_of_law,
)
from hexapod_cosim.cosim.interface.controller_interface import ControllerSetup
from hexapod_cosim.cosim.interface.plant_interface import plant_roots
from hexapod_cosim.cosim.interface.start_values import parameter_values
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.master.loop import COMPLETED, Outcome, Progress, diagnostic_columns, run
from hexapod_cosim.cosim.master.recorder import Recorder, chosen_columns
from hexapod_cosim.cosim.master.sensors import errors_of
from hexapod_cosim.cosim.master.signals import Signals
from hexapod_cosim.cosim.results.arrival import is_sent_ahead, missed_end
from hexapod_cosim.cosim.results.drop import describe_drop
from hexapod_cosim.cosim.results.facts import FmuIdentity, RobotIdentity, RunFacts
from hexapod_cosim.cosim.results.ground import is_on_surface, surface_of_grid
from hexapod_cosim.cosim.results.heat import heat_warnings
from hexapod_cosim.cosim.results.metrics import MEASURED_BY_PLANT, compute_metrics, metric_columns
from hexapod_cosim.cosim.results.result import Result
from hexapod_cosim.cosim.results.warnings import (
    describe_fall,
    locomotion_of,
    missing_metrics_warnings,
    off_map_warnings,
    short_run_warnings,
    unused_settings,
    walk_warnings,
)
from hexapod_cosim.cosim.results.window import View
from hexapod_cosim.cosim.run.chosen_walk import ChosenWalk, choose_walk
from hexapod_cosim.cosim.run.preparation import PlantFmus, chosen_gains, law_of
from hexapod_cosim.cosim.scenario.checks import check_servo_faults
from hexapod_cosim.cosim.scenario.controls import control_of
from hexapod_cosim.cosim.scenario.event_log import event_log
from hexapod_cosim.cosim.scenario.reach import check_commands
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.cosim.scenario.scenario import scenario_robot
from hexapod_cosim.cosim.scenario.schedule import Schedule, make_schedule
from hexapod_cosim.cosim.scenario.variation import (
    Drawn,
    delayed,
    draw,
    initial_values,
)
from hexapod_cosim.models import LEG_NAMES, FmuError, Robot
from hexapod_cosim.models.ground.faces import surface_of
from hexapod_cosim.models.ground.grid_file import grid_bytes
from hexapod_cosim.models.ground.surface import Surface

# parameters with these prefixes describe the robot; all others are settings
BODY_PARAMETERS = ("torso.", "foot.", *(f"{leg}." for leg in LEG_NAMES))
GRID = "terrain.grid"  # parameter: number of the grid file in the FMU's resources
SAME = 1e-9  # relative, of a parameter that was printed and read again


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
    if law is not None:
        scenario = replace(scenario, control=text_of_law(law, label))
    plan = make_plan(scenario, gains=gains)
    with (
        open_plant(scenario, fmu, robot=plan.robot) as plant,
        make_controller(plan, law=law) as controller,
    ):
        parameters = initialise_plant(plant, plan)
        signals = Signals(plant, errors=errors_of(scenario, plan.schedule))
        recorder = _make_recorder(plan, signals, controller)
        start_controller(controller, plant, plan)
        if begin is not None:
            begin()
        outcome = run(
            plant,
            signals,
            controller,
            plan.schedule,
            recorder,
            h=scenario.macro_step,
            progress=progress,
        )
        return make_result(
            plan,
            outcome,
            plant,
            parameters,
            controller=control_facts(scenario, law),
            warnings=controller.warnings,
            surface=run_surface(plant, plan.robot, parameters),
        )


def start_controller(controller: RunController, plant: Fmu, plan: RunPlan) -> None:
    """Starts a controller at the plant's first outputs. Raises FmuError.

    The outputs are read without the errors of sensors, whose random numbers belong to the run.
    """
    scenario, signals = plan.scenario, Signals(plant)
    signals.read()
    stop = scenario.start + scenario.duration
    controller.start(scenario.start, stop, plan.schedule.commands[0], signals.measurement)


def _make_recorder(plan: RunPlan, signals: Signals, controller: RunController) -> Recorder:
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


@dataclass(frozen=True, kw_only=True)
class RunPlan:
    """All parts of a run that do not depend on a plant FMU."""

    scenario: Scenario
    robot: Robot  # the plant's, in the stance of the walk
    walk: ChosenWalk
    controller: ControllerSetup
    schedule: Schedule
    drawn: Drawn | None  # None: nothing is varied


def make_plan(scenario: Scenario, *, gains: Gains | None = None) -> RunPlan:
    """Returns the plan of a scenario.

    Raises HexapodError for commands that the legs do not reach and where no gains can be designed.
    """
    own = scenario_robot(scenario)
    check_servo_faults(scenario, own)
    walk = choose_walk(scenario, own, gains)
    robot, gait = walk.robot, walk.gait
    if control_of(scenario.control).is_builtin:  # another control has strides of its own
        check_commands(scenario.commands, robot, gait, where=f"{scenario.where}: command")
    setup = ControllerSetup(
        robot=robot,
        gait=gait,
        period=scenario.macro_step,
        gains=chosen_gains(scenario, gains),
        parts=scenario.compliance,
        law=law_of(scenario.control),
    )
    drawn = None if scenario.variation is None else draw(scenario.variation, seed=scenario.seed)
    timed = scenario
    if drawn is not None:
        timed = replace(scenario, commands=delayed(scenario.commands, drawn.command_delay))
    return RunPlan(
        scenario=scenario,
        robot=walk.standing(own),
        walk=walk,
        controller=setup,
        schedule=make_schedule(timed),
        drawn=drawn,
    )


def initialise_plant(plant: Fmu, plan: RunPlan) -> dict[str, float]:
    """Initialises a plant with the scenario's parameters and the drawn initial values.

    Returns all parameters as they then hold.
    """
    scenario = plan.scenario
    _check_measurements(plant)
    plant.set_parameters(scenario.parameters)
    if plan.drawn is not None:
        plant.set_parameters(initial_values(plan.robot, plant.parameters(), plan.drawn))
    plant.initialise(scenario.start, scenario.start + scenario.duration)
    return plant.parameters()


def _check_measurements(plant: Fmu) -> None:
    """Raises FmuError when an FMU lacks the outputs that metrics are made of."""
    missing = [name for name in MEASURED_BY_PLANT if name not in plant.variables]
    if missing:
        fix = "export it again with `hexapod export`"
        expected = "the outputs that metrics are made of, which FMUs of earlier versions lack"
        raise FmuError(
            "an FMU without measurements",
            got=f"no {min(missing)}",
            expected=expected,
            fix=fix,
            where=str(plant.path),
        )


def make_result(
    plan: RunPlan,
    outcome: Outcome,
    plant: Fmu,
    parameters: Mapping[str, float],
    *,
    controller: Mapping[str, Any],
    warnings: Sequence[str] = (),
    surface: Surface | None = None,
) -> Result:
    """Returns the result of a run, with its metrics and warnings.

    controller: facts of the controller; warnings: its own; surface: the run's, for reports.
    """
    scenario, setup, drawn = plan.scenario, plan.controller, plan.drawn
    view = View(outcome.judged, parameters, setup.gait.period)
    missing, drop = list[str](), describe_drop(replace(view, recording=outcome.recording))
    fall = describe_fall(view, setup.robot)
    if outcome.status == COMPLETED:
        missing = short_run_warnings(view)
        # a drop neither walks nor swings a foot, and has the metrics of a drop
        missing += missing_metrics_warnings(view) if drop is None else []
    metrics = compute_metrics(view, servo=plan.robot.servo, realtime_factor=outcome.realtime_factor)
    arrives = outcome.status != COMPLETED or not is_sent_ahead(view)
    missed = "" if arrives else missed_end(metrics)
    facts = RunFacts(
        status=outcome.status,
        reason=outcome.reason,
        title=scenario.title,
        control=control_of(scenario.control).label,
        simulated=outcome.simulated,
        wall=outcome.wall,
        realtime_factor=outcome.realtime_factor,
        finished=outcome.finished.isoformat(timespec="seconds"),
        robot=RobotIdentity(name=setup.robot.name, hash=setup.robot.hash),
        gait_period=setup.gait.period,
        fmu=FmuIdentity(file=plant.path.name, guid=plant.description.guid, sha256=plant.sha256),
        versions=dict(_versions()),
        platform=f"{sys.platform} {platform.machine()}",
        controller=controller,
        warnings=(
            *warnings,
            *unused_settings(scenario, setup.robot),
            *([fall] if fall else []),
            *walk_warnings(view, setup.robot),
            *off_map_warnings(view.recording, surface_of(plan.robot.terrain)),
            *heat_warnings(view.recording, plan.robot.servo),
            *missing,
        ),
        events=tuple(event_log(scenario, outcome.simulated)),
        gains=None if setup.gains is None else setup.gains.as_facts(),
        walk=locomotion_of(view, upright=not fall, missed=missed),
        drop=drop,
        drawn=None if drawn is None else drawn.as_facts(),
        walking=plan.walk.as_facts(),
        terrain={} if surface is None else dict(surface.recipe),
        parameters=dict(parameters),
    )
    return Result(scenario=scenario, outcome=outcome, metrics=metrics, facts=facts, surface=surface)


@contextmanager
def open_plant(
    scenario: Scenario, path: Path | None = None, *, robot: Robot | None = None
) -> Iterator[Fmu]:
    """Opens the FMU of a scenario and sets the scenario's laws and settings.

    The FMU is exported to a temporary folder, or the one at `path`, which must hold the same robot.

    robot: the scenario's robot in the stance of its walk; by default in its own stance.
    """
    with TemporaryFolder("export") as folder:
        fmus = PlantFmus(folder, given=path)
        with Fmu(fmus.fmu(scenario.robot)) as plant:
            apply_settings(plant, scenario_robot(scenario) if robot is None else robot)
            yield plant


def apply_settings(plant: Fmu, robot: Robot) -> None:
    """Sets the laws and settings of an FMU to those of the robot.

    Raises FmuError when the FMU holds another robot.
    """
    plant.set_parameters(different_settings(plant, robot))


def different_settings(plant: Fmu, robot: Robot) -> dict[str, float]:
    """Returns the robot's laws and settings that differ from those of an FMU.

    Raises FmuError when the FMU holds another robot.
    """
    wanted = parameter_values(PLANT, plant_roots(robot)) | _grid_of(plant, robot)
    present = plant.parameters()
    changes = {
        name: value
        for name, value in wanted.items()
        if name in present and not math.isclose(present[name], value, rel_tol=SAME, abs_tol=SAME**2)
    }
    for name, value in changes.items():
        if name.startswith(BODY_PARAMETERS):
            fix = (
                "export one of this robot with `hexapod export --robot`, "
                "or name the FMU's robot in the scenario"
            )
            expected = f"{value:g}, as robot {robot.name!r} has"
            raise FmuError(
                f"the FMU holds another robot: {name}",
                got=present[name],
                expected=expected,
                fix=fix,
                where=str(plant.path),
            )
    return changes


def _grid_of(plant: Fmu, robot: Robot) -> dict[str, float]:
    """Returns the parameter that chooses the robot's surface, whose grid file the FMU gets.

    Raises FmuError when the FMU is of a version without surfaces.
    """
    surface = surface_of(robot.terrain)
    if surface is None:
        return {}
    if GRID not in plant.variables:
        raise FmuError(
            "an FMU without surfaces",
            got=f"no {GRID}",
            expected="an FMU that reads grid files",
            fix="export it again with `hexapod export`",
            where=str(plant.path),
        )
    return {GRID: float(plant.provide_grid(grid_bytes(surface)))}


def run_surface(plant: Fmu, robot: Robot, parameters: Mapping[str, float]) -> Surface | None:
    """Returns the surface that a plant with these parameters read from its resources.

    It has the recipe of the robot's surface if both are equal.
    """
    if not is_on_surface(parameters):
        return None
    own, content = surface_of(robot.terrain), plant.grid(round(parameters[GRID]))
    if own is not None and content == grid_bytes(own):
        return own
    return surface_of_grid(content, {})


@cache
def _versions() -> Mapping[str, str]:
    names = ("fmpy", "numpy", "scipy", "control")
    return {
        "hexapod-cosim": package_version(),
        "python": platform.python_version(),
        **{name: version(name) for name in names},
    }
