"""Corrects the foot trajectories by the deviations that the ground causes. C: paper.h.

Section 3 of the paper corrects the foot positions by a PID on the tangential force and a virtual
suspension on the normal force, and does inverse kinematics again. It gives no equations: these are
ours. They use joint angles and foot forces, and command angles only.

1. Deviations. Force and softness of a leg give the deviation of a standing foot at once (C25), the
   measured joint angles that of the torso, with which feet in the air deviate (C26).
2. Along the ground (C47). A share of the deviation is taken back. The P part yields to the force
   that makes a foot slip, the I part returns all feet to their plan by the same way.
3. Upwards (C48, C49). A share of the deviation is taken back, feet in the air are lifted by the
   torso's sag, and a suspension answers early and late landings.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from hexapod_cosim.controller.comply.load_plan import LEAST_LOAD, indentation
from hexapod_cosim.controller.gains import Gains, Parts
from hexapod_cosim.controller.memory import Stateful
from hexapod_cosim.controller.plane import LEGS, Array, Mask, Plane, along, clamp, plane_of, square
from hexapod_cosim.controller.walk.gait import Gait
from hexapod_cosim.controller.walk.kinematics import Feet, Joints, LegSolver, Pose, Softness
from hexapod_cosim.models import Robot

LARGEST_PART = 0.5  # 1    of the weight: what a foot carries beyond is not taken back
CONTACT_PART = 0.02  # 1    of the weight: a foot with more is on the ground
WHOLE_PART = 0.9  # 1    of the weight: with less in all, the force of some foot is not reported
WEIGHT_TIME = 0.5  # s    smoothing of the sum of all loads
EVENING = 0.15  # 1    added to the spread of the standing feet, for the tilt of the torso
LANDED_TIME = 0.05  # s    in which a landed foot gives back the lift that it had in the air
EARLY_HEIGHT = 0.003  # m    a foot that is planned higher above the ground meets it early
LATE_TIME = 0.04  # s    after the planned touch-down, in which a foot may be late
SEARCH_SPEED = 0.08  # m/s    at most, of a foot that extends
AIR_TIME = 0.06  # s    in which the suspension of a foot in the air returns


class Step(NamedTuple):
    """Plan and measurements of a period, torso frame, six legs."""

    pose: Pose  # planned
    planned: Array  # m    (6, 3) planned centres of the feet
    height: Array  # m    (6,) of the planned feet above the ground
    rise: Array  # m/s    (6,) of the planned feet
    swinging: Mask  # planned in the air
    angle: Array  # rad    (6, 3) measured
    force: Array  # N    (6, 3) measured, ground on foot


class Paper(Stateful):
    """The paper's control of one robot in one gait.

    Attributes:
        force: (6, 3) smoothed forces on the feet, torso axes [N].
        weight: smoothed sum of the normal forces [N].
        back: common return of all feet, x + i y [m].
        sag: height by which the torso sags at its centre, and its slope, x + i y [m, 1].
        lifted: (6,) lift by the torso's sag [m].
        yielded: (6,) deflection of the suspensions; positive: the leg is shorter [m].
        late: (6,) time without force since the planned touch-down [s].
        shift, lift: (6,) corrections of the feet, torso frame, x + i y and z [m].
    """

    STATE = ("force", "weight", "back", "sag", "lifted", "yielded", "late", "shift", "lift")

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
        self.gains, self.parts, self.legs, self.period = gains.paper, parts, legs, period
        self.kp, self.ground = robot.servo.kp, robot.contact.stiffness
        shares = self.gains.shares(gait.duty) if parts.paper_share else (0.0, 0.0)
        self.share, self.height_share = shares
        self.weighing = 1.0 - math.exp(-period / WEIGHT_TIME)
        self.smoothing = 1.0 - math.exp(-period / self.gains.filter_time)
        self.landed = math.exp(-period / LANDED_TIME)
        self.in_air = math.exp(-period / AIR_TIME)
        self.on_ground = math.exp(-period / self.gains.return_time)
        self.reset()

    def reset(self) -> None:
        """Sets all forces, deviations and corrections to zero."""
        self.force = np.zeros((LEGS, 3))
        self.weight, self.back, self.sag = 0.0, 0j, (0.0, 0j)
        self.lifted, self.yielded, self.late, self.lift = np.zeros((4, LEGS))
        self.shift: Plane = np.zeros(LEGS, dtype=np.complex128)

    def _update_torso(self, step: Step, load: Array) -> None:
        """Updates the torso's sag and the return of the feet by the standing feet (C26, C47).

        load: (6,) smoothed normal forces [N].
        """
        weight = np.where(step.swinging, 0.0, load)
        total = float(weight.sum())
        if total <= LEAST_LOAD:
            return
        found = self.legs.forward(step.angle) - step.planned
        feet, part = plane_of(*step.planned.T[:2]), weight / total
        sunk = found[:, 2] - self.yielded + indentation(load, self.ground)
        centre, mean = part @ feet, float(part @ sunk)
        # least squares: slope g of sum part (Re(arm^* g) - (sunk - mean))^2
        arm = feet - centre
        spread, skew = float(part @ square(arm)), 0.5 * complex(part @ (arm * arm))
        even = (0.5 + EVENING) * spread
        moment = complex(part @ (arm * (sunk - mean)))
        size = even * even - square(skew)
        slope = (even * moment - skew * moment.conjugate()) / size if spread > 0.0 else 0j
        height, old = self.sag
        now = mean - along(centre, slope)
        self.sag = (height + self.smoothing * (now - height), old + self.smoothing * (slope - old))
        if self.parts.paper_pid:
            astray = complex(part @ plane_of(*found.T[:2]))
            back = self.back - self.period * self.gains.return_rate * astray
            self.back = back * (self.gains.limit / max(abs(back), self.gains.limit))

    def _along_ground(self, step: Step, soft: Softness, borne: Array) -> Plane:
        """Returns the correction along the ground (6,) x + i y [m] (C47).

        borne: (6,) normal forces whose deviation is taken back [N].
        """
        heading = step.pose.heading
        shift = -self.share * soft.splay * borne * heading
        if self.parts.paper_pid:
            pull = plane_of(*self.force.T[:2]) * heading.conj()
            # a standing foot keeps the outward force, which carries a part of the weight
            outward = np.where(step.swinging, soft.outward * pull.real, 0.0)
            sideward = soft.sideward * pull.imag
            shift = shift + self.gains.yield_share * plane_of(outward, sideward) * heading
        return np.asarray(shift + self.back)

    def _lift_swinging(self, step: Step) -> None:
        """Updates the lift of the feet in the air by the torso's sag (C48)."""
        height, slope = self.sag
        sunk = height + along(plane_of(*step.planned.T[:2]), slope)
        wanted = clamp(sunk, -self.gains.sag_limit, self.gains.sag_limit)
        raised = self.lifted + self.smoothing * (wanted - self.lifted)
        self.lifted = np.where(step.swinging, raised, self.landed * self.lifted)

    def _suspend(self, step: Step, total: float) -> None:
        """Updates the deflections of the suspensions (C48). total: of the normal forces [N]."""
        contact = step.force[:, 2] > max(CONTACT_PART * self.weight, LEAST_LOAD)
        missing = ~contact & ~step.swinging & (total >= WHOLE_PART * self.weight)
        self.late = np.where(missing, self.late + self.period, 0.0)
        # the damper yields to the force beyond the share of a foot
        rate = (step.force[:, 2] - self.weight / LEGS) / self.gains.damping
        descent = np.where(step.height > EARLY_HEIGHT, np.maximum(-step.rise, 0.0), 0.0)
        met = self.yielded + self.period * clamp(rate, 0.0, descent)
        sought = self.yielded + self.period * clamp(rate, -SEARCH_SPEED, 0.0)
        kept = np.where(step.swinging & ~contact, self.in_air, self.on_ground)
        moved = np.where(step.swinging & contact, met, kept * self.yielded)
        moved = np.where(self.late > LATE_TIME, sought, moved)
        self.yielded = clamp(moved, -self.gains.limit, self.gains.limit)

    def step(self, step: Step) -> None:
        """Advances the corrections by one period."""
        self.force = self.force + self.smoothing * (step.force - self.force)
        load = np.maximum(self.force[:, 2], 0.0)
        soft = self.legs.softness(step.pose, self.kp)
        total = float(np.maximum(step.force[:, 2], 0.0).sum())
        started = self.weight > 0.0
        self.weight += (self.weighing if started else 1.0) * (total - self.weight)
        borne = np.minimum(load, LARGEST_PART * self.weight)
        self._update_torso(step, load)
        if self.parts.paper_share:
            self._lift_swinging(step)
        if self.parts.paper_suspension:
            self._suspend(step, total)
        self.shift = self._along_ground(step, soft, borne)
        self.lift = self.lifted + self.yielded - self.height_share * soft.up * borne

    def actuate(self, feet: Feet) -> Joints:
        """Returns the joints that put the feet on their corrected trajectories (C49).

        feet: planned ones, torso frame.
        """
        pose = self.legs.pose(feet.plane + self.shift, feet.height + self.lift)
        return self.legs.solve(pose, feet.velocity, feet.rise)
