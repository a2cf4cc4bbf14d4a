"""Places the legs for the planned feet of one step. C: planned_step.h.

feet -> way of the torso -> lowering by the loads -> rolling -> posture -> inverse kinematics
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hexapod_cosim.controller.comply.compliant import Compliant
from hexapod_cosim.controller.comply.sway import Sway
from hexapod_cosim.controller.gains import Parts
from hexapod_cosim.controller.plane import LEGS, Array, Plane, cis
from hexapod_cosim.controller.walk.absence import Absence
from hexapod_cosim.controller.walk.foot_paths import PlannedFeet
from hexapod_cosim.controller.walk.gait_clock import GaitClock
from hexapod_cosim.controller.walk.inverse_dynamics import Masses
from hexapod_cosim.controller.walk.kinematics import LegSolver, Pose
from hexapod_cosim.controller.walk.posture import Posture


class PlannedStep(NamedTuple):
    """One planned step, which depends on the command alone. Feet (6,) are in the walking frame."""

    value: Array  # (6,) commanded vx vy yaw_rate height roll pitch
    posture: Posture
    feet: PlannedFeet
    torso: complex  # m    way of the torso from its nominal place (C54)
    plane: Plane  # m    of the feet from the torso, rolling
    activation: Array  # 1    of the legs
    lowering: Array  # m    lowering of the feet by the indentation of the ground (C21)
    height: Array  # m    of the lowered feet
    shift: Plane  # m    of the feet due to rolling (C9)
    pose: Pose  # of the legs
    masses: Masses | None  # of the links; None under kinematic control


def place_legs(
    legs: LegSolver, posture: Posture, plane: Plane, height: Array, rolled: Array
) -> tuple[Plane, Pose]:
    """Returns the shift of the feet due to rolling (C9) [m], and the pose of the legs.

    A tibia that pitches by dB rolls the sphere of its foot by -R dB along the outward direction
    of the leg. The shift s changes B itself: s = R (C + s dC/du) is solved by one Newton step.

    Args:
        legs: of the robot.
        posture: of the torso.
        plane, height: (..., 6) centres of the feet, walking frame [m].
        rolled: (6,) distances rolled that are no shift, because the feet aim at another
            position than that of the stance [m].
    """
    pose = legs.pose(*posture.to_torso(plane, height))
    slope = legs.speeds(pose, pose.heading, 0.0)
    turns = slope[..., 2] - slope[..., 1]
    rolls = legs.rolling(pose.angle) - rolled
    shift = pose.heading * (rolls / (1.0 - legs.radius * turns))
    return shift, legs.pose(*posture.to_torso(plane + shift, height))


class StepPlanner:
    """Places the legs of one robot. compliant: compliant control, which lowers feet; None: none."""

    def __init__(self, parts: Parts, *, legs: LegSolver, compliant: Compliant | None) -> None:
        self.legs, self.compliant = legs, compliant
        self.sway = None if compliant is None else Sway(compliant.dynamics, legs, active=parts.sway)

    def _stand(
        self,
        value: Array,
        posture: Posture,
        feet: PlannedFeet,
        torso: complex,
        clock: GaitClock,
        presence: Array,
    ) -> PlannedStep:
        """Computes the pose of the legs and the point masses for a torso that has moved.

        torso: its way in the walking frame [m]; presence: (6,) factors on the activations [1].
        """
        plane = feet.plane - torso
        activation, lowering, masses = presence, np.zeros(LEGS), None
        if self.compliant is not None:
            activation, lowering = self.compliant.lowered(feet.phase, plane, clock, presence)
        height = feet.height - lowering
        shift, pose = place_legs(self.legs, posture, plane, height, feet.rolled)
        if self.compliant is not None:
            way = feet.way + cis(feet.turn) * torso
            masses = self.compliant.dynamics.place(pose, way, feet.turn, posture)
        return PlannedStep(
            value=value,
            posture=posture,
            feet=feet,
            torso=torso,
            plane=plane + shift,
            activation=activation,
            lowering=lowering,
            height=height,
            shift=shift,
            pose=pose,
            masses=masses,
        )

    def lay_out(
        self,
        value: Array,
        posture: Posture,
        feet: PlannedFeet,
        clock: GaitClock,
        absence: Absence,
        ahead: int,
    ) -> PlannedStep:
        """Computes way of the torso, pose of the legs and point masses for planned feet.

        clock: of the gait, in the section of the step; ahead: periods from the present step.
        """
        torso, presence = absence.torso(ahead), absence.presence(ahead)
        sway, compliant = self.sway, self.compliant
        if compliant is not None and sway is not None and sway.acts(compliant.adaptation.narrowing):
            part = compliant.adaptation.narrowing
            weight_ratio = compliant.adaptation.planned_weight_ratio()
            guess = sway.guess(feet, weight_ratio)
            masses = self._stand(value, posture, feet, guess, clock, presence).masses
            assert masses is not None
            torso += part * sway.of(guess, masses, weight_ratio)
        return self._stand(value, posture, feet, torso, clock, presence)

    def weight_ratio(self) -> float:
        """Returns the weight that moves with the torso over the modelled one [1] (C53)."""
        assert self.sway is not None
        assert self.compliant is not None
        return self.compliant.adaptation.planned_weight_ratio() if self.sway.active else 1.0
