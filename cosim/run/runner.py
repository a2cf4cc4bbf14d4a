"""Runs scenarios one after the other with the controller FMU and the master loop in C.

FMUs are opened once, and gains are designed once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing
from dataclasses import replace
from pathlib import Path
from types import NoneType

from hexapod_cosim.controller import Gains
from hexapod_cosim.cosim.common.temporary import Closing, TemporaryFolder
from hexapod_cosim.cosim.control.controllers import connection_of, fmu_parameters_of
from hexapod_cosim.cosim.control.fmu_instance import open_controller_fmu
from hexapod_cosim.cosim.control.fmu_law import FmuLaw
from hexapod_cosim.cosim.export.plant import export_controller
from hexapod_cosim.cosim.interface.controller import ControllerSetup, controller_parameters
from hexapod_cosim.cosim.master.connection import Connection
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.master.fmu_block import FmuBlock
from hexapod_cosim.cosim.master.loop import Progress
from hexapod_cosim.cosim.master.native_loop import NativeMaster
from hexapod_cosim.cosim.master.recorder import COMMAND_COLUMNS, chosen_columns
from hexapod_cosim.cosim.master.sensors import errors_of
from hexapod_cosim.cosim.results.facts import COMPILED, Result
from hexapod_cosim.cosim.results.metrics import metric_columns
from hexapod_cosim.cosim.results.summary import Summary, refused_summary, summarise
from hexapod_cosim.cosim.run.plan import RunPlan, check_arguments, make_plan
from hexapod_cosim.cosim.run.plant import (
    PlantFmus,
    different_settings,
    initialise_plant,
    run_surface,
)
from hexapod_cosim.cosim.run.single_run import make_result, simulate, start_controller
from hexapod_cosim.cosim.scenario.controls import FMU, PYTHON, control_of
from hexapod_cosim.cosim.scenario.events import SensorFault
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.models import HexapodError, Robot
from hexapod_cosim.models.errors import check_type

MAX_SETTINGS = 64  # robots whose settings are kept


def reads_no_numbers(scenario: Scenario) -> bool:
    """Returns whether a sensor of a scenario reads NaN."""
    faults = (event for event in scenario.events if isinstance(event, SensorFault))
    return any(fault.fault == "nan" for fault in faults)


class Runner(Closing):
    """Runs scenarios as `simulate` does, with the controller FMU instead of the Python controller.

    It is a context manager for use in one thread. Results do not depend on earlier runs.

    Args:
        fmu: the plant FMU of all runs; by default one is exported for each robot.
        controller: the controller FMU, whose parameters every run sets; by default one is
            exported.
        everything: whether all signals are recorded, not only those that metrics and warnings
            need.
    """

    def __init__(
        self, *, fmu: Path | None = None, controller: Path | None = None, everything: bool = False
    ) -> None:
        for path, name in ((fmu, "fmu"), (controller, "controller")):
            check_type(path, (str, Path, NoneType), "the path of an FMU", where=name)
        self._given_controller, self._everything = controller, everything
        self._open = ExitStack()
        self._folder = self._open.enter_context(TemporaryFolder("runner"))
        self._fmus = PlantFmus(self._folder, given=fmu)
        # by plant FMU and recorded columns, of the built-in controls
        self._masters: dict[tuple[Path, tuple[str, ...] | None], NativeMaster] = {}
        self._plants: dict[Path, Fmu] = {}
        self._controller: Fmu | None = None
        # the controller's latest set-up and the blocks of parameters that make it
        self._setup: tuple[ControllerSetup, list[FmuBlock]] | None = None
        self._settings: dict[tuple[Path, Robot], dict[str, float]] = {}

    def simulate(
        self,
        scenario: Scenario,
        *,
        fmu: Path | None = None,
        gains: Gains | None = None,
        progress: Progress | None = None,
        begin: Callable[[], None] | None = None,
    ) -> Result:
        """Runs a scenario, on the plant FMU `fmu` and with `gains` if given.

        Arguments are those of run.simulate(), which runs on the loop in Python what the loop in C
        cannot: a controller in Python, and with a warning an FMU of FMI 3.0 or with Boolean inputs
        and a built-in control whose sensors read NaN, which FMUs refuse. Raises HexapodError when
        the run cannot start; how a run that started ended is in the result.
        """
        check_arguments(scenario, fmu, gains)
        control = control_of(scenario.control)
        path = self._fmus.fmu(scenario.robot) if fmu is None else fmu
        if control.is_builtin and not reads_no_numbers(scenario):
            plan = make_plan(scenario, gains=gains)
            controller = self._controller_for(plan)
            plant, master = self._plant(plan, controller, path)
            parameters = self._initialise_plant(plant, plan)
            controller.initialise(scenario.start, scenario.start + scenario.duration)
            return self._run(plan, plant, master, parameters, progress, begin)
        if control.kind == FMU and control.path is not None:
            # opened anew for each run, because FMUs need not support a reset
            with closing(open_controller_fmu(control.path)) as given:
                plan = make_plan(scenario, gains=gains)
                connection = connection_of(control, given.described, scenario, plan.controller)
                if connection.is_scalar and isinstance(given, Fmu):
                    return self._simulate_fmu(plan, path, given, connection, progress, begin)
        result = simulate(scenario, fmu=path, gains=gains, progress=progress, begin=begin)
        if control.kind == PYTHON:
            return result
        what = "sensors that read NaN" if control.is_builtin else "FMI 3.0 and Boolean inputs"
        text = f"the run used the loop in Python: that in C does not support {what}"
        facts = replace(result.facts, warnings=(text, *result.facts.warnings))
        return replace(result, facts=facts)

    def _simulate_fmu(
        self,
        plan: RunPlan,
        path: Path,
        controller: Fmu,
        connection: Connection,
        progress: Progress | None,
        begin: Callable[[], None] | None,
    ) -> Result:
        """Runs a plan under a user's controller FMU on the loop in C."""
        control, plant = control_of(plan.scenario.control), self._open_plant(path)
        columns, judged = self._columns(plan), metric_columns(bristles=True)
        master = NativeMaster(plant, controller, connection, columns=columns, judged=judged)
        parameters = self._initialise_plant(plant, plan)
        controller.set_parameters(fmu_parameters_of(control, controller.described, plan.scenario))
        law = FmuLaw(controller, connection, period=plan.controller.period)
        start_controller(law, plant, plan)
        return self._run(plan, plant, master, parameters, progress, begin, law.warnings)

    def _initialise_plant(self, plant: Fmu, plan: RunPlan) -> dict[str, float]:
        """Resets and initialises a plant for a plan; returns all its parameters."""
        plant.reset()
        plant.set_parameters(self._settings_of(plant, plan.robot))
        return initialise_plant(plant, plan)

    def _run(
        self,
        plan: RunPlan,
        plant: Fmu,
        master: NativeMaster,
        parameters: dict[str, float],
        progress: Progress | None,
        begin: Callable[[], None] | None,
        warnings: Sequence[str] = (),
    ) -> Result:
        """Runs the loop in C on initialised FMUs; `warnings` are the controller's."""
        scenario = plan.scenario
        if self._everything:
            chosen_columns(
                ("time", *master.columns, *COMMAND_COLUMNS),
                scenario.outputs.csv,
                where=f"{scenario.where}: outputs.csv",
            )
        if begin is not None:
            begin()
        every = scenario.every if self._everything else 1  # metrics need every macro-step
        errors = errors_of(scenario, plan.schedule)
        outcome = master.run(
            plan.schedule, h=scenario.macro_step, every=every, errors=errors, progress=progress
        )
        # only a run that records everything gets a report, which shows the surface
        surface = run_surface(plant, plan.robot, parameters) if self._everything else None
        return make_result(
            plan,
            outcome,
            plant,
            parameters,
            engine=COMPILED,
            warnings=[*plan.controller.warnings, *warnings],
            surface=surface,
        )

    def summary(
        self,
        scenario: Scenario,
        *,
        fmu: Path | None = None,
        gains: Gains | None = None,
        progress: Progress | None = None,
    ) -> Summary:
        """Returns the summary of a scenario's run, also of a run that cannot start."""
        try:
            return summarise(self.simulate(scenario, fmu=fmu, gains=gains, progress=progress))
        except HexapodError as error:
            return refused_summary(scenario, error)

    def _plant(self, plan: RunPlan, controller: Fmu, path: Path) -> tuple[Fmu, NativeMaster]:
        """Returns the plant FMU of the plan and the master that connects it to the controller."""
        plant, columns = self._open_plant(path), self._columns(plan)
        key = path, columns
        if key not in self._masters:
            judged = metric_columns(bristles=True)
            self._masters[key] = NativeMaster(plant, controller, columns=columns, judged=judged)
        return plant, self._masters[key]

    def _open_plant(self, path: Path) -> Fmu:
        """Returns a plant FMU, which stays open until the runner is closed."""
        if path not in self._plants:
            self._plants[path] = self._open.enter_context(Fmu(path))
        return self._plants[path]

    def _columns(self, plan: RunPlan) -> tuple[str, ...] | None:
        """Returns the columns to record; None for all."""
        bristles = plan.robot.friction.has_bristles or "friction.law" in plan.scenario.parameters
        return None if self._everything else metric_columns(bristles=bristles)

    def _controller_for(self, plan: RunPlan) -> Fmu:
        """Returns the controller FMU, reset, with the parameters of the plan."""
        setup = plan.controller
        if self._controller is None:
            path = self._given_controller or export_controller(
                setup, self._folder / "controller.fmu", bare=True
            )
            self._controller = self._open.enter_context(Fmu(path, name="controller"))
        self._controller.reset()
        if self._setup is None or self._setup[0] != setup:
            self._setup = setup, self._controller.parameter_blocks(controller_parameters(setup))
        self._controller.set_blocks(self._setup[1])
        return self._controller

    def _settings_of(self, plant: Fmu, robot: Robot) -> dict[str, float]:
        """Returns the parameters in which the plant, just reset, differs from the robot."""
        key = plant.path, robot
        if key not in self._settings:
            if len(self._settings) >= MAX_SETTINGS:
                self._settings.clear()
            self._settings[key] = different_settings(plant, robot)
        return self._settings[key]

    def close(self) -> None:
        """Frees the FMUs. A second call does nothing."""
        self._masters.clear()
        self._plants.clear()
        self._setup = None
        self._controller = None
        self._open.close()
