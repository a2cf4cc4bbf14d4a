"""Robots with secret numbers and the logs that they would record: the plant FMU with drawn
parameters, walking, read through sensors with noise, delay and bias.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import hexapod_cosim
from hexapod_cosim.cosim.export.plant import export_fmu
from hexapod_cosim.cosim.interface.names import joint_names, vector_names
from hexapod_cosim.cosim.interface.plant import plant_roots
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.extensions.identify.experiment import JOINTS, Experiment, of_point, readings
from hexapod_cosim.extensions.identify.log import ATTITUDE, CHANNELS, Log, log_of
from hexapod_cosim.extensions.identify.numbers import Unknown
from hexapod_cosim.extensions.identify.plant import LogPlant
from hexapod_cosim.extensions.identify.unknowns import (
    DELAYS,
    START,
    changed_robot,
    chosen_unknowns,
    is_delay,
)
from hexapod_cosim.models import Robot, load_robot

Array = NDArray[np.float64]
# standard deviations: encoders of 12 bits, current sensing, load cells, a small IMU, mocap
NOISE = {
    "angle": 1e-3,
    "speed": 0.02,
    "torque": 0.03,
    "current": 0.02,
    "normal_force": 0.3,
    "gyroscope": 0.01,
    "accelerometer": 0.1,
    "position": 5e-4,
    "attitude": 1e-3,
}
SEEN = ("angle", "speed", "torque", "normal_force", "gyroscope", "accelerometer", "position",
        "attitude")  # fmt: skip
GROUPS = ("servo", "mass", "contact", "sensor")
PERIOD = 0.005  # s    between two rows
REST, BEFORE = 0.5, 1.5  # s    standing still at the start of the log, and before it
WALK = {
    "command": [
        {"time": 0.0, "vx": 0.08},
        {"time": 1.5, "vx": 0.05, "yaw_rate": 0.25, "height": 0.01},
        {"time": 3.0, "vx": 0.06, "vy": 0.04, "pitch": 0.06, "roll": 0.05},
        {"time": 4.5, "vx": -0.05, "yaw_rate": -0.2, "pitch": -0.05, "height": -0.01},
    ]
}
EXACT = {"solver.tolerance": 1e-6}
SPREAD = 2.0  # priors: drawn numbers lie no farther from the robot file's


@dataclass(frozen=True)
class Secret:
    """A robot whose numbers only its maker knows."""

    robot: Robot
    values: dict[str, float]  # by key of the table of unknowns
    log: Log  # with noise
    clean: Array  # what sensors without noise read (rows, columns)
    columns: tuple[str, ...]


@cache
def walking_commands(duration: float) -> Log:
    """Returns commands for standing still from -BEFORE on and then walking, up to a time [s]."""
    settings = {"duration": duration - REST, "outputs.plots": False, **WALK}
    recording = hexapod_cosim.simulate("walk_flat", "kinematic", settings=settings).recording
    names = ("time", *joint_names("angle_ref"), *joint_names("speed_ref"))
    rows = recording.columns(names)
    still = np.repeat(rows[:1], round((BEFORE + REST) / PERIOD), axis=0)
    still[:, 1 + 18 :] = 0.0
    data = np.vstack([still, rows])
    data[:, 0] = PERIOD * np.arange(len(data)) - BEFORE
    return log_of(Recording(names, data), "commands")


def drawn(rows: list[Unknown], robot: Robot, rng: np.random.Generator) -> dict[str, float]:
    """Returns values of the rows, drawn as the table says of what is known beforehand."""
    values = {}
    for row in rows:
        z = float(np.clip(rng.normal(), -SPREAD, SPREAD))
        if row.group != START:
            values[row.key] = row.value(z, row.read(robot))
        if is_delay(row):
            values[row.key] = float(rng.uniform(0.001, 0.009))
    return values


def secret_robot(
    seed: int,
    folder: Path,
    *,
    duration: float,
    groups: tuple[str, ...] = GROUPS,
    file: Robot | None = None,
    seen: tuple[str, ...] = SEEN,
) -> Secret:
    """Makes a robot with secret numbers and its log of a walk.

    file: the robot as it is known, by default athena. seen: channels of the log; by default it has
    the torque that the servo reports, and no current.
    """
    rng = np.random.default_rng(seed)
    file, commands = file or load_robot("athena"), walking_commands(duration)
    columns = tuple(name for one in CHANNELS if one.key in seen for name in one.names)
    dummy = Log(Recording((*commands.recording.names, *columns), np.empty((0, 37 + len(columns)))),
                "")  # fmt: skip
    rows = chosen_unknowns(file, [dummy], groups)
    values = drawn(rows, file, rng)
    robot = replace(changed_robot(file, rows, values), name="secret")
    experiment = Experiment(
        log=commands, number=0, columns=columns, fitted=slice(None), held_out=slice(0, 0)
    )
    zero = np.array([values.get(f"zero.{name}", 0.0) for name in JOINTS])
    delays = [values.get(DELAYS[one], 0.0) for one in experiment.sensors]
    pose = plant_roots(robot).settled
    start = dict(zip(vector_names("initial.position"), pose.position, strict=True))
    with LogPlant(export_fmu(robot, folder / f"secret{seed}.fmu"), EXACT) as plant:
        outputs = plant.simulate(commands, columns, start, offset=-zero, delay=delays)
    # cameras see a point of the torso, not the centre of mass
    offset = np.array(file.torso.com) - np.array(robot.torso.com)
    attitude = outputs[:, [columns.index(name) for name in ATTITUDE]]
    outputs = of_point(columns, outputs, attitude, offset)
    recorded = slice(round(BEFORE / PERIOD), None)
    clean = readings(experiment, outputs, values)[recorded]
    noise = np.array([NOISE[key] for key in experiment.channels])
    noisy = clean + noise * rng.standard_normal(clean.shape)
    data = np.column_stack([commands.recording.data[recorded], noisy])
    log = log_of(Recording((*commands.recording.names, *columns), data), f"robot {seed}")
    return Secret(robot, values, log, clean, columns)


DAMAGES: dict[str, Callable[[Array], Array]] = {
    "dead": lambda column: np.full_like(column, column[0]),
    "turned": lambda column: -column,
    "in degrees": np.degrees,
    "stuck": lambda column: np.where(
        np.arange(len(column)) < len(column) // 2, column, column[len(column) // 2]
    ),
    "missing": lambda column: np.where(np.arange(len(column)) % 4 == 0, np.nan, column),
}


def with_column(log: Log, name: str, change: Callable[[Array], Array]) -> Log:
    """Returns a log with one column changed."""
    data, place = log.recording.data.copy(), log.recording.names.index(name)
    data[:, place] = change(data[:, place])
    return Log(Recording(log.recording.names, data), log.where)
