"""One hexapod as a Gymnasium environment."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from hexapod_cosim.extensions.gym.batch import Batch
from hexapod_cosim.extensions.gym.settings import (
    JOINTS,
    LARGEST,
    RATE,
    REASONS,
    TERMS,
    EnvSettings,
    changed,
)
from hexapod_cosim.extensions.gym.settings import task as task_settings
from hexapod_cosim.models.arrays import array_of
from hexapod_cosim.models.errors import HexapodError

LARGEST_SEED = 2**32  # seeds are drawn below it


def action_space() -> spaces.Box[Any]:
    """Returns the space of one environment's actions."""
    return spaces.Box(-1.0, 1.0, (JOINTS,), np.float32)


def observation_space(settings: EnvSettings) -> spaces.Box[Any]:
    """Returns the space of one environment's observations, which C limits to LARGEST."""
    largest = [
        np.broadcast_to(np.minimum(np.abs(settings.observation[name]) * limit, LARGEST), size)
        for name, (size, limit) in settings.blocks.items()
    ]
    high = np.concatenate(largest).astype(np.float32)
    return spaces.Box(-high, high, dtype=np.float32)


class HexapodEnv(gymnasium.Env[NDArray[np.float32], NDArray[np.float32]]):
    """A hexapod that follows velocity commands, stepped at 50 Hz.

    task: the registered name whose settings are used; the other keywords change them
    (`EnvSettings`). The info of a step holds the weighted `terms` of the reward by name and, at the
    end of an episode, its `reason`: time, tilted, belly (the torso rests on the ground) or failed,
    with the plant's `message`.
    """

    metadata = {"render_modes": [], "render_fps": RATE}  # noqa: RUF012

    def __init__(self, *, task: str = "Hexapod-v0", **changes: Any) -> None:
        self.settings = changed(task_settings(task), changes)
        self.action_space = action_space()
        self.observation_space = observation_space(self.settings)
        self._batch = Batch(self.settings, 1, threads=1, autoreset="disabled")
        self._seeded = self._going = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Starts an episode; returns the observation and the drawn parameters.

        Episodes after a seed are the same for the same seed. An episode whose start the plant
        refuses is followed by the next one. Raises FmuError when it refuses 20 in a row.
        """
        super().reset(seed=seed)
        if seed is None and not self._seeded:
            seed = int(self.np_random.integers(LARGEST_SEED))
        self._going = False
        self._batch.reset(seeds=None if seed is None else [seed])
        self._seeded = self._going = True
        return self._batch.observation[0].copy(), {"drawn": self._batch.drawn(0)}

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Steps by 20 ms under an action (18,) in [-1, 1]; larger values are limited.

        Raises ResetNeeded before the first reset and after the end of an episode, InvalidAction for
        numbers that are not finite: the environment has then not stepped.
        """
        if not self._going:
            raise gymnasium.error.ResetNeeded(
                "step: got a call without an episode, expected one that goes on; call reset"
            )
        batch = self._batch
        batch.action[0] = checked(action, (JOINTS,))
        batch.step()
        if batch.refused[0]:
            raise gymnasium.error.InvalidAction(
                f"action: got {np.asarray(action).tolist()}, expected finite numbers; "
                "the environment has not stepped"
            )
        terminated, truncated = bool(batch.terminated[0]), bool(batch.truncated[0])
        info: dict[str, Any] = {"terms": dict(zip(TERMS, batch.term[0].tolist(), strict=True))}
        if terminated or truncated:
            self._going = False
            info["reason"] = REASONS[batch.reason[0]]
            if info["reason"] == "failed":
                info["message"] = batch.message(0)
        return batch.observation[0].copy(), float(batch.reward[0]), terminated, truncated, info

    def close(self) -> None:
        """Frees the plant; may be called twice."""
        self._batch.close()


def checked(action: Any, shape: tuple[int, ...]) -> NDArray[np.float32]:
    """Returns an action as an array. Raises InvalidAction for another shape or for no numbers."""
    try:
        return array_of(action, shape, where="action").astype(np.float32)
    except HexapodError as error:
        raise gymnasium.error.InvalidAction(str(error)) from error
