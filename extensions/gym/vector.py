"""Many hexapods as a Gymnasium vector environment whose loop is in C."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from numbers import Integral
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from hexapod_cosim.extensions.gym.batch import Batch
from hexapod_cosim.extensions.gym.checks import check_count, check_names, checked_mask
from hexapod_cosim.extensions.gym.environment import (
    LARGEST_SEED,
    action_space,
    checked,
    observation_space,
)
from hexapod_cosim.extensions.gym.settings import JOINTS, RATE, REASONS, TERMS, changed
from hexapod_cosim.extensions.gym.settings import task as task_settings

Result = tuple[
    NDArray[np.float32], NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]
]


def checked_mode(mode: AutoresetMode | str) -> AutoresetMode:
    """Returns an autoreset mode. Raises HexapodError for an unknown one."""
    names = [one.value for one in AutoresetMode]
    check_names([mode.value if isinstance(mode, AutoresetMode) else mode], "autoreset mode", names)
    return AutoresetMode(mode)


class HexapodVectorEnv(VectorEnv[NDArray[np.float32], NDArray[np.float32], NDArray[Any]]):
    """A number of hexapods, stepped together by the C loop over threads.

    Args:
        num_envs: number of robots.
        task: the registered name whose settings are used; the other keywords change them.
        threads: that step the robots; None: one for each core. Results do not depend on it.
        autoreset_mode: what follows the end of an episode.

    A robot whose action is not finite does not step: `info["refused"]` marks it, its observation
    stays and its reward is 0. The info of a step also has `terms`, the weighted terms of the reward
    by name; of the episodes that ended `reason` and `message` (of those that failed); of those that
    began `drawn`. With the mode same step, `final_obs` and `final_info` are those of the ends.
    Where a key applies to some of the robots, `_` and the key is their mask.
    """

    def __init__(
        self,
        num_envs: int = 1,
        *,
        task: str = "Hexapod-v0",
        threads: int | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        **changes: Any,
    ) -> None:
        mode = checked_mode(autoreset_mode)
        check_count("number of environments", num_envs)
        self.settings = changed(task_settings(task), changes)
        self.num_envs, self._mode = num_envs, mode
        self.metadata = {"autoreset_mode": mode, "render_modes": [], "render_fps": RATE}
        self.single_action_space = action_space()
        self.single_observation_space = observation_space(self.settings)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._batch = Batch(self.settings, num_envs, threads=threads, autoreset=mode.name.lower())
        self._seeded = False
        self._begun = np.zeros(num_envs, bool)
        self._ended = np.zeros(num_envs, bool)  # by the last step

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Starts an episode in all environments, or in those of options["reset_mask"].

        seed: one for each environment, or a number s: environment i has the seed s + i.

        An episode whose start the plant refuses is followed by the next one. Raises FmuError when
        it refuses 20 in a row.
        """
        mask = None if options is None else options.get("reset_mask")
        chosen = slice(None) if mask is None else checked_mask(mask, self.num_envs) > 0
        first = seed is None and not self._seeded
        super().reset(seed=int(seed) if isinstance(seed, int | np.integer) else None)
        if first:
            seed = int(self.np_random.integers(LARGEST_SEED))
        self._batch.reset(seeds=None if seed is None else self._seeds(seed), mask=mask)
        self._seeded, self._begun[chosen], self._ended[chosen] = True, True, False
        every = range(self.num_envs)
        return self._batch.observation.copy(), {"drawn": self._drawn(every)}

    def _drawn(self, indices: Iterable[int]) -> dict[str, NDArray[np.float64]]:
        """Returns the drawn parameters of environments by name, 0 for the others."""
        values = {name: np.zeros(self.num_envs) for name in self._batch.drawn_names}
        if values:
            for index in indices:
                for name, value in self._batch.drawn(index).items():
                    values[name][index] = value
        return values

    def _seeds(self, seed: int | Sequence[int | None]) -> list[int]:
        """Returns the seeds of all environments."""
        if isinstance(seed, (int, Integral)):
            return [int(seed) + index for index in range(self.num_envs)]
        draw = self.np_random.integers
        return [int(draw(LARGEST_SEED)) if one is None else one for one in seed]

    def step(self, actions: NDArray[np.float32]) -> Result:
        """Steps all environments by 20 ms under actions (num_envs, 18) in [-1, 1].

        Raises InvalidAction for another shape, ResetNeeded before the first reset of each
        environment.
        """
        batch = self._batch
        if not self._begun.all():
            raise gymnasium.error.ResetNeeded(
                f"step: got a call before the reset of {np.count_nonzero(~self._begun)} "
                "environments, expected one after it; call reset"
            )
        batch.action[...] = checked(actions, (self.num_envs, JOINTS))
        batch.step()
        return (
            batch.observation.copy(),
            batch.reward.copy(),
            batch.terminated.copy(),
            batch.truncated.copy(),
            self._info(),
        )

    def _info(self) -> dict[str, Any]:
        batch = self._batch
        own: dict[str, Any] = {"terms": dict(zip(TERMS, batch.term.copy().T, strict=True))}
        info: dict[str, Any] = {"refused": batch.refused.copy()}
        ended = batch.terminated | batch.truncated
        if ended.any():
            own |= self._ends(ended)
            if self._mode is AutoresetMode.SAME_STEP:
                info |= {"final_obs": batch.last.copy(), "_final_obs": ended}
                info |= {"final_info": own, "_final_info": ended}
        began = {
            AutoresetMode.NEXT_STEP: self._ended,
            AutoresetMode.SAME_STEP: ended,
            AutoresetMode.DISABLED: np.zeros_like(ended),
        }[self._mode]
        if began.any():
            info |= {"drawn": self._drawn(np.flatnonzero(began)), "_drawn": began}
        self._ended = ended
        return info | own

    def _ends(self, ended: NDArray[np.bool_]) -> dict[str, Any]:
        """Returns why episodes ended, with the messages of the plants that failed."""
        reason = [REASONS[number] for number in self._batch.reason]
        found = {"reason": np.array(reason, dtype=object), "_reason": ended}
        failed = np.array([one == "failed" for one in reason])
        if failed.any():
            message = np.full(self.num_envs, "", dtype=object)
            for index in np.flatnonzero(failed):
                message[index] = self._batch.message(int(index))
            found |= {"message": message, "_message": failed}
        return found

    def close_extras(self, **_: Any) -> None:
        """Ends the threads and frees the plants."""
        self._batch.close()
