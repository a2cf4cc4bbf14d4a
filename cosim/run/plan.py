"""Plans runs: robot, walk, controller, schedule and drawn numbers, before any FMU is opened."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from types import NoneType

from hexapod_cosim.controller import Gains, GainsError, Gait, make_gait
from hexapod_cosim.cosim.interface.controller import ControllerSetup
from hexapod_cosim.cosim.run.designs import designed_gains
from hexapod_cosim.cosim.run.gait_selection import GaitSelection, select_gait
from hexapod_cosim.cosim.scenario.checks import check_servo_faults
from hexapod_cosim.cosim.scenario.controls import control_of
from hexapod_cosim.cosim.scenario.reach import check_commands
from hexapod_cosim.cosim.scenario.reading import scenario_robot
from hexapod_cosim.cosim.scenario.records import CONTROLS, Scenario
from hexapod_cosim.cosim.scenario.schedule import Schedule, make_schedule
from hexapod_cosim.cosim.scenario.variation import Drawn, delayed, draw
from hexapod_cosim.models import Robot, unknown_name
from hexapod_cosim.models.errors import check_type


@dataclass(frozen=True, kw_only=True)
class RunPlan:
    """All parts of a run that do not depend on a plant FMU."""

    scenario: Scenario
    robot: Robot  # the plant's, in the stance of the walk
    selection: GaitSelection
    controller: ControllerSetup
    schedule: Schedule
    drawn: Drawn | None  # None: nothing is varied


def check_arguments(scenario: Scenario, fmu: Path | None, gains: Gains | None) -> None:
    """Raises HexapodError for an argument of a run that has another type."""
    check_type(scenario, Scenario, "a Scenario, as of load_scenario()", where="scenario")
    check_type(fmu, (str, Path, NoneType), "the path of an FMU", where="fmu")
    check_type(gains, (Gains, NoneType), "gains, as of load_gains()", where="gains")


def make_plan(scenario: Scenario, *, gains: Gains | None = None) -> RunPlan:
    """Returns the plan of a scenario.

    Raises HexapodError for commands that the legs do not reach and where no gains can be designed.
    """
    own = scenario_robot(scenario)
    check_servo_faults(scenario, own)
    selection = select_gait(scenario, own, gains)
    robot, gait = selection.robot, selection.gait
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
        robot=selection.standing(own),
        selection=selection,
        controller=setup,
        schedule=make_schedule(timed),
        drawn=drawn,
    )


def chosen_gains(scenario: Scenario, given: Gains | None = None) -> Gains | None:
    """Returns the gains that a scenario runs with, None unless its control needs gains.

    They are the given ones, or else designed for its robot and macro-step; those in [gains] of the
    scenario replace them. Raises GainsError when no gains can be designed, HexapodError for a robot
    that cannot be read.
    """
    control = control_of(scenario.control)
    if not control.is_builtin or control.name == "kinematic":
        return None
    gains = designed_gains(*design_key(scenario)) if given is None else given
    changes = {
        part: replace(getattr(gains, part), **dict(values))
        for part, values in scenario.gains.items()
    }
    return replace(gains, **changes) if changes else gains


def law_of(control: str) -> str:
    """Returns the law of a built-in controller with gains, from the text of a control.

    Kinematic control has no gains and uses no law.
    """
    named = control_of(control)
    return "paper" if named.is_builtin and named.name == "paper" else "compliant"


def design_key(scenario: Scenario) -> tuple[Robot, float]:
    """Returns the robot, in its stance, and the period [s] that gains are designed for.

    Scenarios with equal keys share gains. Raises HexapodError for a robot that cannot be read.
    """
    return select_gait(scenario).robot, scenario.macro_step


def make_setup(
    robot: Robot,
    *,
    control: str,
    period: float,
    gait: str | Gait | None = None,
    gains: Gains | None = None,
) -> ControllerSetup:
    """Returns the controller's set-up as `simulate` would make it.

    Args:
        control: "kinematic", "paper" or "compliant".
        period: controller period [s].
        gait: a gait or its name; by default the gait of the robot file.
        gains: gains of paper or compliant control; by default they are designed for the robot.

    Raises:
        HexapodError: the control or the gait is unknown.
        GainsError: gains are given for kinematic control, or none can be designed.
    """
    if control not in CONTROLS:
        raise unknown_name("control", control, CONTROLS)
    walked = gait if isinstance(gait, Gait) else make_gait(robot, gait)
    setup = ControllerSetup(robot=robot, gait=walked, period=period)
    setup.build()  # refuses an impossible set-up before gains are designed
    if control == "kinematic":
        if gains is not None:
            raise GainsError(
                "gains for kinematic control, which has none",
                got=control,
                expected="paper or compliant",
                fix="leave out the gains",
            )
        return setup
    chosen = designed_gains(robot, period) if gains is None else gains
    return replace(setup, gains=chosen, law=control)
