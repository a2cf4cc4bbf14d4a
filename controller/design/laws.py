"""Builds both laws as discrete python-control systems, with the delays of sensors and computing."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import control
import numpy as np

from hexapod_cosim.controller.design.loci import Response, response
from hexapod_cosim.controller.gains import Requirements, SlipGains, SuspensionGains
from hexapod_cosim.controller.plane import Array

ROUNDING = 1e-9  # 1    of a period


def slip_law(gains: SlipGains) -> control.TransferFunction:
    """Returns the PID with its force filter in continuous time, from force to force."""
    s = control.tf("s")
    pid = gains.kp + gains.ki / s + gains.kd * s / (gains.derivative_time * s + 1.0)
    return pid / (gains.filter_time * s + 1.0)


def sampled_slip_law(gains: SlipGains, *, period: float) -> control.StateSpace:
    """Returns the PID as the controller runs it, discretised part by part by Tustin's rule."""
    s = control.tf("s")
    smooth = control.sample_system(1.0 / (gains.filter_time * s + 1.0), period, method="bilinear")
    integral = control.sample_system(1.0 / s, period, method="bilinear")
    derivative = control.sample_system(
        s / (gains.derivative_time * s + 1.0), period, method="bilinear"
    )
    return control.ss(smooth * (gains.kp + gains.ki * integral + gains.kd * derivative))


def slip_response(gains: SlipGains, omega: Array, *, period: float) -> Response:
    """Returns the frequency response (frequencies,) of sampled_slip_law() in closed form.

    omega: frequencies [rad/s].
    """
    z = np.exp(1j * omega * period)
    s = 2.0 / period * (z - 1.0) / (z + 1.0)
    pid = gains.kp + gains.ki / s + gains.kd * s / (gains.derivative_time * s + 1.0)
    return np.asarray(pid / (gains.filter_time * s + 1.0))


def sampled_suspension(gains: SuspensionGains, *, period: float) -> control.StateSpace:
    """Returns the suspension as the controller runs it, from force to deflection.

    x+ = A x + B f, and the output is the new deflection. The matrix exponential is scipy's, so that
    it is independent of suspension.discretise().
    """
    from scipy.linalg import expm  # noqa: PLC0415  slow to import

    system = np.zeros((3, 3))
    system[0, 1] = 1.0
    system[1] = np.array([-gains.stiffness, -gains.damping, 1.0]) / gains.mass
    step = expm(system * period)
    a, b = step[:2, :2].copy(), step[:2, 2].copy()
    return control.ss(a, b.reshape(2, 1), a[:1], b[:1].reshape(1, 1), period)


def delay_steps(needs: Requirements, *, period: float) -> int:
    """Returns the delay from a force to the command that responds to it, in whole periods."""
    return math.ceil(needs.delay_periods - ROUNDING) + math.ceil(
        needs.force_delay / period - ROUNDING
    )


def delay_response(steps: int, omega: Array, *, period: float) -> Response:
    """Returns the frequency response (frequencies,) of a delay of whole periods."""
    return np.asarray(np.exp(-1j * omega * period * steps))


def delay(steps: int, *, period: float) -> control.StateSpace:
    """Returns a delay of whole periods as a system."""
    chain = np.eye(steps, k=-1)
    if not steps:
        return control.ss([], [], [], [[1.0]], period)
    return control.ss(chain, np.eye(steps)[:, :1], np.eye(steps)[-1:], 0, period)


@dataclass(frozen=True, kw_only=True)
class Laws:
    """Both laws with a period [s], delayed by `delays` periods."""

    slip: SlipGains
    suspension: SuspensionGains
    period: float
    delays: int

    @cached_property
    def systems(self) -> tuple[control.StateSpace, control.StateSpace]:
        """Returns the PID and the suspension as the controller runs them, without the delay."""
        return sampled_slip_law(self.slip, period=self.period), sampled_suspension(
            self.suspension, period=self.period
        )

    def responses(self, omega: Array) -> tuple[Response, Response]:
        """Returns the frequency responses (frequencies,) of PID and suspension, with the delay."""
        late = delay_response(self.delays, omega, period=self.period)
        spring = response(sampled_suspension(self.suspension, period=self.period), omega)[:, 0, 0]
        return slip_response(self.slip, omega, period=self.period) * late, spring * late
