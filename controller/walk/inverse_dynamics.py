"""Computes the servo torques and ground forces that the planned motion needs (inverse dynamics).

C: inverse_dynamics.h. A leg is three point masses. In its own vertical plane, which turns with the
coxa, a point is U = u + i w (outward, up) and Y to the side; this plane has the heading e^(i psi).
Accelerations are second differences of three successive planned steps. The joint torques are C15,
the force and moment of the ground on the whole robot C16. A force f of the ground on the foot needs
the joint torques -J^T f, J of the contact point (C17). Neglected: the coupling of the torso's
rotation with that of the legs, and the inertia of the links about their long axes.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from hexapod_cosim.controller.plane import LEGS, Array, Plane, across, cis, plane_of
from hexapod_cosim.controller.walk.kinematics import LegSolver, Pose
from hexapod_cosim.controller.walk.posture import Posture
from hexapod_cosim.models import Robot
from hexapod_cosim.models.actuator import GEAR_SPEED

Wrench = tuple[Any, ...]  # push, weight, moment, twist of (C16)


class Masses(NamedTuple):
    """Positions of the point masses at one step; (6, 3): legs, links."""

    point: Plane  # m    (6, 3) U, from where the coxa axis meets the hip
    place: Plane  # m    (6, 3) x + i y, walking frame
    height: Array  # m    (6, 3) z, walking frame
    ground: Plane  # m    (6, 3) x + i y, ground frame
    torso_place: complex  # m    x + i y, walking frame
    torso_height: float  # m    z, walking frame
    torso_ground: complex  # m    x + i y, ground frame
    R_WK: complex  # 1    e^(i yaw) of the walking frame over the ground


class Demand(NamedTuple):
    """Torques and ground forces that a planned motion needs at one step."""

    torque: Array  # N m    (6, 3) for the legs' own weight and motion, their feet free
    lever: Array  # m    (6, 3, 3) J^T: joint torques per force on the contact point, walking axes
    push: complex  # N    horizontal force of the ground on the robot, walking frame
    weight: float  # N    vertical force of the ground on the robot
    moment: complex  # N m    sum of p f_n over the feet
    twist: float  # N m    sum of Im(p^* f_h) over the feet, the moment about the vertical


class Neighbours(NamedTuple):
    """Three successive steps: before, now, after. Without a neighbour there is no acceleration."""

    masses: tuple[Masses | None, Masses, Masses | None]
    pose: tuple[Pose | None, Pose, Pose | None]


class InverseDynamics:
    """Inverse dynamics of one robot. legs: its kinematics; period: between two steps [s]."""

    def __init__(self, robot: Robot, legs: LegSolver, *, period: float) -> None:
        self.legs, self.period = legs, period
        self.gravity = float(np.linalg.norm(robot.gravity))
        self.rotor, self.friction = robot.servo.rotor_inertia, robot.servo.coulomb_friction
        self.drag = robot.servo.drag
        self.torso_mass, self.torso_inertia = robot.torso.mass, robot.torso.inertia[2]
        self.torso_com = complex(robot.torso.com[0], robot.torso.com[1])
        self.torso_com_z = robot.torso.com[2]
        self.stance = legs.forward(robot.stance)  # m    (6, 3) feet
        self.floor = float(np.mean(self.stance[:, 2])) - robot.foot.radius  # m    torso frame
        links = [leg.links for leg in robot.legs]
        com = np.array([[link.com for link in leg] for leg in links])  # (6, 3, 3)
        offset = np.array([[link.offset_y for link in leg] for leg in links])
        inertia = np.array([[link.inertia[:3] for link in leg] for leg in links])
        self.mass = np.array([[link.mass for link in leg] for leg in links])  # kg    (6, 3)
        self.total_mass = self.torso_mass + float(self.mass.sum())  # kg
        self.joint = legs.coxa_length + 1j * legs.coxa_height  # m    (6,) U of the femur's joint
        # m    (6, 3) from the joint, plane of the leg; of femur and tibia when they are level
        level = np.array((np.ones(LEGS), legs.femur_zero, legs.tibia_zero)).T
        self.com = level * (com[..., 0] + 1j * com[..., 2])
        self.side = com[..., 1] + np.cumsum(offset, axis=1) - offset  # m    (6, 3) Y
        self.yaw_inertia = inertia[..., 2].sum(axis=1)  # kg m2    (6,)
        self.pitch_inertia = inertia[..., 1]  # kg m2    (6, 3)

    def rest(self) -> Demand:
        """Returns the demand of the robot standing in its stance."""
        x, y, z = self.stance.T
        pose = self.legs.pose(x + 1j * y, z)
        level = Posture.of(np.zeros(3), np.zeros(3))
        masses = self.place(pose, 0j, 0.0, level)
        alone = Neighbours((None, masses, None), (None, pose, None))
        return self.demand(alone, np.zeros_like(pose.angle), level)

    def place(self, pose: Pose, way: complex, turn: float, posture: Posture) -> Masses:
        """Returns the positions of the point masses.

        Args:
            pose: the legs, torso frame.
            way, turn: position and heading of the walking frame in the ground frame [m, rad].
            posture: of the torso in the walking frame.
        """
        legs, R_WK = self.legs, cis(turn)
        knee = self.joint + pose.femur * legs.femur
        point = np.empty((LEGS, 3), dtype=np.complex128)
        point[:, 0] = self.com[:, 0]
        point[:, 1] = self.joint + pose.femur * self.com[:, 1]
        point[:, 2] = knee + pose.tibia * self.com[:, 2]
        aside = plane_of(point.real, self.side)
        place, height = posture.turn(
            legs.place[:, None] + pose.heading[:, None] * aside, legs.hip[2][:, None] + point.imag
        )
        torso_place, torso_height = posture.turn(self.torso_com, self.torso_com_z)
        return Masses(
            point=point,
            place=place,
            height=height + posture.height,
            ground=way + R_WK * place,
            torso_place=torso_place,
            torso_height=torso_height + posture.height,
            torso_ground=way + R_WK * torso_place,
            R_WK=R_WK,
        )

    def _acceleration(self, before: Any, now: Any, after: Any) -> Any:
        """Returns the second difference of numbers or points at three steps, per second squared."""
        return (after - 2.0 * now + before) / (self.period * self.period)

    def _add_force(self, total: Wrench, push: Any, lift: Any, place: Any, height: Any) -> Wrench:
        """Adds m (a + g) = (push, lift) of points at (place, height), walking frame (C16).

        `total` and the result are push, weight, moment and twist.
        """
        moment = place * lift - push * (height - self.floor)
        parts = (push, lift, moment, across(place, push))
        return tuple(
            a + (part.sum() if isinstance(part, np.ndarray) else part)
            for a, part in zip(total, parts, strict=True)
        )

    def _demand_torso(
        self, total: Wrench, masses: tuple[Masses | None, Masses, Masses | None], ratio: float
    ) -> Wrench:
        """Adds the forces that the torso needs to push, weight, moment and twist (C16, C56)."""
        before, now, after = masses
        acceleration, up, spin = 0j, 0.0, 0j
        if before is not None and after is not None:
            acceleration = self._acceleration(
                before.torso_ground, now.torso_ground, after.torso_ground
            )
            up = self._acceleration(before.torso_height, now.torso_height, after.torso_height)
            spin = self._acceleration(before.R_WK, now.R_WK, after.R_WK)
        pushed = (self.torso_mass + (ratio - 1.0) * self.total_mass) / ratio
        push = pushed * acceleration * now.R_WK.conjugate()
        lift = self.torso_mass * (up + self.gravity)
        place, height = now.torso_place, now.torso_height
        push, weight, moment, twist = self._add_force(total, push, lift, place, height)
        return push, weight, moment, twist + self.torso_inertia * across(now.R_WK, spin)

    def _demand_links(
        self, masses: tuple[Masses | None, Masses, Masses | None]
    ) -> tuple[Plane, Array]:
        """Returns m (a + g) of the links, horizontal and vertical (6, 3) [N], walking axes."""
        before, now, after = masses
        if before is None or after is None:
            return np.zeros((LEGS, 3), dtype=np.complex128), self.mass * self.gravity
        acceleration = self._acceleration(before.ground, now.ground, after.ground)
        up = self._acceleration(before.height, now.height, after.height)
        push = self.mass * acceleration * now.R_WK.conjugate()
        return push, self.mass * (up + self.gravity)

    def _demand_torques(self, motion: Neighbours, push: Plane, lift: Array, speed: Array) -> Array:
        """Returns the joint torques (6, 3) [N m] (C15).

        push, lift: (6, 3) forces that the links need, torso frame [N]; speed: (6, 3) [rad/s].
        """
        legs, (before, now, after), point = self.legs, motion.pose, motion.masses[1].point
        turning = np.zeros((LEGS, 3))
        if before is not None and after is not None:
            turning = self._acceleration(before.angle, now.angle, after.angle)
        torque = self.rotor * turning + self.friction * np.tanh(speed / GEAR_SPEED)
        torque += self.drag * speed
        # tau_1 = sum Im((u + i Y)^* F_h e^(-i psi))
        along = push * now.heading.conj()[:, None]
        torque[:, 0] += across(plane_of(point.real, self.side), along).sum(axis=1)
        torque[:, 0] += turning[:, 0] * self.yaw_inertia
        # tau_2 = sum Im((U - U_femur)^* P)    tau_3 = -Im((U - U_knee)^* P)
        inner = plane_of(along.real, lift)
        arm = point[:, 1:] - self.joint[:, None]
        tibia = arm[:, 1] - legs.femur * now.femur
        upper = turning[:, 1] * self.pitch_inertia[:, 1]
        lower = (turning[:, 1] - turning[:, 2]) * self.pitch_inertia[:, 2]
        torque[:, 1] += across(arm, inner[:, 1:]).sum(axis=1) + upper + lower
        torque[:, 2] -= across(tibia, inner[:, 2]) + lower
        return np.asarray(torque)

    def _lever_of(self, pose: Pose, posture: Posture) -> Array:
        """Returns J^T of the contact points (6, 3, 3) [m] (C17): joints by walking axes."""
        femur = pose.foot - 1j * self.legs.radius
        tibia = femur - self.legs.femur * pose.femur
        row = np.empty((LEGS, 3), dtype=np.complex128)
        up = np.zeros((LEGS, 3))
        row[:, 0] = 1j * pose.point
        row[:, 1], up[:, 1] = -femur.imag * pose.heading, femur.real
        row[:, 2], up[:, 2] = tibia.imag * pose.heading, -tibia.real
        row, up = posture.turn(row, up)
        return np.array((row.real, row.imag, up)).transpose(1, 2, 0)

    def demand(
        self, motion: Neighbours, speed: Array, posture: Posture, weight_ratio: float = 1.0
    ) -> Demand:
        """Returns the demand of the middle one of three steps.

        Args:
            motion: the steps.
            speed: (6, 3) joint speeds [rad/s].
            posture: of the torso in the walking frame.
            weight_ratio: measured over modelled weight [1]. The planned loads are scaled by it
                (C30), but a payload needs no push for the legs, and more for the torso (C56).
        """
        now = motion.masses[1]
        push, lift = self._demand_links(motion.masses)
        legs = self._add_force((0j, 0.0, 0j, 0.0), push / weight_ratio, lift, now.place, now.height)
        total, weight, moment, twist = self._demand_torso(legs, motion.masses, weight_ratio)
        push, lift = posture.turn_back(push, lift)
        torque = self._demand_torques(motion, push, lift, speed)
        lever = self._lever_of(motion.pose[1], posture)
        return Demand(torque, lever, complex(total), float(weight), complex(moment), float(twist))
