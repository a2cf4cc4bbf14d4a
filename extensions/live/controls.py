"""The controllers of a live robot: the controller FMU, which all built-in controls share, and a
user's one.
"""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from hexapod_cosim.controller import BodyCommand, Gains, Measurement
from hexapod_cosim.cosim.common.closing import Closing
from hexapod_cosim.cosim.control.controllers import make_controller
from hexapod_cosim.cosim.control.fmu_law import FmuLaw, law_of_ours
from hexapod_cosim.cosim.export.controller_export import export_controller
from hexapod_cosim.cosim.interface.controller_interface import (
    ControllerSetup,
    controller_parameters,
)
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.master.loop import JointController
from hexapod_cosim.cosim.run.single_run import RunPlan
from hexapod_cosim.cosim.scenario.controls import control_of

HORIZON = 1e6  # s    stop time of the FMUs
REST = BodyCommand()


class Controls(Closing):
    """Starts controllers and changes the controller FMU; a context manager that frees them.

    Args:
        folder: where the controller FMU is exported to.
        gains: of the built-in controls; None where kinematic control alone is used.
    """

    def __init__(self, folder: Path, gains: Gains | None) -> None:
        self._folder, self._gains = folder, gains
        self._open = ExitStack()
        self._law = self._open.enter_context(ExitStack())  # of a user's control
        self._built_in: Fmu | None = None

    def start(self, plan: RunPlan, time: float, measurement: Measurement) -> JointController:
        """Returns the controller of a plan, which begins at a time [s] in the stance.

        Raises what a user's controller raises.
        """
        self._law.close()
        if control_of(plan.scenario.control).is_builtin:
            return self._start_built_in(plan.controller, time)
        controller = self._law.enter_context(make_controller(plan))
        controller.start(time, HORIZON, REST, measurement)
        return controller

    def _start_built_in(self, setup: ControllerSetup, time: float) -> FmuLaw:
        """Returns the controller FMU with the set-up's parameters, and gains for each control."""
        known = replace(setup, gains=setup.gains or self._gains)
        control = {"control": controller_parameters(setup)["control"]}
        if self._built_in is None:
            path = export_controller(setup, self._folder / "controller.fmu")
            self._built_in = self._open.enter_context(Fmu(path, name="controller"))
        self._built_in.reset()
        self._built_in.set_parameters(controller_parameters(known) | control)
        self._built_in.initialise(time, HORIZON)
        return law_of_ours(self._built_in, period=setup.period)

    def change_control(self, setup: ControllerSetup) -> None:
        """Lets the controller FMU go on under the control of a set-up."""
        self._change({"control": controller_parameters(setup)["control"]})

    def change_gait(self, setup: ControllerSetup) -> None:
        """Lets the controller FMU go on with the gait of a set-up."""
        given = controller_parameters(setup)
        self._change({name: value for name, value in given.items() if name.startswith("gait.")})

    def _change(self, parameters: dict[str, float]) -> None:
        assert self._built_in is not None
        self._built_in.set_parameters(parameters)

    def close(self) -> None:
        """Frees the controllers."""
        self._open.close()


def differ_in_control(present: RunPlan, then: RunPlan) -> bool:
    """Returns whether two plans have built-in controls and differ in control, gait and friction at
    most, so that the controller FMU can exchange the control.
    """
    now, next_one = present.controller, then.controller
    robot = replace(next_one.robot, friction=now.robot.friction)
    same = replace(now, gains=next_one.gains, law=next_one.law, gait=next_one.gait)
    both = present.scenario, then.scenario
    built_in = all(control_of(scenario.control).is_builtin for scenario in both)
    return built_in and replace(next_one, robot=robot) == same


def differ_in_gait(present: RunPlan, then: RunPlan) -> bool:
    """Returns whether a plan with a built-in control differs from another in gait and friction at
    most, so that the controller FMU can change the gait.
    """
    now, next_one = present.controller, then.controller
    robot = replace(next_one.robot, friction=now.robot.friction)  # a change of friction is late
    built_in = control_of(present.scenario.control).is_builtin
    return built_in and replace(next_one, gait=now.gait, robot=robot) == now
