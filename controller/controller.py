"""From body command and measurement to joint commands, once a period.

    command -> ramp -> foot paths -> + compliance (measured forces) -> posture -> inverse kinematics -> angle_ref, speed_ref

Kinematic control is the same chain without the compliance: the commands alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.controller.compliance import Compliance
from hexapod_cosim.controller.gains import Gains
from hexapod_cosim.controller.gait import Gait
from hexapod_cosim.controller.kinematics import LEGS, Array, LegSolver, Mask, Plane
from hexapod_cosim.controller.trajectory import BodyCommand, CommandRamp, FootPaths, Twist
from hexapod_cosim.models import HexapodError, Robot
from hexapod_cosim.models.kinematics import axis_rotation

CLOCK_TOLERANCE = 0.01  # 1    of a period, between the time given and the steps counted


class ControllerError(HexapodError):
    """A controller that cannot be built, or is called out of step."""


def _zeros() -> Array:
    return np.zeros((LEGS, 3))


def _upright() -> Array:
    return np.array([1.0, 0.0, 0.0, 0.0])


@dataclass
class Measurement:
    """What the robot senses. The arrays belong to the caller, who updates them in place."""

    angle: Array = field(default_factory=_zeros)  # rad    (6, 3)
    speed: Array = field(default_factory=_zeros)  # rad/s    (6, 3)
    foot_force: Array = field(default_factory=_zeros)  # N    (6, 3) ground on foot, world axes
    contact: Mask = field(default_factory=lambda: np.zeros(LEGS, dtype=np.bool_))  # (6,)
    quaternion: Array = field(default_factory=_upright)  # 1    (4,) torso to world, w x y z
    angular_velocity: Array = field(default_factory=lambda: np.zeros(3))  # rad/s    (3,) torso, world axes


@dataclass
class JointCommand:
    """What the servos are told. The arrays belong to the controller, which writes them anew at every step."""

    angle_ref: Array = field(default_factory=_zeros)  # rad    (6, 3)
    speed_ref: Array = field(default_factory=_zeros)  # rad/s    (6, 3)
    torque_ref: Array = field(default_factory=_zeros)  # N m    (6, 3)


@dataclass(frozen=True)
class Diagnostics:
    """The controller's insides for recorders and tests: arrays of six legs that change at every step."""

    phase: Array  # 1    of each leg's cycle
    swinging: Mask  # planned to be in the air
    shift: Plane  # m    horizontal correction by the compliance, x + i y in the walking frame
    lift: Array  # m    vertical correction
    plane: Plane  # m    foot targets given to the inverse kinematics, x + i y in the torso frame
    height: Array  # m    and z
    unreachable: Mask  # the joints could not follow at the last step
    command: Array  # (6,) vx vy yaw_rate height roll pitch after the ramp


class Controller:
    """Walks a robot. `gains` None: kinematic control; else compliant control with these gains.

    `warnings` lists what is doubtful about the set-up (gains of another robot or period); nothing in it stops the run.
    Raises RobotError for a joint pattern without closed-form kinematics, ControllerError for an impossible period.
    """

    def __init__(self, robot: Robot, *, period: float, gait: Gait, gains: Gains | None = None) -> None:
        phases = (gait.duty * gait.period, (1.0 - gait.duty) * gait.period)
        if not 0.0 < period < min(phases):
            raise ControllerError(
                "impossible controller period", got=period, expected=f"0 < period < {min(phases):g} s, the gait's shorter phase",
                fix="shorten the period or slow the gait",
            )  # fmt: skip
        self.period, self.gait, self.gains = period, gait, gains
        self.legs = LegSolver(robot)
        self.ramp = CommandRamp(gait.period)
        self.stance = np.array([leg.stance for leg in robot.legs])
        self.paths = FootPaths(gait, self.legs.forward(self.stance), period=period)
        weight = robot.total_mass * float(np.linalg.norm(robot.gravity))
        self.compliance = None if gains is None else Compliance(gains, weight=weight, centre=centre_of_mass(robot), period=period)
        mismatch = None if gains is None else gains.mismatch(robot, period=period)
        self.warnings: tuple[str, ...] = () if mismatch is None else (mismatch,)
        self._radius = np.full(LEGS, robot.foot.radius)
        self._allocate()
        self.reset()

    def _allocate(self) -> None:
        self._out = JointCommand()
        # rows: position and velocity
        self._horizontal, self._vertical = np.empty((2, LEGS), dtype=np.complex128), np.empty((2, LEGS))
        (self._plane, self._plane_velocity), (self._height, self._rise) = self._horizontal, self._vertical
        # rows (x y z 0) of forces, seen as x + i y and z without a copy
        self._force, self._rotation = np.zeros((LEGS, 4)), np.zeros((3, 4))
        self._push, self._normal = self._force.view(np.complex128)[:, 0], self._force[:, 2]
        self._rolling = np.zeros((2, LEGS), dtype=np.complex128)
        self._rolled, self._roll_rate = self._rolling
        self._pitch, self._stance_pitch = np.empty(LEGS), self.stance[:, 2] - self.stance[:, 1]
        self._per_second = np.full(LEGS, 1.0 / self.period)
        self._unreachable = np.zeros(LEGS, dtype=np.bool_)
        laws = self.compliance
        self.diagnostics = Diagnostics(
            phase=self.paths.phase, swinging=self.paths.swinging, plane=self._plane, height=self._height,
            shift=np.zeros(LEGS, dtype=np.complex128) if laws is None else laws.shift, lift=np.zeros(LEGS) if laws is None else laws.lift,
            unreachable=self._unreachable, command=self.ramp.value,
        )  # fmt: skip

    def reset(self) -> None:
        """Standing in the stance, all memory cleared; the next step is the first."""
        self.ramp.reset()
        self.paths.reset()
        if self.compliance is not None:
            self.compliance.reset()
        self._rolled[:] = 0.0
        self._twist: Twist = (0j, 0.0)
        self._start: float | None = None
        self._count = 0

    @property
    def state_arrays(self) -> dict[str, NDArray[Any]]:
        """Everything the controller remembers between steps, by name (live arrays)."""
        paths = self.paths
        arrays: dict[str, NDArray[Any]] = {
            "ramp.value": self.ramp.value, "ramp.rate": self.ramp.rate,
            "paths.plane": paths.plane, "paths.height": paths.height, "paths.landing": paths.landing,
            "paths.phase": paths.phase, "paths.blend": paths.blend, "rolled": self._rolled,
        }  # fmt: skip
        if self.compliance is not None:
            laws = self.compliance
            arrays |= {"pid.state": laws.pid.state, "suspension.state": laws.suspension.state, "compliance.shift": laws.shift}
        return arrays

    def step(self, t: float, command: BodyCommand, measurement: Measurement) -> JointCommand:
        """The joint commands for [t, t + period). The result's arrays are reused by the next step.

        Args:
            t: time [s]; the first step may come at any time, later ones a period apart. Raises ControllerError otherwise.
            command: what the torso should do; changes are ramped over a gait period.
            measurement: sensor values at t; kinematic control does not look at it.
        """
        self._advance(t, command)
        paths, laws = self.paths, self.compliance
        if laws is None:
            self._horizontal[:], self._vertical[:] = paths.horizontal, paths.vertical
        else:
            self._sense(measurement)
            laws.step(self._push, self._normal, measurement.contact, swinging=paths.swinging, plane=paths.plane)
            np.add(paths.horizontal, laws.tangential, self._horizontal)
            np.add(paths.vertical, laws.normal, self._vertical)
        if self._count:
            self._roll()
        self._pose()
        out = self._out
        self.legs.solve(self._plane, self._height, self._plane_velocity, self._rise, out.angle_ref, out.speed_ref, self._unreachable)
        return self._out

    def _advance(self, t: float, command: BodyCommand) -> None:
        self.ramp.aim(command)
        if self._start is None:
            self._start = t
            return
        self._count += 1
        due = self._start + self._count * self.period
        if not abs(t - due) <= CLOCK_TOLERANCE * self.period:
            raise ControllerError("step out of time", got=t, expected=f"t = {due} s", fix="step once per period, or reset the controller")
        ramp, target = self.ramp, self.ramp.target
        if ramp.settled:
            going = (target.vx, target.vy, target.yaw_rate) != (0.0, 0.0, 0.0)
            self.paths.advance(self._twist, self._twist, going=going)
            return
        v, yaw_rate = self._twist
        ramp.advance(self.period)
        vx, vy, turn = ramp.value[:3].tolist()
        self._twist = (complex(vx, vy), turn)
        self.paths.advance(self._twist, (0.5 * (v + self._twist[0]), 0.5 * (yaw_rate + turn)), going=True)

    def _roll(self) -> None:
        """Keeps the contact point of the round foot, not its centre, on the planned path.

        A tibia that pitches by dB rolls its foot's sphere by -R dB along the leg's outward direction; B from the last step's angles.
        """
        angle, roll, rate = self._out.angle_ref, self._rolled, self._roll_rate
        rate[:] = roll
        np.subtract(angle[:, 2], angle[:, 1], self._pitch)
        np.subtract(self._pitch, self._stance_pitch, self._pitch)
        np.multiply(self._pitch, self._radius, self._pitch)
        np.multiply(self.legs.heading, self._pitch, roll)
        np.subtract(roll, rate, rate)
        np.multiply(rate, self._per_second, rate)
        np.add(self._horizontal, self._rolling, self._horizontal)

    def _sense(self, measurement: Measurement) -> None:
        """Foot forces in the walking frame K: rows f_K = f_W R_WT R_TK, the transpose of R_KT R_TW f_W."""
        w, x, y, z = measurement.quaternion.tolist()
        rotation = self._rotation
        rotation[:, :3] = (
            (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
            (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
            (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
        )
        roll, pitch = self.ramp.value[4:].tolist()
        if roll != 0.0 or pitch != 0.0:
            rotation[:, :3] = rotation[:, :3] @ _posture(roll, pitch).T
        np.dot(measurement.foot_force, rotation, self._force)

    def _pose(self) -> None:
        """Walking frame to torso frame: p_T = R_TK (p_K - height), v_T = R_TK (v_K - rate) - w_T x p_T."""
        ramp = self.ramp
        if ramp.settled and ramp.level:
            return
        height, roll, pitch = ramp.value[3:].tolist()
        height_rate, roll_rate, pitch_rate = ramp.rate[3:].tolist()
        plane, velocity = self._plane, self._plane_velocity
        turn = _posture(roll, pitch).T
        x, y, z = turn @ np.stack([plane.real, plane.imag, self._height - height])
        vx, vy, vz = turn @ np.stack([velocity.real, velocity.imag, self._rise - height_rate])
        wx, wy, wz = roll_rate, pitch_rate * math.cos(roll), -pitch_rate * math.sin(roll)
        plane.real, plane.imag, self._height[:] = x, y, z
        velocity.real, velocity.imag, self._rise[:] = vx - (wy * z - wz * y), vy - (wz * x - wx * z), vz - (wx * y - wy * x)


def centre_of_mass(robot: Robot) -> complex:
    """x + i y of the robot's centre of mass in its stance, torso frame [m]."""
    moment = robot.torso.mass * np.array(robot.torso.com)
    for leg in robot.legs:
        point, rotation = np.array(leg.hip_position), axis_rotation(np.array([0.0, 0.0, 1.0]), leg.hip_yaw)
        for link, q in zip(leg.links, leg.stance, strict=True):
            rotation = rotation @ axis_rotation(np.array(link.axis), q)
            moment = moment + link.mass * (point + rotation @ np.array(link.com))
            point = point + rotation @ np.array(link.tip)
    x, y, _ = (moment / robot.total_mass).tolist()
    return complex(x, y)


def _posture(roll: float, pitch: float) -> Array:
    """(3, 3) R_KT: torso to walking frame, roll about x first, then pitch about y."""
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    return np.array([[cp, sp * sr, sp * cr], [0.0, cr, -sr], [-sp, cp * sr, cp * cr]])
