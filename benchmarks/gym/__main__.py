"""Environment steps per second: the vector environment in C, and mujoco.rollout on the same robot.

usage: python -m benchmarks.gym

All walk the same open-loop tripod gait, held for 20 ms at a time. The error of a path is measured
against a fine solution of the same engine, because the contact laws of the two differ. Speeds are
per second of processor time and core, so that other processes disturb them little; those of the
clock are shown too.
"""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from mujoco import rollout
from numpy.typing import NDArray

from hexapod_cosim.extensions.gym.batch import Batch
from hexapod_cosim.extensions.gym.settings import JOINTS, RATE, EnvSettings
from hexapod_cosim.models import load_robot
from hexapod_cosim.models.mjcf import robot_to_mjcf

Array = NDArray[np.float64]
COUNT, DURATION = 64, 5.0  # robots; s
ROLLED = 8  # robots of a rollout, which takes longer
TIMESTEPS = (0.002, 0.001)  # s
FINE = 0.0002  # s
JUDGED = 2  # robots whose paths are compared
FULL = mujoco.mjtState.mjSTATE_FULLPHYSICS
SWING, LIFT = 0.5, 0.8  # 1  amplitudes of the actions of coxa and femur: a stride of 70 mm
TRIPOD = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])  # phases of LF LM LR RF RM RR
SIDES = np.array([1.0, 1.0, 1.0, -1.0, -1.0, -1.0])
NAMES = ("torso.position[1]", "torso.position[2]", "torso.position[3]")


def walking_action(step: int, count: int) -> Array:
    """Returns the actions (count, 18) of an open-loop tripod gait; robots differ in their phase."""
    phase = 2.0 * np.pi * (step / RATE + np.arange(count) / max(count, 1))
    turn, rise = np.sin(phase)[:, None], np.maximum(np.cos(phase)[:, None] * TRIPOD, 0.0)
    action = np.zeros((count, JOINTS))
    ramp = min(step / RATE, 1.0)
    action[:, 0::3] = -SWING * ramp * turn * TRIPOD * SIDES
    action[:, 1::3] = LIFT * ramp * rise
    return action


def ways(settings: EnvSettings, count: int, steps: int) -> Array:
    """Returns the positions (steps, count, 3) [m] of the torsos over a walk."""
    found = np.zeros((steps, count, 3))
    with Batch(settings, count) as batch:
        batch.reset(seeds=range(count))
        for step in range(steps):
            batch.action[:] = walking_action(step, count)
            batch.step()
            for index in range(count):
                values = batch.values(index)
                found[step, index] = [values[name] for name in NAMES]
    return found


def path_error(settings: EnvSettings, count: int = 8, steps: int = 500) -> float:
    """Returns the largest distance [m] from the path of an exact solution, over all robots."""
    exact = ways(replace(settings, solver="rosw3", tolerance=1e-6, step_max=0.002), count, steps)
    difference = ways(settings, count, steps) - exact
    return float(np.linalg.norm(difference, axis=2).max())


def steps_per_second(
    settings: EnvSettings, *, count: int, threads: int, steps: int
) -> tuple[float, float]:
    """Returns environment steps per second of the clock, and per second of processor time."""
    actions = [walking_action(step, count) for step in range(steps)]
    with Batch(settings, count, threads=threads) as batch:
        batch.reset(seeds=range(count))
        wall, processor = time.perf_counter(), time.process_time()
        for action in actions:
            batch.action[:] = action
            batch.step()
        processor = time.process_time() - processor
        wall = time.perf_counter() - wall
    return count * steps / wall, count * steps / processor


def bench(*, count: int = 64, duration: float = 10.0, threads: Sequence[int] | None = None) -> str:
    """Returns a table of speeds for 1 and all cores, with the error of the path."""
    settings = replace(EnvSettings(), command_vx=(0.1, 0.1), duration=2.0 * duration)
    steps, cores = round(duration * RATE), os.cpu_count() or 1
    error = path_error(settings)
    lines = [
        f"Hexapod-v0, {count} robots in a tripod gait of {duration:g} s at {RATE} Hz; "
        f"worst path error of 8 robots over 10 s: {1e3 * error:.2f} mm",
        "threads   steps/s   steps/s and core of processor time   scaling",
    ]
    alone = 0.0
    for number in dict.fromkeys(threads or (1, cores)):
        wall, processor = steps_per_second(settings, count=count, threads=number, steps=steps)
        alone = alone or wall
        lines.append(
            f"{number:7d}  {wall:8.0f}   {processor:34.0f}   {100.0 * wall / alone / number:6.0f} %"
        )
    return "\n".join(lines)


@dataclass(frozen=True)
class Rollout:
    """A rollout of mujoco: torso positions (robots, steps, 3) [m] and times [s]."""

    position: Array
    wall: float
    processor: float


def controls(count: int, steps: int, substeps: int, stance: Array) -> Array:
    """Returns commanded angles (count, steps * substeps, 18) [rad] of the tripod gait."""
    scale = EnvSettings().action_scale
    actions = np.stack([walking_action(step, count) for step in range(steps)], axis=1)
    return np.repeat(stance + scale * actions, substeps, axis=1)


def roll(timestep: float, *, count: int, steps: int, threads: int) -> Rollout:
    """Rolls robots out over a number of steps of 20 ms, with this time step [s]."""
    robot = load_robot("athena")
    model = mujoco.MjModel.from_xml_string(robot_to_mjcf(robot))
    model.opt.timestep = timestep
    data = [mujoco.MjData(model) for _ in range(threads)]
    mujoco.mj_resetDataKeyframe(model, data[0], 0)
    state = np.zeros(mujoco.mj_stateSize(model, FULL))
    mujoco.mj_getState(model, data[0], state, FULL)
    stance = np.array([leg.stance for leg in robot.legs]).ravel()
    substeps = round(1.0 / (RATE * timestep))
    given = controls(count, steps, substeps, stance)[:, :, :JOINTS]
    wall, processor = time.perf_counter(), time.process_time()
    states, _ = rollout.rollout(model, data, np.tile(state, (count, 1)), given)
    processor = time.process_time() - processor
    wall = time.perf_counter() - wall
    # the full state begins with the time, then the torso's position
    return Rollout(np.array(states[:, substeps - 1 :: substeps, 1:4]), wall, processor)


def mujoco_table(cores: int) -> str:
    """Returns the table of mujoco.rollout."""
    steps = round(DURATION * RATE)
    exact = roll(FINE, count=ROLLED, steps=steps, threads=cores).position[:JUDGED]
    lines = [
        f"mujoco.rollout {mujoco.__version__}, the same robot as `hexapod export --mjcf` writes it",
        "time step   threads   steps/s   steps/s and core of processor time   worst path error",
    ]
    for timestep in TIMESTEPS:
        for threads in dict.fromkeys((1, cores)):
            found = roll(timestep, count=ROLLED, steps=steps, threads=threads)
            error = np.linalg.norm(found.position[:JUDGED] - exact, axis=2).max()
            number = ROLLED * steps
            lines.append(
                f"{1e3 * timestep:6.1f} ms   {threads:7d}  {number / found.wall:8.0f}   "
                f"{number / found.processor:34.0f}   {1e3 * error:13.2f} mm"
            )
    return "\n".join(lines)


def main() -> None:
    """Prints the tables."""
    cores = os.cpu_count() or 1
    print(bench(count=COUNT, duration=DURATION), flush=True)
    print()
    print(mujoco_table(cores))


if __name__ == "__main__":
    main()
