"""The state of a live robot as pages show it: numbers of plain types, forces in body weights."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.interface.names import foot_names, joint_names, vector_names
from hexapod_cosim.cosim.report.geometry import describe_ground, describe_shape
from hexapod_cosim.cosim.report.surface import pack_surface
from hexapod_cosim.cosim.results.window import robot_weight
from hexapod_cosim.extensions.live.pacing import Pacer
from hexapod_cosim.extensions.live.robot import LiveRobot
from hexapod_cosim.models import LEG_NAMES, Robot
from hexapod_cosim.models.ground.faces import surface_of
from hexapod_cosim.models.kinematics import rotation_matrix

Array = NDArray[np.float64]

DIGITS = 5  # of positions [m], angles [rad] and shares
SHOWN = {  # variables of the plant by key of a frame
    "position": vector_names("torso.position"),
    "quaternion": vector_names("torso.quaternion", 4),
    "tilt": ["torso.roll", "torso.pitch"],
    "angle": joint_names("angle"),
    "contact": foot_names("contact"),
    "slip": foot_names("slip_speed"),
}
FORCES = [name for leg in LEG_NAMES for name in vector_names(f"{leg}.foot.force")]


def describe_world(robot: Robot, parameters: Mapping[str, float], step: float) -> dict[str, Any]:
    """Returns the robot's shape and the ground for the viewer (viewer/messages.ts).

    Args:
        robot: with its terrain.
        parameters: of the plant.
        step: the macro-step [s].
    """
    surface, ground = surface_of(robot.terrain), describe_ground(parameters)
    return {
        "robot": describe_shape(parameters, robot.torso.size),
        "ground": ground if surface is None else {**ground, "surface": 0},
        "surfaces": [] if surface is None else [pack_surface(surface, parameters)],
        "weight": round(robot_weight(parameters), 3),
        "step": step,
    }


def frame_of(robot: LiveRobot, pacer: Pacer) -> dict[str, Any]:
    """Returns pose, forces, motion and lateness as of now.

    `force` [body weights] has three entries a foot; `speed` is forward, left [m/s] and turn
    [rad/s] in the torso's own axes; `tilt` roll and pitch [rad]; `torque` [N m] the largest.
    """
    turn = rotation_matrix(_values(robot, SHOWN["quaternion"]))
    velocity = turn.T @ _values(robot, vector_names("torso.velocity"))
    rates = _values(robot, vector_names("imu.angular_velocity"))
    late = pacer.lateness
    return {key: _rounded(_values(robot, names)) for key, names in SHOWN.items()} | {
        "time": round(robot.time, 6),
        "seconds": robot.count * robot.h,
        "force": _rounded(_values(robot, FORCES) / robot.weight),
        "torque": float(np.abs(_values(robot, joint_names("torque"))).max()),
        "speed": _rounded(np.array([velocity[0], velocity[1], rates[2]])),
        "push": _rounded(robot.signals.push[:3]),
        "factor": round(pacer.factor, 4),
        "steps": late.steps,
        "misses": late.misses,
        "worst": round(late.worst, 5),
        "skipped": round(late.skipped, 3),
    }


def _values(robot: LiveRobot, names: list[str]) -> Array:
    """Returns variables of the plant by name."""
    return np.asarray(robot.signals.values[_indices(robot.signals.names, tuple(names))])


@lru_cache(maxsize=256)
def _indices(known: tuple[str, ...], names: tuple[str, ...]) -> NDArray[np.intp]:
    place = {name: k for k, name in enumerate(known)}
    return np.array([place[name] for name in names])


def _rounded(values: Array) -> list[float]:
    return [round(value, DIGITS) for value in values.tolist()]
