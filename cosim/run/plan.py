"""Plans runs: robot, walk, controller, schedule and drawn numbers, before any FMU is opened."""

from __future__ import annotations

from dataclasses import dataclass, replace

from hexapod_cosim.controller import Gains
from hexapod_cosim.cosim.interface.controller import ControllerSetup
from hexapod_cosim.cosim.run.gait_selection import GaitSelection, select_gait
from hexapod_cosim.cosim.run.preparation import chosen_gains, law_of
from hexapod_cosim.cosim.scenario.checks import check_servo_faults
from hexapod_cosim.cosim.scenario.controls import control_of
from hexapod_cosim.cosim.scenario.reach import check_commands
from hexapod_cosim.cosim.scenario.reading import scenario_robot
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.cosim.scenario.schedule import Schedule, make_schedule
from hexapod_cosim.cosim.scenario.variation import (
    Drawn,
    delayed,
    draw,
)
from hexapod_cosim.models import Robot


@dataclass(frozen=True, kw_only=True)
class RunPlan:
    """All parts of a run that do not depend on a plant FMU."""

    scenario: Scenario
    robot: Robot  # the plant's, in the stance of the walk
    selection: GaitSelection
    controller: ControllerSetup
    schedule: Schedule
    drawn: Drawn | None  # None: nothing is varied


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
