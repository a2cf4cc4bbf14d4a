"""Computes the torque of a voltage-driven motor, its current and power (eq. 48), and the friction
of its gear (eq. 49, 50); the heat of winding and housing with the duty limit of hot motors (eq.
52), the voltage of a battery under load (eq. 53), and what servos get from their bus. The fast
forms are in plant_fmu/src/lanes/actuator.h, plant_fmu/src/measure and plant_fmu/src/command.

The equations and the names M1 to M6 are those of Duclusaud, Passault, Padois and Ly, *Extended
Friction Models for the Physics Simulation of Servo Actuators*, ICRA 2025, arXiv 2410.08650.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.records import Servo


def torque_per_volt(servo: Servo) -> float:
    """Returns k_t/R [N m/V]."""
    return servo.torque_constant / servo.resistance


def back_emf_damping(servo: Servo) -> float:
    """Returns k_t^2/R [N m s/rad], by which the back-EMF damps the joint at a given voltage."""
    return servo.torque_constant * torque_per_volt(servo)


def stall_torque(servo: Servo) -> float:
    """Returns the motor's torque at its largest voltage and at rest [N m]."""
    return torque_per_volt(servo) * servo.duty_max * servo.voltage


def no_load_speed(servo: Servo) -> float:
    """Returns the speed at which the back-EMF equals the largest voltage [rad/s]."""
    return servo.duty_max * servo.voltage / servo.torque_constant


def motor_constant(servo: Servo) -> float:
    """Returns the torque over the root of the copper loss, k_t/sqrt(R) [N m/sqrt(W)]."""
    return servo.torque_constant / math.sqrt(servo.resistance)


def position_gain(servo: Servo, duty_gain: float) -> float:
    """Returns kp [N m/rad] of a servo whose duty is duty_gain [1/rad] times its position error."""
    return torque_per_volt(servo) * servo.voltage * duty_gain


@dataclass(frozen=True)
class Power:
    """What motors get from their supply, shares of one or of each joint [1] (eq. 52, 53)."""

    supply: Array | float  # voltage over that of the servo
    limit: Array | float  # this times the share of the duty limit that heat leaves
    strength: Array | float = 1.0  # share of its limits that a fault leaves


FULL = Power(1.0, 1.0)


def motor_torque(servo: Servo, speed: Array, wanted: Array, power: Power = FULL) -> Array:
    """Returns the motor's torque on the child [N m] (eq. 48), in the shape of the inputs.

    wanted: kp (q_ref - q) + kd (qd_ref - qd) + tau_ff [N m]. In position mode its voltage is
    R/k_t wanted V/V_0 with the supply's V, as in servos that turn the position error into a duty;
    torque mode adds the back-EMF, as a current controller does. The voltage is clipped to duty_max
    times the supply; the torques at these limits are multiplied by the strength.
    """
    stall, brake = stall_torque(servo) * power.limit, back_emf_damping(servo) * speed
    driven = wanted + brake if servo.mode == "torque" else wanted * power.supply
    low, high = -stall - brake, stall - brake
    if np.any(servo.current_max):
        most = servo.torque_constant * servo.current_max
        low, high = np.clip(-most, low, high), np.clip(most, low, high)
    return np.asarray(np.clip(driven - brake, power.strength * low, power.strength * high))


def motor_current(servo: Servo, torque: Array) -> Array:
    """Returns the current of the motor [A], in the shape of its torque [N m]; 0 for the drive line,
    whose motor is unknown.
    """
    return torque / servo.torque_constant if servo.drive == "motor" else np.zeros_like(torque)


def electrical_power(servo: Servo, torque: Array, speed: Array) -> Array:
    """Returns the power that the motor takes from its supply [W], voltage times current, in the
    shape of the inputs; below 0 it brakes and feeds back. It is 0 for the drive line.
    """
    if servo.drive != "motor":
        return np.zeros_like(torque)
    return torque * speed + servo.resistance * motor_current(servo, torque) ** 2


def has_measured_friction(servo: Servo) -> bool:
    """Returns whether the gear has more than Coulomb friction."""
    loads = servo.motor_load_friction + servo.external_load_friction
    sticking = servo.stribeck_motor_load_friction + servo.stribeck_external_load_friction
    quadratic = servo.quadratic_motor_friction + servo.quadratic_external_friction
    return servo.viscous_friction + servo.stribeck_friction + loads + sticking + quadratic > 0.0


def stribeck_share(servo: Servo, speed: Array) -> Array:
    """Returns exp(-|w/w_s|^a) [1], the share of the Stribeck terms at a speed [rad/s] (eq. 50)."""
    return np.asarray(np.exp(-(np.abs(speed / servo.stribeck_speed) ** servo.stribeck_exponent)))


def quadratic_friction(servo: Servo, motor: Array, external: Array) -> Array:
    """Returns the quadratic term of eq. 50 [N m]: where the external torque opposes the motor's."""
    m, e = np.abs(motor), np.abs(external)
    weaker = np.where(m < e, servo.quadratic_motor_friction * m**2, 0.0)
    squares = np.where(e < m, servo.quadratic_external_friction * e**2, weaker)
    return np.where(motor * external < 0.0, squares, 0.0)


def friction_budget(servo: Servo, speed: Array, motor: Array, external: Array) -> Array:
    """Returns the largest dry friction of motor and gear [N m] (eq. 50 without its viscous term).

    motor: torque of the motor; external: torque of gravity, ground and the links' motion on the
    joint (`external_torques`) [N m]. All arrays have one shape. The models M1 to M5 are special
    cases: M3 and M4 have equal coefficients for both torques.
    """
    load = np.abs(servo.motor_load_friction * motor - servo.external_load_friction * external)
    sticking = np.abs(
        servo.stribeck_motor_load_friction * motor
        - servo.stribeck_external_load_friction * external
    )
    quadratic = quadratic_friction(servo, motor, external)
    slow = stribeck_share(servo, speed) * (servo.stribeck_friction + sticking + quadratic)
    return np.asarray(servo.coulomb_friction + load + slow)


def measured_friction(servo: Servo, speed: Array, motor: Array, external: Array) -> Array:
    """Returns the friction of motor and gear on the child [N m] (eq. 49), in the shape of the
    inputs, those of `friction_budget`.

    The budget acts against the speed with tanh(speed / friction_speed), so a joint that friction
    holds creeps at up to about friction_speed.
    """
    budget = friction_budget(servo, speed, motor, external)
    return -budget * np.tanh(speed / servo.friction_speed) - servo.viscous_friction * speed


def measured_drag(servo: Servo, speed: Array, motor: Array, external: Array) -> Array:
    """Returns minus the slope of `measured_friction` by speed at a given budget [N m s/rad]."""
    budget = friction_budget(servo, speed, motor, external)
    steep = 1.0 - np.tanh(speed / servo.friction_speed) ** 2
    return budget / servo.friction_speed * steep + servo.viscous_friction


BUS_MARGIN = 1e-9  # s  transmissions this early or late are on time


def warm_servo(
    servo: Servo, winding: Array, housing: Array, h: float, copper: Array, gear: Array
) -> tuple[Array, Array]:
    """Returns the temperatures [K] of winding and housing after a step of h [s] (eq. 52).

    copper: heat of the winding in the step [J]; gear: what friction gives to the housing [J]. The
    trapezoidal rule solves for the mean temperatures: 2 C (T_m - T_0)/h = powers at T_m.
    """
    g, k = 1.0 / servo.winding_to_housing, 1.0 / servo.housing_to_air
    a, b = 2.0 * servo.winding_capacity / h, 2.0 * servo.housing_capacity / h
    of_winding = copper / h + a * winding
    of_housing = gear / h + b * housing + k * servo.air_temperature
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


def motor_duty(
    servo: Servo, speed: Array, wanted: Array, share: Array, strength: Array | float
) -> Array:
    """Returns the duties [1] of motors as of `supply_power` (eq. 53), with shares of their duty
    limits [1].
    """
    back, most = back_emf_damping(servo) * speed, servo.torque_constant * servo.current_max
    wanted = wanted + back if servo.mode == "torque" else wanted
    if servo.current_max > 0.0:
        wanted = np.clip(wanted, back - most, back + most)
    per_torque, limit = servo.duty_max / stall_torque(servo), strength * servo.duty_max * share
    idle = (1.0 - strength) * per_torque * back  # without a current
    return np.asarray(np.clip(wanted * per_torque, idle - limit, idle + limit))


def supply_share(servo: Servo, speed: Array, duty: Array) -> float:
    """Returns the voltage of the supply over that of the servo, at most 1, under these speeds
    [rad/s] and duties [1] (eq. 53): V = V_0 - R_b sum d (d V - k_t w)/R.
    """
    ratio = servo.supply_resistance / servo.resistance
    back = servo.torque_constant * float(np.sum(duty * speed)) / servo.voltage
    return min(1.0, (1.0 + ratio * back) / (1.0 + ratio * float(np.sum(duty**2))))


def supply_power(
    servo: Servo, speed: Array, wanted: Array, winding: Array, strength: Array | float = 1.0
) -> Power:
    """Returns what motors get whose speeds [rad/s], wanted torques [N m] as of `motor_torque` and
    windings' temperatures [K] have one shape.
    """
    share = duty_share(servo, winding)
    if servo.supply_resistance == 0.0 or servo.mode == "kinematic":
        return Power(1.0, share, strength)
    supply = supply_share(servo, speed, motor_duty(servo, speed, wanted, share, strength))
    return Power(supply, supply * share, strength)


def setpoint_rate(servo: Servo, setpoint: Array, goal: Array, h: Array | float) -> Array:
    """Returns the speed [rad/s] at which the firmware's setpoint [rad] follows the commanded angle
    for a time h [s], at most `goal_speed_max` (eq. 57).
    """
    return np.asarray(np.clip((goal - setpoint) / h, -servo.goal_speed_max, servo.goal_speed_max))


def overload_share(servo: Servo, loaded: Array | float) -> Array | float:
    """Returns the share of the duty limit that the overload protection leaves after a time of
    `count_overload` [s] (eq. 58).
    """
    if servo.overload_time == 0.0:
        return 1.0
    left = servo.overload_left / servo.duty_max
    return np.where(np.abs(loaded) > servo.overload_time, left, 1.0)


def count_overload(
    servo: Servo, wanted: Array, loaded: Array | float, h: Array | float
) -> Array | float:
    """Returns how long the wanted duty has been above `overload_duty` after a further time h [s]
    (eq. 58).

    wanted: torque at standstill, as of `motor_torque` [N m]. loaded: the time before [s], < 0 of a
    duty below 0. It begins anew where the wanted duty changes its sign.
    """
    if servo.overload_time == 0.0:
        return loaded
    above = np.abs(wanted) >= servo.overload_duty * torque_per_volt(servo) * servo.voltage
    side = np.sign(wanted)
    return np.where(above, side * (np.maximum(side * loaded, 0.0) + h), 0.0)


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
