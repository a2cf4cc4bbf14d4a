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
