"""Computes what motors get from their supply: the heat of winding and housing with the duty limit
of hot motors (eq. 52), and the voltage of a battery under load (eq. 53); and what servos get from
their bus. The fast forms are in plant_fmu/src/measure/measure.h and in plant_fmu/src/command.
"""

from __future__ import annotations

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.records import Servo
from hexapod_cosim.models.servos.motor import Power, back_emf_damping, stall_torque

BUS_MARGIN = 1e-9  # s  transmissions this early or late are on time


def warmed(
    servo: Servo, winding: Array, housing: Array, h: float, copper: Array, gear: Array
) -> tuple[Array, Array]:
    """Returns the temperatures [K] of winding and housing after a step of h [s] (eq. 52).

    copper: heat of the winding in the step [J]; gear: what friction gives to the housing [J]. The
    trapezoidal rule solves for the mean temperatures: 2 C (T_m - T_0)/h = powers at T_m.
    """
    g, k = 1.0 / servo.winding_to_housing, 1.0 / servo.housing_to_air
    a, b = 2.0 * servo.winding_capacity / h, 2.0 * servo.housing_capacity / h
    of_winding, of_housing = (
        copper / h + a * winding,
        gear / h + b * housing + k * servo.air_temperature,
    )
    determinant = (a + g) * (b + g + k) - g * g
    mean_winding = ((b + g + k) * of_winding + g * of_housing) / determinant
    mean_housing = (g * of_winding + (a + g) * of_housing) / determinant
    return 2.0 * mean_winding - winding, 2.0 * mean_housing - housing


def duty_share(servo: Servo, winding: Array) -> Array:
    """Returns the share of the duty limit [1] that is left at temperatures of windings [K]."""
    if servo.winding_capacity == 0.0:
        return np.ones_like(winding)
    span = servo.temperature_max - servo.derate_temperature
    return np.asarray(np.clip((servo.temperature_max - winding) / span, 0.0, 1.0))


def remaining_rating(servo: Servo, winding: Array) -> Array:
    """Returns the share of a winding's rise over the air that is left up to temperature_max [1]."""
    span = servo.temperature_max - servo.air_temperature
    return np.asarray(np.clip((servo.temperature_max - winding) / span, 0.0, 1.0))


def supply_power(servo: Servo, speed: Array, wanted: Array, winding: Array) -> Power:
    """Returns what motors get whose speeds [rad/s], wanted torques [N m] as of `motor_torque` and
    windings' temperatures [K] have one shape (eq. 53).

    The supply's voltage V solves V = V_0 - R_b sum d (d V - k_t w)/R with the duties d; it is at
    most V_0.
    """
    share = duty_share(servo, winding)
    if servo.supply_resistance == 0.0 or servo.mode == "kinematic":
        return Power(1.0, share)
    brake = back_emf_damping(servo) * speed if servo.mode == "torque" else 0.0
    limit = servo.duty_max * share
    duty = np.clip((wanted + brake) * servo.duty_max / stall_torque(servo), -limit, limit)
    ratio = servo.supply_resistance / servo.resistance
    back = servo.torque_constant * float(np.sum(duty * speed)) / servo.voltage
    supply = min(1.0, (1.0 + ratio * back) / (1.0 + ratio * float(np.sum(duty**2))))
    return Power(supply, supply * share)


def held_commands(servo: Servo, time: Array, angle: Array) -> Array:
    """Returns the commanded angles (n, ...) [rad] that servos hold at times (n,) [s].

    angle: commands (n, ...) at these times, which begin at 0 and contain all transmissions, at
    multiples of bus_period; angles are rounded to multiples of command_step.
    """
    step, period = servo.command_step, servo.bus_period
    rounded = step * np.floor(angle / step + 0.5) if step > 0.0 else angle
    if period == 0.0:
        return rounded
    last = np.floor((time + BUS_MARGIN) / period) * period
    return np.asarray(rounded[np.searchsorted(time, last - BUS_MARGIN)])
