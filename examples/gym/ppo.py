"""Trains a policy with PPO of Stable-Baselines3: pip install stable-baselines3.

usage: python ppo.py [STEPS]

The observation is what a robot can measure. Some hundred steps show that everything is installed.
"""

from __future__ import annotations

import sys

import gymnasium

import hexapod_cosim.extensions.gym.envs  # noqa: F401  registers the environments
from hexapod_cosim.extensions.gym.train import WALKING


def make_env() -> gymnasium.Env:
    """Returns the environment, with episodes of 4 s and commands forward."""
    return gymnasium.make(
        "Hexapod-v0",
        observation="measurable",
        rewards=WALKING,
        duration=4.0,
        command_vx=(0.05, 0.15),
        command_vy=(0.0, 0.0),
        command_yaw_rate=(0.0, 0.0),
    )


def main(steps: int) -> None:
    """Trains for a number of steps and writes ppo_hexapod.zip."""
    from stable_baselines3 import PPO  # noqa: PLC0415  brings PyTorch
    from stable_baselines3.common.env_util import make_vec_env  # noqa: PLC0415

    model = PPO("MlpPolicy", make_vec_env(make_env, n_envs=8), n_steps=256, verbose=1)
    model.learn(total_timesteps=steps)
    model.save("ppo_hexapod")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 300_000)
