"""Compliant control around its laws: from the planned steps to what the laws need, and from the
sensors to the corrected feet.
"""

from __future__ import annotations

from dataclasses import replace
from math import asin, atan2
from struct import Struct
from typing import TYPE_CHECKING, Any

import numpy as np

from hexapod_cosim.controller.compliance import Compliance
from hexapod_cosim.controller.gains import Gains
from hexapod_cosim.controller.gait import Gait
from hexapod_cosim.controller.hold import Hold, Sight
from hexapod_cosim.controller.inverse_dynamics import Frames, InverseDynamics
from hexapod_cosim.controller.kinematics import LEGS, Array, Feet, LegSolver, Plane, Pose, rates
from hexapod_cosim.controller.parts import Parts
from hexapod_cosim.controller.posture import rotations, turned
from hexapod_cosim.controller.support import Support
from hexapod_cosim.controller.trajectory import Steps, cis
from hexapod_cosim.models import Robot

if TYPE_CHECKING:
    from hexapod_cosim.controller.controller import JointCommand, Measurement

REMEMBERED = (
    "_steered",
    "_count",
    "_at",
    "_moving",
    "_rotations",
    "_command",
    "_climb",
    "_planned",
)
STEERING_TIME = 0.1  # s    in which a change of the added velocity is led over
PACK = Struct("12d").pack_into  # numbers into an array: half the time of an assignment


class Compliant:
    """What compliant control adds to the feet, angles and torques of one robot in one gait.

    Attributes: laws: the force laws;  hold: the slow loops;  shift, lift: (6,) corrections of the
    feet [m], walking frame.
    """

    def __init__(
        self,
        robot: Robot,
        gait: Gait,
        gains: Gains,
        parts: Parts,
        *,
        legs: LegSolver,
        period: float,
    ) -> None:
        self._parts, self._legs, self._per_second, self._leading = (
            parts,
            legs,
            1.0 / period,
            STEERING_TIME / period,
        )
        self._dynamics = InverseDynamics(robot, legs, period=period)
        self._support = Support(robot, gait, gains.support, rest=self._dynamics.rest())
        self.laws = Compliance(
            gains,
            parts,
            weight=robot.weight,
            cycle=gait.period,
            kp=robot.servo.kp,
            step_height=gait.step_height,
            period=period,
        )
        self.hold = Hold(gains.hold, parts, period=period)
        self.shift: Plane = np.zeros(LEGS, dtype=np.complex128)
        self.lift: Array = np.zeros(LEGS)
        # rows (x y z 0) of forces, the last column so that rows pair up
        self._force, self._rotation = np.zeros((LEGS, 4)), np.zeros((3, 4))
        self._raised, self._offset = np.zeros((2, LEGS))
        self._home = legs.forward(robot.stance)[:, 2]
        self.reset()

    def reset(self) -> None:
        """All at rest, nothing planned."""
        self.laws.reset()
        self.hold.reset()
        for array in (self.shift, self.lift, self._raised, self._offset):
            array[...] = 0.0
        self._steered = np.zeros(2, dtype=np.complex128), np.zeros(2, dtype=np.complex128), 0
        self._count, self._at, self._moving = 0, -1, False

    def save(self) -> dict[str, Any]:
        """What it remembers and has planned. Planned arrays are never changed, so they are
        shared.
        """
        own = {name: getattr(self, name) for name in REMEMBERED}
        return {
            "laws": self.laws.save(),
            "hold": self.hold.save(),
            "offset": self._offset.copy(),
            "own": own,
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Restores a state returned by save()."""
        self.laws.restore(state["laws"])
        self.hold.restore(state["hold"])
        self._offset[:] = state["offset"]
        vars(self).update(state["own"])

    def steer(self, v: Plane, yaw_rate: Array, *, moves: bool, afresh: bool) -> tuple[Plane, Array]:
        """Commanded velocities of the coming steps and what the lost way adds to them.

        That is looked at `afresh` when a leg lifts off or touches down, and led over without a
        jump.
        """
        if afresh or (not moves and self._steered[1].any()):
            hold = self.hold
            goal = (
                np.array([hold.velocity, hold.yaw_rate])
                if moves
                else np.zeros(2, dtype=np.complex128)
            )
            self._steered = self._steering(np.zeros(1))[0], goal, 0
        added = self._steering(np.arange(len(v), dtype=np.float64))
        return v + added[:, 0], yaw_rate + added[:, 1].real

    def _steering(self, steps: Array) -> Plane:
        """(n, 2) the additions to velocity and yaw rate so many steps ahead."""
        begin, goal, past = self._steered
        return np.asarray(
            begin + (goal - begin) * np.minimum((past + steps) / self._leading, 1.0)[:, None]
        )

    def advance(self, steps: int) -> None:
        """So many of the steps planned last are past: the next are planned from there."""
        begin, goal, past = self._steered
        self._steered = begin, goal, past + steps

    def lower(self, feet: Feet, steps: Steps, *, walking: bool) -> Feet:
        """Planned feet, all rows, lowered by what the ground will give way under their loads."""
        self._activation = self._support.activation(
            steps.phase, steps.stayed, steps.stays, walking=walking
        )
        self._heights = feet.height
        if not self._parts.support:
            return feet
        lowering = self._support.lowering(steps.plane, self._activation)
        self._heights = feet.height - lowering
        return replace(
            feet, height=self._heights, rise=feet.rise - self._per_second * rates(lowering, 1.0)
        )

    def plan(
        self,
        first: int,
        steps: Steps,
        value: Array,
        pose: Pose,
        speed: Array,
        *,
        shift: Plane,
        level: bool,
    ) -> None:
        """Lays out planned steps from the row `first` on.

        Args:
            value: (n, 6) commanded vx vy yaw_rate height roll pitch;  pose, speed: the legs, and
                the joints' speeds [rad/s];
            shift: (n, 6) of the feet from their paths for rolling [m];  level: height, roll and
                pitch are all 0.
        """
        rotation = None if level else rotations(value[:, 4], value[:, 5])
        demand = self._dynamics.demand(
            pose, speed, Frames(steps.way, cis(steps.turn), value[:, 3:4], rotation)
        )
        rows = slice(first, None)
        feet = steps.plane + shift
        shares = self._support.shares(feet, self._activation, demand).rows(rows)
        self.laws.plan(
            demand.rows(rows),
            shares,
            feet=feet[rows],
            height=(steps.height - self._home)[rows],
            rise=steps.rise[rows],
            swinging=steps.swinging[-1],
            hurried=np.asarray((np.abs(speed[rows]) >= self._legs.speed_max).any(axis=(1, 2))),
        )
        self._climb = self._legs.speeds(pose.rows(rows), np.zeros(1), np.ones(1))
        self._rotations, self._command = (
            None if rotation is None else rotation[rows],
            value[rows].tolist(),
        )
        self._planned = steps.plane[rows], self._heights[rows]
        self._at = -1

    def step(self, measurement: Measurement, out: JointCommand) -> None:
        """The joint commands of this step, corrected in place."""
        self._at += 1
        at, laws, raised, before = self._at, self.laws, self._raised, self._offset
        self._sense(measurement)
        laws.step(self._force)
        if self._count % self.hold.every == 0:
            self._look(measurement) if laws.trust == 1.0 else self.hold.reset()
        self._count += 1
        np.add(laws.offset, self.hold.lift, out=raised)
        angle, climb = out.angle_ref, self._climb[at]
        angle += laws.bend
        angle += climb * raised[:, None]
        np.maximum(
            np.minimum(angle, self._legs.angle_max, out=angle), self._legs.angle_min, out=angle
        )
        if laws.touchdown.busy or self._moving:
            self._moving = laws.touchdown.busy
            out.speed_ref += climb * ((laws.offset - before) * self._per_second)[:, None]
            before[...] = laws.offset
        out.torque_ref[...] = laws.torque
        self.shift[...] = laws.shift_plane
        np.add(laws.shift[:, 2], raised, out=self.lift)

    def _sense(self, measurement: Measurement) -> None:
        """Foot forces in the walking frame K: rows f_K = f_W R_WT R_TK, the transpose of R_KT
        R_TW f_W.
        """
        w, x, y, z = self._quaternion = measurement.quaternion.tolist()
        xx, yy, zz = x * x, y * y, z * z
        PACK(
            self._rotation.data, 0,
            1.0 - 2.0 * (yy + zz), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y), 0.0,
            2.0 * (x * y + w * z), 1.0 - 2.0 * (xx + zz), 2.0 * (y * z - w * x), 0.0,
            2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (xx + yy), 0.0,
        )  # fmt: skip
        rotation = self._rotation
        if self._rotations is not None:
            rotation[:, :3] = rotation[:, :3] @ self._rotations[self._at].T
        np.dot(measurement.foot_force, rotation, out=self._force)

    def _look(self, measurement: Measurement) -> None:
        """Shows the slow loops where the standing feet are."""
        vx, vy, yaw_rate, height, roll, pitch = self._command[self._at]
        angle = measurement.angle
        foot = self._legs.forward(angle)
        rolled = self._legs.rolling(angle) * np.exp(1j * (self._legs.hip_yaw + angle[:, 0]))
        plane, heights = foot[:, 0] + 1j * foot[:, 1], foot[:, 2]
        if self._rotations is not None:
            plane, heights = turned(plane, heights, self._rotations[self._at])
        w, x, y, z = self._quaternion
        leaning = (
            atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
            asin(min(max(2.0 * (w * y - z * x), -1.0), 1.0)),
        )
        yaw = atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        planned, planned_heights = (rows[self._at].tolist() for rows in self._planned)
        self.hold.look(
            Sight(
                plane=(plane - rolled).tolist(),
                height=(heights + height).tolist(),
                planned=planned,
                planned_height=planned_heights,
                load=self.laws.law.load.tolist(),
                tilt=(leaning[0] - roll, leaning[1] - pitch),
                yaw=yaw,
                velocity=complex(vx, vy),
                yaw_rate=yaw_rate,
            )
        )
