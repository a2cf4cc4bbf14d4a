"""Corrects the foot trajectories by the forces on the feet, as the paper describes it. C: paper.c.

Section 3 of the paper adds a correction of the foot position to the trajectory of each leg and
computes the joint angles again by inverse kinematics. The tangential correction is a PID of the
tangential contact force (C47); the normal one is the deflection of a virtual suspension under the
normal contact force (C48). There is nothing else: no plan of the loads, no torques, no posture.
The paper states these laws in words only, so that C47 to C49 are their plainest form.
"""

from __future__ import annotations

import math

import numpy as np

from hexapod_cosim.controller.comply.posture import Posture
from hexapod_cosim.controller.comply.slip_pid import SlipPid
from hexapod_cosim.controller.comply.suspension import discretise
from hexapod_cosim.controller.gains import Gains
from hexapod_cosim.controller.memory import Stateful
from hexapod_cosim.controller.parts import Parts
from hexapod_cosim.controller.plane import LEGS, Array, Mask, Plane, clamp
from hexapod_cosim.controller.walk.kinematics import Feet, Joints, LegSolver


class Paper(Stateful):
    """PID on the tangential and virtual suspension on the normal force of each foot.

    Attributes, (6,) each:
        pid: the PIDs, from forces [N] to shifts [m].
        shift: horizontal correction of the foot, x + i y, walking frame [m].
        lift, rate: vertical correction of the foot and its rate [m, m/s].
    """

    STATE = ("pid", "shift", "lift", "rate")

    def __init__(self, gains: Gains, parts: Parts, *, period: float) -> None:
        slip = gains.paper_slip
        self.parts, self.pid = parts, SlipPid(slip, period=period)
        self.a, self.b = discretise(gains.paper_suspension, period=period)
        self.memory = math.exp(-period / slip.load_time)
        self.tracking = min(period / slip.tracking_time, 1.0)
        self.farthest, self.deepest = slip.limit, gains.paper_suspension.limit  # m
        self.reset()

    def reset(self) -> None:
        """Sets all shifts, deflections and integrals to zero."""
        self.pid.reset()
        self.shift: Plane = np.zeros(LEGS, dtype=np.complex128)
        self.lift, self.rate = np.zeros((2, LEGS))

    def _yield_sideways(self, force: Plane, swinging: Mask) -> None:
        """Updates the shifts for tangential forces (6,) [N] (C47).

        The length of a shift is limited, and its integral follows the limited value. The integral
        of a swinging foot decays, so that the foot lands where its trajectory ends.
        """
        wanted = self.pid.step(force)
        scale = self.farthest / np.maximum(np.abs(wanted), self.farthest)
        self.shift = wanted * scale
        kept = np.where(swinging, self.memory, 1.0)
        self.pid.integral = kept * (self.pid.integral + self.tracking * (self.shift - wanted))

    def _yield_upwards(self, force: Array) -> None:
        """Updates the deflections of the suspensions for normal forces (6,) [N] (C48)."""
        z, rate, a, b = self.lift, self.rate, self.a, self.b
        lift = a[0, 0] * z + a[0, 1] * rate + b[0] * force
        self.rate = a[1, 0] * z + a[1, 1] * rate + b[1] * force
        self.rate = np.where(np.abs(lift) > self.deepest, 0.0, self.rate)
        self.lift = clamp(lift, -self.deepest, self.deepest)

    def actuate(self, legs: LegSolver, feet: Feet, posture: Posture) -> Joints:
        """Returns the joints that put the feet on their corrected trajectories (C49).

        feet: planned ones in the walking frame; posture: of the torso.
        """
        plane, height = posture.see_place(feet.plane + self.shift, feet.height + self.lift)
        seen = posture.see(feet)
        return legs.solve(legs.pose(plane, height), seen.velocity, seen.rise)

    def step(self, force: Array, swinging: Mask) -> None:
        """Advances the corrections by one period.

        force: (6, 3) of the ground on the feet, walking frame [N]; swinging: (6,) legs planned in
        the air.
        """
        if self.parts.slip_pid:
            self._yield_sideways(force[:, 0] + 1j * force[:, 1], swinging)
        if self.parts.paper_suspension:
            self._yield_upwards(force[:, 2])
