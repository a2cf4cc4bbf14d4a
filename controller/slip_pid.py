"""The law against slip: one discrete PID per foot and direction, from tangential force to the force
the leg's servos are relieved of.

A foot that the ground pushes by f while the leg holds it is being squeezed against its neighbours
or dragged. Giving way takes the load off the contact, and with it the creep f/(mu f_n k_t). Forces
that move the body are left alone: of the tangential forces d_i beyond the plan, (n_i/N) (D + i w
(p_i - c)) are those of a body that is pushed and turned, n_i the normal forces, N their sum, p = x
+ i y,

    D = sum d_i      c = sum n_i p_i / N      w = sum Im((p_i - c)^* d_i) / sum (n_i/N) |p_i - c|^2

so that what is left has neither a sum nor a moment about the vertical: e_i = d_i - (n_i/N)
(D + i w (p_i - c)) is legs squeezing against each other. How the answer reaches the joints is said
in compliance.py.

Discretised by Tustin's rule at the controller's period h:

    e' = (h (e + e-) + (2 T_f - h) e'-) / (2 T_f + h)          force filter
    i  = i- + k_i h/2 (e' + e'-)                               integral
    d  = (2 k_d (e' - e'-) + (2 T_d - h) d-) / (2 T_d + h)     filtered derivative
    u  = k_p e' + i + d
"""

from __future__ import annotations

import numpy as np

from hexapod_cosim.controller.gains import SlipGains
from hexapod_cosim.controller.kinematics import Array, Plane

LOAD_FLOOR = 1e-6  # N    below it no foot carries anything
LEAST_SPREAD = 1e-4  # m2    of the feet about their centre: less takes no moment about the vertical


def squeeze(push: Plane, normal: Array, feet: Plane) -> Plane:
    """(n,) e [N] of tangential forces x + i y on feet that carry normal forces [N] at places
    [m].
    """
    total = normal.sum()
    if total <= LOAD_FLOOR:
        return push
    share = normal / total
    arm = feet - share @ feet
    carried = share * arm
    spread = np.vdot(arm, carried).real
    turn = np.vdot(arm, push).imag / spread if spread >= LEAST_SPREAD else 0.0
    return np.asarray(push - (push.sum() * share + 1j * turn * carried))


def system(gains: SlipGains, *, period: float) -> Array:
    """(5, 5) from the row e-, e'-, i-, d-, e to the row u, e, e', i, d: acts from the right."""
    h, tf, td = period, gains.filter_time, gains.derivative_time
    last, old, integral, slope, force = np.eye(5)
    smooth = (h * (force + last) + (2.0 * tf - h) * old) / (2.0 * tf + h)
    integral = integral + 0.5 * h * gains.ki * (smooth + old)
    slope = (2.0 * gains.kd * (smooth - old) + (2.0 * td - h) * slope) / (2.0 * td + h)
    return np.column_stack([gains.kp * smooth + integral + slope, force, smooth, integral, slope])
