"""Computes the slip PID: tangential forces on the feet to forces by which the legs yield.

C: slip_pid.c. Standing legs squeeze each other through the ground. A leg that yields reduces the
tangential force f on its foot, and with it the creep f/(mu f_n k_t). Forces that move the body must
remain. So the PID acts on the squeeze alone (C24): the part of the tangential forces above the plan
whose sum and moment about the vertical are zero. The PID is the same for every foot and direction
(C25) and is discretised by Tustin's rule. Equation C28 turns its force into joint angles.
"""

from __future__ import annotations

import numpy as np

from hexapod_cosim.controller.gains import SlipGains
from hexapod_cosim.controller.memory import Stateful
from hexapod_cosim.controller.plane import LEGS, Array, Plane, along, square

LOAD_FLOOR = 1e-6  # N    a smaller sum of loads cannot be divided by
LEAST_SPREAD = 1e-4  # m2    mean square distance of the feet from their centre: below it no twist


def squeeze(push: Plane, normal: Array, feet: Plane) -> Plane:
    """Subtracts the common push and twist, shared by load, from tangential forces (C24).

    Args:
        push: (n,) tangential forces x + i y beyond the planned ones [N].
        normal: (n,) normal forces on the feet [N].
        feet: (n,) places of the feet, x + i y [m].

    Returns:
        (n,) the squeeze e, x + i y [N].
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


def missing_share(found: Plane, planned: Plane) -> float:
    """Returns the share of the planned squeeze that creep has taken away, in [0, 1] (C46).

    found: (6,) squeeze above the planned one [N]; planned: (6,) [N]. Without planned squeeze it is
    0.
    """
    whole = float(square(planned).sum())
    if whole <= LOAD_FLOOR:
        return 0.0
    return min(max(-float(along(planned, found).sum()) / whole, 0.0), 1.0)


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
