"""Closed-form kinematics of six three-joint legs, all at once.

Geometry (docs/architecture.md): the coxa turns about +z, the femur about -y, the tibia about +y; every link's tip is
(length, offset_y, offset_z) in its frame. Seen in the coxa frame a leg is then a planar two-link arm in the x-z plane, shifted
sideways by the sum Y of the y offsets:

    x = l_1  + a cos A + b cos B        A = q_2 + atan2(offset_z, length) of the femur     a = |femur tip|
    z = oz_1 + a sin A + b sin B        B = q_2 - q_3 + atan2(offset_z, length) of the tibia   b = |tibia tip|

The knee angle gamma = A - B in [0, pi] (knee up) makes the inverse unique. `LegSolver.solve`, which runs at every period, writes
points of a plane as complex numbers: a turn is one product, all six legs are one operation, and only the results need arc functions.
"""

from __future__ import annotations

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
                    "no closed-form inverse kinematics for this joint axis", got=tuple(link.axis), expected=f"{axis}",
                    fix="turn the link's frame so that coxa, femur and tibia turn about +z, -y and +y",
                    where=f"leg {leg.name}, joint {joint + 1}",
                )  # fmt: skip


class LegSolver:
    """Forward and inverse kinematics of a robot's legs in the torso frame. Raises RobotError on another axis pattern."""

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
        # constants as full arrays: numpy is faster with them than with Python numbers
        self._hip_plane, self._hip_height = self.hip[0] + 1j * self.hip[1], self.hip[2] + self.coxa_height
        self._side2, self._floor, self._one = self.offset_y**2, np.full(LEGS, RADIUS_FLOOR), np.ones(LEGS)
        self._squares, self._product = self.femur**2 + self.tibia**2, 0.5 / (self.femur * self.tibia)
        self._knee_tilt = self.femur_tilt - self.tibia_tilt
        self._zero_turn = np.exp(-1j * np.stack([self.hip_yaw, self.femur_tilt]))  # turns e^i psi, e^i A into e^i q
        self._divisor = np.stack([-self.femur, -self.femur * self.tibia])
        self._sine_floor = np.full(LEGS, SINGULAR_SINE)
        self._folded = np.full(LEGS, FOLDED_COSINE)
        self._low, self._high = np.ascontiguousarray(self.angle_min.T), np.ascontiguousarray(self.angle_max.T)
        self._fastest = np.full((3, LEGS), self.speed_max)
        self._slowest = -self._fastest
        self._rows = np.empty((6, LEGS))
        self._point, self._knee, self._reach, self._heading = (np.empty(LEGS, dtype=np.complex128) for _ in range(4))
        self._arm, self._turn = (np.empty((2, LEGS), dtype=np.complex128) for _ in range(2))
        self._q, self._bounded, self._speed = (np.empty((3, LEGS)) for _ in range(3))
        self._short, self._far = np.empty((2, LEGS), dtype=np.bool_)

    @property
    def heading(self) -> Plane:
        """(6,) the legs' outward directions e^(i psi) in the torso frame, conjugated, at the last solve."""
        return self._heading

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
        angle, wrong = np.empty((LEGS, 3)), np.empty(LEGS, dtype=np.bool_)
        points = np.asarray(foot, dtype=np.float64)
        if np.isfinite(points).all():
            plane = points[:, 0] + 1j * points[:, 1]
            self.solve(plane, points[:, 2], np.zeros_like(plane), np.zeros(LEGS), angle, np.empty_like(angle), wrong)
        else:
            wrong[:] = ~np.isfinite(points).all(axis=1)
        if not wrong.any():
            return angle
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

    def solve(self, plane: Plane, height: Array, plane_velocity: Plane, rise: Array, angle: Array, speed: Array, unreachable: Mask) -> None:
        """Inverse kinematics that never raises: the nearest angles within the limits, and a flag.

        Args:
            plane, height: (6,) feet's centres in the torso frame, x + i y and z [m].
            plane_velocity, rise: (6,) their velocity in the torso frame, alike [m/s].
            angle, speed: (6, 3) results [rad, rad/s]; a joint held by its limit has speed 0, none is faster than the servo.
            unreachable: (6,) result: this leg's angles do not put the foot on its target.
        """
        self._angles(plane, height)
        q, bounded = self._q, self._bounded
        np.maximum(q, self._low, out=bounded)
        np.minimum(bounded, self._high, out=bounded)
        self._speeds(plane_velocity, rise)
        unreachable[:] = self._short
        if q.tobytes() != bounded.tobytes():
            held = np.abs(q - bounded) > FLAG_TOLERANCE
            unreachable |= held.any(axis=0)
            self._speed[held] = 0.0
        angle[...] = bounded.T
        speed[...] = self._speed.T

    def _angles(self, plane: Plane, height: Array) -> None:
        """q from the foot. Complex numbers stand for points of a plane: x + i y from above, u + i w in the leg's own plane."""
        rho, square, sine, t = self._rows[:4]
        point, knee, reach, (arm, chord), turn, q = self._point, self._knee, self._reach, self._arm, self._turn, self._q
        # rho^2 = x^2 + y^2 - Y^2: the foot's distance along the coxa's x axis;  e^i psi = (x + i y) / (rho + i Y)
        np.subtract(plane, self._hip_plane, point)
        np.absolute(point, square)
        np.multiply(square, square, square)
        np.subtract(square, self._side2, square)
        np.maximum(square, self._floor, out=rho)
        np.not_equal(rho, square, self._short)
        np.sqrt(rho, rho)
        reach.real, reach.imag = rho, self.offset_y
        np.divide(point, reach, turn[0])
        np.conjugate(turn[0], self._heading)
        # chord = u + i w: from the femur joint to the foot;  cos gamma = (|chord|^2 - a^2 - b^2) / (2 a b)
        np.subtract(rho, self.coxa_length, chord.real)
        np.subtract(height, self._hip_height, chord.imag)
        np.absolute(chord, square)
        np.multiply(square, square, square)
        np.subtract(square, self._squares, square)
        np.multiply(square, self._product, square)
        np.minimum(square, self._one, out=t)
        np.maximum(t, self._folded, out=t)
        np.not_equal(square, t, self._far)
        if True in self._far.tolist():
            self._short |= np.abs(square - t) > FLAG_TOLERANCE
        # chord = e^i B (b + a e^i gamma)
        np.arccos(t, q[2])
        np.sin(q[2], sine)
        knee.real, knee.imag = t, sine
        np.multiply(knee, self.femur, reach)
        np.add(reach, self.tibia, reach)
        np.divide(chord, reach, arm)
        np.multiply(arm, knee, turn[1])
        # q_1 = psi - hip_yaw, q_2 = A - tilt_2, q_3 = gamma - tilt_2 + tilt_3
        np.multiply(turn, self._zero_turn, turn)
        np.arctan2(turn.imag, turn.real, q[:2])
        np.subtract(q[2], self._knee_tilt, q[2])

    def _speeds(self, plane_velocity: Plane, rise: Array) -> None:
        """dq from the foot's velocity, with what `_angles` left behind."""
        rho, _, sine, t, radial = self._rows[:5]
        point, reach, arm, turn, speed = self._point, self._reach, self._arm, self._turn, self._speed
        # velocity in the coxa frame: v e^-i psi
        np.multiply(plane_velocity, self._heading, reach)
        # dq_1 = v_y / rho; then v = v_x + Y dq_1 + i v_z is left for the plane
        np.divide(reach.imag, rho, speed[0])
        np.multiply(speed[0], self.offset_y, t)
        np.add(reach.real, t, radial)
        point.real, point.imag = radial, rise
        # dq_2 = -Re(v / e^i B) / (a sin gamma);  dq_3 = -Re(v^* chord) / (a b sin gamma)
        np.conjugate(arm, turn)
        np.multiply(turn, point, turn)
        np.maximum(sine, self._sine_floor, out=sine)
        np.multiply(self._divisor, sine, self._rows[4:6])
        np.divide(turn.real, self._rows[4:6], speed[1:])
        np.maximum(speed, self._slowest, out=speed)
        np.minimum(speed, self._fastest, out=speed)
