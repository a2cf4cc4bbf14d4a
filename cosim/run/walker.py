"""Runs scenarios one after the other with the controller FMU and the master loop in C.

FMUs are opened once, and gains are designed once.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from time import thread_time
from types import TracebackType
from typing import Self

from hexapod_cosim.controller import Gains
from hexapod_cosim.cosim.export.controller_export import export_controller
from hexapod_cosim.cosim.interface.controller_interface import (
    ControllerSetup,
    controller_parameters,
)
from hexapod_cosim.cosim.master.fmu import Fmu, FmuBlock
from hexapod_cosim.cosim.master.loop import Progress
from hexapod_cosim.cosim.master.native_loop import NativeMaster
from hexapod_cosim.cosim.master.recorder import COMMAND_COLUMNS, chosen_columns
from hexapod_cosim.cosim.results.metrics import metric_columns
from hexapod_cosim.cosim.results.result import Result
from hexapod_cosim.cosim.results.summary import Summary, refused_summary, summarise
from hexapod_cosim.cosim.run.preparation import PlantFmus
from hexapod_cosim.cosim.run.run import (
    RunPlan,
    describe,
    different_settings,
    initialise_plant,
    make_plan,
    make_result,
    run_surface,
    sensor_settings,
)
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.models import HexapodError, Robot
from hexapod_cosim.models.records import BRISTLE_LAWS

MAX_SETTINGS = 64  # robots whose settings are kept


class Walker:
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
        self._given_controller, self._everything = controller, everything
        self._open = ExitStack()
        self._folder = Path(self._open.enter_context(TemporaryDirectory(prefix="hexapod-walker-")))
        self._fmus = PlantFmus(self._folder, given=fmu)
        # by plant FMU and recorded columns
        self._masters: dict[tuple[Path, tuple[str, ...] | None], tuple[Fmu, NativeMaster]] = {}
        self._controller: Fmu | None = None
        self.loop_time = 0.0  # s    processor time of the last run's loop
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

        Arguments are those of run.simulate(). Raises HexapodError when the run cannot start; how a
        run that started ended is in the result.
        """
        plan = make_plan(scenario, gains=gains)
        controller = self._controller_for(plan)
        plant, master = self._plant(plan, controller, fmu)
        plant.reset()
        plant.set_parameters(self._settings_of(plant, plan.robot))
        parameters = initialise_plant(plant, plan)
        controller.initialise(scenario.start, scenario.start + scenario.duration)
        sensor = sensor_settings(scenario, plan.schedule)
        if self._everything:
            chosen_columns(
                ("time", *master.columns, *COMMAND_COLUMNS),
                scenario.outputs.csv,
                where=f"{scenario.where}: outputs.csv",
            )
        if begin is not None:
            begin()
        started = thread_time()
        every = scenario.every if self._everything else 1  # metrics need every macro-step
        outcome = master.run(
            plan.schedule, h=scenario.macro_step, every=every, sensor=sensor, progress=progress
        )
        self.loop_time = thread_time() - started
        facts = describe(plan.controller.robot, plant, plan.controller.gait.period)
        facts |= {"warnings": plan.controller.warnings}
        # only a run that records everything gets a report, which shows the surface
        surface = run_surface(plant, plan.robot, parameters) if self._everything else None
        return make_result(plan, outcome, parameters, facts, surface=surface)

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

    def _plant(self, plan: RunPlan, controller: Fmu, fmu: Path | None) -> tuple[Fmu, NativeMaster]:
        """Returns the plant FMU of the plan and the master that connects it to the controller."""
        path = self._fmus.fmu(plan.scenario.robot) if fmu is None else fmu
        bristles = (
            plan.robot.friction.law in BRISTLE_LAWS or "friction.law" in plan.scenario.parameters
        )
        columns = None if self._everything else metric_columns(bristles=bristles)
        key = path, columns
        if key not in self._masters:
            plant = self._open.enter_context(Fmu(path))
            judged = metric_columns(bristles=True)
            self._masters[key] = (
                plant,
                NativeMaster(plant, controller, columns=columns, judged=judged),
            )
        return self._masters[key]

    def _controller_for(self, plan: RunPlan) -> Fmu:
        """Returns the controller FMU, reset, with the parameters of the plan."""
        setup = plan.controller
        if self._controller is None:
            path = self._given_controller or export_controller(
                setup, self._folder / "controller.fmu"
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
        self._setup = None
        self._controller = None
        self._open.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()
