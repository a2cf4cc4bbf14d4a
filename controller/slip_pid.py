"""The law against slip: one discrete PID per foot and direction, from tangential force to foot shift.

A foot that the ground pushes by f while the leg holds it is being squeezed against its neighbours or dragged. Giving way, in the
direction of the force, takes the load off the contact and with it the creep f/(mu f_n k_t): so the shift is +PID(f). The controller
decides which part of the force is to be given way to (controller.py).

Discretised by Tustin's rule at the controller's period h:

    e' = (h (e + e-) + (2 T_f - h) e'-) / (2 T_f + h)          force filter
    i  = i- + k_i h/2 (e' + e'-) + h/T_t (clamped - wanted)-   integral, with back-calculation of the clamp
    d  = (2 k_d (e' - e'-) + (2 T_d - h) d-) / (2 T_d + h)     filtered derivative
    u  = clamp(k_p e' + i + d)                                 of the shift's length, direction kept
"""

from __future__ import annotations

import numpy as np

from hexapod_cosim.controller.gains import SlipGains
from hexapod_cosim.controller.kinematics import LEGS, Array, Mask, Plane


def recursion(gains: SlipGains, *, period: float) -> Array:
    """(5, 5) one period of the law: (e, e', i, d, u) from (e-, e'-, i-, d-, e)."""
    h, tf, td = period, gains.filter_time, gains.derivative_time
    take, keep = h / (2.0 * tf + h), (2.0 * tf - h) / (2.0 * tf + h)
    taken, kept = 2.0 * gains.kd / (2.0 * td + h), (2.0 * td - h) / (2.0 * td + h)
    last, old, integral, derivative, force = np.eye(5)
    smooth = take * (force + last) + keep * old
    integral = integral + 0.5 * gains.ki * h * (smooth + old)
    derivative = taken * (smooth - old) + kept * derivative
    return np.stack([force, smooth, integral, derivative, gains.kp * smooth + integral + derivative])


class SlipPid:
    """PIDs of all feet. Both directions at once: forces and shifts are complex numbers x + i y, one per leg.

    Attributes: output: (6,) foot shift [m]; state: (4, 6) rows e, e', integral, derivative.
    """

    def __init__(self, gains: SlipGains, *, period: float) -> None:
        self._step = recursion(gains, period=period)
        self._tracking, self._limit = min(period / gains.tracking_time, 1.0), gains.limit
        self._before, self._after = np.zeros((2, 5, LEGS), dtype=np.complex128)
        self._before_parts, self._after_parts = self._before.view(np.float64), self._after.view(np.float64)
        self.state: Plane = self._after[:4]
        self.output: Plane = self._after[4]

    def reset(self, legs: Mask | None = None) -> None:
        """Forgets everything, of the legs (6,) given or of all."""
        np.copyto(self._after, 0.0, where=True if legs is None else legs)

    def step(self, force: Plane) -> Plane:
        """One period. force: (6,) tangential force to give way to [N]. Returns `output`, the foot shift [m]."""
        self._before[:4] = self.state
        self._before[4] = force
        np.dot(self._step, self._before_parts, self._after_parts)
        self._clamp()
        return self.output

    def _clamp(self) -> None:
        length = np.abs(self.output)
        if max(length.tolist()) <= self._limit:
            return
        wanted = self.output.copy()
        self.output *= self._limit / np.maximum(length, self._limit)
        self.state[2] += self._tracking * (self.output - wanted)
