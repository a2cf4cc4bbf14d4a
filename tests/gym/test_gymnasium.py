"""The Gymnasium environments: the interface's own checks, ends, wrong arguments."""

from __future__ import annotations

import re
import runpy
from typing import Any

import gymnasium
import numpy as np
import pytest
from building import ROOT
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode

import hexapod_cosim.extensions.gym.envs  # noqa: F401  registers them
from hexapod_cosim.extensions.gym.environment import HexapodEnv
from hexapod_cosim.extensions.gym.vector import HexapodVectorEnv
from hexapod_cosim.models import HexapodError

pytestmark = pytest.mark.usefixtures("plant_build")


@pytest.mark.parametrize("name", ["Hexapod-v0", "HexapodRough-v0"])
def test_every_environment_passes_the_checks_of_gymnasium(name: str) -> None:
    env = gymnasium.make(name)
    try:
        check_env(env.unwrapped, skip_render_check=True)
    finally:
        env.close()


def test_observations_are_within_finite_bounds_also_when_scales_are_large() -> None:
    large = {"rotation": 1e6, "gravity": 3.0, "action": 1e4}
    env = gymnasium.make("Hexapod-v0", observation=large)
    try:
        space = env.observation_space
        assert isinstance(space, gymnasium.spaces.Box)
        assert space.high[[0, 3, 6]].tolist() == [100.0, 3.0, 100.0]
        env.reset(seed=0)
        observation = env.step(np.ones(18, np.float32))[0]
        assert observation in space
        assert np.abs(observation).max() == 100.0
    finally:
        env.close()


def test_the_environment_of_the_example_passes_the_checks_of_gymnasium() -> None:
    example = runpy.run_path(str(ROOT / "examples" / "gym" / "ppo.py"))
    env = example["make_env"]()
    try:
        check_env(env.unwrapped)
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
        with pytest.raises(gymnasium.error.InvalidAction, match=r"shape \(17,\).*shape \(18,\)"):
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


@pytest.mark.parametrize(
    ("setting", "value", "expected"),
    [
        ("max_tilt", -1.0, "a finite number > 0"),
        ("push_interval", 0.001, "a finite number >= 0.02"),
        ("action_scale", "a", "a finite number > 0"),
        ("terrain_seeds", 0, "a whole number, 1 or more"),
        ("tracking_width", (0.0, 1.0), "two finite numbers above 0"),
        ("command_vx", 0.1, "a range"),
        # a block that is left out would move the others to wrong places
        ("observation", {"velocity": 0.0, "angle": 1.0}, "a finite scale other than 0"),
    ],
)
def test_impossible_numbers_are_refused_before_anything_is_made(
    setting: str, value: Any, expected: str
) -> None:
    changes: dict[str, Any] = {setting: value}
    with pytest.raises(HexapodError, match=f"{setting}.*expected {expected}"):
        HexapodEnv(**changes)


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ({"num_envs": -1}, "a whole number, 1 or more"),
        ({"threads": 0}, "a whole number, 1 or more"),
        ({"autoreset_mode": "next"}, "one of NextStep, SameStep, Disabled"),
    ],
)
def test_impossible_vectors_are_refused(arguments: dict[str, Any], expected: str) -> None:
    with pytest.raises(HexapodError, match=f"expected {expected}"):
        HexapodVectorEnv(**arguments)


def test_wrong_seeds_and_masks_are_refused() -> None:
    envs = HexapodVectorEnv(2)
    try:
        for seed in ([1], [1, -1], [1.5, 2], 2**64 - 1):
            with pytest.raises(HexapodError, match="seed"):
                envs.reset(seed=seed)  # type: ignore[arg-type]
        for mask in ([True], [0.5, 1.0], "x"):
            with pytest.raises(HexapodError, match=r"mask of environments.*an array of 2 bool"):
                envs.reset(options={"reset_mask": mask})
        numbers, whole = np.arange(3, 5), np.int64(3)
        first = envs.reset(seed=numbers)[0]  # type: ignore[arg-type]
        assert first.tobytes() == envs.reset(seed=whole)[0].tobytes()  # type: ignore[arg-type]
    finally:
        envs.close()


def test_a_vector_steps_after_the_reset_of_all_its_robots_only() -> None:
    envs = HexapodVectorEnv(2, autoreset_mode="SameStep")
    try:
        still = np.zeros((2, 18), np.float32)
        with pytest.raises(gymnasium.error.ResetNeeded, match="the reset of 2 environments"):
            envs.step(still)
        envs.reset(options={"reset_mask": np.array([True, False])})
        with pytest.raises(gymnasium.error.ResetNeeded, match="the reset of 1 environments"):
            envs.step(still)
        envs.reset(options={"reset_mask": np.array([False, True])})
        assert not envs.step(still)[2].any()
    finally:
        envs.close()


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_infos_of_an_autoreset_have_the_end_and_what_was_drawn(mode: str) -> None:
    envs = HexapodVectorEnv(2, task="HexapodPush-v0", autoreset_mode=mode, duration=0.04)
    still = np.zeros((2, 18), np.float32)
    try:
        drawn = envs.reset(seed=1)[1]["drawn"]["friction.mu"]
        infos = [envs.step(still)[4] for _ in range(3)]
        assert infos[1]["reason"].tolist() == ["time", "time"]
        assert ("final_info" in infos[1]) == (mode == "SameStep")
        place = 1 if mode == "SameStep" else 2
        assert [place for place in range(3) if "drawn" in infos[place]] == [place]
        assert infos[place]["_drawn"].all()
        again = infos[place]["drawn"]["friction.mu"]
        assert ((again >= 0.5) & (again <= 0.9) & (again != drawn)).all()
    finally:
        envs.close()


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_an_episode_that_cannot_start_ends_with_its_message_and_is_followed_by_another(
    mode: str,
) -> None:
    # some of the heights are so low that the plant refuses to start with feet deep in the ground
    low = {"initial.position[3]": (0.02, 0.2)}
    envs = HexapodVectorEnv(1, autoreset_mode=mode, duration=0.02, randomise=low, max_tilt=3.0)
    still = np.zeros((1, 18), np.float32)
    try:
        envs.reset(seed=1)
        infos = [envs.step(still)[4] for _ in range(12)]
    finally:
        envs.close()
    failed = [place for place, info in enumerate(infos) if "message" in info]
    assert failed
    for place in failed:
        assert infos[place]["reason"].tolist() == ["failed"]
        assert "deep in the ground" in infos[place]["message"][0]
    later = [info["reason"][0] for info in infos[failed[0] + 1 :] if "reason" in info]
    assert "time" in later


def test_the_examples_of_the_page_work_as_typed(capsys: pytest.CaptureFixture[str]) -> None:
    page = (ROOT / "extensions" / "gym" / "README.md").read_text(encoding="utf-8")
    names: dict[str, Any] = {}
    for example in re.findall(r"```python\n(.*?)```", page, flags=re.DOTALL):
        exec(example, names)
    assert "'progress'" in capsys.readouterr().out
