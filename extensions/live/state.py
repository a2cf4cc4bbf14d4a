"""The state of a live robot as pages show it: numbers of plain types, forces in body weights."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.interface.names import foot_names, joint_names, vector_names
from hexapod_cosim.cosim.master.signals import Signals
from hexapod_cosim.cosim.report.geometry import describe_ground, describe_shape
from hexapod_cosim.cosim.report.surface import pack_surface
from hexapod_cosim.extensions.live.pacing import Pacer
from hexapod_cosim.extensions.live.robot import LiveRobot
from hexapod_cosim.models import LEG_NAMES
from hexapod_cosim.models.ground.faces import surface_of
from hexapod_cosim.models.kinematics import rotation_matrix

Array = NDArray[np.float64]

LENGTH, ANGLE, SHARE = 5, 5, 4  # decimals of m, rad and 1


def world_of(robot: LiveRobot) -> dict[str, Any]:
    """Returns the robot's shape and the ground for the viewer (cosim/viewer/src/types.ts)."""
    surface, ground = surface_of(robot.plan.robot.terrain), describe_ground(robot.parameters)
    return {
        "robot": describe_shape(robot.parameters, robot.plan.robot.torso.size),
        "ground": ground if surface is None else {**ground, "surface": 0},
        "surfaces": [] if surface is None else [pack_surface(surface, robot.parameters)],
        "weight": round(robot.weight, 3),
        "step": robot.plan.scenario.macro_step,
    }


def frame_of(robot: LiveRobot, pacer: Pacer) -> dict[str, Any]:
    """Returns pose, forces, motion and lateness as of now.

    `force` [body weights] has three entries a foot; `speed` is forward, left [m/s] and turn
    [rad/s] in the torso's own axes; `tilt` roll and pitch [rad].
    """
    signals = robot.signals
    turn = rotation_matrix(_values(signals, vector_names("torso.quaternion", 4)))
    velocity = turn.T @ _values(signals, vector_names("torso.velocity"))
    rates = turn.T @ _values(signals, vector_names("torso.angular_velocity"))
    late = pacer.lateness
    return {
        "time": round(robot.time, 6),
        "position": _rounded(_values(signals, vector_names("torso.position")), LENGTH),
        "quaternion": _rounded(_values(signals, vector_names("torso.quaternion", 4)), 6),
        "angle": _rounded(_values(signals, joint_names("angle")), ANGLE),
        "contact": _values(signals, foot_names("contact")).astype(int).tolist(),
        "force": _rounded(_values(signals, _FORCES) / robot.weight, SHARE),
        "torque": round(float(np.abs(_values(signals, joint_names("torque"))).max()), 4),
        "slip": _rounded(_values(signals, foot_names("slip_speed")), LENGTH),
        "speed": _rounded(np.array([velocity[0], velocity[1], rates[2]]), LENGTH),
        "tilt": _rounded(
            np.array([np.arctan2(turn[2, 1], turn[2, 2]), -np.arcsin(np.clip(turn[2, 0], -1, 1))]),
            ANGLE,
        ),
        "push": _rounded(signals.push[:3], 3),
        "factor": round(pacer.factor, 4),
        "steps": late.steps,
        "misses": late.misses,
        "worst": round(late.worst, 5),
        "gaps": late.gaps,
        "skipped": round(late.skipped, 3),
    }


_FORCES = [name for leg in LEG_NAMES for name in vector_names(f"{leg}.foot.force")]


def _values(signals: Signals, names: list[str]) -> Array:
    """Returns variables of the plant by name."""
    return np.asarray(signals.values[_indices(signals.names, tuple(names))])


@lru_cache(maxsize=256)
def _indices(known: tuple[str, ...], names: tuple[str, ...]) -> NDArray[np.intp]:
    place = {name: k for k, name in enumerate(known)}
    return np.array([place[name] for name in names])


def _rounded(values: Array, digits: int) -> list[float]:
    return [round(value, digits) for value in values.tolist()]
