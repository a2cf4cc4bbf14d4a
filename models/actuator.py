"""The servo of a joint: PD with feed-forward inside the torque-speed line, and dry friction in
the gear.
"""

from __future__ import annotations

import numpy as np

from hexapod_cosim.models.records import Array, Servo

GEAR_SPEED = 0.05  # rad/s, where the gear's dry friction saturates


def servo_torque(
    servo: Servo, angle: Array, speed: Array, angle_ref: Array, speed_ref: Array, torque_ref: Array
) -> Array:
    """Motor torque on the child [N m], shapes as the inputs'.

    clip(kp (q_ref - q) + kd (qd_ref - qd) + tau_ff) to the torque-speed line; in torque mode kp =
    kd = 0.
    """
    kp, kd = (0.0, 0.0) if servo.mode == "torque" else (servo.kp, servo.kd)
    wanted = kp * (angle_ref - angle) + kd * (speed_ref - speed) + torque_ref
    upper = servo.torque_max * np.clip(1.0 - speed / servo.speed_max, 0.0, 1.0)
    lower = -servo.torque_max * np.clip(1.0 + speed / servo.speed_max, 0.0, 1.0)
    return np.clip(wanted, lower, upper)


def gear_friction(servo: Servo, speed: Array) -> Array:
    """Gear torque on the child [N m], -tau_c tanh(qd / 0.05 rad/s), in every mode."""
    return -servo.coulomb_friction * np.tanh(speed / GEAR_SPEED)


def servo_slopes(
    servo: Servo, angle: Array, speed: Array, angle_ref: Array, speed_ref: Array, torque_ref: Array
) -> tuple[Array, Array]:
    """Minus the slopes of `servo_torque` by angle [N m/rad] and speed [N m s/rad], 0 where clipped.

    Shapes are the inputs'. On the torque-speed line the slope by speed is the line's own.
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
    """Minus the slope of `gear_friction` by speed [N m s/rad], shape as the input's."""
    return servo.coulomb_friction / GEAR_SPEED * (1.0 - np.tanh(speed / GEAR_SPEED) ** 2)
