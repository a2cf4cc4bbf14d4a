"""The settings of an environment: robot, ground, actions, observations, rewards and random
numbers, as data.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Annotated, Any

from hexapod_cosim.extensions.gym.checks import (
    check,
    check_count,
    check_names,
    check_range,
    numbers,
)
from hexapod_cosim.models.schema import Number, check_record

JOINTS = 18
RATE = 50  # Hz  of actions

LARGEST = 100.0  # of an observation's values (HX_ENV_LARGEST in C)
# Blocks of an observation in their order, with their sizes (hxEnvBlock in C).
BLOCKS: Mapping[str, int] = {
    "velocity": 3,
    "rotation": 3,
    "gravity": 3,
    "command": 3,
    "angle": JOINTS,
    "speed": JOINTS,
    "action": JOINTS,
    "clock": 2,
}
# largest values before the scale, of blocks that have one
LIMITS: Mapping[str, float] = {"gravity": 1.0, "action": 1.0, "clock": 1.0}
# Terms of the reward in their order (hxEnvTerm in C), with the names that legged_gym uses where it
# has the term.
TERMS = (
    "tracking_lin_vel",
    "tracking_ang_vel",
    "progress",
    "lin_vel_z",
    "ang_vel_xy",
    "orientation",
    "torques",
    "dof_vel",
    "power",
    "action_rate",
    "feet_slip",
    "alive",
    "termination",
)
# Reasons for the end of an episode (hxEnvReason in C).
REASONS = ("", "time", "tilted", "belly", "failed")

MAPPINGS = ("terrain", "observation", "rewards", "randomise")
Positive = Annotated[float, Number("1", above=0.0)]
Length = Annotated[float, Number("m", at_least=0.0)]
Angle = Annotated[float, Number("rad", above=0.0)]
Force = Annotated[float, Number("N", at_least=0.0)]
Duration = Annotated[float, Number("s", at_least=1.0 / RATE)]  # one step or more

MAX_TILT = math.radians(60.0)  # rad
Range = tuple[float, float]
Scale = float | tuple[float, float, float]

# The observation that users of legged_gym expect, with its scales.
LEGGED_GYM: Mapping[str, Scale] = {
    "velocity": 2.0,
    "rotation": 0.25,
    "gravity": 1.0,
    "command": (2.0, 2.0, 0.25),
    "angle": 1.0,
    "speed": 0.05,
    "action": 1.0,
}
# What a robot can measure, and a clock: the observation of policies that are exported as FMUs
# (extensions/gym/policy_fmu/src/policy.c computes the same).
MEASURABLE: Mapping[str, Scale] = {
    "rotation": 0.25,
    "gravity": 1.0,
    "command": (10.0, 10.0, 1.0),
    "angle": 1.0,
    "clock": 1.0,
}
OBSERVATIONS: Mapping[str, Mapping[str, Scale]] = {
    "legged_gym": LEGGED_GYM,
    "measurable": MEASURABLE,
}
REWARDS: Mapping[str, float] = {
    "tracking_lin_vel": 1.0,
    "tracking_ang_vel": 0.5,
    "lin_vel_z": -2.0,
    "ang_vel_xy": -0.05,
    "orientation": -1.0,
    "torques": -1e-4,
    "action_rate": -0.01,
    "termination": -1.0,
}


@dataclass(frozen=True, kw_only=True)
class EnvSettings:
    """Everything that distinguishes one environment from another.

    Raises HexapodError for unknown names and impossible numbers.
    """

    robot: str = "athena"  # name or file
    terrain: Mapping[str, Any] = field(
        default_factory=dict
    )  # as [terrain] of a scenario; {}: the robot's own
    terrain_seeds: int = 1  # grounds with seeds 1, 2, ... to draw from, for kinds with a seed
    pad_radius: Length = 0.0  # of the feet on soil; 0: the robot's own
    action_scale: Angle = 0.4  # change of a joint's commanded angle for the action 1
    observation: Mapping[str, Scale] = field(default_factory=lambda: LEGGED_GYM)
    rewards: Mapping[str, float] = field(default_factory=lambda: REWARDS)  # weights of the terms
    tracking_width: tuple[float, float] = (0.1, 0.25)  # m/s, rad/s  of the tracking terms
    clock: Annotated[float, Number("Hz", at_least=0.0)] = 1.5
    duration: Duration = 20.0  # of an episode
    command_vx: Range = (0.0, 0.15)  # m/s
    command_vy: Range = (-0.05, 0.05)  # m/s
    command_yaw_rate: Range = (-0.3, 0.3)  # rad/s
    push_force: Force = 0.0  # largest push on the torso; 0: none
    push_interval: Duration = 2.0  # from the start of a push to the next
    push_duration: Duration = 0.1
    max_tilt: Angle = MAX_TILT  # lean that counts as a fall
    belly_force: Force = 1.0  # on the torso that counts as a fall
    # plant parameters drawn for each episode, as factors of a study: name -> (lowest, highest)
    randomise: Mapping[str, Range] = field(default_factory=dict)
    solver: str = "ros2"
    tolerance: Positive = 0.005  # 0.85 mm of path error in 10 s of a tripod gait
    step_max: Annotated[float, Number("s", above=0.0)] = 0.02

    def __post_init__(self) -> None:
        """Checks names and numbers."""
        for name in MAPPINGS:
            given = getattr(self, name)
            table = isinstance(given, Mapping) and all(isinstance(key, str) for key in given)
            check(table, name, given, "a table (a dict) from names to values")
        check_names(self.rewards, "term of the reward", TERMS)
        check_names(self.observation, "block of the observation", BLOCKS)
        check_record(self, "environment")
        check_count("terrain_seeds", self.terrain_seeds)
        for name in ("command_vx", "command_vy", "command_yaw_rate"):
            check_range(name, getattr(self, name))
        for name, ends in self.randomise.items():
            check_range(f"randomise: {name}", ends)
        for name, weight in self.rewards.items():
            check(len(numbers(weight)) == 1, f"rewards: {name}", weight, "a finite number")
        width = numbers(self.tracking_width)
        holds = len(width) == 2 and min(width) > 0.0
        check(holds, "tracking_width", self.tracking_width, "two finite numbers above 0")
        self._check_observation()

    def _check_observation(self) -> None:
        """Checks the scales of the observed blocks. A scale of 0 would leave a block out."""
        check(bool(self.observation), "observation", "no blocks", f"some of {', '.join(BLOCKS)}")
        for name, scale in self.observation.items():
            sizes = {1, 3} if BLOCKS[name] == 3 else {1}
            holds = len(numbers(scale)) in sizes and any(numbers(scale))
            expected = "a finite scale other than 0, or three of them for a block of 3"
            check(holds, f"observation: {name}", scale, expected)

    @property
    def blocks(self) -> dict[str, tuple[int, float]]:
        """Sizes and largest values before the scale of the observed blocks, in their order."""
        return {
            name: (size, LIMITS.get(name, math.inf))
            for name, size in BLOCKS.items()
            if name in self.observation
        }

    @property
    def size(self) -> int:
        """Number of values in an observation."""
        return sum(size for size, _ in self.blocks.values())

    @property
    def steps(self) -> int:
        """Number of steps in a whole episode."""
        return round(self.duration * RATE)


def changed(settings: EnvSettings, changes: Mapping[str, Any]) -> EnvSettings:
    """Returns settings with changes by name. Raises HexapodError for an unknown name.

    An observation may be given by its name, one of OBSERVATIONS.
    """
    known = [item.name for item in fields(EnvSettings)]
    check_names(changes, "setting of the environment", known)
    given = dict(changes)
    if isinstance(given.get("observation"), str):
        check_names([given["observation"]], "observation", OBSERVATIONS)
        given["observation"] = OBSERVATIONS[given["observation"]]
    return replace(settings, **given)


# the registered environments
FLAT = EnvSettings()
ROUGH = replace(
    FLAT,
    terrain={"kind": "rubble", "max_height": 0.03, "stone_size": 0.15},
    terrain_seeds=8,
    randomise={"friction.mu": (0.5, 0.9)},
)
SOIL = replace(FLAT, terrain={"kind": "sand", "soil": "dry_sand"}, pad_radius=0.025)
PUSH = replace(FLAT, push_force=40.0, randomise={"friction.mu": (0.5, 0.9)})

TASKS: Mapping[str, tuple[str, EnvSettings]] = {  # by name: title and settings
    "Hexapod-v0": ("flat ground", FLAT),
    "HexapodRough-v0": ("rubble of up to 30 mm from 8 seeds, friction 0.5 to 0.9", ROUGH),
    "HexapodSoil-v0": ("dry sand, feet with pads", SOIL),
    "HexapodPush-v0": ("flat ground, pushes of up to 40 N every 2 s, friction 0.5 to 0.9", PUSH),
}


def task(name: str) -> EnvSettings:
    """Returns the settings of a registered environment. Raises HexapodError."""
    check_names([name], "environment", TASKS)
    return TASKS[name][1]


def environment_rows() -> list[dict[str, Any]]:
    """Returns what `hexapod list environments` shows."""
    return [{"name": name, "title": title} for name, (title, _) in TASKS.items()]
