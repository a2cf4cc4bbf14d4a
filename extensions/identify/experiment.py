"""Predicts the readings of a log from values of the unknowns, by simulation with the FMU."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from types import SimpleNamespace

import numpy as np

from hexapod_cosim.cosim.common.components import PLANT
from hexapod_cosim.cosim.interface.names import joint_names, vector_names
from hexapod_cosim.cosim.interface.plant import parameter_values
from hexapod_cosim.extensions.identify.log import ATTITUDE, Log, channel_of
from hexapod_cosim.extensions.identify.numbers import Unknown
from hexapod_cosim.extensions.identify.plant import LogPlant
from hexapod_cosim.extensions.identify.start import initial_state
from hexapod_cosim.extensions.identify.unknowns import CURRENT, DELAYS, changed_robot
from hexapod_cosim.models import Robot
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.kinematics import axis_quaternion, quaternion_product, rotation_matrix

PLACE, TURN = vector_names("initial.position"), vector_names("initial.quaternion", 4)
JOINTS = [name.removesuffix(".angle") for name in joint_names("angle")]
# start values of a pose, which a log replaces
_REST = SimpleNamespace(
    position=[0.0] * 3, quaternion=[1.0, 0.0, 0.0, 0.0], angle=[[0.0] * 3 for _ in range(6)]
)


@dataclass(frozen=True, kw_only=True)
class Experiment:
    """A log and what is compared of it."""

    log: Log
    number: int  # of the log, from 0
    columns: tuple[str, ...]  # readings that are compared
    fitted: slice  # rows that are compared in the fit
    held_out: slice  # rows that the fit does not see

    @property
    def measured(self) -> Array:
        """The compared readings (rows, columns)."""
        return self.log.recording.columns(self.columns)

    @property
    def start_key(self) -> str:
        """What the keys of its start values end in: "[1]" for the first log."""
        return f"[{self.number + 1}]"

    def without(self, names: Sequence[str]) -> Experiment:
        """Returns the experiment without some columns."""
        return replace(self, columns=tuple(name for name in self.columns if name not in names))

    @property
    def channels(self) -> list[str]:
        """The channel of each column."""
        return [channel_of(name).key for name in self.columns]

    @property
    def sensors(self) -> list[str]:
        """The sensors of each column."""
        return [channel_of(name).sensors for name in self.columns]


def first_part(experiment: Experiment, seconds: float = math.inf) -> Experiment:
    """Returns the first seconds of an experiment, without held-out rows.

    Itself if nothing is left out.
    """
    log = experiment.log
    stop = experiment.fitted.indices(len(log.time))[1]
    end = min(int(np.searchsorted(log.time, log.time[0] + seconds)), stop)
    if end == len(log.time):
        return experiment
    part = slice(experiment.fitted.start, end)
    return replace(experiment, log=log.part(slice(0, end)), fitted=part, held_out=slice(end, end))


def robot_parameters(robot: Robot, base: Robot) -> dict[str, float]:
    """Returns the parameters of the FMU in which a robot differs from the one it was made of."""
    other = _parameters(base)
    return {name: value for name, value in _parameters(robot).items() if value != other[name]}


@lru_cache(maxsize=8)
def _parameters(robot: Robot) -> dict[str, float]:
    """Returns the parameters of a robot's FMU but for its pose of rest."""
    return parameter_values(PLANT, SimpleNamespace(robot=robot, settled=_REST))


def simulated(
    plant: LogPlant,
    experiment: Experiment,
    base: Robot,
    rows: Sequence[Unknown],
    values: Mapping[str, float],
    parameters: Mapping[str, float] | None = None,
) -> Array:
    """Simulates a log; returns the outputs of which its readings are made (rows, columns).

    base: the robot of the plant's FMU; `values` replace its numbers. parameters: further ones.

    Raises HexapodError when the FMU refuses a value or a step.
    """
    robot, log = changed_robot(base, rows, values), experiment.log
    zero = np.array([values.get(f"zero.{name}", 0.0) for name in JOINTS])
    # the pose in the log is that of the point which the robot file has as the centre of mass
    offset = np.array(base.torso.com) - np.array(robot.torso.com)
    names = [_source(name, base) for name in experiment.columns]
    delays = [values.get(DELAYS[one], 0.0) for one in experiment.sensors]
    # a position is turned by the attitude of the same time
    turned = [(name, values.get(DELAYS["pose"], 0.0)) for name in ATTITUDE]
    pairs = list(dict.fromkeys([*zip(names, delays, strict=True), *turned]))
    found = plant.simulate(
        log,
        [name for name, _ in pairs],
        {
            **(parameters or {}),
            **robot_parameters(robot, base),
            **_start(experiment, robot, zero, values, offset),
        },
        offset=-zero if zero.any() else None,
        delay=[delay for _, delay in pairs],
    )
    own = found[:, [pairs.index(pair) for pair in zip(names, delays, strict=True)]]
    attitude = found[:, [pairs.index(pair) for pair in turned]]
    return of_point(experiment.columns, own, attitude, offset)


def of_point(columns: Sequence[str], outputs: Array, attitude: Array, offset: Array) -> Array:
    """Returns outputs (rows, columns) with the position of another point of the torso.

    attitude: roll, pitch and yaw (rows, 3) [rad]. offset: from the centre of mass to the point, in
    torso axes (3,) [m].
    """
    if not offset.any():
        return outputs
    found, turned = outputs.copy(), _turned(attitude, offset)
    for axis, name in enumerate(vector_names("torso.position")):
        if name in columns:
            found[:, columns.index(name)] += turned[:, axis]
    return found


def _turned(attitude: Array, vector: Array) -> Array:
    """Returns a vector of the torso (3,) in world axes (rows, 3), from z-y-x angles (rows, 3)."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(attitude).T, np.sin(attitude).T
    x, y, z = vector.tolist()
    ahead = cp * x + sp * (sr * y + cr * z)
    left = cr * y - sr * z
    up = -sp * x + cp * (sr * y + cr * z)
    return np.column_stack([cy * ahead - sy * left, sy * ahead + cy * left, up])


def readings(experiment: Experiment, outputs: Array, values: Mapping[str, float]) -> Array:
    """Returns what the sensors read (rows, columns) of the outputs of `simulated`."""
    found = outputs.copy()
    for k, name in enumerate(experiment.columns):
        if name.endswith(".angle"):
            found[:, k] += values.get(f"zero.{name.rpartition('.')[0]}", 0.0)
        elif name.endswith(".current"):
            found[:, k] /= values.get(CURRENT, 1.0)
        elif name == ATTITUDE[2]:
            found[:, k] = np.unwrap(found[:, k])
        found[:, k] += values.get(f"bias.{name}", 0.0)
    return found


def needs_simulation(row: Unknown) -> bool:
    """Returns whether a number changes more than the reading of simulated outputs."""
    return not (row.key.startswith("bias.") or row.key == CURRENT)


def _source(name: str, robot: Robot) -> str:
    """Returns the output of the FMU that a reading is made of.

    Currents of servos without a model of their motor are torques over a constant.
    """
    if name.endswith(".current") and robot.servo.drive != "motor":
        return name.removesuffix(".current") + ".torque"
    return name


def _start(
    experiment: Experiment, robot: Robot, zero: Array, values: Mapping[str, float], offset_T: Array
) -> dict[str, float]:
    """Returns the initial state: the first row's, less joint zeros, plus unknown start values.

    offset_T: from the centre of mass to the point whose position the log has (3,) [m].
    """
    log, key = experiment.log, experiment.start_key
    found = initial_state(log, robot)
    for name, angle in zip(joint_names("angle"), zero.tolist(), strict=True):
        found[f"initial.{name}"] -= angle
    for axis, name in zip("xy", PLACE, strict=False):
        found[name] += values.get(f"start.{axis}{key}", 0.0)
    if log.has(vector_names("torso.position")):
        R_WT = rotation_matrix(np.array([found[name] for name in TURN]))
        offset_W = R_WT @ offset_T
        for name, value in zip(PLACE, offset_W.tolist(), strict=True):
            found[name] -= value
    yaw = values.get(f"start.yaw{key}", 0.0)
    if yaw:
        q_VW = axis_quaternion(np.array([0.0, 0.0, 1.0]), yaw)
        q_WT = np.array([found[name] for name in TURN])
        found |= dict(zip(TURN, quaternion_product(q_VW, q_WT).tolist(), strict=True))
    return found
