"""Measures environment steps per second and core, and the error of the path that they compute."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.extensions.gym.batch import Batch
from hexapod_cosim.extensions.gym.settings import JOINTS, RATE, EnvSettings

Array = NDArray[np.float64]
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
