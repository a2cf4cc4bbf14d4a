"""A robot whose plant and controller are stepped one macro-step at a time, and changed meanwhile.

The steps are those of `cosim/master/loop.py`: read outputs, call the controller, set inputs, step.
So a walk from the start repeats under `hexapod simulate` bit for bit. The built-in controls are the
controller FMU; all others run as in `simulate`.

Changes while the robot walks:

- friction: the plant begins again in its present pose and motion, on ground of the new friction.
  Bristles of the friction laws and the measures of work and slip begin at zero.
- gait: the built-in controller changes it without a stop (`gait_change.py`).
- control, from a built-in one to another: it goes on in the present phase of the walk at once.
- control, from or to a user's one, and the gait of a user's control: the robot stops, as the
  present controller stops it, and the next controller begins in the stance; over FADE the joint
  commands pass from the old ones to the new ones.
- ground: the robot is placed at its start on the new ground.

A controller that raises an exception, ends the program or commands a value that the plant refuses
is replaced by one that holds the joints where they were commanded to be last.
"""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace

from hexapod_cosim.controller import BodyCommand, ControllerError, Gains, JointCommand
from hexapod_cosim.cosim.common.closing import Closing
from hexapod_cosim.cosim.common.temporary import TemporaryFolder
from hexapod_cosim.cosim.master.fmu import Fmu, StepError
from hexapod_cosim.cosim.master.loop import JointController, macro_step
from hexapod_cosim.cosim.master.sensors import errors_of
from hexapod_cosim.cosim.master.signals import Signals
from hexapod_cosim.cosim.results.walk import robot_weight
from hexapod_cosim.cosim.run.preparation import PlantFmus
from hexapod_cosim.cosim.run.single_run import (
    RunPlan,
    apply_settings,
    initialise_plant,
    make_plan,
)
from hexapod_cosim.cosim.scenario.controls import control_of
from hexapod_cosim.extensions.live.controls import (
    HORIZON,
    REST,
    Controls,
    differ_in_control,
    differ_in_gait,
)
from hexapod_cosim.extensions.live.fault import text_of
from hexapod_cosim.extensions.live.gait_change import GaitChange, begin_change
from hexapod_cosim.extensions.live.protocol import Change
from hexapod_cosim.extensions.live.settings import Choices, Limits, Settings, find_limits, gait_of
from hexapod_cosim.extensions.live.take import Force
from hexapod_cosim.extensions.live.takeover import Stop, blend
from hexapod_cosim.models import FmuError, HexapodError

FADE = 0.4  # s    from the joint commands of one controller to those of the next
PATIENCE = 4.0  # gait periods    after which the controller is changed although the robot moves
STATE = "initial."  # prefix of the plant's parameters for the state at the start
MOST_WEIGHTS = 3.0  # body weights    largest push


class LiveRobot(Closing):
    """Steps a robot; a context manager that frees its FMUs.

    Args:
        choices: the scenario and the changes that are allowed.
        gains: of the built-in controls; they are needed unless kinematic control alone is allowed.

    Attributes:
        settings: the settings that hold.
        wanted: the settings that are being changed to; None while nothing is changed.
        limits: the largest commands.
        count: macro-steps since the robot was placed.
        fault: why a controller was replaced or the plant has stopped; "" without a fault.
        stopped: whether the plant has refused a step; only `place` helps.
        weight: of the robot [N].
        advance: steps the plant from t [s] by h [s]; `realtime.py` puts a clock around it.
    """

    def __init__(self, choices: Choices, *, gains: Gains | None = None) -> None:
        self.choices, self._gains = choices, gains
        self._open = ExitStack()
        self._folder = self._open.enter_context(TemporaryFolder("live"))
        self._controls = self._open.enter_context(Controls(self._folder, gains))
        self.wanted: Settings | None = None
        self._from = JointCommand()  # that the present controller is faded in from
        self.limits: Limits
        self._gait_change: GaitChange | None = None
        self._command, self._since = REST, 0  # of the last macro-step, and the one it began at
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
    def time(self) -> float:
        """Returns the simulated time [s]."""
        scenario = self.plan.scenario
        return scenario.start + scenario.macro_step * self.count

    @property
    def signals(self) -> Signals:
        """The plant's variables as of now."""
        return self._signals

    # ------------------------------------------------------------------------------- changes

    def place(self, settings: Settings | None = None) -> None:
        """Places the robot at its start, standing, under settings: given, wanted or present ones.

        Raises HexapodError for settings under which it cannot start; it is then placed under
        those that held before.
        """
        before = self.settings
        try:
            self._begin(settings or self.wanted or self.settings)
        except HexapodError:
            self._begin(before)
            raise

    def _begin(self, settings: Settings) -> None:
        """Starts plant and controller anew. Raises HexapodError."""
        self.plan = self._plan_of(settings)
        scenario = self.plan.scenario
        self.count, self.settings, self.wanted = 0, settings, None
        self.fault, self.stopped = "", False
        self._gait_change, self._command, self._since = None, REST, 0
        self._plant.reset()
        apply_settings(self._plant, self.plan.robot)
        endless = replace(self.plan, scenario=replace(scenario, duration=HORIZON))
        parameters = initialise_plant(self._plant, endless)
        self.weight = robot_weight(parameters)
        self.parameters = parameters
        self._signals = Signals(self._plant, errors=errors_of(scenario, self.plan.schedule))
        self._signals.read()
        self._last = JointCommand(angle_ref=self._signals.measurement.angle.copy())
        self._fading = 0
        self._try_controller()

    def change(self, change: Change) -> None:
        """Begins a change of the settings. Raises HexapodError, and then leaves all as it was."""
        before = self.wanted or self.settings
        wanted = self.choices.changed(before, change)
        if wanted == before:
            return
        plan = self._plan_of(wanted)
        if change.key == "ground" or self.stopped:
            self.place(wanted)
        elif change.key == "friction":
            self._change_friction(wanted, plan)
        elif change.key == "control" and self._can_exchange(plan):
            self._exchange(wanted, plan)
        elif self._can_walk_on(wanted, plan):
            self.wanted, self._next = wanted, plan
            self._begin_gait_change()
        else:
            self.wanted, self._next, self._gait_change = wanted, plan, None
            self._stop = Stop(self._steps_of(0.5 * self._period), self._steps_of(self._patience))

    @property
    def halts(self) -> bool:
        """Whether the robot stops, because a change needs a stand."""
        return self.wanted is not None and self._gait_change is None

    def _plan_of(self, settings: Settings) -> RunPlan:
        scenario = self.choices.scenario_with(settings)
        built_in = control_of(scenario.control).is_builtin
        return make_plan(scenario, gains=self._gains if built_in else None)

    def _can_exchange(self, plan: RunPlan) -> bool:
        """Whether the controller FMU can go on under the control of a plan.

        It can from one built-in control to another, while no other change needs a stand.
        """
        return not self.halts and not self.fault and differ_in_control(self.plan, plan)

    def _exchange(self, wanted: Settings, plan: RunPlan) -> None:
        """Lets the controller FMU go on under another control."""
        self._controls.change_control(plan.controller)
        self.settings = replace(self.settings, control=wanted.control)
        if self.wanted is None:
            self.plan = plan
            return
        self.wanted, self._next = wanted, plan
        self.plan = self._plan_of(self.settings)

    def _can_walk_on(self, wanted: Settings, plan: RunPlan) -> bool:
        """Whether the gait alone changes, and the controller FMU can change it."""
        alone = wanted == replace(self.settings, gait=wanted.gait)
        return alone and not self.fault and differ_in_gait(self.plan, plan)

    def _begin_gait_change(self) -> None:
        """Slows down for the change to the gait of the next plan."""
        now, then = self.plan.controller, self._next.controller
        self._gait_change = begin_change(
            now.gait,
            then.gait,
            limits=(
                self.limits,
                find_limits(now.robot, now.gait),
                find_limits(then.robot, then.gait),
            ),
            command=self._command,
            held=(self.count - self._since) * self._h,
            h=self._h,
        )
        self.limits = self._gait_change.limits

    def _go_on_with(self, change: GaitChange) -> None:
        """Makes what is due of a change of gait."""
        setup = self._next.controller
        if change.tell == 0:
            self._controls.change_gait(setup)
            self._period, self._patience = setup.gait.period, PATIENCE * setup.gait.period
        if change.hold == 0:
            assert self.wanted is not None
            self.settings, self.wanted, self.plan = self.wanted, None, self._next
        if change.end == 0:
            self.limits, self._gait_change = find_limits(setup.robot, setup.gait), None
        change.advance()

    def _change_friction(self, wanted: Settings, plan: RunPlan) -> None:
        """Starts the plant again in its present state with another friction."""
        self.settings = replace(self.settings, friction=wanted.friction)
        if self.wanted is not None:
            self.wanted, self._next = wanted, plan
        friction = plan.robot.friction
        self.plan = replace(
            self.plan,
            scenario=self.choices.scenario_with(self.settings),
            robot=replace(self.plan.robot, friction=friction),
        )
        state = self._state()
        self._plant.reset()
        apply_settings(self._plant, self.plan.robot)
        self._plant.set_parameters({**self.plan.scenario.parameters, **state})
        self._plant.initialise(self.time, HORIZON)
        self._signals.read()

    def _state(self) -> dict[str, float]:
        """Returns the plant's pose and motion as the parameters of a start."""
        present = dict(zip(self._signals.names, self._signals.values.tolist(), strict=True))
        own = {
            name: name.removeprefix(STATE)
            for name in self._plant.variables
            if name.startswith(STATE)
        }
        return {
            name: present[key if key in present else f"torso.{key}"] for name, key in own.items()
        }

    def _try_controller(self) -> None:
        """Starts the controller; one that cannot start is a fault, and the joints hold."""
        try:
            self._start_controller()
        except BaseException as error:  # of a user's controller
            self.fault = text_of(error)

    def _start_controller(self) -> None:
        """Makes the controller of the plan, which begins at the present time in the stance."""
        setup = self.plan.controller
        self.limits = find_limits(setup.robot, setup.gait)
        self._period = setup.gait.period
        self._patience = PATIENCE * self._period
        self._controller: JointController = self._controls.start(
            self.plan, self.time, self._signals.measurement
        )

    # ------------------------------------------------------------------------------- steps

    def step(self, command: BodyCommand, force: Force) -> None:
        """Makes one macro-step under a body command and a force on the torso [N], world axes.

        Does nothing once the plant has stopped.
        """
        if self.stopped:
            return
        if command != self._command:
            self._command, self._since = command, self.count
        if self._gait_change is not None and not self.fault:
            self._go_on_with(self._gait_change)
        elif self.wanted is not None:
            command = REST
            if self.fault or self._stop.reached(self._last.angle_ref):
                self._take_over()
        self._signals.push[:3] = force
        try:
            self._advance(self._joints(command))
            self.count += 1
        except HexapodError as error:
            self.fault, self.stopped = str(error), True

    def _advance(self, joints: JointCommand) -> None:
        """Makes a macro-step under joint commands, or under those that hold if the plant refuses
        them. Raises FmuError.
        """
        try:
            macro_step(self.advance, self._signals, joints, self.time, self._h)
        except FmuError as error:
            if self.fault or isinstance(error, StepError):
                raise
            self.fault = str(error)
            joints = self._holding()
            macro_step(self.advance, self._signals, joints, self.time, self._h)
        # copies, because a controller may write its next commands into the same arrays
        angle, torque = joints.angle_ref.copy(), joints.torque_ref.copy()
        self._last = JointCommand(angle_ref=angle, torque_ref=torque)

    def _joints(self, command: BodyCommand) -> JointCommand:
        """Returns the joint commands of the controller; after a fault, those that hold."""
        if self.fault:
            return self._last
        try:
            found = self._controller.step(self.time, command, self._signals.measurement)
        except BaseException as error:  # a user's controller may raise anything
            self.fault = text_of(error)
            return self._holding()
        if self._fading > 0:
            share = 1.0 - self._fading / self._steps_of(FADE)
            self._fading -= 1
            found = blend(self._from, found, share, self._steps_of(FADE) * self._h)
        return found

    def _holding(self) -> JointCommand:
        """Returns commands that keep the joints where they were commanded to be last.

        Servos that follow a torque alone keep their last torque: they have no angle to hold.
        """
        torque = self.plan.robot.servo.mode == "torque"
        held = JointCommand(angle_ref=self._last.angle_ref.copy())
        if torque:
            held.torque_ref[...] = self._last.torque_ref
        return held

    def _take_over(self) -> None:
        """Lets the next controller begin, faded in from the last joint commands."""
        assert self.wanted is not None
        self._gait_change = None
        self._from, self._fading = self._holding(), self._steps_of(FADE)
        self.settings, self.wanted, self.plan, self.fault = self.wanted, None, self._next, ""
        self._last = self._from
        self._try_controller()

    @property
    def _h(self) -> float:
        return self.plan.scenario.macro_step

    def _steps_of(self, seconds: float) -> int:
        return max(round(seconds / self._h), 1)

    def close(self) -> None:
        """Frees the FMUs."""
        self._open.close()
