"""From body command and measurement to joint commands, once a period.

    command -> ramp -> foot paths -> + compliance (measured forces) -> posture -> inverse kinematics -> angle_ref, speed_ref

Kinematic control is the same chain without the compliance: the commands alone. What depends on these alone, up to the foot paths, is
planned for many steps at once, in arrays over time; what depends on the last step, in Python's own numbers, leg by leg.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from operator import add
from struct import Struct
from typing import Any

import numpy as np

from hexapod_cosim.controller.compliance import Compliance
from hexapod_cosim.controller.gains import Gains
from hexapod_cosim.controller.gait import Gait
from hexapod_cosim.controller.kinematics import LEGS, Array, Feet, LegSolver, Mask, Plane
from hexapod_cosim.controller.posture import Posture
from hexapod_cosim.controller.trajectory import BodyCommand, CommandRamp, FootPaths
from hexapod_cosim.models import HexapodError, Robot
from hexapod_cosim.models.kinematics import axis_rotation

CLOCK_TOLERANCE = 0.01  # 1    of a period, between the time given and the steps counted
PLANNED = 128  # steps at most that are planned at once; nothing depends on it but the time it takes
PACK = Struct("12d").pack_into  # numbers into an array: half the time of an assignment


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

    swinging: Mask  # planned to be in the air
    shift: Plane  # m    horizontal correction by the compliance, x + i y in the walking frame
    lift: Array  # m    vertical correction
    unreachable: Mask  # the joints could not follow at the last step


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
        self.ramp = CommandRamp(gait.period, period=period)
        self.stance = np.array([leg.stance for leg in robot.legs])
        self.paths = FootPaths(gait, self.legs.forward(self.stance), period=period)
        weight = robot.total_mass * float(np.linalg.norm(robot.gravity))
        self.compliance = None if gains is None else Compliance(gains, weight=weight, centre=centre_of_mass(robot), period=period)
        mismatch = None if gains is None else gains.mismatch(robot, period=period)
        self.warnings: tuple[str, ...] = () if mismatch is None else (mismatch,)
        self._per_second, self._radius = 1.0 / period, robot.foot.radius
        self._stance_pitch = (self.stance[:, 2] - self.stance[:, 1]).tolist()
        self._allocate()
        self.reset()

    def _allocate(self) -> None:
        laws, legs = self.compliance, self.legs
        self._out = JointCommand(*legs.joints)
        # rows (x y z 0) of forces, seen as x + i y and z without a copy
        self._force, self._rotation = np.zeros((LEGS, 4)), np.zeros((3, 4))
        self._push, self._normal = self._force.view(np.complex128)[:, 0], self._force[:, 2]
        self.diagnostics = Diagnostics(
            swinging=np.zeros(LEGS, dtype=np.bool_), unreachable=legs.unreachable,
            shift=np.zeros(LEGS, dtype=np.complex128) if laws is None else laws.shift, lift=np.zeros(LEGS) if laws is None else laws.lift,
        )  # fmt: skip

    def reset(self) -> None:
        """Standing in the stance, all memory cleared; the next step is the first."""
        self.ramp.reset()
        self.paths.reset()
        self.rolled = [0j] * LEGS
        self._start: float | None = None
        self._count = 0
        if self.compliance is not None:
            self.compliance.reset()
        self._lay_out(slice(0, 1), *self.ramp.ahead(0))

    def save(self) -> dict[str, Any]:
        """Everything the controller remembers between steps."""
        laws = None if self.compliance is None else self.compliance.save()
        own = {"rolled": self.rolled, "_start": self._start, "_count": self._count}
        return {"ramp": self.ramp.save(), "paths": self.paths.save(), "laws": laws, "legs": self.legs.save(), "own": own}

    def restore(self, state: dict[str, Any]) -> None:
        """Goes back to a saved state: the steps after it are the same again, bit for bit."""
        self.ramp.restore(state["ramp"])
        self.paths.restore(state["paths"])
        if self.compliance is not None:
            self.compliance.restore(state["laws"])
        self.legs.restore(state["legs"])
        vars(self).update(state["own"])
        self._lay_out(slice(0, 1), *self.ramp.ahead(0))

    def step(self, t: float, command: BodyCommand, measurement: Measurement) -> JointCommand:
        """The joint commands for [t, t + period). The result's arrays are reused by the next step.

        Args:
            t: time [s]; the first step may come at any time, later ones a period apart. Raises ControllerError otherwise.
            command: what the torso should do; changes are ramped over a gait period.
            measurement: sensor values at t; kinematic control does not look at it.
        """
        self._advance(t, command)
        feet = self._feet[self._at]
        if self.compliance is not None:
            self._sense(measurement)
            feet = _sum(feet, self.compliance.step(self._push, self._normal, measurement.contact))
        if self._count:
            feet = self._roll(feet)
        if self._posture is not None:
            feet = self._posture.apply(self._at, feet)
        self.legs.solve(feet)
        return self._out

    def _advance(self, t: float, command: BodyCommand) -> None:
        """To the planned step at t."""
        due = t if self._start is None else self._start + (self._count + 1) * self.period
        if not abs(t - due) <= CLOCK_TOLERANCE * self.period:
            raise ControllerError("step out of time", got=t, expected=f"t = {due} s", fix="step once per period, or reset the controller")
        if command is not self.ramp.target and command != self.ramp.target:
            self.ramp.aim(command)
            self._last = self._at
        if self._start is None:
            self._start = t
            return
        self._count += 1
        if self._at == self._last:
            self._plan()
        self._at += 1
        self.paths.advance()
        self.ramp.steps += 1

    def _plan(self) -> None:
        """Plans what depends on the command alone, up to the next lift-off or touch-down."""
        ramp, target, paths = self.ramp, self.ramp.target, self.paths
        moves = (target.vx, target.vy, target.yaw_rate) != (0.0, 0.0, 0.0)
        value, rate = ramp.ahead(PLANNED if ramp.settled or moves else min(ramp.remaining, PLANNED))
        paths.plan(value[:, 0] + 1j * value[:, 1], value[:, 2], going=moves or not ramp.settled)
        end = paths.left + 1
        self._lay_out(slice(1, end), value[1:end], rate[1:end])

    def _lay_out(self, chosen: slice, value: Array, rate: Array) -> None:
        """Turns planned steps into what `step` needs: Python's own numbers, faster than arrays of six."""
        steps = self.paths.steps
        columns = (steps.plane, steps.height, steps.plane_velocity, steps.rise)
        self._feet: list[Feet] = list(zip(*(column[chosen].tolist() for column in columns), strict=True))
        swinging = self.diagnostics.swinging
        swinging[:] = steps.swinging[-1]  # in all of them the same
        level = not (value[:, 3:].any() or rate[:, 3:].any())
        self._posture = None if level else Posture(value[:, 3:], rate[:, 3:])
        if self.compliance is not None:
            self.compliance.plan(steps.plane[chosen], swinging)
        self._at, self._last = (0 if chosen.start == 0 else -1), len(self._feet) - 1

    def _roll(self, feet: Feet) -> Feet:
        """Keeps the contact point of the round foot, not its centre, on the planned path.

        A tibia that pitches by dB rolls its foot's sphere by -R dB along the leg's outward direction; B from the last step's angles.
        """
        angles, radius, per_second, before = self.legs.angles, self._radius, self._per_second, self.rolled
        legs = zip(self.legs.headings, angles[1::3], angles[2::3], self._stance_pitch, strict=True)
        self.rolled = rolled = [heading * (radius * (q3 - q2 - stance)) for heading, q2, q3, stance in legs]
        plane, height, velocity, rise = feet
        velocity = [v + (new - old) * per_second for v, new, old in zip(velocity, rolled, before, strict=True)]
        return list(map(add, plane, rolled)), height, velocity, rise

    def _sense(self, measurement: Measurement) -> None:
        """Foot forces in the walking frame K: rows f_K = f_W R_WT R_TK, the transpose of R_KT R_TW f_W."""
        w, x, y, z = measurement.quaternion.tolist()
        xx, yy, zz = x * x, y * y, z * z
        PACK(
            self._rotation.data, 0,
            1.0 - 2.0 * (yy + zz), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y), 0.0,
            2.0 * (x * y + w * z), 1.0 - 2.0 * (xx + zz), 2.0 * (y * z - w * x), 0.0,
            2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (xx + yy), 0.0,
        )  # fmt: skip
        rotation = self._rotation
        if self._posture is not None:
            rotation[:, :3] = rotation[:, :3] @ self._posture.rotation[self._at].T
        np.dot(measurement.foot_force, rotation, out=self._force)


def _sum(feet: Feet, shifts: Feet) -> Feet:
    (plane, height, velocity, rise), (x, z, v, w) = feet, shifts
    return list(map(add, plane, x)), list(map(add, height, z)), list(map(add, velocity, v)), list(map(add, rise, w))


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
