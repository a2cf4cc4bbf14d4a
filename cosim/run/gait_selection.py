"""Chooses gait and stance of a run: those that its scenario names, or else those of its control.

A scenario that names a gait (`gait.name`, `gait.period`, `gait.duty`) or a stance (`walk.stance`)
has chosen the walk of every control; what it leaves out is the robot's own. Otherwise kinematic and
paper control and all controls of the user walk as the robot file says, but the plant stands in the
stance of a controller FMU that has one (parameters `{leg}.{joint}.stance`), and its gait is that of
the FMU's parameters. Compliant control walks an amble at the height of the stance of least heat,
with its feet a part of the way from the robot's own stance to that one: the whole way would give up
too much footing on uneven ground. The feet step to the stance of least heat when the robot is
heavier than its model (C53). Where the legs do not reach the commands or the step height in this
walk, or the joints are not fast enough, it keeps the robot's own gait, and then its own stance as
well. Any control can be asked to walk so, by `walk.stance = "chosen"` or as kinematic@chosen, and
compliant control to walk as the robot file says (compliant@own).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from hexapod_cosim.controller import BodyCommand, Gains, GainsError, Gait, make_gait
from hexapod_cosim.cosim.control.fmu_law import stance_and_gait
from hexapod_cosim.cosim.design.stance import (
    SPEED_SHARE,
    Motion,
    StanceChange,
    find_stance,
    settled_motion,
    with_stance,
)
from hexapod_cosim.cosim.export.robot_package import SPEED
from hexapod_cosim.cosim.results.facts import OF_FMU, OWN_CONTROLLER, GaitChoice
from hexapod_cosim.cosim.run.designs import kept_stance
from hexapod_cosim.cosim.scenario.controls import FMU, control_of
from hexapod_cosim.cosim.scenario.reach import reaches
from hexapod_cosim.cosim.scenario.reading import scenario_robot
from hexapod_cosim.cosim.scenario.records import CHOSEN, DESIGNED, OWN, Command, Scenario
from hexapod_cosim.models import ReachError, Robot, ScenarioError, Servo, load_robot
from hexapod_cosim.models.arrays import Vector3

CHOSEN_GAIT = "amble"  # of compliant control
FOOTING = 0.4  # 1    of the way to the stance of least heat by which feet move to the hips
GIVEN = "given"  # a stance that a scenario gives as two lengths
BY_SCENARIO, BY_CONTROL, BY_ROBOT = "scenario", "control", "robot file"


@dataclass(frozen=True, kw_only=True)
class GaitSelection:
    """Gait and stance of a run."""

    robot: Robot  # as the controller knows it, in the stance
    gait: Gait
    stance: str  # OWN, DESIGNED, GIVEN as two lengths, CHOSEN by the control, or OF_FMU
    # m  by which the feet stand further out from the hips than the robot's; 0 for OF_FMU
    outward: float = 0.0
    deeper: float = 0.0  # m    and deeper below them
    chosen_by: str = BY_SCENARIO

    def as_facts(self) -> GaitChoice:
        """Returns gait and stance for run.json."""
        return GaitChoice(
            gait=self.gait.name,
            period=self.gait.period,
            duty=self.gait.duty,
            stance=self.stance,
            outward=self.outward,
            deeper=self.deeper,
            narrowing=self.gait.narrowing,
            chosen_by=self.chosen_by,
        )

    def standing(self, own: Robot) -> Robot:
        """Returns the plant's robot in the stance."""
        return own if self.stance == OWN else replace(own, legs=self.robot.legs)


def select_gait(
    scenario: Scenario, own: Robot | None = None, gains: Gains | None = None
) -> GaitSelection:
    """Returns gait and stance of a run.

    Args:
        scenario: of the run.
        own: the plant's robot, if the caller has it already.
        gains: of the run, if they exist already. Gains that were designed for the robot's own
            stance and not for the chosen one keep the robot in its own stance and gait.

    Raises:
        ScenarioError: a named stance is beyond the legs' reach.
        GainsError: no stance can be designed where the scenario asks for it.
    """
    bare = load_robot(scenario.robot)
    own = own or scenario_robot(scenario)
    robot = _with_servo(bare, own.servo, own.gravity)
    settings = dict(scenario.settings.get("gait", {}))
    plain = GaitSelection(robot=robot, gait=make_gait(robot, **settings), stance=OWN)
    if scenario.stance != CHOSEN:
        control = control_of(scenario.control)
        if scenario.names_walk:
            named = _named(scenario, plain, bare)
            return named if control.is_builtin else replace(named, chosen_by=OWN_CONTROLLER)
        if control.kind == FMU and control.path is not None:
            return _of_fmu(plain, control.path)
        if not control.chooses:
            return replace(plain, chosen_by=BY_ROBOT if control.is_builtin else OWN_CONTROLLER)
        plain = replace(plain, chosen_by=BY_CONTROL)
    chosen = _chosen(scenario.commands, plain, bare, settings)
    if plain.chosen_by == BY_CONTROL and _designed_for(gains, plain.robot, chosen.robot):
        return plain
    return chosen


def compliant_gait(robot: Robot) -> GaitSelection:
    """Returns the walk that compliant control chooses for a robot at the speed of packages.

    Exported FMUs can have it (`hexapod export --stance chosen`).
    """
    plain = GaitSelection(robot=robot, gait=make_gait(robot), stance=OWN, chosen_by=BY_CONTROL)
    return _chosen([Command(vx=SPEED)], plain, robot, {})


def _of_fmu(plain: GaitSelection, path: Path) -> GaitSelection:
    """Returns the walk with stance and gait of a controller FMU, as far as it has them."""
    found = stance_and_gait(path)
    gait = make_gait(plain.robot, **found.gait) if found.gait else plain.gait
    own = replace(plain, gait=gait, chosen_by=BY_CONTROL if found.gait else OWN_CONTROLLER)
    if found.stance is None or np.array_equal(found.stance, plain.robot.stance):
        return own
    legs = tuple(
        replace(leg, stance=angles)
        for leg, angles in zip(plain.robot.legs, found.stance, strict=True)
    )
    return replace(own, robot=replace(plain.robot, legs=legs), stance=OF_FMU, chosen_by=BY_CONTROL)


def _named(scenario: Scenario, plain: GaitSelection, bare: Robot) -> GaitSelection:
    """Returns the walk with the stance that the scenario names; `bare` is the robot file's."""
    stance = scenario.stance
    if stance is None or stance == OWN:
        return plain
    if isinstance(stance, str):
        design = _design(bare, plain.gait)
        stance, name = (design.outward, design.deeper), DESIGNED
    else:
        name = GIVEN
    try:
        return _moved(plain, name, *stance)
    except ReachError as error:
        raise ScenarioError(
            "the legs do not reach this stance",
            got=f"{stance[0]:g} m outwards and {stance[1]:g} m deeper",
            expected="feet within the reach of the legs",
            fix='move the feet less, or write stance = "designed"',
            where=f"{scenario.where}: walk.stance",
        ) from error


def _moved(walk: GaitSelection, name: str, outward: float, deeper: float) -> GaitSelection:
    """Returns a walk with the feet moved from the robot's own stance [m]. Raises ReachError."""
    moved = with_stance(walk.robot, outward, deeper)
    return replace(walk, robot=moved, stance=name, outward=outward, deeper=deeper)


def _chosen(
    commands: Sequence[Command], plain: GaitSelection, bare: Robot, settings: Mapping[str, Any]
) -> GaitSelection:
    """Returns the first walk of compliant control that the robot can follow.

    bare: the robot of the robot file, for which stances are designed. settings: those of [gait],
    whose gait is the only one if they name one.
    """
    amble = make_gait(plain.robot, **{"name": CHOSEN_GAIT, **settings})
    for gait in (amble, plain.gait):
        try:
            design = _design(bare, gait)
            begin = replace(plain, gait=gait)
            walk = _moved(begin, CHOSEN, FOOTING * design.outward, design.deeper)
        except (GainsError, ReachError):
            continue
        if _follows(walk, plain, commands):
            return _narrowing(walk, begin, design, plain, commands)
    return plain


def _narrowing(
    walk: GaitSelection,
    begin: GaitSelection,
    design: StanceChange,
    plain: GaitSelection,
    commands: Sequence[Command],
) -> GaitSelection:
    """Returns a walk whose feet can step to the stance of least heat, if the robot follows there.

    In that stance feet can be lifted by half of the step height at least.

    begin: the walk in the robot's own stance.
    """
    way = (FOOTING - 1.0) * design.outward
    if way <= 0.0:
        return walk
    try:
        narrow = _moved(begin, CHOSEN, design.outward, design.deeper)
    except ReachError:
        return walk
    if not _follows(narrow, plain, commands, whole=False):
        return walk
    return replace(walk, gait=replace(walk.gait, narrowing=way))


def _follows(
    walk: GaitSelection, plain: GaitSelection, commands: Sequence[Command], *, whole: bool = True
) -> bool:
    """Returns whether legs and joints follow the commands in a walk.

    A joint may need SPEED_SHARE of its largest speed, or what the robot's own walk needs. whole:
    the feet must follow the whole arc of a swing, as far as they do in the robot's own walk.
    """
    if not reaches(commands, walk.robot, walk.gait):
        return False
    limit = walk.robot.servo.speed_max
    for command in map(_body_command, commands):
        own = _motion(plain.robot, plain.gait, command)
        needed = _motion(walk.robot, walk.gait, command)  # its speed is at most `limit`
        if needed.speed > max(SPEED_SHARE * limit, own.speed) or needed.speed >= limit:
            return False
        if whole and needed.cut and not own.cut:
            return False
    return True


def _body_command(command: Command) -> BodyCommand:
    return BodyCommand(vx=command.vx, vy=command.vy, yaw_rate=command.yaw_rate)


@lru_cache(maxsize=256)
def _motion(robot: Robot, gait: Gait, command: BodyCommand) -> Motion:
    """Returns settled_motion() from a cache."""
    return settled_motion(robot, gait, command)


def _designed_for(gains: Gains | None, own: Robot, chosen: Robot) -> bool:
    """Returns whether gains are for the robot's own stance, and not for the chosen one."""
    return gains is not None and gains.robot_hash == own.hash and own.hash != chosen.hash


@lru_cache(maxsize=64)
def _design(robot: Robot, gait: Gait) -> StanceChange:
    """Returns the stance of least heat of a robot file, designed once and kept in the user's
    cache.
    """
    return kept_stance(robot, gait, find_stance)


def known_robot(scenario: Scenario) -> Robot:
    """Returns the robot as its controller knows it: the robot file with the scenario's servos and
    gravity.

    The controller has to find out ground, contact and payload by itself.
    """
    own = scenario_robot(scenario)
    return _with_servo(load_robot(scenario.robot), own.servo, own.gravity)


@lru_cache(maxsize=64)
def _with_servo(robot: Robot, servo: Servo, gravity: Vector3) -> Robot:
    if (robot.servo, robot.gravity) == (servo, gravity):
        return robot
    return replace(robot, servo=servo, gravity=gravity)
