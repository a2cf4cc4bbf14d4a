"""The settings of an environment: robot, ground, actions, observations, rewards and random
numbers, as data.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from types import MappingProxyType
from typing import Any

from hexapod_cosim.extensions.gym.checks import (
    check_count,
    check_mapping,
    check_names,
    check_number,
    check_range,
    check_scale,
    check_widths,
    refused,
)

JOINTS = 18
RATE = 50  # Hz  of actions
MOST_PLACES = 10_000  # whose heights are observed
BASES = ("stance", "kinematic", "compliant")  # what actions are added to

# Blocks of an observation in their order, with their sizes (hxEnvBlock in C). The size of the
# heights is the number of places that are scanned.
BLOCKS: Mapping[str, int] = MappingProxyType(
    {
        "velocity": 3,
        "rotation": 3,
        "gravity": 3,
        "command": 3,
        "angle": JOINTS,
        "speed": JOINTS,
        "action": JOINTS,
        "clock": 2,
        "heights": 0,
    }
)
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

# Settings by what their numbers may be.
POSITIVE = ("action_scale", "tolerance", "step_max", "scan_spacing", "max_tilt")
NOT_NEGATIVE = (
    *("clock", "scan_length", "scan_width", "command_interval"),
    *("push_force", "belly_force", "pad_radius"),
)
MAPPINGS = ("terrain", "observation", "rewards", "randomise")
TIMES = ("duration", "push_interval", "push_duration")  # at least one step

Range = tuple[float, float]
Scale = float | tuple[float, float, float]

# The observation that users of legged_gym expect, with its scales.
LEGGED_GYM: Mapping[str, Scale] = MappingProxyType(
    {
        "velocity": 2.0,
        "rotation": 0.25,
        "gravity": 1.0,
        "command": (2.0, 2.0, 0.25),
        "angle": 1.0,
        "speed": 0.05,
        "action": 1.0,
    }
)
# The same with heights of the ground around the robot, as on legged_gym's uneven grounds.
LEGGED_GYM_HEIGHTS: Mapping[str, Scale] = MappingProxyType({**LEGGED_GYM, "heights": 5.0})
# What a robot can measure, and a clock: the observation of policies that are exported as FMUs
# (extensions/gym/policy_fmu/src/policy.c computes the same).
MEASURABLE: Mapping[str, Scale] = MappingProxyType(
    {
        "rotation": 0.25,
        "gravity": 1.0,
        "command": (10.0, 10.0, 1.0),
        "angle": 1.0,
        "clock": 1.0,
    }
)
OBSERVATIONS: Mapping[str, Mapping[str, Scale]] = MappingProxyType(
    {
        "legged_gym": LEGGED_GYM,
        "legged_gym_heights": LEGGED_GYM_HEIGHTS,
        "measurable": MEASURABLE,
    }
)
REWARDS: Mapping[str, float] = MappingProxyType(
    {
        "tracking_lin_vel": 1.0,
        "tracking_ang_vel": 0.5,
        "lin_vel_z": -2.0,
        "ang_vel_xy": -0.05,
        "orientation": -1.0,
        "torques": -1e-4,
        "action_rate": -0.01,
        "termination": -1.0,
    }
)


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
    pad_radius: float = 0.0  # m  of the feet on soil; 0: the robot's own
    base: str = "stance"  # what actions are added to: the standing pose or a controller's commands
    action_scale: float = 0.4  # rad  change of a joint's commanded angle for the action 1
    observation: Mapping[str, Scale] = field(default_factory=lambda: LEGGED_GYM)
    rewards: Mapping[str, float] = field(default_factory=lambda: REWARDS)  # weights of the terms
    tracking_width: tuple[float, float] = (0.1, 0.25)  # m/s, rad/s  of the tracking terms
    clock: float = 1.5  # Hz
    duration: float = 20.0  # s  of an episode
    # a grid of places around the torso whose heights are observed
    scan_length: float = 0.8  # m  forward and back, from end to end
    scan_width: float = 0.5  # m  to the sides
    scan_spacing: float = 0.05  # m
    command_interval: float = 0.0  # s  from one draw of the command to the next; 0: the episode
    command_vx: Range = (0.0, 0.15)  # m/s
    command_vy: Range = (-0.05, 0.05)  # m/s
    command_yaw_rate: Range = (-0.3, 0.3)  # rad/s
    push_force: float = 0.0  # N    largest push on the torso; 0: none
    push_interval: float = 2.0  # s    from the start of a push to the next
    push_duration: float = 0.1  # s
    max_tilt: float = math.radians(60.0)  # rad  lean that counts as a fall
    belly_force: float = 1.0  # N    on the torso that counts as a fall
    # plant parameters drawn for each episode, as factors of a study: name -> (lowest, highest)
    randomise: Mapping[str, Range] = field(default_factory=dict)
    solver: str = "ros2"
    tolerance: float = 0.005  # 0.85 mm of path error in 10 s of a tripod gait
    step_max: float = 0.02  # s

    def __post_init__(self) -> None:
        """Checks names and numbers."""
        for name in MAPPINGS:
            check_mapping(name, getattr(self, name))
        check_names(self.rewards, "term of the reward", TERMS)
        check_names(self.observation, "block of the observation", BLOCKS)
        check_names([self.base], "base of actions", BASES)
        for name in POSITIVE:
            check_number(name, getattr(self, name), above=0.0)
        for name in NOT_NEGATIVE:
            check_number(name, getattr(self, name), least=0.0)
        for name in TIMES:
            check_number(name, getattr(self, name), least=1.0 / RATE)
        if self.command_interval:
            check_number("command_interval", self.command_interval, least=1.0 / RATE)
        check_count("terrain_seeds", self.terrain_seeds)
        for name in ("command_vx", "command_vy", "command_yaw_rate"):
            check_range(name, getattr(self, name))
        for name, given in self.randomise.items():
            check_range(f"randomise: {name}", given)
        for name, weight in self.rewards.items():
            check_number(f"rewards: {name}", weight)
        check_widths("tracking_width", self.tracking_width)
        self._check_observation()

    def _check_observation(self) -> None:
        """Checks the scales of the observed blocks, and the number of scanned places."""
        if not self.observation:
            raise refused("observation", "no blocks", f"some of {', '.join(BLOCKS)}")
        for name, scale in self.observation.items():
            check_scale(f"observation: {name}", scale, axes=BLOCKS[name] == 3)
        if "heights" in self.observation and len(self.places) > MOST_PLACES:
            raise refused("scan_spacing", self.scan_spacing, f"at most {MOST_PLACES} places")

    @property
    def size(self) -> int:
        """Number of values in an observation."""
        scanned = len(self.places) if "heights" in self.observation else 0
        return scanned + sum(size for name, size in BLOCKS.items() if name in self.observation)

    @property
    def places(self) -> list[tuple[float, float]]:
        """Places (forward, left) [m] whose heights are observed: rows from back to front, each from
        right to left.
        """
        along, across = (
            symmetric(extent, self.scan_spacing) for extent in (self.scan_length, self.scan_width)
        )
        return [(x, y) for x in along for y in across]

    @property
    def steps(self) -> int:
        """Number of steps in a whole episode."""
        return round(self.duration * RATE)


def symmetric(extent: float, spacing: float) -> list[float]:
    """Returns coordinates [m] with a spacing, symmetric about 0, within an extent."""
    half = math.floor(0.5 * extent / spacing + 1e-9)
    return [spacing * number for number in range(-half, half + 1)]


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
