"""The law against slip: one discrete PID per foot and direction, from tangential force to the force the leg's servos are relieved of.

A foot that the ground pushes by f while the leg holds it is being squeezed against its neighbours or dragged. Giving way takes the load
off the contact, and with it the creep f/(mu f_n k_t). What part of the force is to be given way to, and how the answer reaches the
joints, is said in compliance.py.

Discretised by Tustin's rule at the controller's period h:

    e' = (h (e + e-) + (2 T_f - h) e'-) / (2 T_f + h)          force filter
    i  = i- + k_i h/2 (e' + e'-)                               integral
    d  = (2 k_d (e' - e'-) + (2 T_d - h) d-) / (2 T_d + h)     filtered derivative
    u  = k_p e' + i + d
"""

from __future__ import annotations

import numpy as np

from hexapod_cosim.controller.gains import SlipGains
from hexapod_cosim.controller.kinematics import Array


def system(gains: SlipGains, *, period: float) -> Array:
    """(5, 5) from the row e-, e'-, i-, d-, e to the row u, e, e', i, d: acts from the right."""
    h, tf, td = period, gains.filter_time, gains.derivative_time
    last, old, integral, slope, force = np.eye(5)
    smooth = (h * (force + last) + (2.0 * tf - h) * old) / (2.0 * tf + h)
    integral = integral + 0.5 * h * gains.ki * (smooth + old)
    slope = (2.0 * gains.kd * (smooth - old) + (2.0 * td - h) * slope) / (2.0 * td + h)
    return np.column_stack([gains.kp * smooth + integral + slope, force, smooth, integral, slope])
