"""Applies the force laws: turns planned load and measured foot forces into servo torques.

C: force_laws.h. Every period consists of these steps:

1. Contacts. The detector decides which feet touch the ground (C23). If a contact contradicts the
   plan, a sensor may be wrong and is replaced (C34), or the ground is higher or lower (C35, C36).
2. Deviations. The planned forces are subtracted from the measured ones (C24). They tell whether the
   robot slides (C33) and how much of the planned squeeze the ground holds (C46, C52).
3. Weight. The plan is scaled by the measured weight (C30), so that a payload is carried too.
4. Torques. They are those of the planned load (C29).

When the whole robot slides or is far too heavy, `trust` goes to 0 and the robot walks under
kinematic control (C33).
"""

from __future__ import annotations

import math

import numpy as np

from hexapod_cosim.controller.comply.load_plan import LoadPlan
from hexapod_cosim.controller.gains import TRIPOD_LEGS, Gains, Parts
from hexapod_cosim.controller.memory import Stateful
from hexapod_cosim.controller.plane import LEGS, Array, Mask, Plane, along, clamp, plane_of, some
from hexapod_cosim.controller.sense.contact_detection import ContactDetector
from hexapod_cosim.controller.sense.load_limit import LoadLimit
from hexapod_cosim.controller.sense.touchdown import EARLY, REACH_LIMIT, Landings, Touchdown
from hexapod_cosim.controller.sense.trust import SensorWatch, Trust, replaced

SETTLED_SHARE = 0.5  # 1    of the weight: feet that carry less together have only just landed
GRIPPED = 0.99  # 1    of its share: a leg with more carries it
LOAD_FLOOR = 1e-6  # N    a smaller sum of loads cannot be divided by
LEAST_SCALE, LARGEST_SCALE = 0.5, 3.0  # 1    measured over modelled weight that is believed
LIKELY = 1.2  # 1    of its planned load, or a third of the weight: a doubted foot bears no more
WEIGHED = 0.9  # 1    of the weight ratio, which changes faster: a larger scale has settled
CARRYING_SHARE = 0.2  # 1    in thirds of the weight: an awaited foot with more stands
LARGEST_LEAN = 0.4  # 1    of the depth of the ground: distance of the centre of mass, each axis
HIGH_SHARE = 0.25  # 1    of the step height: a foot planned higher is certainly in the air


class ForceLaws(Stateful):
    """Force laws of all feet.

    Attributes, (6,) unless stated otherwise:
        detector, watch, touchdown, landings, limit, trust: components with states.
        load: smoothed load of the feet in thirds of the weight [1].
        torque: (6, 3) feed-forward torques of the servos [N m].
        contact: feet on the ground.
        carrying: feet on the ground that carry so much that the gait clock need not wait for them.
        doubted: sensors that are replaced.
        open_loop: feet that follow their paths: their sensors have just been doubted, or all are.
        fallback: legs under kinematic control.
        grip: factor on the planned load of a leg that is regaining contact [1].
        regaining: some grip may be below 1 (scalar).
        scale: measured over planned weight (scalar) [1].
        lean: of the measured centre of mass from the modelled one, x + i y (scalar) [m].
        squeeze_share: of the planned squeeze, that the ground holds (scalar) [1].
        trusted: scale, lean and weight ratio before a sensor contradicted the plan (scalars).
    """

    STATE = (
        "detector", "watch", "touchdown", "landings", "limit", "trust", "load", "torque",
        "contact", "carrying", "doubted", "open_loop", "fallback", "grip", "regaining", "scale",
        "lean", "squeeze_share", "trusted",
    )  # fmt: skip

    def __init__(
        self,
        gains: Gains,
        parts: Parts,
        *,
        weight: float,
        depth: float,
        cycle: float,
        step_height: float,
        period: float,
    ) -> None:
        """Computes the constants of the laws and resets their state.

        weight: of the robot [N]; depth: of the ground below the torso's origin [m]; cycle,
        step_height: of its gait [s, m]; period [s].
        """
        self.parts = parts
        self.share = weight / TRIPOD_LEGS  # N
        self.settled = SETTLED_SHARE * weight  # N
        self.most_lean = LARGEST_LEAN * depth  # m
        self.high = HIGH_SHARE * step_height  # m
        self.landings = Landings()
        self.detector = ContactDetector(weight)
        self.watch = SensorWatch(weight, cycle=cycle, period=period)
        self.touchdown = Touchdown(period=period)
        time = gains.support.weight_time
        self.most = gains.limits.torque  # N m
        self.limit = LoadLimit(most=self.most, cycle=cycle, period=period, weight_time=time)
        self.trust = Trust(cycle=cycle, period=period, load_time=gains.support.load_time)
        self.follow_load = 1.0 - math.exp(-period / gains.support.load_time)
        self.follow_cycle = 1.0 - math.exp(-period / cycle)
        self.follow_weight = 1.0 - math.exp(-period / gains.support.weight_time)
        self.reset()

    def reset(self) -> None:
        """Puts all laws to rest: no torques, all sensors trusted, no offsets."""
        for part in (
            self.detector, self.watch, self.touchdown, self.landings, self.limit, self.trust
        ):  # fmt: skip
            part.reset()
        self.load, self.torque = np.zeros(LEGS), np.zeros((LEGS, 3))
        self.contact, self.carrying, self.doubted = np.zeros((3, LEGS), np.bool_)
        self.open_loop, self.fallback = np.zeros((2, LEGS), np.bool_)
        self.grip, self.regaining = np.ones(LEGS), False
        self.scale, self.lean, self.squeeze_share = 0.0, 0j, 1.0
        self.trusted = 1.0, 0j, 1.0

    def needed(self) -> float:
        """Returns the torque needed for the measured weight over the torque allowed [1]."""
        return self.limit.weight_ratio * self.limit.peak / self.limit.most

    # ------------------------------------------------------------------------------ contacts

    def _replace_forces(self, plan: LoadPlan, force: Array) -> Array:
        """Returns the forces (6, 3) [N], with those of doubted sensors replaced (C34)."""
        before, self.contact = self.contact, self.detector.contact
        if not some(self.doubted):
            return force
        force = replaced(force, self.scale * plan.shares.forces(), self.contact, self.doubted)
        found = self.watch.found(force[:, 2], before)
        found = plan.shares.activation > 0.5 if self.doubted.all() else found
        self.contact = np.where(self.doubted, found, self.contact)
        return force

    def _judge_sensors(self, plan: LoadPlan, met: Array, force: Array, measured: Array) -> None:
        """Decides which sensors are doubted (C34): all of them once a tripod's are.

        met: (6,) heights at which the feet are expected to meet the ground [m]; force: (6, 3) that
        the laws use; measured: (6,) normal forces of the sensors [N].
        """
        reported = np.where(self.detector.contact, measured, 0.0)
        high = plan.height > self.high + met
        most = np.maximum(self.share, LIKELY * self.scale * plan.shares.normal)
        known = float(np.minimum(force[:, 2], most)[self.doubted & ~high].sum())
        whole = float(reported.sum())
        total = np.where(self.doubted, whole, whole + known)
        total = np.where(high, whole + known - reported, total)
        loaded = plan.standing | plan.awaited
        doubted = self.watch.update(self.detector.contact, total, loaded, high)
        all_doubted = np.count_nonzero(doubted) >= TRIPOD_LEGS
        doubted = doubted | all_doubted
        fresh = doubted & ~self.doubted
        if some(fresh):
            self.scale, self.lean, self.limit.weight_ratio = self.trusted
        self.open_loop = (self.open_loop | fresh) & doubted & (plan.height <= EARLY) | all_doubted
        self.doubted = doubted

    def _meet_ground(self, plan: LoadPlan, met: Array) -> None:
        """Adapts the foot heights to early and late contacts (C36). met: as in _judge_sensors()."""
        self.regaining = True
        early = self.landings.early(met, plan.height)
        falling = np.where(early, plan.descent, 0.0)
        searching = plan.awaited & ~self.open_loop & ~self.carrying
        self.touchdown.step(
            self.contact, falling, plan.swinging, plan.standing, searching, self.open_loop
        )

    def _examine_contacts(self, plan: LoadPlan, force: Array, measured: Array) -> None:
        """Decides between a wrong sensor and an early or late contact; as _judge_sensors()."""
        met = self.landings.expected(self.contact, plan.height, plan.swinging)
        if self.parts.fallback:
            self._judge_sensors(plan, met, force, measured)
        if self.trust.level < 1.0:
            self.touchdown.reset()
        elif self.parts.touchdown:
            self._meet_ground(plan, met)

    def _contacts_differ(self, plan: LoadPlan) -> bool:
        """Returns whether contacts contradict the plan, or a response to it is still under way."""
        wrong = (self.contact != plan.standing) & (plan.standing | (plan.height > EARLY))
        return some(wrong | plan.awaited) or self.watch.busy() or self.touchdown.busy()

    # ------------------------------------------------------------------------ inputs and weight

    def _squeeze_lost(self, plan: LoadPlan, deviation: Plane) -> float:
        """Returns the share of the planned squeeze that creep has taken away, in [0, 1] (C46).

        deviation: (6,) of the tangential forces from the planned ones [N].
        """
        planned = np.where(self.contact, self.scale * plan.shares.squeeze, 0.0)
        whole = float(along(planned, planned).sum())
        if whole <= LOAD_FLOOR:
            return 0.0
        return min(max(-float(along(planned, deviation).sum()) / whole, 0.0), 1.0)

    def _measure_loads(self, plan: LoadPlan, force: Array) -> tuple[Array, float]:
        """Returns the normal forces (6,) and their sum [N].

        It updates trust (C33), smoothed loads (C27) and the held share of the planned squeeze (C52)
        by the deviations of the tangential forces (C24).
        """
        horizontal = plane_of(*force.T[:2])
        deviation = np.where(self.contact, horizontal - self.scale * plan.shares.push, 0.0)
        normal = np.where(self.contact, force[:, 2], 0.0)
        total = float(normal.sum())
        if self.parts.fallback:
            drag = abs(deviation.sum()) / total if total > max(self.settled, LOAD_FLOOR) else 0.0
            goal = self.trust.step(drag, overloaded=self.limit.overloaded)
            self.fallback = np.full(LEGS, goal == 0.0)
        self.load = self.load + self.follow_load * (normal / self.share - self.load)
        missing = self._squeeze_lost(plan, deviation)
        self.squeeze_share += self.follow_cycle * (1.0 - missing - self.squeeze_share)
        return normal, total

    def _update_lean(self, plan: LoadPlan, normal: Array, total: float) -> None:
        """Updates the distance of the centre of mass from the modelled one (C44).

        The planned loads contain the present distance. normal: (6,) measured [N]; total: their sum.
        """
        if not total > self.settled or not plan.weight > self.settled:
            return
        ahead = (normal @ plan.feet) / total - (plan.shares.normal @ plan.feet) / plan.weight
        lean = complex(self.lean + self.follow_cycle * ahead)
        self.lean = complex(
            min(max(lean.real, -self.most_lean), self.most_lean),
            min(max(lean.imag, -self.most_lean), self.most_lean),
        )

    def _update_weight(self, plan: LoadPlan, normal: Array, total: float) -> None:
        """Updates the ratio of measured to planned weight (C30), the centre of mass (C44) and the
        load of the servos.

        normal: (6,) measured normal forces [N]; total: their sum [N].
        """
        if self.scale > WEIGHED * self.limit.weight_ratio and not some(self.watch.contradicted):
            self.trusted = self.scale, self.lean, self.limit.weight_ratio
        if not some(self.doubted):
            ratio = total / max(plan.weight, LOAD_FLOOR)
            scale = min(max(ratio, LEAST_SCALE), LARGEST_SCALE)
            self.scale += self.follow_weight * (scale - self.scale)
            self.limit.weigh(ratio)
            self._update_lean(plan, normal, total)
        self.limit.step(plan.needed, self.scale)

    # ---------------------------------------------------------------------------------- joints

    def _restore_grip(self, plan: LoadPlan, torque: Array) -> Array:
        """Scales the planned load of each leg by its grip, which grows as the leg loads (C28).

        A leg that should stand and does not touch the ground has grip 0. torque: (6, 3) for the
        planned load [N m]. Returns the scaled torques (6, 3) [N m].
        """
        grip = self.grip + self.follow_load * (1.0 - self.grip)
        self.grip = np.where((plan.standing | plan.awaited) & ~self.contact, 0.0, grip)
        self.regaining = some(self.grip < GRIPPED)
        return torque * self.grip[:, None]

    def _actuate(self, plan: LoadPlan) -> None:
        """Sets the torques of the planned load: trust (own + grip strength scale carry) (C29)."""
        strength = self.limit.strength if self.parts.limits else 1.0
        torque = plan.carry * (strength * self.scale)
        if self.regaining:
            torque = self._restore_grip(plan, torque)
        torque = (torque + plan.own) * self.trust.level
        self.torque = clamp(torque, -self.most, self.most) if self.parts.limits else torque

    def raised(self) -> tuple[Array, bool]:
        """Returns the height offsets of the feet (6,) [m] (C36), and whether they are changing."""
        return self.touchdown.offset, self.touchdown.busy()

    def meets(self) -> Mask:
        """Returns the feet (6,) that have met the ground on their way down (C51)."""
        return self.contact & ~self.open_loop & (self.parts.touchdown and self.trust.level == 1.0)

    def waits(self, landing: Mask, *, waiting: bool) -> bool:
        """Returns whether the gait clock waits for the feet of legs that end their swing (C50).

        landing: (6,) these legs; waiting: it waits already.
        """
        if not self.parts.touchdown or self.trust.level < 1.0:
            return False
        found = self.carrying if waiting else self.contact
        hopeful = self.touchdown.offset > -REACH_LIMIT
        return some(landing & ~found & ~self.open_loop & hopeful)

    def step(self, plan: LoadPlan, force: Array) -> None:
        """Advances all laws by one period.

        force: (6, 3) of the ground on the feet, walking frame [N].
        """
        measured = force[:, 2]
        self.detector.step(measured)
        force = self._replace_forces(plan, force)
        self.carrying = self.contact & (force[:, 2] > CARRYING_SHARE * self.share)
        self.landings.update(self.contact, plan.height, plan.swinging)
        if self._contacts_differ(plan):
            self._examine_contacts(plan, force, measured)
        normal, total = self._measure_loads(plan, force)
        self._update_weight(plan, normal, total)
        self._actuate(plan)
