"""Registers the environments with Gymnasium."""

from __future__ import annotations

import gymnasium

from hexapod_cosim.extensions.gym.tasks import TASKS


def register_all() -> None:
    """Registers one environment for each task; a second call changes nothing."""
    for name in TASKS:
        if name not in gymnasium.registry:
            gymnasium.register(
                id=name,
                entry_point="hexapod_cosim.extensions.gym.environment:HexapodEnv",
                vector_entry_point="hexapod_cosim.extensions.gym.vector:HexapodVectorEnv",
                kwargs={"task": name},
            )
