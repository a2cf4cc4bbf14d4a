"""Closed-form kinematics of six three-joint legs, all at once.

Geometry (docs/architecture.md): the coxa turns about +z, the femur about -y, the tibia about +y; every link's tip is
(length, offset_y, offset_z) in its frame. Seen in the coxa frame a leg is then a planar two-link arm in the x-z plane, shifted
sideways by the sum Y of the y offsets:

    x = l_1  + a cos A + b cos B        A = q_2 + atan2(offset_z, length) of the femur     a = |femur tip|
    z = oz_1 + a sin A + b sin B        B = q_2 - q_3 + atan2(offset_z, length) of the tibia   b = |tibia tip|

The knee angle gamma = A - B in [0, pi] (knee up) makes the inverse unique. `LegSolver.solve`, which runs at every period, writes
points of a plane as complex numbers: a turn is one product, and only the results need arc functions. It takes leg by leg in Python's own
numbers: on arrays of six, numpy's cost per call is several times that of the six sums.
"""

from __future__ import annotations

from cmath import phase
from collections.abc import Sequence
from math import acos, sin, sqrt
from struct import Struct
from typing import NamedTuple

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
ROOT_FLOOR = sqrt(RADIUS_FLOOR)  # m
PACK = Struct(f"{6 * LEGS}d").pack_into  # numbers into an array: half the time of an assignment


def _check_axes(robot: Robot) -> None:
    for leg in robot.legs:
        for joint, (link, axis) in enumerate(zip(leg.links, AXES, strict=True)):
            if np.abs(np.subtract(link.axis, axis)).max() > AXIS_TOLERANCE:
                raise RobotError(
                    "no closed-form inverse kinematics for this joint axis", got=tuple(link.axis), expected=f"{axis}",
                    fix="turn the link's frame so that coxa, femur and tibia turn about +z, -y and +y",
                    where=f"leg {leg.name}, joint {joint + 1}",
                )  # fmt: skip


class LegConstants(NamedTuple):
    """What the inverse kinematics of a leg need. Points of a plane are x + i y seen from above, u + i w in the leg's own plane."""

    hip: complex  # m    of the coxa axis, torso frame
    height: float  # m    of the femur joint, torso frame
    coxa: float  # m    from the coxa axis to the femur joint
    side: float  # m    Y
    femur: float  # m    a
    tibia: float  # m    b
    yaw: complex  # e^-i hip_yaw
    tilt: complex  # e^-i tilt_2
    knee_tilt: float  # rad    tilt_2 - tilt_3
    side_square: float  # m2    Y^2
    scale: float  # 1/m2    1 / (2 a b)
    shift: float  # 1    (a^2 + b^2) / (2 a b)


Feet = tuple[Sequence[complex], Sequence[float], Sequence[complex], Sequence[float]]
Solution = tuple[list[float], list[float], list[complex], list[int]]


def solve_legs(legs: Sequence[LegConstants], feet: Feet) -> Solution:
    """Inverse kinematics without limits: whatever comes in, something comes out.

    Args:
        feet: of each leg x + i y and z of its foot in the torso frame [m], and their velocities [m/s].

    Returns: q_1 q_2 q_3 of all legs [rad], their speeds [rad/s], e^i psi of the legs' outward directions, and which legs do not reach.
    """
    angle: list[float] = []
    speed: list[float] = []
    headings: list[complex] = []
    lost: list[int] = []
    for number, (leg, plane, height, velocity, rise) in enumerate(zip(legs, *feet, strict=True)):
        hip, z_0, coxa, side, a, b, yaw, tilt, knee_tilt, side_square, scale, shift = leg
        # rho^2 = x^2 + y^2 - Y^2: the foot's distance along the coxa's x axis;  e^i psi = (x + i y) / (rho + i Y)
        point = plane - hip
        x, y = point.real, point.imag
        square = x * x + y * y - side_square
        rho = sqrt(square) if square >= RADIUS_FLOOR else ROOT_FLOOR
        heading = point / complex(rho, side)
        # from the femur joint to the foot: r + i z = e^i B (b + a e^i gamma), so cos gamma = (r^2 + z^2 - a^2 - b^2) / (2 a b)
        r, z = rho - coxa, height - z_0
        cosine = wanted = (r * r + z * z) * scale - shift
        if not FOLDED_COSINE <= cosine <= 1.0:
            cosine = min(max(wanted, FOLDED_COSINE), 1.0)
        if not (square >= RADIUS_FLOOR and abs(wanted - cosine) <= FLAG_TOLERANCE):
            lost.append(number)
        gamma = acos(cosine)
        sine = sin(gamma)
        knee = complex(cosine, sine)
        lower = complex(r, z) / (b + a * knee)  # e^i B
        # velocity in the coxa frame v e^-i psi: dq_1 = v_y / rho; then u + i rise, u = v_x + Y dq_1, is left for the leg's plane
        v = velocity * heading.conjugate()
        turn = v.imag / rho
        u = v.real + side * turn
        # dq_2 = -Re((u + i rise)^* e^i B) / (a sin gamma);  dq_3 = -Re((u + i rise)^* (r + i z)) / (a b sin gamma)
        lever = -a * (sine if sine > SINGULAR_SINE else SINGULAR_SINE)
        angle += (phase(heading * yaw), phase(lower * knee * tilt), gamma - knee_tilt)
        speed += (turn, (u * lower.real + rise * lower.imag) / lever, (u * r + rise * z) / (lever * b))
        headings.append(heading)
    return angle, speed, headings, lost


class LegSolver:
    """Forward and inverse kinematics of a robot's legs in the torso frame. Raises RobotError on another axis pattern.

    Attributes, results of the last solve:
        joints: (2, 6, 3) angles and speeds [rad, rad/s];  angles: the same angles, leg by leg;
        unreachable: (6,) legs whose angles do not put the foot on its target;
        headings: the legs' outward directions e^(i psi) in the torso frame.
    """

    def __init__(self, robot: Robot) -> None:
        _check_axes(robot)
        tip = np.array([[(link.length, link.offset_y, link.offset_z) for link in leg.links] for leg in robot.legs])
        self.hip = np.ascontiguousarray(np.array([leg.hip_position for leg in robot.legs]).T)  # m    (3, 6) torso frame
        self.hip_yaw = np.array([leg.hip_yaw for leg in robot.legs])  # rad    (6,)
        self.coxa_length, self.coxa_height = tip[:, 0, 0].copy(), tip[:, 0, 2].copy()  # m    (6,)
        self.offset_y = tip[:, :, 1].sum(axis=1)  # m    (6,)  Y
        self.femur, self.tibia = (np.hypot(tip[:, j, 0], tip[:, j, 2]) for j in (1, 2))  # m    (6,)  a, b
        self.femur_tilt, self.tibia_tilt = (np.arctan2(tip[:, j, 2], tip[:, j, 0]) for j in (1, 2))  # rad    (6,)
        self.angle_min = np.array([[link.angle_min for link in leg.links] for leg in robot.legs])  # rad    (6, 3)
        self.angle_max = np.array([[link.angle_max for link in leg.links] for leg in robot.legs])  # rad    (6, 3)
        self.speed_max = robot.servo.speed_max  # rad/s
        self._prepare()

    def _prepare(self) -> None:
        zero = np.exp(-1j * np.stack([self.hip_yaw, self.femur_tilt]))  # turns e^i psi, e^i A into e^i q
        a, b, y = self.femur, self.tibia, self.offset_y
        columns = (
            self.hip[0] + 1j * self.hip[1], self.hip[2] + self.coxa_height, self.coxa_length, y, a, b, *zero,
            self.femur_tilt - self.tibia_tilt, y * y, 0.5 / (a * b), 0.5 * (a / b + b / a),
        )  # fmt: skip
        self._legs = [LegConstants(*values) for values in zip(*(column.tolist() for column in columns), strict=True)]
        # angles of all legs, then speeds
        most = np.full((LEGS, 3), self.speed_max)
        self._low, self._high = (np.stack(limits).reshape(-1) for limits in ((self.angle_min, -most), (self.angle_max, most)))
        self._wanted, self._bounded = np.zeros((2, 6 * LEGS))
        self.joints = self._bounded.reshape(2, LEGS, 3)
        self.unreachable: Mask = np.zeros(LEGS, dtype=np.bool_)
        self.angles, self.headings = [0.0] * (3 * LEGS), [0j] * LEGS

    def forward(self, angle: Array) -> Array:
        """(6, 3) feet's centres in the torso frame [m] at joint angles (6, 3) [rad]."""
        x, z = self._plane(angle)[:2]
        heading = self.hip_yaw + angle[:, 0]
        c, s = np.cos(heading), np.sin(heading)
        foot: Array = np.stack([c * x - s * self.offset_y, s * x + c * self.offset_y, z], axis=1) + self.hip.T
        return foot

    def _plane(self, angle: Array) -> tuple[Array, Array, Array, Array]:
        """x, z of the foot in the coxa frame [m] and the angles A, B [rad], (6,) each."""
        a = angle[:, 1] + self.femur_tilt
        b = angle[:, 1] - angle[:, 2] + self.tibia_tilt
        x = self.coxa_length + self.femur * np.cos(a) + self.tibia * np.cos(b)
        z = self.coxa_height + self.femur * np.sin(a) + self.tibia * np.sin(b)
        return x, z, a, b

    def jacobian(self, angle: Array) -> Array:
        """(6, 3, 3) foot velocity in the torso frame per joint speed [m/rad]; row: axis, column: joint."""
        x, z, _, b = self._plane(angle)
        heading = self.hip_yaw + angle[:, 0]
        c, s = np.cos(heading), np.sin(heading)
        jacobian = np.zeros((LEGS, 3, 3))
        jacobian[:, 0, 0] = -s * x - c * self.offset_y
        jacobian[:, 1, 0] = c * x - s * self.offset_y
        for joint, radial, rise in (
            (1, self.coxa_height - z, x - self.coxa_length),
            (2, self.tibia * np.sin(b), -self.tibia * np.cos(b)),
        ):
            jacobian[:, 0, joint], jacobian[:, 1, joint], jacobian[:, 2, joint] = c * radial, s * radial, rise
        return jacobian

    def inverse(self, foot: Array) -> Array:
        """(6, 3) joint angles [rad] of feet (6, 3) [m] in the torso frame. Raises ReachError: leg, target, reach."""
        points = np.asarray(foot, dtype=np.float64)
        wrong = ~np.isfinite(points).all(axis=1)
        if not wrong.any():
            still = [0.0] * LEGS
            self.solve(((points[:, 0] + 1j * points[:, 1]).tolist(), points[:, 2].tolist(), still, still))
            wrong = self.unreachable
        if not wrong.any():
            return np.array(self.joints[0])
        leg = int(np.argmax(wrong))
        raise ReachError(
            "the foot cannot get there", got=tuple(points[leg].tolist()), expected=self._reach_text(leg),
            fix="move the target closer to the stance, or shorten the stride", where=f"leg {LEG_NAMES[leg]}",
        )  # fmt: skip

    def _reach_text(self, leg: int) -> str:
        near, far = abs(self.femur[leg] - self.tibia[leg]), self.femur[leg] + self.tibia[leg]
        limits = ", ".join(f"[{low:.3f}, {high:.3f}]" for low, high in zip(self.angle_min[leg], self.angle_max[leg], strict=True))
        hip = tuple(round(float(v), 4) for v in self.hip[:, leg])
        return (
            f"a point {near:.4f} to {far:.4f} m from the femur joint, which circles the hip {hip} m "
            f"at {self.coxa_length[leg]:.4f} m, with joints within {limits} rad"
        )

    def save(self) -> tuple[list[float], list[complex]]:
        """What of the last solve the next step looks at."""
        return self.angles, self.headings

    def restore(self, state: tuple[list[float], list[complex]]) -> None:
        """Goes back to it."""
        self.angles, self.headings = state

    def solve(self, feet: Feet) -> None:
        """Inverse kinematics that never raises: the nearest angles within the limits, and a flag.

        A joint held by its limit has speed 0, none is faster than the servo.

        Args:
            feet: of each leg x + i y and z of its foot in the torso frame [m], and their velocities [m/s].
        """
        angles, speeds, self.headings, lost = solve_legs(self._legs, feet)
        wanted, bounded = self._wanted, self._bounded
        PACK(wanted.data, 0, *angles, *speeds)
        np.maximum(wanted, self._low, out=bounded)
        np.minimum(bounded, self._high, out=bounded)
        self.unreachable.fill(False)
        if lost:
            self.unreachable[lost] = True
        if wanted.tobytes() != bounded.tobytes():
            angle, speed = self.joints
            held = np.abs(wanted[: 3 * LEGS].reshape(LEGS, 3) - angle) > FLAG_TOLERANCE
            self.unreachable |= held.any(axis=1)
            speed[held] = 0.0
            angles = angle.reshape(-1).tolist()
        self.angles = angles
