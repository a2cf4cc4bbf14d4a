"""The settings of a walk that a page may change, and the choices for each of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import astuple, dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.controller import PATTERNS, BodyCommand, Gait, make_gait
from hexapod_cosim.cosim.run.gait_selection import known_robot
from hexapod_cosim.cosim.scenario.controls import control_of
from hexapod_cosim.cosim.scenario.reach import largest_share
from hexapod_cosim.cosim.scenario.reading import scenario_from_table, scenario_robot
from hexapod_cosim.cosim.scenario.records import CONTROLS, Command, Scenario
from hexapod_cosim.extensions.live.messages import Change, Drive
from hexapod_cosim.models import Robot, unknown_name
from hexapod_cosim.models.ground.table import CATALOGUE

OWN = "scenario"  # the ground of the scenario
FLAT = "flat"
NEED_FILES = ("heightfield",)  # grounds that cannot be chosen by name alone
REACHED = 0.6  # largest command as a share of what the legs reach
PROBE = np.array([1.0, 1.0, 3.0])  # m/s, m/s, rad/s    more than legs reach
# of the commands that both gaits allow, during a change: no leg reaches its limits (C55)
SHARE = 0.3
HEIGHT = 0.1  # m    of the torso above its stance, more than legs reach


@dataclass(frozen=True)
class Settings:
    """What a page may change."""

    control: str  # label
    gait: str
    friction: float  # coefficient of sliding friction of the ground
    ground: str  # OWN, FLAT or a name of the catalogue


@dataclass(frozen=True)
class Limits:
    """Largest commands that a drive of 1 means."""

    vx: float  # m/s
    vy: float  # m/s
    yaw_rate: float  # rad/s
    up: float  # m
    down: float  # m

    def command(self, drive: Drive) -> BodyCommand:
        """Returns the body command of a drive.

        Walking, sidestepping, turning and the height share the reach of the legs: when the sum of
        their shares exceeds 1, the first three are reduced.
        """
        shares = np.array([drive.forward, drive.left, drive.turn]) * drive.speed
        room = 1.0 - abs(drive.height)
        shares *= min(room / max(float(np.abs(shares).sum()), 1e-9), 1.0)
        vx, vy, yaw_rate = (shares * [self.vx, self.vy, self.yaw_rate]).tolist()
        height = drive.height * (self.up if drive.height > 0.0 else self.down)
        return BodyCommand(vx, vy, yaw_rate, height)

    def least(self, other: Limits) -> Limits:
        """Returns the smaller ones of two limits."""
        mine, theirs = astuple(self), astuple(other)
        return Limits(*(min(pair) for pair in zip(mine, theirs, strict=True)))

    def times(self, share: float) -> Limits:
        """Returns these limits with a share of the velocities and the whole heights."""
        return replace(self, vx=share * self.vx, vy=share * self.vy, yaw_rate=share * self.yaw_rate)


class Choices:
    """The scenario that a live walk starts from and the changes that it allows.

    `controls`: the texts of the controls that a page may choose, by label. `refused`: why built-in
    controls are not among them, by name.
    """

    def __init__(
        self, scenario: Scenario, controls: Mapping[str, str], refused: Mapping[str, str]
    ) -> None:
        self.scenario, self.controls, self.refused = scenario, dict(controls), dict(refused)
        grounds = [name for name in CATALOGUE if name not in NEED_FILES]
        self.grounds = (OWN, FLAT, *grounds)
        self.gaits = tuple(PATTERNS)

    def first(self) -> Settings:
        """Returns the settings of the scenario."""
        robot = scenario_robot(self.scenario)
        gait = self.scenario.settings.get("gait", {}).get("name", robot.gait.name)
        label = control_of(self.scenario.control).label
        return Settings(label, gait, robot.friction.mu, OWN)

    def changed(self, settings: Settings, change: Change) -> Settings:
        """Returns settings with a change. Raises HexapodError for an unknown name."""
        known: dict[str, tuple[str, ...]] = {
            "control": tuple(self.controls),
            "gait": self.gaits,
            "ground": self.grounds,
        }
        names = known.get(change.key)
        if names is not None and change.value not in names:
            refusal = self.refused.get(str(change.value))
            raise unknown_name(change.key, str(change.value), names, where=refusal)
        fields: dict[str, Any] = {**vars(settings), change.key: change.value}
        return Settings(**fields)

    def scenario_with(self, settings: Settings) -> Scenario:
        """Returns the scenario with the settings, standing still. Raises HexapodError."""
        base, own = self.scenario, self.first()
        tables: dict[str, Any] = {name: dict(table) for name, table in base.settings.items()}
        # the page shows the gait, so that no control chooses another one by itself
        timing = tables.get("gait", {}) if settings.gait == own.gait else {}
        tables["gait"] = {**timing, "name": settings.gait}
        if settings.friction != own.friction:
            tables["friction"] = {**tables.get("friction", {}), "mu": settings.friction}
        if settings.ground != OWN:
            tables["terrain"] = {"kind": settings.ground}
        still = replace(
            base,
            control=self.controls[settings.control],
            settings=tables,
            commands=(Command(),),
            events=(),
            variation=None,
        )
        # read again, so that values are checked as those of a file are
        return scenario_from_table(still.to_table(), where=base.where)


def live_scenario(scenario: Scenario) -> Scenario:
    """Returns the scenario that a live robot begins with, for which its gains are designed.

    It names the gait, so compliant control does not choose gait and stance.
    """
    choices = Choices(scenario, control_texts(scenario, ()), {})
    return choices.scenario_with(choices.first())


def control_texts(scenario: Scenario, able: tuple[str, ...] = CONTROLS) -> dict[str, str]:
    """Returns the controls that a page may choose by label: the scenario's and built-in ones."""
    own = control_of(scenario.control)
    return {own.label: own.text} | {name: name for name in able if name != own.label}


def gait_of(scenario: Scenario) -> Gait:
    """Returns the gait of a scenario."""
    return make_gait(known_robot(scenario), **dict(scenario.settings.get("gait", {})))


@lru_cache(maxsize=64)
def find_limits(robot: Robot, gait: Gait) -> Limits:
    """Returns the largest commands: REACHED of what the legs reach along each axis alone."""
    largest = [REACHED * _reached(PROBE[axis] * np.eye(6)[axis], robot, gait) for axis in range(3)]
    heights = [REACHED * _reached(sign * HEIGHT * np.eye(6)[3], robot, gait) for sign in (1, -1)]
    return Limits(*largest, *heights)


def _reached(part: NDArray[np.float64], robot: Robot, gait: Gait) -> float:
    """Returns the size of the largest share of a command (6,) that the legs follow alone."""
    return float(np.abs(part).max()) * largest_share(part, np.zeros(6), robot, gait)


@dataclass(frozen=True)
class GaitChange:
    """The plan of a change of gait while the robot walks; times since the request.

    Feet stand longer during a change than in either gait and need more reach
    (docs/control/gait.md, C55). So the robot walks slowly from the request until every leg has made
    a step in the next gait. The server's loop and the page without a server follow this plan.
    """

    limits: Limits  # of commands until `end`
    begin: float  # s    the robot is slow, and the controller gets the next gait
    end: float  # s    each leg has made its first step in the next gait


def plan_change(robot: Robot, before: Gait, after: Gait) -> GaitChange:
    """Returns the plan of a change between two gaits of a robot."""
    limits = find_limits(robot, before).least(find_limits(robot, after)).times(SHARE)
    swing = before.period * (1.0 - before.duty)  # legs in the air finish their steps first
    begin = before.period  # the ramp to a slower command takes a gait period (C1)
    return GaitChange(limits, begin, begin + 2.0 * swing + after.period)
