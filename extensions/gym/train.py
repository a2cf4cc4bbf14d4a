"""Trains a policy with an evolution strategy: no gradients, no other package.

In each generation, pairs of policies with opposite random changes walk one episode each, all in one
vector environment. The changes are weighted by the ranks of their returns (Salimans et al.,
Evolution strategies as a scalable alternative to reinforcement learning, 2017), and Adam follows
the sum.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hexapod_cosim.extensions.gym.batch import Batch
from hexapod_cosim.extensions.gym.checks import check_count, check_seeds
from hexapod_cosim.extensions.gym.policy import FREE, FREE_SIZE, INPUTS, Policy, symmetric_weights
from hexapod_cosim.extensions.gym.settings import MEASURABLE, EnvSettings, Positive
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.schema import check_record

FIRST, SECOND, TINY = 0.9, 0.99, 1e-8  # of Adam
# weights of the reward: velocity along the command first, then what keeps the walk smooth
WALKING = {
    "progress": 15.0,
    "tracking_lin_vel": 2.0,
    "tracking_ang_vel": 0.5,
    "alive": 0.2,
    "lin_vel_z": -2.0,
    "ang_vel_xy": -0.05,
    "orientation": -2.0,
    "power": -0.02,
    "torques": -0.01,
    "action_rate": -0.05,
    "feet_slip": -3.5,
    "termination": -5.0,
}


@dataclass(frozen=True, kw_only=True)
class TrainSettings:
    """Settings of the training."""

    minutes: Positive = 8.0  # of the clock on the wall
    generations: int = 100_000  # at most
    pairs: int = 48  # of policies in a generation
    size: Positive = 0.08  # of the random changes
    rate: Positive = 0.03  # of Adam
    seed: int = 0

    def __post_init__(self) -> None:
        """Checks the numbers. Raises HexapodError."""
        check_record(self, "training")
        for name in ("generations", "pairs"):
            check_count(name, getattr(self, name))
        check_seeds([self.seed], 1)


@dataclass(frozen=True, kw_only=True)
class Progress:
    """One generation: number, mean and best return of its policies, seconds since the start."""

    generation: int
    mean: float
    best: float
    distance: float  # m  mean way forward in an episode
    seconds: float


Report = Callable[[Progress], None]


def training_settings(settings: EnvSettings) -> EnvSettings:
    """Returns an environment for training: measurable observations, short episodes, speeds forward.

    The term of the tracked speed is narrower than that of the environments, whose standing robots
    get most of it.
    """
    return replace(
        settings,
        observation=MEASURABLE,
        rewards=WALKING,
        tracking_width=(0.05, 0.25),
        duration=4.0,
        command_vx=(0.0, 0.15),
        command_vy=(0.0, 0.0),
        command_yaw_rate=(0.0, 0.0),
    )


@dataclass
class Adam:
    """Steps of gradient ascent with estimates of the gradient's moments (Kingma and Ba, 2015)."""

    rate: float
    mean: Array = field(default_factory=lambda: np.zeros(FREE_SIZE))
    square: Array = field(default_factory=lambda: np.zeros(FREE_SIZE))
    count: int = 0

    def step(self, gradient: Array) -> Array:
        """Returns the change of the parameters (FREE_SIZE,) for a gradient."""
        self.count += 1
        self.mean = FIRST * self.mean + (1.0 - FIRST) * gradient
        self.square = SECOND * self.square + (1.0 - SECOND) * gradient**2
        mean = self.mean / (1.0 - FIRST**self.count)
        square = self.square / (1.0 - SECOND**self.count)
        return self.rate * mean / (np.sqrt(square) + TINY)


def first_parameters(rng: np.random.Generator) -> Array:
    """Returns the parameters (FREE_SIZE,) before training: random units and actions of 0."""
    size = int(np.prod(FREE["hidden_weight"]))
    free = np.zeros(FREE_SIZE)
    weight = rng.standard_normal((size // INPUTS, INPUTS)) * 0.3
    weight[:, -2:] *= 3.0  # the clock moves the legs before anything else does
    free[:size] = weight.ravel()
    return free


def returns(batch: Batch, policies: Array, seed: int) -> tuple[Array, float]:
    """Returns the returns (count,) of policies over one episode, and their mean way [m].

    batch: same number of environments, with autoreset "disabled". All walk the episode of the same
    seed, so that only the policies differ.
    """
    weights = symmetric_weights(policies)
    batch.reset(seeds=[seed] * batch.count)
    total = np.zeros(batch.count)
    for _ in range(batch.settings.steps):
        observed = batch.observation.astype(np.float64)[:, :, None]
        hidden = np.tanh((weights["hidden_weight"] @ observed)[:, :, 0] + weights["hidden_bias"])
        batch.action[:] = (weights["action_weight"] @ hidden[:, :, None])[:, :, 0] + weights[
            "action_bias"
        ]
        going = ~(batch.terminated | batch.truncated)
        batch.step()
        total += np.where(going, batch.reward, 0.0)
    ways = [batch.values(index)["torso.position[1]"] for index in range(batch.count)]
    return total, float(np.mean(ways))


def ranks(values: Array) -> Array:
    """Returns the ranks of values, from -0.5 for the least to 0.5 for the largest."""
    order = np.empty(len(values))
    order[np.argsort(values, kind="stable")] = np.arange(len(values))
    return order / (len(values) - 1) - 0.5


def still_rising(means: Sequence[float]) -> bool:
    """Returns whether the mean returns of generations rise to the end.

    The last quarter is compared with the one before; the rise must exceed two standard errors.
    """
    quarter = len(means) // 4
    if quarter < 2:
        return True
    before, last = np.array(means[-2 * quarter : -quarter]), np.array(means[-quarter:])
    error = math.sqrt((before.var(ddof=1) + last.var(ddof=1)) / quarter)
    return float(last.mean() - before.mean()) > 2.0 * error


def train(settings: EnvSettings, how: TrainSettings, report: Report) -> tuple[Policy, bool]:
    """Trains a policy until the time is over or all generations are done.

    Returns the policy, and whether more training would better it, see still_rising(). Ctrl-C ends
    the training with the policy of the last whole generation; KeyboardInterrupt is raised before
    the first one. Raises HexapodError for impossible settings of the environment.
    """
    begin, rng = time.monotonic(), np.random.default_rng(how.seed)
    free, ascent, means = first_parameters(rng), Adam(how.rate), list[float]()
    with Batch(settings, 2 * how.pairs, autoreset="disabled") as batch:
        try:
            for generation in range(how.generations):
                changes = rng.standard_normal((how.pairs, FREE_SIZE))
                policies = free + how.size * np.concatenate([changes, -changes])
                found, way = returns(batch, policies, seed=generation)
                weight = ranks(found)
                free = free + ascent.step((weight[: how.pairs] - weight[how.pairs :]) @ changes)
                means.append(float(found.mean()))
                seconds = time.monotonic() - begin
                report(
                    Progress(
                        generation=generation,
                        mean=means[-1],
                        best=float(found.max()),
                        distance=way,
                        seconds=seconds,
                    )
                )
                if seconds > 60.0 * how.minutes:
                    break
        except KeyboardInterrupt:
            if not ascent.count:
                raise
        policy = Policy(
            **symmetric_weights(free),
            robot=batch.robot.name,
            clock=settings.clock,
            action_scale=settings.action_scale,
        )
        return policy, still_rising(means)
