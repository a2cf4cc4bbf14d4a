"""Computes the torques of a joint's servo (eq. 12): PD control with feed-forward, torque-speed
line, gear friction.
"""

from __future__ import annotations

import numpy as np

from hexapod_cosim.models.records import Array, Servo

GEAR_SPEED = 0.05  # rad/s  speed at which the gear's dry friction saturates


def servo_torque(
    servo: Servo, angle: Array, speed: Array, angle_ref: Array, speed_ref: Array, torque_ref: Array
) -> Array:
    """Returns the motor's torque on the child [N m], in the shape of the inputs.

    The torque is kp (q_ref - q) + kd (qd_ref - qd) + tau_ff, clipped to the torque-speed line; in
    torque mode kp = kd = 0.
    """
    kp, kd = (0.0, 0.0) if servo.mode == "torque" else (servo.kp, servo.kd)
    wanted = kp * (angle_ref - angle) + kd * (speed_ref - speed) + torque_ref
    upper = servo.torque_max * np.clip(1.0 - speed / servo.speed_max, 0.0, 1.0)
    lower = -servo.torque_max * np.clip(1.0 + speed / servo.speed_max, 0.0, 1.0)
    return np.clip(wanted, lower, upper)


def gear_friction(servo: Servo, speed: Array) -> Array:
    """Returns the gear's torque on the child [N m], -tau_c tanh(qd / 0.05 rad/s), in every mode."""
    return -servo.coulomb_friction * np.tanh(speed / GEAR_SPEED)


def servo_slopes(
    servo: Servo, angle: Array, speed: Array, angle_ref: Array, speed_ref: Array, torque_ref: Array
) -> tuple[Array, Array]:
    """Returns minus the derivatives of `servo_torque` by angle [N m/rad] and by speed [N m s/rad].

    Shapes are those of the inputs. The derivatives are 0 where the torque is clipped, except that
    the derivative by speed is the slope of the torque-speed line on that line.
    """
    kp, kd = (0.0, 0.0) if servo.mode == "torque" else (servo.kp, servo.kd)
    wanted = kp * (angle_ref - angle) + kd * (speed_ref - speed) + torque_ref
    load = speed / servo.speed_max
    upper = servo.torque_max * np.clip(1.0 - load, 0.0, 1.0)
    lower = -servo.torque_max * np.clip(1.0 + load, 0.0, 1.0)
    torque = np.clip(wanted, lower, upper)
    free = (lower < wanted) & (wanted < upper)
    falling = ~free & (torque * load > 0.0) & (np.abs(load) < 1.0)
    line = np.where(falling, servo.torque_max / servo.speed_max, 0.0)
    return np.where(free, kp, 0.0), np.where(free, kd, line)


def gear_drag(servo: Servo, speed: Array) -> Array:
    """Returns minus the derivative of `gear_friction` by speed [N m s/rad], in the shape of the
    input.
    """
    return servo.coulomb_friction / GEAR_SPEED * (1.0 - np.tanh(speed / GEAR_SPEED) ** 2)
