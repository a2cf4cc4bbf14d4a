"""The interface of a policy's FMU, whose parameters are the policy's weights."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from hexapod_cosim.cosim.common.components import Component
from hexapod_cosim.cosim.interface.plant import Interface, expand_interface
from hexapod_cosim.extensions.gym.policy import HIDDEN, SHAPES, Policy
from hexapod_cosim.extensions.gym.settings import RATE, EnvSettings
from hexapod_cosim.models import JOINT_NAMES, LEG_NAMES, HexapodError, Robot

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
UPRIGHT = (1.0, 0.0, 0.0, 0.0)
LEGS, JOINTS = len(LEG_NAMES), len(JOINT_NAMES)


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
        joint_weight=policy.action_weight.reshape(LEGS, JOINTS, HIDDEN),
        joint_bias=policy.action_bias.reshape(LEGS, JOINTS),
    )
    settings = SimpleNamespace(period=1.0 / RATE, upright=UPRIGHT)
    roots = SimpleNamespace(robot=robot, policy=weights, settings=settings)
    return expand_interface(POLICY, robot, roots)
