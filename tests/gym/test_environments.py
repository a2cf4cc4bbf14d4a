"""The vector environment in C: the same bits whatever the batch, refusals, ends of episodes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from hexapod_cosim.extensions.gym.batch import Batch
from hexapod_cosim.extensions.gym.settings import MEASURABLE, REASONS, TERMS, EnvSettings

SEEDS = (11, 7, 30, 2, 5)
STEPS = 25
SHORT = EnvSettings(
    duration=0.2, command_vx=(0.05, 0.15), randomise={"friction.mu": (0.4, 0.9)}, push_force=20.0
)
pytestmark = pytest.mark.usefixtures("plant_build")


def action(seed: int, step: int) -> NDArray[np.float64]:
    """An action that depends on the seed of its environment alone."""
    return 0.3 * np.random.default_rng([seed, step]).standard_normal(18)


def walk(seeds: tuple[int, ...], **options: Any) -> dict[int, list[bytes]]:
    """Returns the bytes of each environment's observations, rewards and flags, by its seed."""
    found: dict[int, list[bytes]] = {seed: [] for seed in seeds}
    with Batch(SHORT, len(seeds), **options) as batch:
        batch.reset(seeds=seeds)
        for step in range(STEPS):
            batch.action[:] = [action(seed, step) for seed in seeds]
            batch.step()
            for place, seed in enumerate(seeds):
                parts = (batch.observation, batch.reward, batch.terminated, batch.truncated)
                found[seed] += [part[place].tobytes() for part in parts]
    return found


@pytest.fixture(scope="module")
def reference(plant_build: Path) -> dict[int, list[bytes]]:
    """Five environments in one thread over two and a half episodes."""
    return walk(SEEDS, threads=1)


def test_bits_do_not_depend_on_the_number_of_threads(reference: dict[int, list[bytes]]) -> None:
    assert walk(SEEDS, threads=3) == reference


def test_bits_do_not_depend_on_the_batch_or_its_order(reference: dict[int, list[bytes]]) -> None:
    chosen = (5, 30)
    assert walk(chosen, threads=1) == {seed: reference[seed] for seed in chosen}


@pytest.fixture
def batch() -> Iterator[Batch]:
    """Three environments that the caller resets."""
    with Batch(SHORT, 3, threads=2, autoreset="disabled") as batch:
        batch.reset(seeds=(1, 2, 3))
        yield batch


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_an_action_that_is_not_finite_is_refused_without_disturbing_the_others(
    batch: Batch, bad: float
) -> None:
    before, still = batch.observation[1].copy(), batch.values(1)
    batch.action[:] = 0.1
    batch.action[1, 4] = bad
    batch.step()
    assert batch.refused.tolist() == [False, True, False]
    assert batch.observation[1].tobytes() == before.tobytes()
    assert batch.values(1) == still
    assert (batch.reward[1], batch.reason[1]) == (0.0, 0)
    with Batch(SHORT, 1, threads=1) as alone:
        alone.reset(seeds=[3])
        alone.action[:] = 0.1
        alone.step()
        assert batch.observation[2].tobytes() == alone.observation[0].tobytes()


def test_a_refused_environment_continues_as_if_it_had_not_been_called(batch: Batch) -> None:
    batch.action[:] = np.nan
    batch.step()
    batch.action[:] = 0.2
    batch.step()
    after = batch.observation.copy()
    batch.reset(seeds=(1, 2, 3))
    batch.step()
    assert batch.observation.tobytes() == after.tobytes()


def test_the_next_step_resets_an_ended_episode_whatever_its_action() -> None:
    with Batch(SHORT, 2, threads=1) as batch:
        batch.reset(seeds=(1, 2))
        for _ in range(10):
            assert not batch.truncated.any()
            batch.step()
        assert batch.truncated.all()
        assert [REASONS[reason] for reason in batch.reason] == ["time", "time"]
        batch.action[:] = np.nan
        batch.step()
        assert not batch.truncated.any()
        assert not batch.refused.any()
        assert batch.reward.tolist() == [0.0, 0.0]


def test_the_same_step_resets_and_keeps_the_last_observation() -> None:
    with (
        Batch(SHORT, 1, threads=1, autoreset="same_step") as same,
        Batch(SHORT, 1, threads=1, autoreset="next_step") as following,
    ):
        for batch in (same, following):
            batch.reset(seeds=[4])
            batch.action[:] = 0.2
            for _ in range(10):
                batch.step()
        assert same.truncated.tolist() == [True]
        assert same.last.tobytes() == following.observation.tobytes()
        assert same.reward.tobytes() == following.reward.tobytes()
        following.step()
        assert same.observation.tobytes() == following.observation.tobytes()


def test_without_autoreset_an_ended_episode_waits_for_its_reset(batch: Batch) -> None:
    for _ in range(10):
        batch.step()
    end = batch.observation.copy()
    batch.step()
    assert batch.truncated.all()
    assert batch.observation.tobytes() == end.tobytes()
    batch.reset(mask=np.array([False, True, False]))
    assert batch.observation[0].tobytes() == end[0].tobytes()
    batch.step()
    assert batch.truncated.tolist() == [True, False, True]


def test_a_robot_that_falls_ends_its_episode_alone_and_says_why() -> None:
    settings = EnvSettings(duration=5.0, command_vx=(0.1, 0.1))
    with Batch(settings, 3, threads=2, autoreset="disabled") as batch:
        batch.reset(seeds=(1, 2, 3))
        steps = 0
        while not batch.terminated.any() and steps < 100:
            batch.action[1] = np.tile([0.0, 1.0, -1.0], 6)  # knees up: the torso sinks
            batch.step()
            steps += 1
        assert batch.terminated.tolist() == [False, True, False]
        assert [REASONS[reason] for reason in batch.reason] == ["", "belly", ""]
        place = TERMS.index("termination")
        assert batch.term[:, place].tolist() == [0.0, -1.0, 0.0]


def test_terms_are_those_of_their_formulas() -> None:
    weights = dict.fromkeys(TERMS, 1.0)
    settings = EnvSettings(rewards=weights, command_vx=(0.1, 0.1), command_yaw_rate=(0.2, 0.2))
    with Batch(settings, 1, threads=1) as batch:
        batch.reset(seeds=[1])
        batch.action[:] = action(1, 0)
        batch.step()
        seen, value = batch.observation[0].astype(float), batch.values(0)
        terms = dict(zip(TERMS, batch.term[0] / 0.02, strict=True))
    command = seen[9:12] / [2.0, 2.0, 0.25]
    v, w, g = seen[0:3] / 2.0, seen[3:6] / 0.25, seen[6:9]
    torque, speed = (
        np.array([x for name, x in value.items() if name.endswith(f".{quantity}")])
        for quantity in ("torque", "speed")
    )
    assert terms["tracking_lin_vel"] == pytest.approx(
        np.exp(-np.sum((command[:2] - v[:2]) ** 2) / 0.1**2), rel=1e-5
    )
    assert terms["tracking_ang_vel"] == pytest.approx(
        np.exp(-(((0.2 - w[2]) / 0.25) ** 2)), rel=1e-5
    )
    assert terms["lin_vel_z"] == pytest.approx(v[2] ** 2, rel=1e-5)
    assert terms["ang_vel_xy"] == pytest.approx(w[0] ** 2 + w[1] ** 2, rel=1e-5)
    assert terms["orientation"] == pytest.approx(g[0] ** 2 + g[1] ** 2, rel=1e-5)
    assert terms["torques"] == pytest.approx(np.sum(torque**2), rel=1e-12)
    assert terms["dof_vel"] == pytest.approx(np.sum(speed**2), rel=1e-12)
    assert terms["power"] == pytest.approx(np.sum(np.maximum(torque * speed, 0.0)), rel=1e-12)
    assert terms["action_rate"] == pytest.approx(np.sum(batch.action.astype(float) ** 2), rel=1e-12)
    assert (terms["alive"], terms["termination"]) == (pytest.approx(1.0), 0.0)
    assert 0.02 * sum(terms.values()) == pytest.approx(batch.reward[0], rel=1e-12)


def test_gravity_points_down_in_a_level_torso_and_the_clock_is_on_the_circle() -> None:
    with Batch(EnvSettings(observation=MEASURABLE, clock=2.0), 1, threads=1) as batch:
        batch.reset(seeds=[1])
        assert batch.observation[0, 3:6] == pytest.approx([0.0, 0.0, -1.0], abs=1e-3)
        assert batch.observation[0, -2:].tolist() == [0.0, 1.0]
        batch.step()
        angle = 2.0 * np.pi * 2.0 * 0.02
        assert batch.observation[0, -2:] == pytest.approx([np.sin(angle), np.cos(angle)], abs=1e-7)


def test_drawn_parameters_keep_their_ranges_and_differ_between_episodes() -> None:
    with Batch(SHORT, 20, threads=1) as batch:
        batch.reset(seeds=range(20))
        first = [batch.drawn(index)["friction.mu"] for index in range(20)]
        batch.reset()
        second = [batch.drawn(index)["friction.mu"] for index in range(20)]
    assert all(0.4 <= mu <= 0.9 for mu in first + second)
    assert len({*first, *second}) == 40
