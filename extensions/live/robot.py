"""A robot whose plant and controller are stepped one macro-step at a time, and changed meanwhile.

The steps are those of `cosim/master/loop.py`, so a walk from the start repeats under
`hexapod simulate` bit for bit. The built-in controls are the controller FMU; all others run as in
`simulate`. README.md, "What changes while the robot walks", describes each change.

A controller that raises an exception, ends the program or commands a value that the plant refuses
is replaced by the last joint commands that the plant accepted.
"""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace

import numpy as np

from hexapod_cosim.controller import BodyCommand, ControllerError, Gains, Gait, JointCommand
from hexapod_cosim.cosim.common.temporary import Closing, TemporaryFolder
from hexapod_cosim.cosim.control.controllers import make_controller
from hexapod_cosim.cosim.control.fmu_law import FmuLaw, law_of_ours
from hexapod_cosim.cosim.export.plant import export_controller
from hexapod_cosim.cosim.interface.controller import controller_parameters
from hexapod_cosim.cosim.interface.names import JOINTS, LEGS
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.master.fmu_block import StepError
from hexapod_cosim.cosim.master.loop import JointController, macro_step
from hexapod_cosim.cosim.master.sensors import errors_of
from hexapod_cosim.cosim.master.signals import SERVOS, Signals
from hexapod_cosim.cosim.results.window import robot_weight
from hexapod_cosim.cosim.run.plan import RunPlan, make_plan
from hexapod_cosim.cosim.run.plant import PlantFmus, apply_settings, initialise_plant
from hexapod_cosim.cosim.scenario.controls import control_of
from hexapod_cosim.extensions.live.messages import Change
from hexapod_cosim.extensions.live.recording import Force
from hexapod_cosim.extensions.live.settings import (
    Choices,
    GaitChange,
    Limits,
    Settings,
    find_limits,
    gait_of,
    plan_change,
)
from hexapod_cosim.models import LEG_NAMES, HexapodError

HORIZON = 1e6  # s    stop time of the FMUs
MOST_WEIGHTS = 3.0  # body weights    largest push


class LiveRobot(Closing):
    """Steps a robot; a context manager that frees its FMUs.

    Args:
        choices: the scenario and the changes that are allowed.
        gains: of the built-in controls; they are needed unless kinematic control alone is allowed.

    Attributes:
        settings: the settings that hold.
        limits: the largest commands.
        count: macro-steps since the robot was placed.
        fault: why a controller was replaced or the plant has stopped; "" without a fault.
        stopped: whether the plant has refused a step; only `place` helps.
        weight: of the robot [N].
        signals: the plant's variables as of now.
        advance: steps the plant from t [s] by h [s]; `realtime.py` puts a clock around it.
    """

    settings: Settings
    limits: Limits
    signals: Signals

    def __init__(self, choices: Choices, *, gains: Gains | None = None) -> None:
        self.choices, self._gains = choices, gains
        self._open = ExitStack()
        self._folder = self._open.enter_context(TemporaryFolder("live"))
        self._law = self._open.enter_context(ExitStack())  # a controller of the user
        self._built_in: Fmu | None = None
        try:
            path = PlantFmus(self._folder).fmu(choices.scenario.robot)
            self._plant = self._open.enter_context(Fmu(path))
            self.advance = self._plant.step
            self._begin(choices.first())
            if self.fault:
                raise ControllerError(self.fault)
            for gait in choices.gaits:  # now, because finding them takes longer than a macro-step
                scenario = choices.scenario_with(replace(self.settings, gait=gait))
                find_limits(self.plan.controller.robot, gait_of(scenario))
        except BaseException:
            self._open.close()
            raise

    @property
    def h(self) -> float:
        """The macro-step [s]."""
        return self.plan.scenario.macro_step

    @property
    def time(self) -> float:
        """Returns the simulated time [s]."""
        return self.plan.scenario.start + self.h * self.count

    @property
    def wanted(self) -> Settings:
        """Returns the settings that hold when all changes are made."""
        if self._pending is None:
            return self.settings
        return replace(self.settings, gait=self._pending[1].name)

    def place(self, settings: Settings | None = None) -> None:
        """Places the robot at its start, standing, under settings: given or wanted ones.

        Raises HexapodError for settings under which it cannot start; it is then placed under
        those that held before.
        """
        before = self.settings
        try:
            self._begin(settings or self.wanted)
        except HexapodError:
            self._begin(before)
            raise

    def _begin(self, settings: Settings) -> None:
        """Starts plant and controller anew. Raises HexapodError."""
        self.plan = self._plan_of(settings)
        scenario = self.plan.scenario
        self.count, self.settings = 0, settings
        self.fault, self.stopped = "", False
        # a change of gait: its plan, the next gait, and the macro-step of the request
        self._pending: tuple[GaitChange, Gait, int] | None = None
        self._plant.reset()
        apply_settings(self._plant, self.plan.robot)
        endless = replace(self.plan, scenario=replace(scenario, duration=HORIZON))
        self.parameters = initialise_plant(self._plant, endless)
        self.weight = robot_weight(self.parameters)
        self.signals = Signals(self._plant, errors=errors_of(scenario, self.plan.schedule))
        self.signals.read()
        self._servos = np.zeros(len(SERVOS))
        self._last = JointCommand(angle_ref=self.signals.measurement.angle.copy())
        self._start_controller()

    def toggle_leg(self, leg: int) -> str:
        """Makes all servos of a leg limp, or healthy again; returns which, in a sentence."""
        weakness = self._servos[: LEGS * JOINTS].reshape(LEGS, JOINTS)
        weakness[leg] = 1.0 - weakness[leg]
        return f"Leg {LEG_NAMES[leg]} {'is limp' if weakness[leg, 0] else 'works again'}."

    @property
    def absent(self) -> tuple[int, ...]:
        """The legs that the controller walks without."""
        shown = getattr(self._controller, "diagnostics", None)
        return tuple(np.flatnonzero(getattr(shown, "absent", ())).tolist())

    @property
    def limp(self) -> tuple[int, ...]:
        """The legs that are limp."""
        return tuple(np.flatnonzero(self._servos[: LEGS * JOINTS : JOINTS]).tolist())

    def change(self, change: Change) -> None:
        """Begins a change of the settings. Raises HexapodError, and then leaves all as it was."""
        wanted = self.choices.changed(self.wanted, change)
        if wanted == self.wanted:
            return
        plan = self._plan_of(wanted)
        if self.stopped or change.key == "ground":
            self.place(wanted)
        elif change.key == "friction":
            self._plant.set_parameters({"friction.mu": wanted.friction})
            self.settings, self.plan = replace(self.settings, friction=wanted.friction), plan
        elif self.fault or not _can_go_on(self.plan, plan):
            self.place(wanted)
        elif change.key == "control":
            self._tune(plan, "control")
            self.settings, self.plan = replace(self.settings, control=wanted.control), plan
        else:
            self._request_gait(plan)

    def _plan_of(self, settings: Settings) -> RunPlan:
        scenario = self.choices.scenario_with(settings)
        return make_plan(scenario, gains=self._gains if _is_built_in(scenario.control) else None)

    def _tune(self, plan: RunPlan, prefix: str) -> None:
        """Sets the parameters of the controller FMU whose names begin with a prefix."""
        assert self._built_in is not None
        given = controller_parameters(plan.controller)
        self._built_in.set_parameters(
            {name: value for name, value in given.items() if name.startswith(prefix)}
        )

    def _request_gait(self, plan: RunPlan) -> None:
        """Begins to walk slowly, for a change to the gait of a plan."""
        setup = plan.controller
        change = plan_change(setup.robot, self._gait, setup.gait)
        self.plan, self._pending = plan, (change, setup.gait, self.count)
        self.limits = change.limits.least(self.limits)

    def _follow_change(self) -> None:
        """Does what is due of a change of gait."""
        if self._pending is None or self.fault:
            return
        change, gait, since = self._pending
        passed = self.count - since
        if passed == round(change.begin / self.h):
            self._tune(self.plan, "gait.")
            self._gait, self.settings = gait, replace(self.settings, gait=gait.name)
        if passed == round(change.end / self.h):
            self.limits, self._pending = find_limits(self.plan.controller.robot, self._gait), None

    def _start_controller(self) -> None:
        """Makes the controller of the plan; one that cannot start is a fault."""
        setup = self.plan.controller
        self._gait, self.limits = setup.gait, find_limits(setup.robot, setup.gait)
        try:
            self._controller = self._make_controller()
        except (Exception, SystemExit) as error:  # of a user's controller
            self.fault = _text_of(error)

    def _make_controller(self) -> JointController:
        """Returns the controller of the plan, which begins at the present time in the stance."""
        self._law.close()
        if _is_built_in(self.plan.scenario.control):
            return self._start_built_in()
        controller = self._law.enter_context(
            make_controller(self.plan.scenario, self.plan.controller)
        )
        if isinstance(controller, FmuLaw):
            controller.start(self.time, HORIZON, BodyCommand(), self.signals.measurement)
        return controller

    def _start_built_in(self) -> FmuLaw:
        """Returns the controller FMU with the plan's parameters, and gains for each control."""
        setup = self.plan.controller
        parameters = controller_parameters(replace(setup, gains=setup.gains or self._gains))
        parameters["control"] = controller_parameters(setup)["control"]
        if self._built_in is None:
            path = export_controller(setup, self._folder / "controller.fmu")
            self._built_in = self._open.enter_context(Fmu(path, name="controller"))
        self._built_in.reset()
        self._built_in.set_parameters(parameters)
        self._built_in.initialise(self.time, HORIZON)
        return law_of_ours(self._built_in, period=setup.period)

    def step(self, command: BodyCommand, force: Force) -> None:
        """Makes one macro-step under a body command and a force on the torso [N], world axes.

        Does nothing once the plant has stopped.
        """
        if self.stopped:
            return
        self._follow_change()
        self.signals.push[:3] = force
        try:
            self.signals.set_servos(self._servos)
            self._advance(command)
            self.count += 1
        except HexapodError as error:
            self.fault, self.stopped = str(error), True

    def _advance(self, command: BodyCommand) -> None:
        """Makes a macro-step under the controller's joint commands; after a fault, under the last
        that were accepted. Raises FmuError.
        """
        if not self.fault:
            try:
                joints = self._controller.step(self.time, command, self.signals.measurement)
                macro_step(self.advance, self.signals, joints, self.time, self.h)
            except StepError:
                raise
            except (Exception, SystemExit) as error:  # a user's controller may raise anything
                self.fault = _text_of(error)
            else:
                # copies, because a controller may write its next commands into the same arrays
                angle, torque = joints.angle_ref.copy(), joints.torque_ref.copy()
                self._last = JointCommand(angle_ref=angle, torque_ref=torque)
                return
        macro_step(self.advance, self.signals, self._last, self.time, self.h)

    def close(self) -> None:
        """Frees the FMUs."""
        self._open.close()


def _is_built_in(control: str) -> bool:
    return control_of(control).is_builtin


def _can_go_on(present: RunPlan, then: RunPlan) -> bool:
    """Returns whether the controller FMU can go on: both controls are built-in ones, and the plans
    differ in control, gait and friction at most.
    """
    now, after = present.controller, then.controller
    robot = replace(after.robot, friction=now.robot.friction)
    same = replace(after, robot=robot, gains=now.gains, law=now.law, gait=now.gait)
    both = (present.scenario.control, then.scenario.control)
    return all(map(_is_built_in, both)) and same == now


def _text_of(error: BaseException) -> str:
    """Returns what happened in a controller, in a sentence."""
    return str(error) if isinstance(error, HexapodError) else f"{type(error).__name__}: {error}"
