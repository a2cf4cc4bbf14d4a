"""Heights of the ground that a policy observes, commands within an episode, pictures."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import hexapod_cosim.extensions.gym.envs  # noqa: F401  registers them
from hexapod_cosim.extensions.gym.batch import Batch
from hexapod_cosim.extensions.gym.environment import HexapodEnv
from hexapod_cosim.extensions.gym.plants import grounds
from hexapod_cosim.extensions.gym.settings import EnvSettings
from hexapod_cosim.models import HexapodError
from hexapod_cosim.models.ground.faces import ground_height

pytestmark = pytest.mark.usefixtures("plant_build")
HEIGHTS = {"heights": 1.0}
STILL = np.zeros(18, np.float32)


def turned(batch: Batch) -> tuple[NDArray[np.float64], float]:
    """Returns the torso's position [m] and its heading [rad]."""
    values = batch.values(0)
    w, x, y, z = (values[f"torso.quaternion[{number}]"] for number in range(1, 5))
    heading = math.atan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z))
    return np.array([values[f"torso.position[{axis}]"] for axis in (1, 2, 3)]), heading


def expected(settings: EnvSettings, batch: Batch, clearance: float, ground: int = 0) -> Any:
    """Returns the heights from the twin's ground at the places of the scan."""
    position, heading = turned(batch)
    terrain, found = grounds(settings)[ground].terrain, []
    for forward, left in settings.places:
        x = position[0] + math.cos(heading) * forward - math.sin(heading) * left
        y = position[1] + math.sin(heading) * forward + math.cos(heading) * left
        found.append(position[2] - ground_height(terrain, x, y) - clearance)
    return np.array(found)


def stance_height() -> float:
    """Returns the height of the torso in the stance on level ground [m], as the plant has it."""
    with Batch(EnvSettings(), 1, threads=1) as standing:
        standing.reset(seeds=[1])
        return float(turned(standing)[0][2])


def walked(settings: EnvSettings, steps: int) -> Batch:
    """Returns one robot that has turned by commands of the base controller."""
    batch = Batch(settings, 1, threads=1, autoreset="disabled")
    batch.reset(seeds=[4])
    for _ in range(steps):
        batch.step()
    return batch


def test_on_a_slope_the_heights_are_those_of_the_plane_also_of_a_turned_robot() -> None:
    settings = EnvSettings(
        terrain={"kind": "slope", "incline": 0.1, "heading": 0.7},
        base="kinematic",
        command_vx=(0.0, 0.0),
        command_yaw_rate=(0.4, 0.4),
        observation=HEIGHTS,
    )
    level = EnvSettings(observation=HEIGHTS)
    with Batch(level, 1, threads=1) as standing:
        standing.reset(seeds=[1])
        assert np.abs(standing.observation).max() < 1e-6  # the stance on level ground
    clearance = stance_height()
    with walked(settings, 100) as batch:
        assert turned(batch)[1] > 0.2
        assert batch.observation.shape == (1, 17 * 11)
        # a plane is bilinear: nothing is lost by the samples but the digits of a float
        assert batch.observation[0] == pytest.approx(expected(settings, batch, clearance), abs=1e-6)


def test_on_blocks_the_heights_are_those_of_the_blocks_within_a_sample() -> None:
    settings = EnvSettings(
        terrain={"kind": "rubble", "max_height": 0.03, "stone_size": 0.2, "platform_size": 0.4},
        terrain_seeds=3,
        observation=HEIGHTS,
        scan_spacing=0.1,
    )
    with Batch(settings, 1, threads=1) as batch:
        batch.reset(seeds=[2])
        number = int(batch.drawn(0)["terrain.grid"])
        clearance = stance_height()
        given = expected(settings, batch, clearance, number - 1)
        same = np.isclose(batch.observation[0], given, atol=1e-6)
        assert same.mean() > 0.7  # the others are between two blocks
        assert np.ptp(batch.observation[0]) > 0.01


def test_heights_are_limited_to_a_metre_and_scaled() -> None:
    settings = EnvSettings(
        terrain={"kind": "stepping_stones", "depth": 3.0, "platform_size": 1.5, "stone_size": 0.2},
        observation={"heights": 5.0},
        scan_length=4.0,
        scan_width=4.0,
        scan_spacing=0.5,
    )
    with Batch(settings, 1, threads=1) as batch:
        batch.reset(seeds=[2])
        assert batch.observation.max() == 5.0
        assert abs(batch.observation[0, 40]) < 1e-3  # below the torso


def test_commands_change_within_an_episode_at_the_interval_and_only_then() -> None:
    settings = EnvSettings(
        command_interval=0.1,
        duration=0.4,
        observation={"command": 1.0},
        rewards={"tracking_ang_vel": 1.0},
    )
    with Batch(settings, 2, threads=1, autoreset="next_step") as batch:
        batch.reset(seeds=[5, 6])
        seen = [batch.observation.copy()]
        for _ in range(20):
            batch.step()
            seen.append(batch.observation.copy())
        changed = [i for i in range(1, 21) if not np.array_equal(seen[i], seen[i - 1])]
        assert changed == [5, 10, 15, 20]
        first, again = seen[0], seen
        batch.reset(seeds=[5, 6])
        assert np.array_equal(batch.observation, first)
        assert not np.array_equal(again[5][0], again[5][1])


def test_the_reward_of_a_step_is_judged_by_the_command_that_it_had() -> None:
    settings = EnvSettings(
        duration=0.2,
        command_interval=0.04,
        command_vx=(0.0, 0.0),
        command_vy=(0.0, 0.0),
        command_yaw_rate=(0.0, 1.0),
        rewards={"tracking_ang_vel": 1.0},
        tracking_width=(0.1, 1e-2),
        observation={"command": 1.0},
    )
    with Batch(settings, 1, threads=1) as batch:
        batch.reset(seeds=[5])
        for _ in range(6):
            command = float(batch.observation[0, 2])
            batch.step()
            rate = batch.values(0)["torso.angular_velocity[3]"]
            wanted = math.exp(-(((command - rate) / 1e-2) ** 2)) * 0.02
            assert batch.reward[0] == pytest.approx(wanted, rel=1e-3, abs=1e-12)


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"scan_spacing": 1e-3, "observation": HEIGHTS}, r"at most 10000 places"),
        ({"observation": "legged_gym_hights"}, r"did you mean 'legged_gym_heights'"),
    ],
)
def test_wrong_scans_and_intervals_are_refused(wrong: dict[str, Any], told: str) -> None:
    with pytest.raises(HexapodError, match=f"(?s){told}"):
        HexapodEnv(**wrong)
