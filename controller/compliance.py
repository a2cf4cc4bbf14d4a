"""The force laws of compliant control: what the planned load and the measured foot forces ask of
the joints.

Support. The servos are told the torques that carry each leg's planned share of weight and
acceleration (support.py), scaled by the weight that the feet really measure: a payload is carried
too.

Tangential. Of its force a foot should give way only to what does no work for the body. What the
plan asks of it is left alone, and so are the legs' common push and twist beyond that, shared in
proportion to the load; the rest is legs squeezing against each other (slip_pid.py). The PID's
answer g is a force, and the joints' angles are corrected by J^T g/kp: that is what the servos yield
under g, so a foot that sticks answers with exactly -g, in every direction alike and without a
vertical force: the loop's plant is at most 1, whatever leg, pose and servo, and the height does not
feel it. The answer goes with the measured load, so that a foot is not dragged over the ground by it
while it is being unloaded.

Normal. The virtual suspension answers the force beyond the planned share; its deflection z reaches
the joints as the vertical force z/C_zz, C = J kp^-1 J^T, and so without a horizontal one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from hexapod_cosim.controller.burden import Burden
from hexapod_cosim.controller.contact_detection import ContactDetector, SensorWatch
from hexapod_cosim.controller.foot_law import FootLaw
from hexapod_cosim.controller.gains import TRIPOD_LEGS, Gains
from hexapod_cosim.controller.inverse_dynamics import Demand
from hexapod_cosim.controller.kinematics import LEGS, Array, Mask, Plane
from hexapod_cosim.controller.landing import Landings
from hexapod_cosim.controller.parts import Parts
from hexapod_cosim.controller.slip_pid import LOAD_FLOOR, squeeze
from hexapod_cosim.controller.support import Shares, torques
from hexapod_cosim.controller.touchdown import EARLY, Touchdown

# 1    common tangential over normal force beyond the plan: only a robot that slides, or a slope of
# 29 degrees, has it
SLIDING = 0.55
CALM = 0.5  # 1    gait cycles without it until feet are trusted again
SLIDING_TIME = 0.04  # s    longer than a foot skids when it touches down
SETTLED = 0.5  # 1    of the weight: feet that carry less together have only just met the ground
OUTRUN = (
    0.35,
    0.45,
    # 1    share of the time in which paths ask more speed than a servo has: below joints follow,
    # above they do not
)
GRIPPED = 0.99  # 1    of its share: a leg with more carries it
LARGEST_LOAD = 2.0  # 1    in thirds of the weight: the design's margins hold up to it
SCALES = 0.5, 3.0  # 1    measured over modelled weight that the support believes
HIGH = 0.25  # 1    of the step height: a foot planned higher is certainly in the air

REMEMBERED = (
    "scale",
    "trust",
    "_plan",
    "_at",
    "_slack",
    "_sliding",
    "outrun",
    "_asked",
    "_dragged",
)


@dataclass(frozen=True)
class Plan:
    """What the coming steps ask, rows are steps. Never changed once made."""

    own: Array  # N m    (n, 6, 3) torques for the legs' own weight and motion
    carry: Array  # N m    (n, 6, 3) and for the planned load
    # (n, 6, 6, 3) of a force on the foot: its shift x y z [m/N], and the bend of the joints [rad/N]
    effect: Array
    shares: Shares
    push: Array  # N    (n, 6, 4) planned tangential forces x y 0 0
    feet: Plane  # m    (n, 6) contact points x + i y
    weight: list[float]  # N    of all shares
    live: Array  # 1    (n, 6) 1 of feet with a share, else 0
    standing: Mask  # (n, 6) planned on the ground, where that is certain
    sure: list[tuple[int, int]]  # n standing, and where that is certain, as `_bits`
    falling: Array  # m    (n, 6) by which feet well above the ground come down in a period
    height: Array  # m    (n, 6) of the paths over their ends
    needed: list[float]  # N m    n largest of `carry`
    swinging: Mask  # (6,)
    hurried: list[bool]  # n some joint is asked for more speed than its servo has


class Compliance:
    """The laws of all feet.

    Attributes: bend: (6, 3) corrections of the joints' angles [rad]; torque: (6, 3) for the servos
    [N m]; shift: (6, 3) of the feet that comes of `bend` [m], shift_plane: (6,) the same x + i y;
    offset: (6,) by which paths are raised for ground met early or late [m]; doubted: (6,) sensors
    not believed; fallback: (6,) legs that walk without feedback, for that or because the robot
    slides; scale: measured over planned weight; trust: 1, or less while the robot slides, is far
    too heavy or its joints cannot follow, which `outrun` tells;  burden: how much of the weight
    servos carry;  landings: how high feet meet the ground.
    """

    def __init__(
        self,
        gains: Gains,
        parts: Parts,
        *,
        weight: float,
        cycle: float,
        kp: float,
        step_height: float,
        period: float,
    ) -> None:
        """weight [N] of the robot, cycle [s] and step height [m] of its gait, kp [N m/rad] of
        its servos.
        """
        self._parts, self._softness, self._high, self._period = (
            parts,
            1.0 / kp,
            HIGH * step_height,
            period,
        )
        share = weight / TRIPOD_LEGS
        self.law = FootLaw(gains, period=period)
        self.detector, self.watch, self.touchdown = (
            ContactDetector(weight),
            SensorWatch(weight, cycle=cycle),
            Touchdown(period=period),
        )
        self.landings = Landings()
        self.burden = Burden(
            most=gains.limits.torque,
            cycle=cycle,
            period=period,
            weight_time=gains.support.weight_time,
        )
        self._tracking, self._memory = (
            min(period / gains.slip.tracking_time, 1.0),
            math.exp(-period / gains.slip.load_time),
        )
        self._follow_load = 1.0 - self._memory
        self._settled = SETTLED * weight
        self._calm, self._follow_cycle = (
            round(CALM * cycle / period),
            1.0 - math.exp(-period / cycle),
        )
        self._follow_weight = 1.0 - math.exp(-period / gains.support.weight_time)
        self._largest, self._deepest = gains.slip.limit * share, gains.suspension.limit
        self._most, self._fastest = gains.limits.torque, gains.limits.speed * period
        self._mixing = np.array([[0.0] * 4, [0.0] * 4, [0.0, 0.0, 1.0, 1.0 / share], [0.0] * 4])
        if not parts.suspension:
            self._mixing[2, 2] = 0.0
        self.bend, self.torque, self._step = np.zeros((3, LEGS, 3))
        self._felt, self._inputs, self._ones = (
            np.zeros((LEGS, 4)),
            np.zeros((LEGS, 4)),
            np.ones(LEGS),
        )
        self._felt_push, self._felt_normal = self._felt.view(np.complex128)[:, 0], self._felt[:, 2]
        self._squeezing = self._inputs.view(np.complex128)[:, 0]
        self._force, self._moved = np.zeros((LEGS, 3, 1)), np.zeros((LEGS, 6, 1))
        self.shift_plane = self._moved[..., 0].view(np.complex128)[:, 0]
        self.shift, self._wanted = self._moved[:, :3, 0], self._moved[:, 3:, 0]
        self._answer = self.law.row.view(np.complex128)[:, 0]
        self.offset, self.grip = np.zeros(LEGS), np.ones(LEGS)
        self.doubted, self.fallback = np.zeros((2, LEGS), dtype=np.bool_)
        self._remembering: tuple[Any, ...] = (
            self.watch,
            self.touchdown,
            self.detector,
            self.landings,
            self.burden,
        )
        self._arrays = (
            self.law.row,
            self.bend,
            self.offset,
            self.doubted,
            self.grip,
            self.fallback,
        )
        self.reset()

    def reset(self) -> None:
        """All laws at rest."""
        for law in (
            self.law,
            self.detector,
            self.watch,
            self.touchdown,
            self.landings,
            self.burden,
        ):
            law.reset()
        for array in (
            self.bend,
            self.torque,
            self._moved,
            self.offset,
            self.doubted,
            self.fallback,
        ):
            array[...] = 0
        self.outrun, self._asked, self._dragged = False, 0.0, 0
        self.scale, self.trust, self._at, self._slack, self._sliding = 0.0, 1.0, -1, False, 0
        self.grip[...] = 1.0

    def save(self) -> dict[str, Any]:
        """What the laws remember, and what is planned."""
        own, kept = (
            {name: getattr(self, name) for name in REMEMBERED},
            [array.copy() for array in self._arrays],
        )
        return {"own": own, "arrays": kept, "parts": [part.save() for part in self._remembering]}

    def restore(self, state: dict[str, Any]) -> None:
        """Restores a state returned by save()."""
        vars(self).update(state["own"])
        for array, kept in zip(self._arrays, state["arrays"], strict=True):
            array[...] = kept
        for part, remembered in zip(self._remembering, state["parts"], strict=True):
            part.restore(remembered)

    def plan(
        self,
        demand: Demand,
        shares: Shares,
        *,
        feet: Plane,
        height: Array,
        rise: Array,
        swinging: Mask,
        hurried: Mask | None = None,
    ) -> None:
        """Lays out the coming steps, rows of all arguments but `swinging`.

        Args:
            feet: (n, 6) contact points x + i y in the walking frame [m];
            height, rise: (n, 6) of the feet's paths over the stance [m, m/s];  swinging: (6,) in
            the air throughout;
            hurried: (n,) some joint is asked for more speed than its servo has, default never.
        """
        lever, none = demand.lever, np.zeros_like(demand.torque)
        carry = torques(lever, shares) if self._parts.support else none
        still = np.zeros_like(height)
        standing, well_up, supports = shares.activation >= 1.0, height > EARLY, self._parts.support
        self._plan = Plan(
            own=demand.torque if supports else none,
            carry=carry,
            effect=self._softness
            * np.concatenate([lever.swapaxes(-1, -2) @ lever, lever], axis=-2),
            shares=shares,
            push=np.stack([shares.push.real, shares.push.imag, still, still], axis=-1),
            feet=feet,
            weight=shares.normal.sum(axis=1).tolist(),
            live=(shares.activation > 0.0).astype(np.float64),
            standing=standing,
            sure=list(zip(_bits(standing), _bits(standing | well_up), strict=True)),
            falling=np.where(well_up, np.maximum(-self._period * rise, 0.0), 0.0),
            height=height,
            swinging=swinging.copy(),
            needed=np.abs(carry).max(axis=(1, 2)).tolist(),
            hurried=[False] * len(rise) if hurried is None else hurried.tolist(),
        )
        self._at = -1

    def step(self, force: Array) -> None:
        """One planned period on. force: (6, 4) ground on foot in the walking frame [N], the last
        column 0.
        """
        self._at += 1
        plan, at, parts = self._plan, self._at, self._parts
        touching = self.detector.step(force[:, 2])
        self.landings.look(touching, plan.height[at], plan.swinging)
        standing, certain = plan.sure[at]
        if (
            (int.from_bytes(touching.tobytes(), "little") ^ standing) & certain
            or self.watch.busy
            or self.touchdown.busy
        ):
            force = self._wonder(force, touching)
            touching = self.detector.touching
        felt = np.subtract(force, self.scale * plan.push[at], out=self._felt)
        felt *= touching[:, None]
        total = self._mix()
        low, high = SCALES
        scale = min(max(total / max(plan.weight[at], LOAD_FLOOR), low), high)
        if not self.doubted.any():
            self.scale += self._follow_weight * (scale - self.scale)
            self.burden.weigh(total / max(plan.weight[at], LOAD_FLOOR))
        self.burden.step(plan.needed[at], self.scale)
        if parts.suspension:
            excess = self._inputs[:, 2]
            excess -= self.scale * plan.shares.normal[at]
            excess *= plan.live[at]
        self._answer_forces(touching)
        self._actuate()

    def _mix(self) -> float:
        """Inputs of the laws from the forces felt, tangential ones beyond the plan's: the squeeze
        of these, f_n, load.

        Returns sum f_n [N].
        """
        mixing, felt = self._mixing, self._felt
        x, y, total, _ = np.dot(self._ones, felt).tolist()
        share = 1.0 / total if total > LOAD_FLOOR else 0.0
        if self._parts.fallback:
            self._judge(math.hypot(x, y) * share if total > self._settled else 0.0)
        np.dot(felt, mixing, out=self._inputs)
        if self._parts.slip_pid:
            self._squeezing[:] = squeeze(
                self._felt_push, self._felt_normal, self._plan.feet[self._at]
            )
        return float(total)

    def _judge(self, drag: float) -> None:
        """A robot whose feet slide, or whose joints cannot follow, has no use for the plan of who
        carries what: kinematic control for it.

        drag: of the feet's common tangential force beyond the plan, the share of the normal one.
        """
        self._asked += self._follow_cycle * (self._plan.hurried[self._at] - self._asked)
        self.outrun = self._asked > (OUTRUN[0] if self.outrun else OUTRUN[1])
        self._dragged = self._dragged + 1 if drag > SLIDING else 0
        if self._dragged * self._period > SLIDING_TIME:
            self._sliding = self._calm
        elif self._sliding:
            self._sliding -= 1
        goal = 0.0 if self._sliding or self.outrun or self.burden.overburdened else 1.0
        if self.trust != goal:
            self.trust += self._follow_load * (goal - self.trust)
            if abs(goal - self.trust) < 1.0 - GRIPPED:
                self.trust = goal
            self.fallback[:] = self.doubted | (goal == 0.0)

    def _answer_forces(self, touching: Mask) -> None:
        """The laws one period on, limited, and the forces that come of them."""
        law, plan, at = self.law, self._plan, self._at
        law.inputs[...] = self._inputs
        law.step()
        # no single one is beyond its limit when all together are not
        if np.vdot(self._answer, self._answer).real > self._largest**2:
            self._limit_answers()
        if np.dot(law.deflection, law.deflection) > self._deepest**2:
            self._limit_deflections()
        freedom = self.burden.freedom if self._parts.support else 1.0
        np.multiply(
            law.answer,
            freedom * np.minimum(law.load, LARGEST_LOAD)[:, None],
            out=self._force[:, :2, 0],
        )
        np.divide(law.deflection, plan.effect[at, :, 2, 2], out=self._force[:, 2, 0])
        # a foot in the air forgets, within the time in which a leg gives up its load; and all do
        # what they may not take away
        kept = 1.0 - (1.0 - freedom) * self._follow_load
        law.integral *= kept * np.where(plan.swinging > touching, self._memory, 1.0)[:, None]

    def _limit_answers(self) -> None:
        """The PID's answers no larger than allowed, their direction kept; integrals give way."""
        law, wanted = self.law, self.law.answer.copy()
        law.answer *= (self._largest / np.maximum(np.abs(self._answer), self._largest))[:, None]
        law.integral += self._tracking * (law.answer - wanted)

    def _limit_deflections(self) -> None:
        """At its stop a suspension stands still."""
        law = self.law
        law.rate[np.abs(law.deflection) > self._deepest] = 0.0
        np.clip(law.deflection, -self._deepest, self._deepest, out=law.deflection)

    def _actuate(self) -> None:
        """bend = J^T f/kp, limited in rate; torque = own + strength x scale x carry, limited."""
        plan, at, bend, torque, wanted = self._plan, self._at, self.bend, self.torque, self._wanted
        np.matmul(plan.effect[at], self._force, out=self._moved)
        strength = self.burden.strength if self._parts.limits else 1.0
        np.multiply(plan.carry[at], strength * self.scale, out=torque)
        if self._slack:
            self._take_up(torque)
        torque += plan.own[at]
        if self.trust != 1.0:
            torque *= self.trust
            wanted *= self.trust
        if not self._parts.limits:
            bend[...] = wanted
            return
        step = np.subtract(wanted, bend, out=self._step)
        bend += np.maximum(np.minimum(step, self._fastest, out=step), -self._fastest, out=step)
        np.maximum(np.minimum(torque, self._most, out=torque), -self._most, out=torque)

    def _take_up(self, torque: Array) -> None:
        """A leg that stands in the plan and not on the ground is given its share back as it
        loads.
        """
        missing = self._plan.standing[self._at] & ~self.detector.touching
        self.grip += self._follow_load * (1.0 - self.grip)
        self.grip[missing] = 0.0
        torque *= self.grip[:, None]
        self._slack = bool((self.grip < GRIPPED).any())

    def _wonder(self, force: Array, touching: Mask) -> Array:
        """Feet that touch and should not, or the other way round: ground met early or late, or a
        sensor that is wrong.

        Returns the forces; where a sensor is not believed, those of the plan, and of all feet once
        a tripod's are not.
        """
        plan, at, parts, touches = self._plan, self._at, self._parts, touching.tolist()
        standing, height = plan.standing[at].tolist(), plan.height[at]
        expected = self.landings.expected(touching, height, plan.swinging)
        if parts.fallback:
            total = float(force[touching, 2].sum())
            doubted = self.watch.look(
                touches,
                total,
                standing,
                (height > self._high + expected).tolist(),
                time=self._period,
            )
            self.doubted[:] = doubted if sum(doubted) < TRIPOD_LEGS else True
            self.fallback[:] = self.doubted | (self.trust < 1.0)
            if self.doubted.any():
                force = np.where(self.doubted[:, None], self.scale * plan.shares.forces(at), force)
                touches = np.where(
                    self.doubted, plan.shares.activation[at] > 0.5, touching
                ).tolist()
                self.detector.touching = np.array(touches)
        if self.trust < 1.0:
            self.touchdown.reset()
            self.offset[:] = 0.0
        elif parts.touchdown:
            self._slack = True
            falling = np.where(self.landings.early(expected, height), plan.falling[at], 0.0)
            self.offset[:] = self.touchdown.step(
                touches, falling.tolist(), plan.swinging.tolist(), standing
            )
        return force


def _bits(flags: Mask) -> list[int]:
    """Rows (n, 6) of flags as numbers, a byte for each flag: compared in no time."""
    return [int.from_bytes(row.tobytes(), "little") for row in flags]
