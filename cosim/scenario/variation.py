"""Draws small changes to a run from its seed: initial pose and delay of the commands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from hexapod_cosim.cosim.interface.names import JOINTS, LEGS, joint_names, vector_names
from hexapod_cosim.cosim.scenario.records import Command, Variation
from hexapod_cosim.models import Robot
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.ground.faces import ground
from hexapod_cosim.models.kinematics import foot_positions, quaternion_product, rotation_matrix

STREAM = 1  # of random numbers; the noise of the sensors is drawn from the seed alone
POSITION, QUATERNION = vector_names("initial.position"), vector_names("initial.quaternion", 4)
ANGLE = [f"initial.{name}" for name in joint_names("angle")]

# accuracy of a set-up by hand: a tenth of a degree of attitude and of joint angles (a step of
# the servos' encoders is 1.5 mrad), 1 mm of height, and a tenth of a second of command delay
STANDARD = Variation(attitude=2e-3, height=1e-3, joint_angle=2e-3, command_delay=0.1)


@dataclass(frozen=True, kw_only=True)
class Drawn:
    """The changes drawn for one seed."""

    rotation: Array  # (3,) rad    rotation vector of the torso, small, world axes
    height: float  # m    height of the drop
    angle: Array  # (6, 3) rad    added to the joint angles
    command_delay: float  # s

    def as_facts(self) -> dict[str, Any]:
        """Returns the changes as plain numbers and lists, for run.json."""
        return {
            "rotation": self.rotation.tolist(),
            "height": self.height,
            "angle": self.angle.tolist(),
            "command_delay": self.command_delay,
        }


def draw(variation: Variation, *, seed: int) -> Drawn:
    """Draws the changes of a seed.

    The random numbers do not depend on the sizes in `variation`, which only scale them.
    """
    generator = np.random.default_rng([seed, STREAM])
    rotation, angle = generator.standard_normal(3), generator.standard_normal((LEGS, JOINTS))
    height, delay = generator.random(2).tolist()
    return Drawn(
        rotation=variation.attitude * rotation,
        height=variation.height * height,
        angle=variation.joint_angle * angle,
        command_delay=variation.command_delay * delay,
    )


def delayed(commands: Sequence[Command], delay: float) -> tuple[Command, ...]:
    """Returns all commands later by `delay` [s]; the robot stands until then."""
    if not delay:
        return tuple(commands)
    return (Command(), *(replace(command, time=command.time + delay) for command in commands))


def initial_values(robot: Robot, parameters: Mapping[str, float], drawn: Drawn) -> dict[str, float]:
    """Returns the FMU's parameters initial.* with the drawn changes applied.

    The torso is raised until no foot is deeper in the ground than before, and then by the height
    drawn.
    """
    position, quaternion, angle = (
        np.array([parameters[name] for name in names]) for names in (POSITION, QUATERNION, ANGLE)
    )
    q_WV, q_VT = np.array([1.0, *(0.5 * drawn.rotation)]), quaternion
    q_WT = quaternion_product(q_WV / np.linalg.norm(q_WV), q_VT)
    bent = angle + drawn.angle.ravel()
    before = _depths_cached(robot, tuple(position), tuple(quaternion), tuple(angle))
    deeper = _depths(robot, position, q_WT, bent) - before
    raised = position + np.array([0.0, 0.0, max(float(deeper.max()), 0.0) + drawn.height])
    pairs = ((POSITION, raised), (QUATERNION, q_WT), (ANGLE, bent))
    return {
        name: value
        for names, values in pairs
        for name, value in zip(names, values.tolist(), strict=True)
    }


@lru_cache(maxsize=64)
def _depths_cached(robot: Robot, *pose: tuple[float, ...]) -> Array:
    """Returns `_depths` of a pose from a cache: runs of one robot begin from the same pose."""
    position, quaternion, angle = map(np.array, pose)
    return _depths(robot, position, quaternion, angle)


def _depths(robot: Robot, position: Array, quaternion: Array, angle: Array) -> Array:
    """Returns the penetration of the feet [m] (6,), negative above the ground."""
    feet = foot_positions(robot, angle.reshape(LEGS, JOINTS)) - np.array(robot.torso.com)
    R_WT = rotation_matrix(quaternion / np.linalg.norm(quaternion))
    centres = position + feet @ R_WT.T
    return np.array([robot.foot.radius - ground(robot.terrain, centre)[0] for centre in centres])
