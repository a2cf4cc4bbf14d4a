"""Computes the kinematics of six three-joint legs in closed form, torso frame. C: kinematics.h.

Geometry (docs/architecture.md): the coxa turns about +z, the femur about -y, the tibia about +y;
the tip of a link is (length, offset_y, offset_z) in the link's frame. Seen in the coxa frame, a leg
is a planar two-link arm in the x-z plane, shifted sideways by the sum Y of the y offsets (C11).
The knee angle gamma in [0, pi] (knee up) makes the inverse unique (C12).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hexapod_cosim.controller.plane import (
    Array,
    Mask,
    Plane,
    across,
    along,
    cis,
    clamp,
    plane_of,
    rows_of,
    square,
)
from hexapod_cosim.models import LEG_NAMES, ReachError, Robot, RobotError
from hexapod_cosim.models.errors import check_type

AXES = ((0.0, 0.0, 1.0), (0.0, -1.0, 0.0), (0.0, 1.0, 0.0))
AXIS_TOLERANCE = 1e-9  # 1    on the components of an axis
FLAG_TOLERANCE = 1e-9  # rad or 1    round-off at the edge of the reach is not "unreachable"
SINGULAR_SINE = 0.02  # 1    floor of sin(gamma): a straight leg has no finite joint speed
FOLDED_COSINE = -1.0 + 1e-12  # 1    least cos(gamma): a folded leg of equal links has no direction
RADIUS_FLOOR = 1e-9  # m2    floor of the squared distance from the coxa axis


class Feet(NamedTuple):
    """Centres of the feet and their velocities, (6,) each."""

    plane: Plane  # m    x + i y
    height: Array  # m    z
    velocity: Plane  # m/s    of x + i y
    rise: Array  # m/s    of z


class Pose(NamedTuple):
    """Pose of the legs, each in its own vertical plane; torso frame."""

    point: Plane  # m    (6,) from the coxa axis to the foot, x + i y
    heading: Plane  # 1    (6,) e^(i psi), the outward direction of the leg
    foot: Plane  # m    (6,) from the femur joint to the foot, u + i w
    femur: Plane  # 1    (6,) e^(i A)
    tibia: Plane  # 1    (6,) e^(i B)
    angle: Array  # rad    (6, 3) without joint limits
    lost: Mask  # (6,) the target is out of reach: `angle` is the nearest pose


class Joints(NamedTuple):
    """Joint angles and speeds within the limits of the joints."""

    angle: Array  # rad    (6, 3)
    speed: Array  # rad/s    (6, 3)
    unreachable: Mask  # (6,) legs whose angles do not put the foot on its target


class Softness(NamedTuple):
    """Softness of the legs on their servos, C = J J^T / kp, (6,) each [m/N]."""

    outward: Array
    sideward: Array
    up: Array
    splay: Array  # outward under an upward force


class LegSolver:
    """Forward and inverse kinematics of a robot's legs.

    Raises RobotError for another type and for joint axes of another pattern.
    """

    def __init__(self, robot: Robot) -> None:
        check_type(robot, Robot, "a Robot, as of load_robot()", where="robot", error=RobotError)
        _check_axes(robot)
        legs = robot.legs
        tip = np.array([[(k.length, k.offset_y, k.offset_z) for k in leg.links] for leg in legs])
        self.hip = np.array([leg.hip_position for leg in legs]).T.copy()  # m    (3, 6) torso frame
        self.place = self.hip[0] + 1j * self.hip[1]  # m    (6,) coxa axes, torso frame
        self.hip_yaw = np.array([leg.hip_yaw for leg in legs])  # rad    (6,)
        self.upright = np.exp(-1j * self.hip_yaw)  # 1    (6,)
        self.coxa_length, self.coxa_height = tip[:, 0, 0].copy(), tip[:, 0, 2].copy()  # m    (6,)
        self.offset_y = tip[:, :, 1].sum(axis=1)  # m    (6,) Y
        self.femur = np.hypot(tip[:, 1, 0], tip[:, 1, 2])  # m    (6,) a
        self.tibia = np.hypot(tip[:, 2, 0], tip[:, 2, 2])  # m    (6,) b
        self.squares = self.femur**2, self.tibia**2, self.offset_y**2  # m2    (6,) a^2, b^2, Y^2
        self.twice = 2.0 * self.femur * self.tibia  # m2    (6,)
        self.femur_tilt = np.arctan2(tip[:, 1, 2], tip[:, 1, 0])  # rad    (6,)
        self.tibia_tilt = np.arctan2(tip[:, 2, 2], tip[:, 2, 0])  # rad    (6,)
        self.femur_zero = np.exp(-1j * self.femur_tilt)  # 1    (6,)
        self.tibia_zero = np.exp(-1j * self.tibia_tilt)  # 1    (6,)
        self.angle_min = np.array([[k.angle_min for k in leg.links] for leg in legs])  # rad
        self.angle_max = np.array([[k.angle_max for k in leg.links] for leg in legs])  # rad
        self.stance = robot.stance  # rad    (6, 3)
        self.stance_pitch = robot.stance[:, 2] - robot.stance[:, 1]  # rad    (6,)
        self.speed_max = robot.servo.speed_max  # rad/s
        self.radius = robot.foot.radius  # m

    def forward(self, angle: Array) -> Array:
        """Returns the centres of the feet (..., 6, 3), torso frame [m] (C11).

        angle: (..., 6, 3) of the joints [rad].
        """
        x, z, c, s = self._leg_planes(angle)
        forward, aside = c * x - s * self.offset_y, s * x + c * self.offset_y
        return np.asarray(np.stack([forward, aside, z], axis=-1) + self.hip.T)

    def _leg_planes(self, angle: Array) -> tuple[Array, Array, Array, Array]:
        """Returns x and z of the feet [m] and the cosine and sine of the headings of their legs."""
        a = angle[..., 1] + self.femur_tilt
        b = angle[..., 1] - angle[..., 2] + self.tibia_tilt
        x = self.coxa_length + self.femur * np.cos(a) + self.tibia * np.cos(b)
        z = self.coxa_height + self.femur * np.sin(a) + self.tibia * np.sin(b)
        heading = self.hip_yaw + angle[..., 0]
        return x, z, np.cos(heading), np.sin(heading)

    def rolling(self, angle: Array) -> Array:
        """Returns the distances that the feet have rolled outwards since the stance (6,) [m]."""
        return np.asarray(self.radius * (angle[..., 2] - angle[..., 1] - self.stance_pitch))

    def pose(self, plane: Plane, height: Array) -> Pose:
        """Solves the inverse kinematics without joint limits (C12); every target gives a pose.

        Args:
            plane, height: (6,) centres of the feet, x + i y and z, torso frame [m].
        """
        a2, b2, side2 = self.squares
        point = plane - self.place
        # rho^2 = x^2 + y^2 - Y^2;  e^(i psi) = (x + i y)/(rho + i Y)
        distance2 = square(point) - side2
        rho = np.sqrt(np.maximum(distance2, RADIUS_FLOOR))
        heading = point / plane_of(rho, self.offset_y)
        foot = plane_of(rho - self.coxa_length, height - self.hip[2] - self.coxa_height)
        # cos gamma = (u^2 + w^2 - a^2 - b^2)/(2 a b);  e^(i B) = (u + i w)/(b + a e^(i gamma))
        wanted = (square(foot) - a2 - b2) / self.twice
        cosine = clamp(wanted, FOLDED_COSINE, 1.0)
        knee = plane_of(cosine, np.sqrt(1.0 - cosine * cosine))
        tibia = foot / (self.tibia + self.femur * knee)
        femur = tibia * knee
        angle = np.empty((*cosine.shape, 3))
        coxa, thigh = heading * self.upright, femur * self.femur_zero
        angle[..., 0] = np.arctan2(coxa.imag, coxa.real)
        angle[..., 1] = np.arctan2(thigh.imag, thigh.real)
        angle[..., 2] = np.arccos(cosine) - self.femur_tilt + self.tibia_tilt
        lost = ~((distance2 >= RADIUS_FLOOR) & (np.abs(wanted - cosine) <= FLAG_TOLERANCE))
        return Pose(point, heading, foot, femur, tibia, angle, lost)

    def speeds(self, pose: Pose, velocity: Plane | float, rise: Array | float) -> Array:
        """Returns the joint speeds (6, 3) for velocities of the feet, without limits [rad/s] (C13).

        velocity, rise: (6,) velocities of x + i y and of z, torso frame [m/s].
        """
        v = velocity * pose.heading.conj()
        turn = v.imag / (pose.foot.real + self.coxa_length)
        left = plane_of(v.real + self.offset_y * turn, rise)
        sine = across(pose.tibia, pose.femur)
        lever = -self.femur * np.maximum(sine, SINGULAR_SINE)
        speed = np.empty((*turn.shape, 3))
        speed[..., 0] = turn
        speed[..., 1] = along(left, pose.tibia) / lever
        speed[..., 2] = along(left, pose.foot) / (lever * self.tibia)
        return speed

    def solve(self, pose: Pose, velocity: Plane, rise: Array) -> Joints:
        """Returns angles and speeds limited to those that the joints can reach.

        The speed of a joint at its angle limit is 0. Arguments are those of speeds().
        """
        angle = clamp(pose.angle, self.angle_min, self.angle_max)
        limited = ~(np.abs(pose.angle - angle) <= FLAG_TOLERANCE)
        speed = clamp(self.speeds(pose, velocity, rise), -self.speed_max, self.speed_max)
        return Joints(angle, np.where(limited, 0.0, speed), pose.lost | limited.any(axis=-1))

    def accelerations(
        self, neighbour: Pose | None, ahead: float, angle: Array, speed: Array
    ) -> Array:
        """Returns the joint accelerations that reach the angles of a neighbouring step (C14).

        They are 0 at a limit of angle or speed. No acceleration exceeds that which reverses the
        largest speed within the time between the steps.

        Args:
            neighbour: the pose of the neighbouring step; None: no accelerations.
            ahead: time from this step to the neighbour [s], negative when it lies before.
            angle, speed: (6, 3) joints at this step [rad, rad/s].

        Returns:
            (6, 3) accelerations [rad/s2].
        """
        if neighbour is None:
            return np.zeros_like(angle)
        most = 2.0 * self.speed_max / abs(ahead)
        limited = (angle <= self.angle_min) | (angle >= self.angle_max)
        limited |= np.abs(speed) >= self.speed_max
        way = clamp(neighbour.angle, self.angle_min, self.angle_max) - angle - ahead * speed
        return np.where(limited, 0.0, clamp(2.0 * way / (ahead * ahead), -most, most))

    def softness(self, pose: Pose, kp: float) -> Softness:
        """Returns the softness of legs whose servos have the stiffness kp [N m/rad] (C25)."""
        # rates of the foot, outward + i up, by the femur's and by the tibia's joint
        femur, tibia = 1j * pose.foot, -1j * self.tibia * pose.tibia
        return Softness(
            outward=(femur.real**2 + tibia.real**2 + self.offset_y**2) / kp,
            sideward=(pose.foot.real + self.coxa_length) ** 2 / kp,
            up=(femur.imag**2 + tibia.imag**2) / kp,
            splay=(femur.real * femur.imag + tibia.real * tibia.imag) / kp,
        )

    def load_torques(self, angle: Array, force: Array) -> Array:
        """Returns the joint torques (6, 3) that carry forces on the feet, -J^T f [N m] (C57).

        angle: (6, 3) [rad]; force: (6, 3) on the feet's centres, torso axes [N].
        """
        a = angle[:, 1] + self.femur_tilt
        b = angle[:, 1] - angle[:, 2] + self.tibia_tilt
        tibia = self.tibia * cis(b)
        arm = self.femur * cis(a) + tibia  # from the femur's joint to the foot
        plane = plane_of(force[:, 0], force[:, 1]) * cis(-(self.hip_yaw + angle[:, 0]))
        foot = plane_of(self.coxa_length + arm.real, self.offset_y)
        inner = plane_of(plane.real, force[:, 2])
        return -rows_of(across(foot, plane), across(arm, inner), -across(tibia, inner))

    # the design and the static checks use the following; the running controller does not

    def jacobian(self, angle: Array) -> Array:
        """Returns the velocity of each foot's centre per joint speed (6, 3, 3) [m/rad], torso axes.

        Rows are axes, columns joints. angle: (6, 3) [rad].
        """
        x, z, c, s = self._leg_planes(angle)
        b = angle[..., 1] - angle[..., 2] + self.tibia_tilt
        jacobian = np.zeros((*angle.shape, 3))
        jacobian[:, 0, 0] = -s * x - c * self.offset_y
        jacobian[:, 1, 0] = c * x - s * self.offset_y
        for joint, radial, rise in (
            (1, self.coxa_height - z, x - self.coxa_length),
            (2, self.tibia * np.sin(b), -self.tibia * np.cos(b)),
        ):
            jacobian[:, 0, joint], jacobian[:, 1, joint] = c * radial, s * radial
            jacobian[:, 2, joint] = rise
        return jacobian

    def inverse(self, foot: Array) -> Array:
        """Returns the joint angles (6, 3) [rad] for feet (6, 3) in the torso frame [m].

        Raises ReachError with leg, target and reach when a foot cannot reach its target.
        """
        points = np.asarray(foot, dtype=np.float64)
        wrong = ~np.isfinite(points).all(axis=1)
        if not wrong.any():
            pose = self.pose(points[:, 0] + 1j * points[:, 1], points[:, 2])
            joints = self.solve(pose, np.zeros_like(pose.point), np.zeros_like(points[:, 2]))
            wrong = joints.unreachable
            if not wrong.any():
                return joints.angle
        leg = int(np.argmax(wrong))
        raise ReachError(
            "the foot cannot get there",
            got=tuple(points[leg].tolist()),
            expected=self._reach_text(leg),
            fix="move the target closer to the stance, or shorten the stride",
            where=f"leg {LEG_NAMES[leg]}",
        )

    def _reach_text(self, leg: int) -> str:
        near = abs(self.femur[leg] - self.tibia[leg])
        far = self.femur[leg] + self.tibia[leg]
        ranges = zip(self.angle_min[leg], self.angle_max[leg], strict=True)
        limits = ", ".join(f"[{low:.3f}, {high:.3f}]" for low, high in ranges)
        hip = tuple(round(float(v), 4) for v in self.hip[:, leg])
        return (
            f"a point {near:.4f} to {far:.4f} m from the femur joint, which circles the hip {hip} "
            f"m at {self.coxa_length[leg]:.4f} m, with joints within {limits} rad"
        )


def _check_axes(robot: Robot) -> None:
    for leg in robot.legs:
        for joint, (link, axis) in enumerate(zip(leg.links, AXES, strict=True)):
            if np.abs(np.subtract(link.axis, axis)).max() > AXIS_TOLERANCE:
                raise RobotError(
                    "no closed-form inverse kinematics for this joint axis",
                    got=tuple(link.axis),
                    expected=f"{axis}",
                    fix="turn the link's frame so that coxa, femur and tibia turn about +z, -y, +y",
                    where=f"leg {leg.name}, joint {joint + 1}",
                )
