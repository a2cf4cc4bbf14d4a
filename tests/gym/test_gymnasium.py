"""The Gymnasium environments: the interface's own checks, ends, wrong arguments."""

from __future__ import annotations

import re
from typing import Any

import gymnasium
import numpy as np
import pytest
from building import ROOT
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode

from hexapod_cosim.gym.environment import HexapodEnv
from hexapod_cosim.gym.tasks import TASKS
from hexapod_cosim.gym.vector import HexapodVectorEnv
from hexapod_cosim.models import HexapodError

pytestmark = pytest.mark.usefixtures("plant_build")


@pytest.mark.parametrize("name", TASKS)
@pytest.mark.filterwarnings("ignore:.*Box observation space.*infinity.*")
def test_every_environment_passes_the_checks_of_gymnasium(name: str) -> None:
    env = gymnasium.make(name)
    try:
        check_env(env.unwrapped, skip_render_check=True)
    finally:
        env.close()


def test_make_vec_makes_the_vector_environment_in_c() -> None:
    envs = gymnasium.make_vec("HexapodPush-v0", num_envs=3, threads=2)
    try:
        assert isinstance(envs.unwrapped, HexapodVectorEnv)
        assert envs.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
        observation, info = envs.reset(seed=1)
        assert observation in envs.observation_space
        assert info["drawn"]["friction.mu"].shape == (3,)
        observation, reward, terminated, truncated, info = envs.step(envs.action_space.sample())
        assert observation in envs.observation_space
        assert [part.shape for part in (reward, terminated, truncated)] == [(3,)] * 3
        assert reward == pytest.approx(sum(info["terms"].values()))
    finally:
        envs.close()


def test_one_environment_and_a_vector_of_one_give_the_same_bits() -> None:
    one, many = HexapodEnv(task="HexapodPush-v0"), HexapodVectorEnv(1, task="HexapodPush-v0")
    try:
        first, both = one.reset(seed=5)[0], many.reset(seed=5)[0]
        assert first.tobytes() == both.tobytes()
        for _ in range(5):
            action = one.action_space.sample()
            single, vector = one.step(action), many.step(action[None])
            assert single[0].tobytes() == vector[0].tobytes()
            assert single[1] == vector[1][0]
    finally:
        one.close()
        many.close()


def test_wrong_actions_are_refused_and_the_environment_has_not_stepped() -> None:
    env = HexapodEnv(duration=0.04)
    try:
        with pytest.raises(gymnasium.error.ResetNeeded, match="call reset"):
            env.step(np.zeros(18, np.float32))
        env.reset(seed=1)
        with pytest.raises(gymnasium.error.InvalidAction, match=r"shape \(17,\), expected \(18,\)"):
            env.step(np.zeros(17, np.float32))
        with pytest.raises(gymnasium.error.InvalidAction, match="expected finite numbers"):
            env.step(np.full(18, np.nan, np.float32))
        assert env.step(np.zeros(18, np.float32))[3] is False
        *_, truncated, info = env.step(np.zeros(18, np.float32))
        assert (truncated, info["reason"]) == (True, "time")
        with pytest.raises(gymnasium.error.ResetNeeded, match="call reset"):
            env.step(np.zeros(18, np.float32))
    finally:
        env.close()


def test_wrong_settings_are_refused_by_name() -> None:
    with pytest.raises(HexapodError, match=r"got 'foward'.*expected.*progress"):
        HexapodEnv(rewards={"foward": 1.0})
    with pytest.raises(HexapodError, match=r"got 'reward'.*did you mean 'rewards'"):
        HexapodEnv(reward={})
    with pytest.raises(HexapodError, match=r"lowest, highest"):
        HexapodEnv(command_vx=(0.2, 0.1))
    with pytest.raises(HexapodError, match=r"friction\.nu"):
        HexapodEnv(randomise={"friction.nu": (0.4, 0.5)})


def test_the_examples_of_the_page_work_as_typed(capsys: pytest.CaptureFixture[str]) -> None:
    page = (ROOT / "docs" / "learning.md").read_text(encoding="utf-8")
    names: dict[str, Any] = {}
    for example in re.findall(r"```python\n(.*?)```", page, flags=re.DOTALL):
        exec(example, names)
    assert "'progress'" in capsys.readouterr().out
    assert names["picture"].shape == (360, 480, 3)
