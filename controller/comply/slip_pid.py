"""Computes the slip PID of the paper's control (C25), the same for every foot and direction.

C: slip_pid.c. The PID is discretised by Tustin's rule.
"""

from __future__ import annotations

import numpy as np

from hexapod_cosim.controller.gains import SlipGains
from hexapod_cosim.controller.memory import Stateful
from hexapod_cosim.controller.plane import LEGS, Plane


class SlipPid(Stateful):
    """Slip PIDs of all feet.

    Forces are complex numbers x + i y. The gains are real, so that both directions are treated
    equally and do not mix.
    """

    STATE = ("force", "smooth", "integral", "slope")

    def __init__(self, gains: SlipGains, *, period: float) -> None:
        self.gains, self.period = gains, period
        self.reset()

    def reset(self) -> None:
        """Sets the filtered forces and the integrals of all feet to zero."""
        self.force: Plane = np.zeros(LEGS, dtype=np.complex128)  # N    e of the last period
        self.smooth = self.force  # N    e', filtered
        self.integral = self.force  # N    i
        self.slope = self.force  # N    d, filtered derivative

    def step(self, force: Plane) -> Plane:
        """Advances the PIDs by one period: returns u for forces e (C25), (6,) x + i y [N]."""
        h, gains, old = self.period, self.gains, self.smooth
        tf, td = gains.filter_time, gains.derivative_time
        # e' = (h (e + e-) + (2 T_f - h) e'-)/(2 T_f + h)
        self.smooth = (h * (force + self.force) + (2.0 * tf - h) * old) / (2.0 * tf + h)
        # i = i- + k_i h/2 (e' + e'-)
        self.integral = self.integral + 0.5 * h * gains.ki * (self.smooth + old)
        # d = (2 k_d (e' - e'-) + (2 T_d - h) d-)/(2 T_d + h)
        change = 2.0 * gains.kd * (self.smooth - old)
        self.slope = (change + (2.0 * td - h) * self.slope) / (2.0 * td + h)
        self.force = force
        # u = k_p e' + i + d
        return gains.kp * self.smooth + self.integral + self.slope
