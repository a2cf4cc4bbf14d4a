"""Run after run in one process on the compiled controller: FMUs are opened once, robots and
designs are made once, the loop is C.
"""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from time import thread_time
from types import TracebackType
from typing import Self

from hexapod_cosim.controller import Gains
from hexapod_cosim.cosim.export.controller_export import export_controller
from hexapod_cosim.cosim.export.export import export_fmu
from hexapod_cosim.cosim.interface.controller_interface import (
    ControllerSetup,
    controller_parameters,
)
from hexapod_cosim.cosim.master.fmu import Fmu, FmuBlock
from hexapod_cosim.cosim.master.loop import Progress
from hexapod_cosim.cosim.master.native_loop import NativeMaster
from hexapod_cosim.cosim.results.metrics import metric_columns
from hexapod_cosim.cosim.results.result import Result
from hexapod_cosim.cosim.results.summary import Summary, refused_summary, summarise
from hexapod_cosim.cosim.run.run import (
    Plan,
    chosen_gains,
    describe,
    different_settings,
    initialise_plant,
    known_robot,
    make_plan,
    make_result,
    sensor_settings,
)
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.models import HexapodError, Robot, load_robot

REMEMBERED = 64  # robots


class Walker:
    """Walks scenarios one after the other as `simulate` does, with the controller's FMU in place of
    the Python controller.

    A context manager, for one thread: threads and processes have one each. Results do not depend on
    what it walked before.

    Args:
        fmu: the plant's FMU for all runs; by default one is exported for each robot.
        controller: a controller's FMU, whose parameters every run sets as its scenario says; by
            default one is exported.
        everything: whether all signals are recorded, not only what metrics and warnings look at.
    """

    def __init__(
        self, *, fmu: Path | None = None, controller: Path | None = None, everything: bool = False
    ) -> None:
        self._given, self._given_controller, self._everything = fmu, controller, everything
        self._open = ExitStack()
        self._folder = Path(self._open.enter_context(TemporaryDirectory(prefix="hexapod-walker-")))
        # by robot, or by the FMU given; and by what is recorded
        self._masters: dict[
            tuple[str | Path, tuple[str, ...] | None], tuple[Fmu, NativeMaster]
        ] = {}
        self._controller: Fmu | None = None
        self.loop_time = 0.0  # s  of the processor, the last run's loop alone
        self._told: tuple[ControllerSetup, list[FmuBlock]] | None = (
            None  # the controller's latest set-up and the blocks that set it
        )
        self._changes: dict[tuple[Path, Robot], dict[str, float]] = {}
        self._designs: dict[tuple[str, float], Gains | None] = {}

    def simulate(
        self,
        scenario: Scenario,
        *,
        fmu: Path | None = None,
        gains: Gains | None = None,
        progress: Progress | None = None,
    ) -> Result:
        """A scenario's run and what came of it, on the plant `fmu` if given. Raises HexapodError
        for what keeps it from starting.
        """
        plan = make_plan(scenario, gains=self._gains(scenario, gains))
        controller = self._told_controller(plan)
        plant, master = self._plant(plan, controller, fmu or self._given)
        plant.reset()
        plant.set_parameters(self._settings(plant, plan.robot))
        parameters = initialise_plant(plant, plan)
        controller.initialise(scenario.start, scenario.start + scenario.duration)
        sensor = sensor_settings(scenario, plan.schedule)
        begin = thread_time()
        every = (
            scenario.every if self._everything else 1
        )  # what is judged is needed of every macro-step
        outcome = master.run(
            plan.schedule, h=scenario.macro_step, every=every, sensor=sensor, progress=progress
        )
        self.loop_time = thread_time() - begin
        facts = describe(plan.controller.robot, plant, plan.controller.gait.period)
        return make_result(
            plan, outcome, parameters, facts | {"warnings": plan.controller.warnings}
        )

    def summary(
        self,
        scenario: Scenario,
        *,
        fmu: Path | None = None,
        gains: Gains | None = None,
        progress: Progress | None = None,
    ) -> Summary:
        """What a scenario's run came to, a refusal to begin included."""
        try:
            return summarise(self.simulate(scenario, fmu=fmu, gains=gains, progress=progress))
        except HexapodError as error:
            return refused_summary(scenario, error)

    def _gains(self, scenario: Scenario, gains: Gains | None) -> Gains | None:
        """As `chosen_gains`, designed once for a robot and a macro-step."""
        if gains is not None or scenario.control == "kinematic":
            return gains
        key = (known_robot(scenario).hash, scenario.macro_step)
        if key not in self._designs:
            self._designs[key] = chosen_gains(scenario)
        return self._designs[key]

    def _plant(self, plan: Plan, controller: Fmu, fmu: Path | None) -> tuple[Fmu, NativeMaster]:
        """A given FMU or that of the plan's robot, wired to the controller."""
        name = plan.scenario.robot
        bristles = (
            plan.robot.friction.law == "bristle" or "friction.law" in plan.scenario.parameters
        )
        columns = None if self._everything else metric_columns(bristles=bristles)
        key = name if fmu is None else fmu, columns
        if key not in self._masters:
            path = fmu or export_fmu(load_robot(name), self._folder / f"{len(self._masters)}.fmu")
            plant = self._open.enter_context(Fmu(path))
            judged = metric_columns(bristles=True)
            self._masters[key] = (
                plant,
                NativeMaster(plant, controller, columns=columns, judged=judged),
            )
        return self._masters[key]

    def _told_controller(self, plan: Plan) -> Fmu:
        """The controller FMU with the parameters of the plan's."""
        setup = plan.controller
        if self._controller is None:
            path = self._given_controller or export_controller(
                setup, self._folder / "controller.fmu"
            )
            self._controller = self._open.enter_context(Fmu(path, name="controller"))
        self._controller.reset()
        if self._told is None or self._told[0] != setup:
            self._told = setup, self._controller.parameter_blocks(controller_parameters(setup))
        self._controller.set_blocks(self._told[1])
        return self._controller

    def _settings(self, plant: Fmu, robot: Robot) -> dict[str, float]:
        """What the plant, just reset, has to be told to be this robot; remembered for some."""
        key = plant.path, robot
        if key not in self._changes:
            if len(self._changes) >= REMEMBERED:
                self._changes.clear()
            self._changes[key] = different_settings(plant, robot)
        return self._changes[key]

    def close(self) -> None:
        """Frees the FMUs; harmless when called twice."""
        self._masters.clear()
        self._told = None
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
