"""Closed-form kinematics of six three-joint legs, for many steps at once.

Geometry (docs/architecture.md): the coxa turns about +z, the femur about -y, the tibia about +y;
every link's tip is (length, offset_y, offset_z) in its frame. Seen in the coxa frame a leg is then
a planar two-link arm in the x-z plane, shifted sideways by the sum Y of the y offsets:

    x = l_1  + a cos A + b cos B        A = q_2 + atan2(offset_z, length) of the femur     a =
    |femur tip| z = oz_1 + a sin A + b sin B        B = q_2 - q_3 + atan2(offset_z, length) of the
    tibia   b = |tibia tip|

The knee angle gamma = A - B in [0, pi] (knee up) makes the inverse unique. Points of a plane are
complex numbers, x + i y seen from above and u + i w, outward and up, in the leg's own plane: a turn
is one product, and only the results need arc functions.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.models import LEG_NAMES, ReachError, Robot, RobotError

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Plane = NDArray[np.complex128]  # points or directions x + i y

LEGS = len(LEG_NAMES)
AXES = ((0.0, 0.0, 1.0), (0.0, -1.0, 0.0), (0.0, 1.0, 0.0))
AXIS_TOLERANCE = 1e-9  # 1    on the components of an axis
FLAG_TOLERANCE = 1e-9  # rad or 1    round-off at the edge of the reach is not "unreachable"
SINGULAR_SINE = 0.02  # 1    floor of sin(gamma): a straight leg has no finite joint speed
FOLDED_COSINE = -1.0 + 1e-12  # 1    least cos(gamma): a folded leg of equal links has no direction
RADIUS_FLOOR = 1e-9  # m2    floor of the squared distance from the coxa axis


def _check_axes(robot: Robot) -> None:
    for leg in robot.legs:
        for joint, (link, axis) in enumerate(zip(leg.links, AXES, strict=True)):
            if np.abs(np.subtract(link.axis, axis)).max() > AXIS_TOLERANCE:
                raise RobotError(
                    "no closed-form inverse kinematics for this joint axis",
                    got=tuple(link.axis),
                    expected=f"{axis}",
                    fix="turn the link's frame so that coxa, femur and tibia turn about +z, -y and +y",
                    where=f"leg {leg.name}, joint {joint + 1}",
                )


@dataclass(frozen=True)
class Feet:
    """Feet and how they move, (n, 6) each; rows are steps."""

    plane: Plane  # m    centres, x + i y
    height: Array  # m    and z
    velocity: Plane  # m/s
    rise: Array  # m/s


@dataclass(frozen=True)
class Pose:
    """Legs in their planes, torso frame, (n, 6) each."""

    point: Plane  # m    from the coxa axis to the foot, x + i y
    heading: Plane  # 1    e^(i psi), the leg's outward direction
    foot: Plane  # m    from the femur joint to the foot, u + i w
    femur: Plane  # 1    e^(i A)
    tibia: Plane  # 1    e^(i B)
    angles: Array  # rad    (n, 6, 3)
    lost: Mask  # the foot is out of reach: these are the nearest angles

    def rows(self, chosen: slice) -> Pose:
        """Some of the steps."""
        return Pose(*(getattr(self, item.name)[chosen] for item in fields(self)))


@dataclass(frozen=True)
class Joints:
    """What servos can be told, (n, 6, 3) each."""

    angle: Array  # rad
    speed: Array  # rad/s
    unreachable: Mask  # (n, 6) legs whose angles do not put the foot on its target


def rates(values: Any, period: float) -> Any:
    """Differences over time of rows a period [s] apart, one-sided at the ends; a single row has
    none.
    """
    return np.gradient(values, period, axis=0) if len(values) > 1 else np.zeros_like(values)


class LegSolver:
    """Forward and inverse kinematics of a robot's legs in the torso frame. Raises RobotError on
    another axis pattern.
    """

    def __init__(self, robot: Robot) -> None:
        _check_axes(robot)
        tip = np.array(
            [
                [(link.length, link.offset_y, link.offset_z) for link in leg.links]
                for leg in robot.legs
            ]
        )
        self.hip = np.ascontiguousarray(
            np.array([leg.hip_position for leg in robot.legs]).T
        )  # m    (3, 6) torso frame
        self.hip_yaw = np.array([leg.hip_yaw for leg in robot.legs])  # rad    (6,)
        self.coxa_length, self.coxa_height = tip[:, 0, 0].copy(), tip[:, 0, 2].copy()  # m    (6,)
        self.offset_y = tip[:, :, 1].sum(axis=1)  # m    (6,)  Y
        self.femur, self.tibia = (
            np.hypot(tip[:, j, 0], tip[:, j, 2]) for j in (1, 2)
        )  # m    (6,)  a, b
        self.femur_tilt, self.tibia_tilt = (
            np.arctan2(tip[:, j, 2], tip[:, j, 0]) for j in (1, 2)
        )  # rad    (6,)
        self.angle_min = np.array(
            [[link.angle_min for link in leg.links] for leg in robot.legs]
        )  # rad    (6, 3)
        self.angle_max = np.array(
            [[link.angle_max for link in leg.links] for leg in robot.legs]
        )  # rad    (6, 3)
        self.speed_max = robot.servo.speed_max  # rad/s
        self.radius, self._stance_pitch = (
            robot.foot.radius,
            robot.stance[:, 2] - robot.stance[:, 1],
        )  # m, rad
        self.place = self.hip[0] + 1j * self.hip[1]  # m    (6,) of the coxa axes, torso frame
        self._upright, self._femur_zero = (
            np.exp(-1j * tilt) for tilt in (self.hip_yaw, self.femur_tilt)
        )

    def forward(self, angle: Array) -> Array:
        """(..., 6, 3) feet's centres in the torso frame [m] at joint angles (..., 6, 3) [rad]."""
        x, z = self._plane(angle)[:2]
        heading = self.hip_yaw + angle[..., 0]
        c, s = np.cos(heading), np.sin(heading)
        foot: Array = (
            np.stack([c * x - s * self.offset_y, s * x + c * self.offset_y, z], axis=-1)
            + self.hip.T
        )
        return foot

    def rolling(self, angle: Array) -> Array:
        """(..., 6) m    how far the round feet have rolled outwards since the stance, R (q_3 -
        q_2 less that of the stance)
        """
        return np.asarray(self.radius * (angle[..., 2] - angle[..., 1] - self._stance_pitch))

    def _plane(self, angle: Array) -> tuple[Array, Array, Array, Array]:
        """x, z of the foot in the coxa frame [m] and the angles A, B [rad], (..., 6) each."""
        a = angle[..., 1] + self.femur_tilt
        b = angle[..., 1] - angle[..., 2] + self.tibia_tilt
        x = self.coxa_length + self.femur * np.cos(a) + self.tibia * np.cos(b)
        z = self.coxa_height + self.femur * np.sin(a) + self.tibia * np.sin(b)
        return x, z, a, b

    def jacobian(self, angle: Array) -> Array:
        """(6, 3, 3) foot velocity in the torso frame per joint speed [m/rad]; row: axis, column:
        joint.
        """
        x, z, _, b = self._plane(angle)
        heading = self.hip_yaw + angle[..., 0]
        c, s = np.cos(heading), np.sin(heading)
        jacobian = np.zeros((LEGS, 3, 3))
        jacobian[:, 0, 0] = -s * x - c * self.offset_y
        jacobian[:, 1, 0] = c * x - s * self.offset_y
        for joint, radial, rise in (
            (1, self.coxa_height - z, x - self.coxa_length),
            (2, self.tibia * np.sin(b), -self.tibia * np.cos(b)),
        ):
            jacobian[:, 0, joint], jacobian[:, 1, joint], jacobian[:, 2, joint] = (
                c * radial,
                s * radial,
                rise,
            )
        return jacobian

    def inverse(self, foot: Array) -> Array:
        """(6, 3) joint angles [rad] of feet (6, 3) [m] in the torso frame. Raises ReachError:
        leg, target, reach.
        """
        points = np.asarray(foot, dtype=np.float64)
        wrong = ~np.isfinite(points).all(axis=1)
        if not wrong.any():
            x, y, z = points.T[:, None]
            joints = self.solve(
                self.pose(x + 1j * y, z), np.zeros(1, dtype=np.complex128), np.zeros(1)
            )
            wrong = joints.unreachable[0]
            if not wrong.any():
                return np.asarray(joints.angle[0])
        leg = int(np.argmax(wrong))
        raise ReachError(
            "the foot cannot get there",
            got=tuple(points[leg].tolist()),
            expected=self._reach_text(leg),
            fix="move the target closer to the stance, or shorten the stride",
            where=f"leg {LEG_NAMES[leg]}",
        )

    def _reach_text(self, leg: int) -> str:
        near, far = abs(self.femur[leg] - self.tibia[leg]), self.femur[leg] + self.tibia[leg]
        limits = ", ".join(
            f"[{low:.3f}, {high:.3f}]"
            for low, high in zip(self.angle_min[leg], self.angle_max[leg], strict=True)
        )
        hip = tuple(round(float(v), 4) for v in self.hip[:, leg])
        return (
            f"a point {near:.4f} to {far:.4f} m from the femur joint, which circles the hip {hip} m "
            f"at {self.coxa_length[leg]:.4f} m, with joints within {limits} rad"
        )

    def pose(self, plane: Plane, height: Array) -> Pose:
        """Inverse kinematics without joint limits: whatever comes in, something comes out. Feet
        (n, 6) x + i y and z, torso frame [m].
        """
        a, b, side = self.femur, self.tibia, self.offset_y
        point = plane - self.place
        # rho^2 = x^2 + y^2 - Y^2: the foot's distance along the coxa's x axis;  e^i psi = (x + i y)
        # / (rho + i Y)
        square = point.real**2 + point.imag**2 - side * side
        rho = np.sqrt(np.maximum(square, RADIUS_FLOOR))
        heading = point / (rho + 1j * side)
        foot = rho - self.coxa_length + 1j * (height - self.hip[2] - self.coxa_height)
        # u + i w = e^i B (b + a e^i gamma), so cos gamma = (u^2 + w^2 - a^2 - b^2) / (2 a b)
        wanted = (foot.real**2 + foot.imag**2 - a * a - b * b) / (2.0 * a * b)
        cosine = np.minimum(np.maximum(wanted, FOLDED_COSINE), 1.0)
        knee = cosine + 1j * np.sqrt(1.0 - cosine * cosine)
        tibia = foot / (b + a * knee)
        femur = tibia * knee
        angles = np.stack(
            [
                np.angle(heading * self._upright),
                np.angle(femur * self._femur_zero),
                np.arccos(cosine) - self.femur_tilt + self.tibia_tilt,
            ],
            axis=-1,
        )
        return Pose(
            point,
            heading,
            foot,
            femur,
            tibia,
            angles,
            ~((square >= RADIUS_FLOOR) & (np.abs(wanted - cosine) <= FLAG_TOLERANCE)),
        )

    def speeds(self, pose: Pose, velocity: Plane | Array, rise: Array) -> Array:
        """(n, 6, 3) joint speeds [rad/s] of feet that move so, (n, 6) each or what broadcasts to
        it, torso frame [m/s].
        """
        # velocity in the coxa frame v e^-i psi: dq_1 = v_y / rho; then u + i rise, u = v_x + Y
        # dq_1, is left for the leg's plane
        v = velocity * pose.heading.conj()
        turn = v.imag / (pose.foot.real + self.coxa_length)
        left = v.real + self.offset_y * turn - 1j * rise
        # dq_2 = -Re((u + i rise)^* e^i B) / (a sin gamma);  dq_3 = -Re((u + i rise)^* foot) / (a b
        # sin gamma)
        lever = -self.femur * np.maximum((pose.femur * pose.tibia.conj()).imag, SINGULAR_SINE)
        return np.stack(
            [
                turn,
                (left * pose.tibia).real / lever,
                (left * pose.foot).real / (lever * self.tibia),
            ],
            axis=-1,
        )

    def solve(self, pose: Pose, velocity: Plane, rise: Array) -> Joints:
        """Angles within the joints' limits, and speeds that servos can reach: a joint held by
        its limit has none.
        """
        angle = np.minimum(np.maximum(pose.angles, self.angle_min), self.angle_max)
        held = ~(np.abs(pose.angles - angle) <= FLAG_TOLERANCE)
        speed = self.speeds(pose, velocity, rise)
        np.minimum(np.maximum(speed, -self.speed_max, out=speed), self.speed_max, out=speed)
        speed[held] = 0.0
        return Joints(angle, speed, pose.lost | held.any(axis=-1))

    def accelerations(self, joints: Joints, period: float) -> Array:
        """(n, 6, 3) [rad/s2] that lead the joints from each row to the angles of the next.

        Rows are a period [s] apart; the last row has those that led there. A joint that its limits
        hold, of angle or of speed, has none; no joint has more than turns its speed round within a
        period.
        """
        angle, speed, found = joints.angle, joints.speed, np.zeros_like(joints.angle)
        if len(angle) > 1:
            found[:-1] = 2.0 * (angle[1:] - angle[:-1] - period * speed[:-1]) / period**2
            found[-1] = 2.0 * (angle[-2] - angle[-1] + period * speed[-1]) / period**2
        most = 2.0 * self.speed_max / period
        np.minimum(np.maximum(found, -most, out=found), most, out=found)
        held = (
            (angle <= self.angle_min)
            | (angle >= self.angle_max)
            | (np.abs(speed) >= self.speed_max)
        )
        found[held] = 0.0
        return found
