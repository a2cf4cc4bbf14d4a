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

from collections.abc import Sequence

from hexapod_cosim.controller.gains import SlipGains
from hexapod_cosim.controller.kinematics import LEGS

AT_REST = (0j, 0j, 0j, 0j)
LegState = tuple[complex, complex, complex, complex]  # e, e', i, d


def coefficients(gains: SlipGains, *, period: float) -> tuple[float, ...]:
    """The numbers in e' = take (e + e-) + keep e'-, i = i- + gather (e' + e'-), d = taken (e' - e'-) + kept d-, u = k_p e' + i + d."""
    h, tf, td = period, gains.filter_time, gains.derivative_time
    smoothing = h / (2.0 * tf + h), (2.0 * tf - h) / (2.0 * tf + h)
    return *smoothing, 0.5 * gains.ki * h, 2.0 * gains.kd / (2.0 * td + h), (2.0 * td - h) / (2.0 * td + h), gains.kp


class SlipPid:
    """PIDs of all feet. Both directions at once: forces and shifts are complex numbers x + i y, one per leg.

    In Python's own numbers, which for six legs take less time than arrays.

    Attributes: output: foot shifts [m]; state: of each leg e, e', integral, derivative.
    """

    def __init__(self, gains: SlipGains, *, period: float) -> None:
        self._coefficients = coefficients(gains, period=period)
        self._tracking, self._limit = min(period / gains.tracking_time, 1.0), gains.limit
        self.state: list[LegState] = [AT_REST] * LEGS
        self.output = [0j] * LEGS

    def reset(self, legs: Sequence[bool] = (True,) * LEGS) -> None:
        """Forgets everything, of the legs chosen or of all."""
        self.state = [AT_REST if chosen else state for state, chosen in zip(self.state, legs, strict=True)]
        self.output = [0j if chosen else shift for shift, chosen in zip(self.output, legs, strict=True)]

    def step(self, force: Sequence[complex]) -> list[complex]:
        """One period. force: of each leg, tangential, to give way to [N]. Returns `output`, the foot shifts [m]."""
        take, keep, gather, taken, kept, kp = self._coefficients
        states, output = [], []
        for f, (last, old, sum_before, slope_before) in zip(force, self.state, strict=True):
            smooth = take * (f + last) + keep * old
            integral = sum_before + gather * (smooth + old)
            derivative = taken * (smooth - old) + kept * slope_before
            states.append((f, smooth, integral, derivative))
            output.append(kp * smooth + integral + derivative)
        self.state, self.output = states, output
        if max(map(abs, output)) > self._limit:
            self._clamp()
        return self.output

    def _clamp(self) -> None:
        wanted = self.output
        self.output = [u * (self._limit / max(abs(u), self._limit)) for u in wanted]
        excess = [self._tracking * (clamped - u) for clamped, u in zip(self.output, wanted, strict=True)]
        self.state = [(e, smooth, i + more, d) for (e, smooth, i, d), more in zip(self.state, excess, strict=True)]
