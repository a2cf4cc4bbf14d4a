"""Computes the torques of a joint's servo (eq. 12): PD control with feed-forward, torque-speed
line, gear friction; and the torque of the joint's stops (eq. 39). Those of measured servos are in
servos/motor.py.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.records import Robot, Servo
from hexapod_cosim.models.servos.motor import (
    FULL,
    Power,
    back_emf_damping,
    motor_torque,
    stall_torque,
)

LOCK_YIELD = 1e-3  # rad  of a locked joint, under its motor's largest torque
LOCK_TIME = 2e-3  # s  damping of a lock over its stiffness
GEAR_SPEED = 0.05  # rad/s  friction_speed of servos that give none; planned torques assume it


def servo_torque(
    servo: Servo,
    angle: Array,
    speed: Array,
    angle_ref: Array,
    speed_ref: Array,
    torque_ref: Array,
    *,
    power: Power = FULL,
) -> Array:
    """Returns the motor's torque on the child [N m], in the shape of the inputs.

    The torque is kp (q_ref - q) + kd (qd_ref - qd) + tau_ff, clipped to the torque-speed line, or
    that of a motor which this drives (`motor_torque`) with this power; in torque mode
    kp = kd = 0.
    """
    kp, kd = feedback_gains(servo)
    wanted = kp * (angle_ref - angle) + kd * (speed_ref - speed) + torque_ref
    if servo.drive == "motor":
        return motor_torque(servo, speed, wanted, power)
    return np.clip(wanted, *torque_limits(servo, speed, power.strength))


def feedback_gains(servo: Servo) -> tuple[float, float]:
    """Returns kp [N m/rad] and kd [N m s/rad] of the servo's law, which are 0 in torque mode."""
    return (0.0, 0.0) if servo.mode == "torque" else (servo.kp, servo.kd)


def torque_limits(servo: Servo, speed: Array, strength: Array | float = 1.0) -> tuple[Array, Array]:
    """Returns the least and largest torque of the torque-speed line [N m], of a servo that gives
    this share of them.
    """
    load, most = speed / servo.speed_max, servo.torque_max * np.asarray(strength)
    return -most * np.clip(1.0 + load, 0.0, 1.0), most * np.clip(1.0 - load, 0.0, 1.0)


def gear_friction(servo: Servo, speed: Array) -> Array:
    """Returns the gear's torque on the child [N m], -tau_c tanh(qd / w_f), in every mode, with w_f
    `friction_speed`, 0.05 rad/s unless it is given.
    """
    return -servo.coulomb_friction * np.tanh(speed / servo.friction_speed)


def servo_slopes(
    servo: Servo,
    angle: Array,
    speed: Array,
    angle_ref: Array,
    speed_ref: Array,
    torque_ref: Array,
    *,
    power: Power = FULL,
) -> tuple[Array, Array]:
    """Returns minus the derivatives of `servo_torque` by angle [N m/rad] and by speed [N m s/rad].

    Shapes are those of the inputs. The derivatives are 0 where the torque is clipped, except that
    the derivative by speed is the slope of the torque-speed line on that line.
    """
    kp, kd = feedback_gains(servo)
    wanted = kp * (angle_ref - angle) + kd * (speed_ref - speed) + torque_ref
    if servo.drive == "motor":
        given = power if servo.mode != "torque" else replace(power, supply=1.0)
        return _motor_slopes(servo, speed, wanted * given.supply, given)
    load = speed / servo.speed_max
    lower, upper = torque_limits(servo, speed, power.strength)
    torque = np.clip(wanted, lower, upper)
    free = (lower < wanted) & (wanted < upper)
    falling = ~free & (torque * load > 0.0) & (np.abs(load) < 1.0)
    line = np.where(falling, servo.torque_max * power.strength / servo.speed_max, 0.0)
    return np.where(free, kp, 0.0), np.where(free, kd, line)


def _motor_slopes(servo: Servo, speed: Array, wanted: Array, power: Power) -> tuple[Array, Array]:
    """Returns minus the derivatives of `motor_torque`: by angle [N m/rad], by speed [N m s/rad]."""
    stall, brake = stall_torque(servo) * power.limit, back_emf_damping(servo)
    kp, kd = (gain * power.supply for gain in feedback_gains(servo))
    voltage_driven = 0.0 if servo.mode == "torque" else brake
    torque = wanted - voltage_driven * speed
    low, high = (side * stall - brake * speed for side in (-1.0, 1.0))
    most = servo.torque_constant * servo.current_max if servo.current_max > 0.0 else 1e300
    low, high = (power.strength * np.clip(side, low, high) for side in (-most, most))
    free = (low < torque) & (torque < high)
    # a torque that the current limits does not depend on the speed
    falling = np.abs(np.clip(torque, low, high)) < most * np.asarray(power.strength)
    on_limit = np.where(falling, brake * power.strength, 0.0)
    damping = np.where(free, kd + voltage_driven, on_limit)
    return np.where(free, kp, 0.0), damping


def gear_drag(servo: Servo, speed: Array) -> Array:
    """Returns minus the derivative of `gear_friction` by speed [N m s/rad], in the shape of the
    input.
    """
    steep = 1.0 - np.tanh(speed / servo.friction_speed) ** 2
    return servo.coulomb_friction / servo.friction_speed * steep


def has_stops(servo: Servo) -> bool:
    """Returns whether stops act on the joints: a kinematic drive moves its joint through them."""
    return bool(np.max(servo.stop_stiffness) > 0.0) and servo.mode != "kinematic"


def overrun(angle: Array, angle_min: Array, angle_max: Array) -> Array:
    """Returns how far angles are past their stops [rad], > 0 above angle_max, < 0 below angle_min.

    The shape is that of the inputs. Angles are measured from the middle between the stops, so that
    a joint may pass pi.
    """
    half = 0.5 * (angle_max - angle_min)
    from_middle = (angle - 0.5 * (angle_min + angle_max) + np.pi) % (2.0 * np.pi) - np.pi
    return np.asarray(from_middle - np.clip(from_middle, -half, half))


def stop_torque(servo: Servo, past: Array, speed: Array) -> Array:
    """Returns the torque of the stops on the child [N m], in the shape of the inputs (eq. 39).

    It is -(k x + c qd), in which the damper's part is limited to the spring's: the torque is
    continuous where a joint reaches a stop, and a stop does not pull. past: x of `overrun` [rad].
    """
    if not has_stops(servo):
        return np.zeros_like(past)
    spring = servo.stop_stiffness * past
    return -(spring + np.clip(servo.stop_damping * speed, -np.abs(spring), np.abs(spring)))


def stop_slopes(servo: Servo, past: Array, speed: Array) -> tuple[Array, Array]:
    """Returns minus the derivatives of `stop_torque` by angle [N m/rad] and by speed [N m s/rad].

    A limited damper doubles the spring on the way in and cancels it on the way out.
    """
    if not has_stops(servo):
        return np.zeros_like(past), np.zeros_like(past)
    k, wanted = servo.stop_stiffness, np.abs(servo.stop_damping * speed)
    free = wanted < k * np.abs(past)
    limited = np.where(past * speed > 0.0, 2.0 * k, 0.0)
    stiffness = np.where(past == 0.0, 0.0, np.where(free, k, limited))
    return stiffness, np.where(free, servo.stop_damping, 0.0)


def stop_energy(servo: Servo, past: Array) -> Array:
    """Returns the energy k x^2/2 that stops store [J], in the shape of past (`overrun`)."""
    return np.asarray(0.5 * servo.stop_stiffness * past**2 * has_stops(servo))


def lock_joints(robot: Robot, locked_angle: Array) -> Robot:
    """Returns the robot with joints locked at angles (6, 3) [rad], NaN for free ones.

    A locked joint has stops at its angle, of arrays (6, 3) of stiffness and damping: it yields
    1 mrad under its motor's largest torque.
    """
    servo, locked = robot.servo, ~np.isnan(locked_angle)
    most = stall_torque(servo) if servo.drive == "motor" else servo.torque_max
    stiffness = np.where(locked, most / LOCK_YIELD, servo.stop_stiffness)
    damping = np.where(locked, LOCK_TIME * most / LOCK_YIELD, servo.stop_damping)
    stops: dict[str, Any] = {"stop_stiffness": stiffness, "stop_damping": damping}
    legs = []
    for leg, angles in zip(robot.legs, locked_angle.tolist(), strict=True):
        coxa, femur, tibia = (
            link if math.isnan(angle) else replace(link, angle_min=angle, angle_max=angle)
            for link, angle in zip(leg.links, angles, strict=True)
        )
        legs.append(replace(leg, links=(coxa, femur, tibia)))
    return replace(robot, servo=replace(servo, **stops), legs=tuple(legs))
