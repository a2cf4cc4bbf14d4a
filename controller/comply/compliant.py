"""Corrects the planned joint commands by the sensors, once per period. C: compliant.h.

Every period controller.py provides a plan of the present step: joint angles, the forces on the
feet, and the torques for these forces. Compliant control corrects the plan by the measurements:

    foot forces -- sense (C22) --> force laws (force_laws.py, C23 to C36) --> torque, offset
    joint angles, attitude -- every 40 ms --> slow loops (hold.py, C37 to C40) --> lift, v, w
    planned angles + climb (offset + lift) ---> angle_ref (C41)

The force laws act in the same period, on torques and heights of the feet. Of the slow loops,
posture lifts the feet in the same period; path adds to the commanded velocity with which the next
steps are planned.
"""

from __future__ import annotations

from math import asin, atan2
from typing import NamedTuple

import numpy as np

from hexapod_cosim.controller.comply.force_laws import ForceLaws
from hexapod_cosim.controller.comply.load_plan import LoadPlan, plan_load
from hexapod_cosim.controller.comply.planned_squeeze import PlannedSqueeze
from hexapod_cosim.controller.comply.support import Support
from hexapod_cosim.controller.gains import Gains, Parts
from hexapod_cosim.controller.memory import Stateful
from hexapod_cosim.controller.plane import LEGS, Array, Plane, cis, clamp, plane_of
from hexapod_cosim.controller.sense.load_adaptation import LoadAdaptation
from hexapod_cosim.controller.signals import JointCommand, Measurement
from hexapod_cosim.controller.walk.gait import Gait
from hexapod_cosim.controller.walk.gait_clock import GaitClock
from hexapod_cosim.controller.walk.hold import Hold, HoldInput
from hexapod_cosim.controller.walk.inverse_dynamics import Demand, InverseDynamics
from hexapod_cosim.controller.walk.kinematics import LegSolver
from hexapod_cosim.controller.walk.posture import Posture
from hexapod_cosim.controller.walk.swing import Twist
from hexapod_cosim.models import Robot
from hexapod_cosim.models.kinematics import unit_rotation

STEERING_TIME = 0.1  # s    duration of the ramp from one added velocity to the next


def sense(measurement: Measurement, posture: Posture) -> Array:
    """Returns the foot forces (6, 3) in the walking frame [N]: f_K = R_KT R_TW f_W (C22)."""
    R_WT = unit_rotation(*measurement.quaternion.tolist())
    f_T = measurement.foot_force @ R_WT  # rows
    return f_T if posture.level else np.asarray(f_T @ posture.R_KT.T)


class PresentStep(NamedTuple):
    """Plan, command and geometry of the present step."""

    load: LoadPlan
    climb: Array  # rad/m    (6, 3) motion of the joints as a foot rises
    value: Array  # (6,) commanded vx vy yaw_rate height roll pitch
    posture: Posture  # of the torso
    plane: Plane  # m    (6,) planned feet, walking frame
    torso: complex  # m    its way in the walking frame
    height: Array  # m    (6,) to which they are lowered, walking frame
    rolled: Array  # m    (6,) outwards from the stance to the positions that the feet aim at


class Steering(NamedTuple):
    """A ramp of the velocity that the path loop adds to the commanded one."""

    begin: Twist
    goal: Twist
    past: int  # periods since the begin, at the first step planned


NO_STEERING = Steering(Twist(0j, 0.0), Twist(0j, 0.0), 0)


class Compliant(Stateful):
    """Compliant control of one robot in one gait.

    Attributes:
        laws: the force laws.
        hold: the slow loops.
        adaptation: of the servos.
        steering: of the path.
        count: number of completed periods.
        offset: (6,) height offsets of early and late touch-downs at the last period [m].
        moving: the offsets have just changed.
        present: the last step; not part of the state.
    """

    STATE = ("laws", "hold", "adaptation", "steering", "count", "offset", "moving")

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
        self.legs, self.period = legs, period
        self.per_second, self.leading = 1.0 / period, STEERING_TIME / period
        self.dynamics = InverseDynamics(robot, legs, period=period)
        self.support = Support(
            robot, gait, gains.support, rest=self.dynamics.rest(), active=parts.support
        )
        self.squeeze = PlannedSqueeze(
            friction=robot.friction.mu, weight=robot.weight, depth=-self.dynamics.floor
        )
        self.laws = ForceLaws(
            gains,
            parts,
            weight=robot.weight,
            depth=-self.dynamics.floor,
            cycle=gait.period,
            step_height=gait.step_height,
            period=period,
        )
        self.hold = Hold(gains.hold, parts, period=period)
        self.adaptation = LoadAdaptation(
            rating=robot.servo.torque_continuous,
            squeeze=parts.squeeze if parts.support else 0.0,
            narrows=parts.support and gait.narrowing > 0.0,
            cycle=gait.period,
            period=period,
        )
        self.present: PresentStep
        self.reset()

    def reset(self) -> None:
        """Resets all laws and the slow loops to their initial states."""
        self.laws.reset()
        self.hold.reset()
        self.adaptation.reset()
        self.steering, self.count = NO_STEERING, 0
        self.offset, self.moving = np.zeros(LEGS), False

    def plan(
        self,
        demand: Demand,
        activation: Array,
        clock: GaitClock,
        *,
        feet: Plane,
        height: Array,
        rise: Array,
    ) -> LoadPlan:
        """Returns the planned loads of feet (6,) x + i y, walking frame [m] (C19, C20, C42).

        activation: (6,) of the legs [1]; other arguments are those of plan_load().
        """
        moment = demand.moment + demand.weight * self.laws.lean
        shares = self.support.shares(feet, activation, demand._replace(moment=moment))
        return plan_load(
            demand,
            self.squeeze.add(feet, demand, shares, self.adaptation.squeeze),
            clock,
            active=self.support.active,
            feet=feet,
            height=height,
            rise=rise,
            period=self.period,
        )

    def lowered(
        self, phase: Array, plane: Plane, clock: GaitClock, presence: Array
    ) -> tuple[Array, Array]:
        """Returns the activations of the legs (6,) and the lowering of their feet (6,) [m].

        phase: (6,) of the legs [1]; plane: (6,) feet x + i y, walking frame [m]; clock: of the
        gait, in the section of the step; presence: (6,) factors of the legs [1].
        """
        active = self.support.activation(phase, clock.stayed, clock.stays, walking=clock.walking)
        active = np.where(clock.awaited, 0.0, active * presence)
        return active, self.support.lowering(plane, active)

    # ------------------------------------------------------------------------------- steering

    def addition(self, steps: int) -> Twist:
        """Returns the addition to the commanded velocity `steps` periods after the first (C40)."""
        begin, goal, past = self.steering
        part = min((past + steps) / self.leading, 1.0)
        return Twist(
            begin.velocity + (goal.velocity - begin.velocity) * part,
            begin.yaw_rate + (goal.yaw_rate - begin.yaw_rate) * part,
        )

    def steer(self, steps: int, *, moves: bool, afresh: bool) -> None:
        """Starts a ramp to the velocity that the path loop adds (C40).

        It is called before new steps are planned. A ramp starts when a leg lifts off or touches
        down, and when the robot stops.

        Args:
            steps: periods since the last planning.
            moves: the body is commanded to move; otherwise nothing is added.
            afresh: a leg lifts off or touches down now.
        """
        self.steering = self.steering._replace(past=self.steering.past + steps)
        goal = self.steering.goal
        added = goal.velocity != 0.0 or goal.yaw_rate != 0.0
        if not afresh and (moves or not added):
            return
        lost = Twist(self.hold.velocity, self.hold.yaw_rate)
        self.steering = Steering(self.addition(0), lost if moves else Twist(0j, 0.0), 0)

    # -------------------------------------------------------------------------------- sensors

    def _update_hold(self, measurement: Measurement, present: PresentStep) -> None:
        """Passes feet, loads and attitude, as measured, to the slow loops."""
        legs, angle = self.legs, measurement.angle
        w, x, y, z = measurement.quaternion.tolist()
        foot = legs.forward(angle)
        plane, height = present.posture.turn(plane_of(*foot.T[:2]), foot[:, 2])
        rolls = legs.rolling(angle) - present.rolled
        rolled = cis(legs.hip_yaw + angle[:, 0]) * rolls
        vx, vy, yaw_rate, commanded_height, roll, pitch = present.value.tolist()
        roll_seen = atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
        pitch_seen = asin(min(max(2.0 * (w * y - z * x), -1.0), 1.0))
        self.hold.update(
            HoldInput(
                plane=plane - rolled + present.torso,
                height=height + commanded_height,
                planned=present.plane,
                planned_height=present.height,
                load=self.laws.load,
                tilt=np.array([roll_seen - roll, pitch_seen - pitch]),
                yaw=atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
                velocity=complex(vx, vy),
                yaw_rate=yaw_rate,
            )
        )

    # ----------------------------------------------------------------------------------- step

    def _correct(self, angle: Array, climb: Array, raised: Array) -> Array:
        """Returns the joint angles (6, 3) [rad] with raised feet (C41).

        climb: (6, 3) motion of the joints as a foot rises [rad/m]; raised: (6,) [m].
        """
        corrected = angle + climb * raised[:, None]
        return np.asarray(clamp(corrected, self.legs.angle_min, self.legs.angle_max))

    def step(self, present: PresentStep, measurement: Measurement, output: JointCommand) -> Array:
        """Advances compliant control by one period and corrects `output` in place (C41).

        Returns by how much the feet are raised (6,) [m].
        """
        laws, self.present = self.laws, present
        laws.step(present.load, sense(measurement, present.posture))
        if self.count % self.hold.every == 0:
            if laws.trust.level == 1.0:
                self._update_hold(measurement, present)
            else:
                self.hold.reset()
        self.count += 1
        climb, (offset, busy) = present.climb, laws.raised()
        raised = offset + self.hold.lift
        output.angle_ref[...] = self._correct(output.angle_ref, climb, raised)
        output.torque_ref[...] = laws.torque
        self.adaptation.weigh(laws.limit.weight_ratio)
        self.adaptation.step(laws.torque, laws.needed(), laws.squeeze_share)
        if busy or self.moving:
            rise = (offset - self.offset) * self.per_second
            speed, most = output.speed_ref + climb * rise[:, None], self.legs.speed_max
            output.speed_ref[...] = clamp(speed, -most, most)
            self.offset, self.moving = offset, busy
        return raised
