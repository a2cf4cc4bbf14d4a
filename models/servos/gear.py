"""Computes the torque of an elastic gear with play between rotor and link (eq. 54, 55). The fast
form is in plant_fmu/src/lanes/actuator.h.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.records import Servo

TOOTH_EDGE = 0.1  # of half of the play: half of the way on which the teeth engage


@dataclass(frozen=True)
class Rotors:
    """State of the rotors behind elastic gears, seen at the joints."""

    deflection: Array  # (6, 3) rad  rotor less link
    speed: Array  # (6, 3) rad/s


def is_elastic(servo: Servo) -> bool:
    """Returns whether gears are elastic: a kinematic drive moves its joint without one."""
    return servo.gear_stiffness > 0.0 and servo.mode != "kinematic"


def spin_inertia(servo: Servo) -> float:
    """Returns the inertia of a rotor times its gear ratio, J_r/n [kg m2] (eq. 57); 0: left out."""
    return servo.rotor_inertia / servo.gear_ratio if servo.gear_ratio != 0.0 else 0.0


def tooth_deflection(servo: Servo, deflection: Array) -> tuple[Array, Array]:
    """Returns the deflection of the teeth x [rad] and its derivative by that of the gear [1].

    x is 0 within the play and the deflection less half of the play beyond. On the tooth edge, a
    tenth of half of the play on both sides, a parabola connects both (eq. 55).
    """
    if servo.backlash == 0.0:
        return deflection, np.ones_like(deflection)
    half = 0.5 * servo.backlash
    edge = TOOTH_EDGE * half
    past = np.abs(deflection) - half
    share = np.clip((past + edge) / (2.0 * edge), 0.0, 1.0)
    size = np.where(past > edge, past, edge * share**2)
    return np.copysign(size, deflection), share


def gear_torque(servo: Servo, deflection: Array, rate: Array) -> Array:
    """Returns the torque of the gear on the link [N m], k x + c x' times the rate (eq. 54).

    It has the shape of the deflection [rad] and its rate [rad/s]; minus it acts on the rotor.
    """
    x, share = tooth_deflection(servo, deflection)
    return np.asarray(servo.gear_stiffness * x + servo.gear_damping * share * rate)


def gear_slopes(servo: Servo, deflection: Array, rate: Array, ahead: float) -> tuple[Array, Array]:
    """Returns the derivatives of `gear_torque` by deflection [N m/rad] and rate [N m s/rad].

    They are the larger ones of now and a time `ahead` [s], because teeth that are about to meet
    have none yet; the derivative of the share is left out.
    """
    later = deflection + ahead * rate
    share = np.maximum(tooth_deflection(servo, deflection)[1], tooth_deflection(servo, later)[1])
    return servo.gear_stiffness * share, servo.gear_damping * share


def gear_energy(servo: Servo, deflection: Array) -> Array:
    """Returns the energy that gears store [J], the integral of k x, in the shape of the input."""
    if servo.backlash == 0.0:
        return np.asarray(0.5 * servo.gear_stiffness * deflection**2)
    half = 0.5 * servo.backlash
    edge = TOOTH_EDGE * half
    past = np.abs(deflection) - half
    share = np.clip((past + edge) / (2.0 * edge), 0.0, 1.0)
    engaged = 0.5 * past**2 + edge**2 / 6.0
    stored = np.where(past > edge, engaged, 2.0 / 3.0 * edge**2 * share**3)
    return np.asarray(servo.gear_stiffness * stored)
