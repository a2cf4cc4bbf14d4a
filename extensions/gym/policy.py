"""A small multilayer perceptron as a policy: measurable observations to actions.

    a = V tanh(W x + w) + v

x (29,) is the observation `MEASURABLE`, a (18,) the action. policy_fmu/ computes the same
in C, with the weights as parameters.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.common.components import Component
from hexapod_cosim.cosim.common.files import atomic_path, why_unreadable
from hexapod_cosim.cosim.interface.plant import expand_interface
from hexapod_cosim.cosim.interface.records import Interface
from hexapod_cosim.extensions.gym.settings import BLOCKS, JOINTS, MEASURABLE, RATE, EnvSettings
from hexapod_cosim.models import JOINT_NAMES, LEG_NAMES, HexapodError, Robot, load_robot
from hexapod_cosim.models.arrays import Array

INPUTS = sum(BLOCKS[name] for name in MEASURABLE)  # 29
HIDDEN = 16
HALF_HIDDEN, HALF_JOINTS = HIDDEN // 2, JOINTS // 2
SHAPES = {
    "hidden_weight": (HIDDEN, INPUTS),
    "hidden_bias": (HIDDEN,),
    "action_weight": (JOINTS, HIDDEN),
    "action_bias": (JOINTS,),
}
UPRIGHT = (1.0, 0.0, 0.0, 0.0)
LEGS, LEG_JOINTS = len(LEG_NAMES), len(JOINT_NAMES)
POLICY = Component(
    name="policy",
    identifier="hexapod_policy",
    tree="extensions/gym/policy_fmu",
    installed="plant/policy",
    header="hexapod/policy.h",
    prefix="policy_",
    structure="Policy",
    suffix="_policy",
    description=(
        "Learned policy of a hexapod robot: angles of its {joints} joints from a body velocity and "
        "from measurements by a multilayer perceptron"
    ),
)


@dataclass(frozen=True, kw_only=True)
class Policy:
    """Weights of a policy, and the settings of the environment that it was trained with."""

    hidden_weight: Array  # (16, 29) W
    hidden_bias: Array  # (16,) w
    action_weight: Array  # (18, 16) V
    action_bias: Array  # (18,) v
    robot: str  # its name
    clock: float  # Hz
    action_scale: float  # rad

    def __call__(self, observation: NDArray[Any]) -> Array:
        """Returns actions (..., 18) for observations (..., 29)."""
        hidden = np.tanh(observation @ self.hidden_weight.T + self.hidden_bias)
        action: Array = hidden @ self.action_weight.T + self.action_bias
        return action

    def save(self, path: Path) -> None:
        """Writes the policy as a .npz file, atomically."""
        with atomic_path(path) as part, part.open("wb") as file:
            np.savez(file, **vars(self))


def load_policy(path: Path) -> Policy:
    """Reads a policy. Raises HexapodError for a file that holds none."""
    names = (*SHAPES, "robot", "clock", "action_scale")
    try:
        with np.load(path, allow_pickle=False) as file:
            values = {name: file[name] for name in names}
    except (OSError, EOFError, ValueError, KeyError, TypeError, BadZipFile) as error:
        raise _no_policy(path, why_unreadable(error, "archive of numbers")) from error
    for name, shape in {**SHAPES, "clock": (), "action_scale": ()}.items():
        value = values[name]
        if value.dtype.kind not in "fiu" or value.shape != shape or not np.isfinite(value).all():
            raise _no_policy(path, f"{name} that is not of finite numbers of shape {shape}")
    return Policy(
        **{name: values[name].astype(float) for name in SHAPES},
        robot=str(values["robot"]),
        clock=float(values["clock"]),
        action_scale=float(values["action_scale"]),
    )


def _no_policy(path: Path, got: str) -> HexapodError:
    return HexapodError(
        "not a policy",
        got=got,
        expected="a file that `hexapod gym train` wrote",
        fix="train one",
        where=str(path),
    )


@cache
def observation_mirror() -> tuple[NDArray[np.intp], Array]:
    """Returns places and signs (29,) of an observation's mirror image, half a clock period later.

    The mirror image of x is x[places] * signs: left and right are exchanged.
    """
    joints, sides = action_mirror()
    signs = {
        "rotation": [-1.0, 1.0, -1.0],
        "gravity": [1.0, -1.0, 1.0],
        "command": [1.0, -1.0, -1.0],
        "angle": sides,
        "clock": [-1.0, -1.0],
    }
    places, begin = [], 0
    for name in MEASURABLE:
        own = joints if name == "angle" else np.arange(BLOCKS[name])
        places.append(begin + own)
        begin += BLOCKS[name]
    return np.concatenate(places), np.concatenate([signs[name] for name in MEASURABLE])


@cache
def action_mirror() -> tuple[NDArray[np.intp], Array]:
    """Returns places and signs (18,) of an action's mirror image."""
    places = np.roll(np.arange(JOINTS), HALF_JOINTS)  # legs are ordered LF LM LR RF RM RR
    return places, np.tile([-1.0, 1.0, 1.0], JOINTS // 3)


# sizes of the free parameters of a symmetric policy: of half of the units and joints
FREE = {
    "hidden_weight": (HALF_HIDDEN, INPUTS),
    "hidden_bias": (HALF_HIDDEN,),
    "action_weight": (HALF_JOINTS, HIDDEN),
    "action_bias": (HALF_JOINTS,),
}
FREE_SIZE = sum(int(np.prod(shape)) for shape in FREE.values())


def symmetric_weights(free: Array) -> dict[str, Array]:
    """Returns the weights of policies that are their own mirror image half a period later.

    free: (..., FREE_SIZE) weights of the units and joints of the left side. The result has the
    shapes of SHAPES behind the same leading axes.
    """
    parts, begin, lead = {}, 0, free.shape[:-1]
    for name, shape in FREE.items():
        size = int(np.prod(shape))
        parts[name] = free[..., begin : begin + size].reshape(*lead, *shape)
        begin += size
    places, signs = observation_mirror()
    _, sides = action_mirror()
    left, bias = parts["hidden_weight"], parts["hidden_bias"]
    own, offset = parts["action_weight"], parts["action_bias"]
    crossed = np.roll(own, HALF_HIDDEN, axis=-1)  # the units of both sides are exchanged
    mirrored = left[..., places] * signs
    return {
        "hidden_weight": np.concatenate([left, mirrored], axis=-2),
        "hidden_bias": np.concatenate([bias, bias], axis=-1),
        "action_weight": np.concatenate([own, sides[:HALF_JOINTS, None] * crossed], axis=-2),
        "action_bias": np.concatenate([offset, sides[:HALF_JOINTS] * offset], axis=-1),
    }


def standing_policy(robot: str) -> Policy:
    """Returns the policy whose actions are 0."""
    settings = EnvSettings()
    return Policy(
        **{name: np.zeros(shape) for name, shape in SHAPES.items()},
        robot=robot,
        clock=settings.clock,
        action_scale=settings.action_scale,
    )


def load_policy_interface(policy: Policy, robot: Robot) -> Interface:
    """Returns the interface of a policy's FMU.

    Raises HexapodError for another robot than the policy's, and when a weight is out of range.
    """
    if robot.name != policy.robot:
        raise HexapodError(
            "a policy of another robot",
            got=robot.name,
            expected=policy.robot,
            fix="export it for the robot that it was trained with",
        )
    weights = SimpleNamespace(
        clock=policy.clock,
        action_scale=policy.action_scale,
        hidden_weight=policy.hidden_weight,
        hidden_bias=policy.hidden_bias,
        joint_weight=policy.action_weight.reshape(LEGS, LEG_JOINTS, HIDDEN),
        joint_bias=policy.action_bias.reshape(LEGS, LEG_JOINTS),
    )
    settings = SimpleNamespace(period=1.0 / RATE, upright=UPRIGHT)
    roots = SimpleNamespace(robot=robot, policy=weights, settings=settings)
    return expand_interface(POLICY, robot, roots)


def default_interface() -> Interface:
    """Returns the interface of the default robot's policy that stands."""
    return load_policy_interface(standing_policy("athena"), load_robot("athena"))
