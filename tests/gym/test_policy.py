"""Policies: their mirror symmetry, their FMU, their training."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command import Call

from hexapod_cosim.cosim.export.plant import export_interface
from hexapod_cosim.cosim.export.validation import find_problems
from hexapod_cosim.cosim.interface.names import joint_names, vector_names
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.extensions.gym.batch import Batch
from hexapod_cosim.extensions.gym.policy import (
    FREE_SIZE,
    INPUTS,
    Policy,
    action_mirror,
    load_policy,
    load_policy_interface,
    observation_mirror,
    standing_policy,
    symmetric_weights,
)
from hexapod_cosim.extensions.gym.settings import task
from hexapod_cosim.extensions.gym.train import (
    Progress,
    TrainSettings,
    still_rising,
    train,
    training_settings,
)
from hexapod_cosim.models import HexapodError, load_robot

pytestmark = pytest.mark.usefixtures("plant_build")
INPUT_NAMES = [
    *("command.vx", "command.vy", "command.yaw_rate"),
    *joint_names("angle"),
    *vector_names("torso.quaternion", 4),
    *vector_names("torso.angular_velocity"),
]


@pytest.fixture(scope="module")
def policy() -> Policy:
    """A symmetric policy with random weights, whose actions are partly limited."""
    free = 0.4 * np.random.default_rng(1).standard_normal(FREE_SIZE)
    return Policy(**symmetric_weights(free), robot="athena", clock=1.5, action_scale=0.3)


@pytest.fixture(scope="module")
def fmu_path(policy: Policy, tmp_path_factory: pytest.TempPathFactory, plant_build: Path) -> Path:
    interface = load_policy_interface(policy, load_robot("athena"))
    return export_interface(interface, tmp_path_factory.mktemp("p") / "policy.fmu")


@pytest.fixture
def fmu(fmu_path: Path) -> Iterator[Fmu]:
    with Fmu(fmu_path, name="policy") as opened:
        yield opened


def test_a_symmetric_policy_answers_a_mirrored_observation_with_the_mirrored_action(
    policy: Policy,
) -> None:
    seen = np.random.default_rng(2).standard_normal((7, INPUTS))
    places, signs = observation_mirror()
    joints, sides = action_mirror()
    assert policy(seen[:, places] * signs) == pytest.approx(
        policy(seen)[:, joints] * sides, rel=1e-12, abs=1e-12
    )
    assert (seen[:, places] * signs)[:, places] * signs == pytest.approx(seen, abs=0.0)


def test_the_fmu_acts_as_the_policy_does_in_its_environment(policy: Policy, fmu: Fmu) -> None:
    settings = replace(
        training_settings(task("Hexapod-v0")), action_scale=0.3, command_yaw_rate=(0.2, 0.2)
    )
    inputs, actions = fmu.block(INPUT_NAMES), fmu.block(joint_names("action"))
    angles = fmu.block(joint_names("angle_ref"))
    stance = np.array([leg.stance for leg in load_robot("athena").legs]).ravel()
    fmu.initialise(0.0, 1.0)
    with Batch(settings, 1, threads=1) as batch:
        batch.reset(seeds=[3])
        for step in range(20):
            wanted = np.clip(policy(batch.observation[0].astype(float)), -1.0, 1.0)
            value = batch.values(0)
            command = batch.observation[0, 6:9] / [10.0, 10.0, 1.0]
            inputs.values[:] = [*command, *(value[name] for name in INPUT_NAMES[3:])]
            inputs.set()
            actions.get()
            angles.get()
            # observations are float32
            assert actions.values == pytest.approx(wanted, abs=3e-6)
            assert angles.values == pytest.approx(stance + 0.3 * actions.values, abs=1e-15)
            fmu.step(0.02 * step, 0.02)
            batch.action[0] = wanted
            batch.step()


def test_the_fmu_holds_its_action_between_ticks(fmu: Fmu) -> None:
    speed, action = fmu.block(["command.vx"]), fmu.block(joint_names("action"))
    fmu.initialise(0.0, 1.0)
    seen = []
    for step in range(8):
        speed.values[0] = 0.01 * step
        speed.set()
        action.get()
        seen.append(action.values.tolist())
        fmu.step(0.005 * step, 0.005)
    assert seen[0] == seen[1] == seen[2] == seen[3]
    assert seen[4] == seen[5] == seen[6] == seen[7]
    assert seen[0] != seen[4]


def test_the_fmu_is_sound(fmu_path: Path) -> None:
    assert find_problems(fmu_path) == []


def test_a_policy_of_another_robot_is_refused(policy: Policy) -> None:
    with pytest.raises(HexapodError, match=r"got 'phantomx_mk4', expected athena"):
        load_policy_interface(policy, load_robot("phantomx_mk4"))


def test_a_saved_policy_is_read_again_and_other_files_are_refused(
    policy: Policy, tmp_path: Path
) -> None:
    policy.save(tmp_path / "policy.npz")
    again = load_policy(tmp_path / "policy.npz")
    seen = np.ones(INPUTS)
    assert again(seen).tobytes() == policy(seen).tobytes()
    assert (again.robot, again.clock, again.action_scale) == ("athena", 1.5, 0.3)


NONE = "a file that is no archive of numbers"


@pytest.mark.parametrize(
    ("content", "got"),
    [
        (b"policy", NONE),
        (b"", NONE),
        (np.zeros(3), NONE),
        (None, "No such file or directory"),
        ({"hidden_weight": None}, "a file without hidden_weight"),
        ({"action_bias": "a"}, r"action_bias that is not of finite numbers of shape \(18,\)"),
        (
            {"hidden_bias": np.zeros(3)},
            r"hidden_bias that is not of finite numbers of shape \(16,\)",
        ),
        ({"clock": "fast"}, r"clock that is not of finite numbers of shape \(\)"),
        ({"action_scale": math.nan}, r"action_scale that is not of finite numbers of shape \(\)"),
    ],
)
def test_a_file_that_is_no_policy_is_refused(
    policy: Policy, tmp_path: Path, content: Any, got: str
) -> None:
    path = tmp_path / "x.npz"
    if isinstance(content, bytes):
        path.write_bytes(content)
    elif isinstance(content, np.ndarray):
        with path.open("wb") as file:
            np.save(file, content)
    elif content is not None:
        changed = {**vars(policy), **content}
        np.savez(path, **{name: one for name, one in changed.items() if one is not None})
    with pytest.raises(HexapodError, match=f"x.npz: not a policy: got '{got}', expected"):
        load_policy(path)


def test_training_is_repeatable_and_leaves_the_standing_policy() -> None:
    settings = replace(training_settings(task("Hexapod-v0")), duration=0.1)
    how = TrainSettings(generations=2, pairs=2, seed=4)
    policies = [train(settings, how, lambda _: None)[0] for _ in range(2)]
    first, second = (policy(np.ones(INPUTS)) for policy in policies)
    assert first.tobytes() == second.tobytes()
    assert np.abs(first - standing_policy("athena")(np.ones(INPUTS))).max() > 0.01


def test_the_commands_train_and_export_also_another_robot(call: Call, tmp_path: Path) -> None:
    policy, fmu = tmp_path / "policy.npz", tmp_path / "policy.fmu"
    robot = ["--robot", "phantomx_mk4"]
    assert call("gym", "train", "-o", policy, "--minutes", "0.001", *robot)[0] == 0
    assert load_policy(policy).robot == "phantomx_mk4"
    assert call("gym", "export", policy, "-o", fmu, *robot)[0] == 0
    assert fmu.is_file()
    assert "not a policy" in call("gym", "export", fmu, "-o", fmu)[2]
    assert "HexapodRough-v0" in call("list", "environments")[1]


@pytest.mark.parametrize("option", ["--minutes=nan", "--generations=0", "--seed=-1"])
def test_the_command_refuses_before_it_trains(call: Call, tmp_path: Path, option: str) -> None:
    code, out, err = call("gym", "train", "-o", tmp_path / "policy.npz", option)
    assert code == 1
    assert "expected" in err
    assert not out
    assert not list(tmp_path.iterdir())


def test_an_interrupted_training_keeps_the_policy_of_its_last_generation() -> None:
    settings = replace(training_settings(task("Hexapod-v0")), duration=0.1)

    def interrupt(progress: Progress) -> None:
        if progress.generation == 1:
            raise KeyboardInterrupt

    kept, _ = train(settings, TrainSettings(pairs=2, seed=4), interrupt)
    whole, _ = train(settings, TrainSettings(pairs=2, seed=4, generations=2), lambda _: None)
    assert kept.action_weight.tobytes() == whole.action_weight.tobytes()


def test_training_is_too_little_while_the_returns_rise_above_their_noise() -> None:
    noise = np.random.default_rng(0).standard_normal(40)
    assert still_rising((noise + np.arange(40)).tolist())
    assert not still_rising((noise + np.minimum(np.arange(40), 15)).tolist())
    assert still_rising([1.0, 1.0])  # too few generations to tell
