"""What the planned motion asks of servos and ground: inverse dynamics of all legs over many steps
at once.

A leg is three masses. Seen in its own plane, which turns with the coxa, a point is U = u + i w
(outward, up) and Y to the side; from above that plane points along e^(i psi). With the mass points'
accelerations a, by differences in time, the force each needs is F = m (a + g), and about the joints
(axes +z, -y, +y)

    tau_1 = sum Im((u + i Y)^* F_h e^-i psi)      tau_2 = sum Im((U - U_femur)^* P)      tau_3 =
    -sum Im((U - U_knee)^* P)

F_h the horizontal force x + i y, P = Re(F_h e^-i psi) + i F_z the force in the plane, the sums over
the links that the joint moves. To these come the turning inertia of links and rotors and the
friction of the gears. A force f of the ground on the foot asks -J^T f of the joints, J of the
contact point. Left out: what the torso's turning does to the legs' turning, and the links' inertia
about their long axes.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from hexapod_cosim.controller.kinematics import Array, LegSolver, Plane, Pose
from hexapod_cosim.controller.posture import turned
from hexapod_cosim.models import Robot
from hexapod_cosim.models.actuator import GEAR_SPEED


@dataclass(frozen=True)
class Frames:
    """How the torso is planned to lie; rows are steps, a period apart."""

    way: Plane  # m    (n, 1) of the walking frame over the ground
    turn: Plane  # 1    (n, 1) e^(i yaw) of it
    height: Array  # m    (n, 1) of the torso over the walking frame
    rotation: Array | None  # 1    (n, 3, 3) R_KT, torso to walking frame; None: level


@dataclass(frozen=True)
class Demand:
    """What a planned motion asks for; rows are steps."""

    torque: (
        Array  # N m    (n, 6, 3) of the joints for the legs' own weight and motion, their feet free
    )
    # m    (n, 6, 3, 3) J^T: joint torques per force on the contact point along x, y, z of the
    # walking frame
    lever: Array
    push: Plane  # N    (n,) horizontal force the ground must give the robot, x + i y, walking frame
    weight: Array  # N    (n,) and the vertical one
    moment: Plane  # N m    (n,) what the sum of p f_n over the feet must be, p = x + i y
    twist: Array  # N m    (n,) and that of Im(p^* f_h), the moment about the vertical

    def rows(self, chosen: slice) -> Demand:
        """Some of the steps."""
        return Demand(*(getattr(self, item.name)[chosen] for item in fields(self)))


class InverseDynamics:
    """Of one robot. `legs` hold its kinematics; `period` [s] lies between two steps."""

    def __init__(self, robot: Robot, legs: LegSolver, *, period: float) -> None:
        self._legs, self._period, self._radius, self._torso = (
            legs,
            period,
            robot.foot.radius,
            robot.torso,
        )
        self._gravity = float(np.linalg.norm(robot.gravity))
        self._rotor, self._friction = robot.servo.rotor_inertia, robot.servo.coulomb_friction
        self._stance = legs.forward(robot.stance)
        self._floor = float(np.mean(self._stance[:, 2])) - robot.foot.radius
        links = [[leg.links[joint] for leg in robot.legs] for joint in range(3)]
        com = np.array([[link.com for link in joint] for joint in links])  # (3, 6, 3)
        offset = np.array([[link.offset_y for link in joint] for joint in links])
        self._mass = np.array([[link.mass for link in joint] for joint in links])[
            :, None
        ]  # (3, 1, 6), and so on
        self._com = (com[..., 0] + 1j * com[..., 2])[:, None]
        self._side = (com[..., 1] + np.cumsum(offset, axis=0) - offset)[:, None]  # Y
        self._yaw_inertia, self._pitch_inertia = (
            np.array([[link.inertia[k] for link in joint] for joint in links]) for k in (2, 1)
        )
        self._femur_zero, self._tibia_zero = (
            np.exp(-1j * tilt) for tilt in (legs.femur_tilt, legs.tibia_tilt)
        )

    def rest(self) -> Demand:
        """Of one step in the stance."""
        still = Frames(
            way=np.zeros((1, 1), dtype=np.complex128),
            turn=np.ones((1, 1), dtype=np.complex128),
            height=np.zeros((1, 1)),
            rotation=None,
        )
        x, y, z = self._stance.T[:, None]
        pose = self._legs.pose(x + 1j * y, z)
        return self.demand(pose, np.zeros_like(pose.angles), still)

    def demand(self, pose: Pose, speed: Array, frames: Frames) -> Demand:
        """Of legs at successive steps, at least one, whose joints move at speed (n, 6, 3)
        [rad/s].
        """
        points, back = self._points(pose), frames.turn.conj()
        place = self._legs.place + pose.heading * (points.real + 1j * self._side)
        xy, z = _walking(place, self._legs.hip[2] + points.imag, frames)
        push, lift = self._forces(frames.way + frames.turn * xy, z, self._mass)
        push *= back
        parts = (push, lift, xy * lift - (z - self._floor) * push, (xy.conj() * push).imag)
        legs, torso = (part.sum(axis=(0, 2)) for part in parts), self._torso_demand(frames)
        total, weight, moment, twist = (ours + its for ours, its in zip(legs, torso, strict=True))
        return Demand(
            torque=self._torques(pose, speed, points, *_torso(push, lift, frames)),
            lever=self._lever(pose, frames),
            push=total,
            weight=weight,
            moment=moment,
            twist=twist,
        )

    def _points(self, pose: Pose) -> Plane:
        """(3, n, 6) U of the mass points, from where the coxa axis meets the hip."""
        legs = self._legs
        joint = legs.coxa_length + 1j * legs.coxa_height
        return np.stack(
            [
                np.broadcast_to(self._com[0], pose.foot.shape),
                joint + pose.femur * (self._femur_zero * self._com[1]),
                joint + legs.femur * pose.femur + pose.tibia * (self._tibia_zero * self._com[2]),
            ]
        )

    def _forces(self, place: Plane, z: Array, mass: Array) -> tuple[Plane, Array]:
        """m (a + g) of points whose path over the ground runs along the last but one axis:
        horizontal x + i y, and vertical [N].
        """
        return mass * self._acceleration(place), mass * (self._acceleration(z) + self._gravity)

    def _acceleration(self, values: Any) -> Any:
        """Second differences along the last but one axis, 0 at its ends: there feet lift off or
        touch down, which they do without any.
        """
        found = np.zeros_like(values)
        found[..., 1:-1, :] = (
            values[..., 2:, :] - 2.0 * values[..., 1:-1, :] + values[..., :-2, :]
        ) / self._period**2
        return found

    def _torso_demand(self, frames: Frames) -> tuple[Plane, Array, Plane, Array]:
        com = self._torso.com
        xy, z = _walking(
            np.full_like(frames.way, complex(com[0], com[1])),
            np.full_like(frames.height, com[2]),
            frames,
        )
        push, lift = self._forces(frames.way + frames.turn * xy, z, np.array(self._torso.mass))
        push *= frames.turn.conj()
        spin = self._torso.inertia[2] * (self._acceleration(frames.turn) * frames.turn.conj()).imag
        return (
            push[:, 0],
            lift[:, 0],
            (xy * lift - (z - self._floor) * push)[:, 0],
            ((xy.conj() * push).imag + spin)[:, 0],
        )

    def _torques(self, pose: Pose, speed: Array, points: Plane, push: Plane, lift: Array) -> Array:
        """(n, 6, 3) from the forces (3, n, 6) that the links need, torso frame."""
        legs = self._legs
        along = push * pose.heading.conj()
        inner = along.real + 1j * lift
        femur = points[1:] - (legs.coxa_length + 1j * legs.coxa_height)
        tibia = femur[1] - legs.femur * pose.femur
        turning = self._acceleration(pose.angles.reshape(len(lift[0]), -1)).reshape(
            pose.angles.shape
        )
        upper, lower = (
            turning[..., 1] * self._pitch_inertia[1],
            (turning[..., 1] - turning[..., 2]) * self._pitch_inertia[2],
        )
        torque = self._rotor * turning + self._friction * np.tanh(speed / GEAR_SPEED)
        torque[..., 0] += ((points.real - 1j * self._side) * along).imag.sum(axis=0) + turning[
            ..., 0
        ] * self._yaw_inertia.sum(axis=0)
        torque[..., 1] += (femur.conj() * inner[1:]).imag.sum(axis=0) + upper + lower
        torque[..., 2] -= (tibia.conj() * inner[2]).imag + lower
        return np.asarray(torque)

    def _lever(self, pose: Pose, frames: Frames) -> Array:
        """(n, 6, 3, 3) J^T of the contact points."""
        femur = pose.foot - 1j * self._radius
        tibia = femur - self._legs.femur * pose.femur
        lever = np.zeros((*pose.foot.shape, 3, 3))
        lever[..., 0, 0], lever[..., 0, 1] = -pose.point.imag, pose.point.real
        for row, arm in ((1, femur), (2, -tibia)):
            lever[..., row, 0], lever[..., row, 1] = (
                -arm.imag * pose.heading.real,
                -arm.imag * pose.heading.imag,
            )
            lever[..., row, 2] = arm.real
        return (
            lever
            if frames.rotation is None
            else lever @ frames.rotation.transpose(0, 2, 1)[:, None]
        )


def _walking(place: Plane, z: Array, frames: Frames) -> tuple[Plane, Array]:
    """Points (..., n, m) of the torso frame in the walking frame."""
    if frames.rotation is not None:
        place, z = turned(place, z, frames.rotation)
    return place, z + frames.height


def _torso(push: Plane, lift: Array, frames: Frames) -> tuple[Plane, Array]:
    """Forces (..., n, m) of the walking frame in the torso frame."""
    return (
        (push, lift)
        if frames.rotation is None
        else turned(push, lift, frames.rotation.transpose(0, 2, 1))
    )
