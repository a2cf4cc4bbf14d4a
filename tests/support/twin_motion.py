"""Calculates the forces and torques that a planned motion requires of the multibody twin, body by
body by virtual work.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexapod_cosim.models import Robot
from hexapod_cosim.models.dynamics import Command, applied_forces, mass_matrix
from hexapod_cosim.models.kinematics import (
    axis_quaternion,
    body_states,
    quaternion_product,
    rotation_matrix,
)

# m; height of the twin over the ground, so that no foot is in contact: the forces are prescribed
HIGH = 1.0
NONE = np.full(6, np.nan)  # no foot in contact
X, Y, Z = np.eye(3)


@dataclass(frozen=True)
class Motion:
    """A motion: the torso's position over the ground, its attitude, and the joints. Rows are time
    steps.
    """

    period: float  # s    between rows
    way: np.ndarray  # m    (n,) x + i y
    yaw: np.ndarray  # rad    (n,)
    posture: np.ndarray  # (n, 3) height [m], roll, pitch [rad]
    angle: np.ndarray  # rad    (n, 6, 3)
    speed: np.ndarray  # rad/s

    def bodies(self, robot: Robot, at: int) -> np.ndarray:
        """Returns the bodies at rest at row k, shape (19, 13)."""
        height, roll, pitch = self.posture[at]
        turn = quaternion_product(axis_quaternion(Y, pitch), axis_quaternion(X, roll))
        turn = quaternion_product(axis_quaternion(Z, self.yaw[at]), turn)
        origin = np.array([self.way[at].real, self.way[at].imag, HIGH + height])
        centre = origin + rotation_matrix(turn) @ np.array(robot.torso.com)
        return body_states(
            robot, centre, turn, np.zeros(3), np.zeros(3), self.angle[at], np.zeros((6, 3))
        )


def velocities(robot: Robot, body: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Returns velocities of all bodies per unit of the torso's v and w and of the joints' speeds,
    shape (114, 24).
    """
    still = (robot, body[0, :3], body[0, 3:7])
    moving = (
        body_states(*still, unit[:3], unit[3:6], angle, unit[6:].reshape(6, 3))
        for unit in np.eye(24)
    )
    return np.array([state[:, 7:].ravel() for state in moving]).T


def turned_by(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Returns rotation vectors (n, 3) from one set of quaternions (n, 4) to the next."""
    found = []
    for p, q in zip(before, after, strict=True):
        w, *xyz = quaternion_product(q, p * [1.0, -1.0, -1.0, -1.0])
        size = np.linalg.norm(xyz)
        found.append(
            np.array(xyz)
            * np.sign(w)
            * (2.0 * np.arctan2(size, abs(w)) / size if size > 0.0 else 2.0)
        )
    return np.array(found)


def twin_needs(robot: Robot, motion: Motion, at: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Returns the required generalised forces, bodies and velocities.

    The forces (24,) are force and moment at the torso's centre of mass and torques of the joints;
    the bodies are (19, 13), their velocities (114, 24).
    """
    before, body, after = (motion.bodies(robot, k) for k in (at - 1, at, at + 1))
    dv = np.zeros((19, 6))
    dv[:, :3] = (after[:, :3] - 2.0 * body[:, :3] + before[:, :3]) / motion.period**2
    coming, going = turned_by(before[:, 3:7], body[:, 3:7]), turned_by(body[:, 3:7], after[:, 3:7])
    dv[:, 3:] = (going - coming) / motion.period**2
    body[:, 10:13] = (going + coming) / (2.0 * motion.period)
    forces = (
        mass_matrix(robot, body) @ dv.ravel()
        - applied_forces(robot, body, Command(angle_ref=motion.angle[at]), NONE).ravel()
    )
    reach = velocities(robot, body, motion.angle[at])
    return reach.T @ forces, body, reach
