"""Computes one step of a method from a start, and its error (eq. 19-22).

This is the readable form of step.h in plant_fmu/src/kernels, with the same names.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.constraints import project
from hexapod_cosim.models.contact.forces import Contacts, bristle_length
from hexapod_cosim.models.contact.switching import start_contacts
from hexapod_cosim.models.dynamics import Command
from hexapod_cosim.models.kinematics import (
    BODIES,
    BODY_STATE,
    LEGS,
    joint_models,
    quaternion_product,
    quaternion_rate,
)
from hexapod_cosim.models.method import METHOD, Method, method_step
from hexapod_cosim.models.records import Robot
from hexapod_cosim.models.stage import Slopes, keep_slopes, solve_stage

TOUCH_DEPTH = (1e-10, 1e-6)  # m, m per tolerance  depth to which a touch-down is located
FIRST_STEP_SIZE = 1e-4  # s  first step
ERROR_SCALE = np.array([0.1] * 3 + [1.0] * 4 + [1.0] * 3 + [10.0] * 3)  # of r p v w
BRISTLE_SCALE = 10.0  # preslidings, or shear displacements of soil
TURN, BODY = 3 * BODIES, BODY_STATE * BODIES  # sizes of a stage's first two parts


@dataclass(frozen=True)
class State:
    """State of the integration."""

    body: Array  # (19, 13) r p v w
    bristle: Array  # (6, 3) m
    contacts: Contacts
    time: float = 0.0  # s
    next_step: float = FIRST_STEP_SIZE  # s  step that the error control proposes next
    first_step: float = FIRST_STEP_SIZE  # s  the same for the first step of a call
    steps: int = 0
    rejected: int = 0
    touchdowns: int = 0
    evaluations: int = 0

    @property
    def damping(self) -> Array:
        """Damping of the feet on the ground below them (6,) [s/m], nan for open ones."""
        return self.contacts.damping[:LEGS]

    @property
    def impact_speed(self) -> Array:
        """Approach speeds of these feet at their last touch-downs (6,) [m/s]."""
        return self.contacts.impact_speed[:LEGS]


@dataclass(frozen=True)
class Trial:
    """Result of one step, accepted or not."""

    body: Array  # (19, 13)
    bristle: Array  # (6, 3)
    error: float  # 1  error over the tolerance; 0 without an estimate


@dataclass(frozen=True)
class Start:
    """Start of a step; the command's age is that at state.time."""

    robot: Robot
    command: Command
    state: State

    @property
    def method(self) -> Method:
        """Returns the solver's method."""
        return METHOD[self.robot.solver.method]

    @property
    def touch_depth(self) -> float:
        """Returns the largest depth of a contact that has just touched down [m]."""
        return max(TOUCH_DEPTH[0], TOUCH_DEPTH[1] * self.robot.solver.tolerance)


def start_state(robot: Robot, body: Array, time: float = 0.0) -> State:
    """Returns the state at bodies (19, 13) with the contacts of `start_contacts`."""
    first = min(FIRST_STEP_SIZE, robot.solver.step_max)
    still = np.zeros((LEGS, 3))
    return State(body, still, start_contacts(robot, body), time, first, first)


def try_step(start: Start, h: float) -> Trial:
    """Computes one step of h [s] by the solver's method (eq. 19, 20), with its error (eq. 22).

    The vector that eq. 19 advances contains the rotations of bodies (57,), the bodies (247,) and
    the bristles (18,). Later stages need the first part, because quaternion rates alone do not give
    the angular velocities.
    """
    robot, method, solver = start.robot, start.method, start.robot.solver
    z, kept = h * method.gamma, list[Slopes]()

    def stage(elapsed: float, y: Array, change: Array) -> Array:
        _, body, bristle = _parts(y)
        command = replace(start.command, age=start.command.age + elapsed)
        at = (robot, body, bristle, command, start.state.contacts)
        if not kept:
            kept.append(keep_slopes(*at, ahead=h))
        rate = solve_stage(*at, kept[0], z, _shifts(change))
        nu, alpha = rate.nu.reshape(BODIES, 6), rate.alpha.reshape(BODIES, 6)
        turns = [quaternion_rate(p, w) for p, w in zip(body[:, 3:7], nu[:, 3:6], strict=True)]
        moved = np.hstack([nu[:, 0:3], turns, alpha])
        return np.concatenate([nu[:, 3:6].ravel(), moved.ravel(), rate.bristle.ravel()])

    state = start.state
    y_0 = np.concatenate([np.zeros(TURN), state.body.ravel(), state.bristle.ravel()])
    y_1, estimate = method_step(method, stage, y_0, h)
    _, body, bristle = _parts(y_1)
    error = error_norm(robot, estimate[TURN:]) if solver.step == 0.0 else 0.0
    body[:, 3:7] /= np.linalg.norm(body[:, 3:7], axis=1, keepdims=True)
    if solver.projection == "step":
        body = project(robot, body)
    return Trial(body, bristle, error)


def _parts(y: Array) -> tuple[Array, Array, Array]:
    """Returns turns (19, 3), bodies (19, 13) and bristles (6, 3)."""
    turn, body, bristle = np.split(y, [TURN, TURN + BODY])
    return turn.reshape(BODIES, 3), body.reshape(BODIES, BODY_STATE), bristle.reshape(LEGS, 3)


def _shifts(change: Array) -> tuple[Array, Array, Array]:
    """Returns s_x (114,), s_v (114,) and s_b (6, 3) of the sums over earlier stages."""
    turn, body, bristle = _parts(change)
    s_x = np.hstack([body[:, 0:3], turn])
    return s_x.ravel(), body[:, 7:13].ravel(), bristle


def error_norm(robot: Robot, estimate: Array) -> float:
    """Returns the largest entry of an error estimate over its scale and the tolerance (eq. 22).

    The estimate has the parts of `try_step` without the rotations (265,).

    Quaternions of links are those of their joints' axes a, b, s (A), as in the C plant.
    """
    body = estimate[:BODY].reshape(BODIES, BODY_STATE).copy()
    for joint in joint_models(robot):
        q_Wj, q_jA = body[joint.child, 3:7], frame_quaternion(joint.a_j, joint.b_j, joint.s_j)
        body[joint.child, 3:7] = quaternion_product(q_Wj, q_jA)
    largest = float(np.max(np.abs(body) / ERROR_SCALE))
    length = bristle_length(robot)
    if length > 0.0:
        bristle = float(np.max(np.abs(estimate[BODY:])))
        largest = max(largest, bristle / (BRISTLE_SCALE * length))
    return largest / robot.solver.tolerance


def frame_quaternion(x: Array, y: Array, z: Array) -> Array:
    """Returns the quaternion (4,), of either sign, of a right-handed frame with axes (3,)."""
    R = np.column_stack([x, y, z])
    # K = 4 p p^T: each row is parallel to p, the largest has the smallest rounding error
    K = np.zeros((4, 4))
    turn = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    K[0, 0], K[0, 1:], K[1:, 0] = 1.0 + np.trace(R), turn, turn
    K[1:, 1:] = R + R.T + (1.0 - np.trace(R)) * np.eye(3)
    p = K[int(np.argmax(np.diag(K)))]
    return np.asarray(p / np.linalg.norm(p))
