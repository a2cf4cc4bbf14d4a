"""The two control loops as python-control systems, linearised about the standing robot and sampled at the controller's period.

Tangential (torso held: the controller gives way to squeezing only, which moves no torso). x foot, u its commanded shift, the servo is
told u and u' (by difference), friction at small slip is a damper c = mu f_n k_t:

    J x'' = -K (x - u) - D (x' - u') - c x'        f = -c x'

Normal. y foot, Z torso over this leg's share m of the mass, u and u' from the suspension, Hertz contact linearised to k_c:

    m_f y'' = -k_c y - K (y - Z - u) - D (y' - Z' - u')        m Z'' = K (y - Z - u) + D (y' - Z' - u')        f = -k_c y

The commands are held over a period and computed one period late, so the zero-order-hold sampling is exact. Both laws are negative
feedback: f answers a shift u with -f, and u = +law(f). Loops are returned as L with 1 + L the characteristic function.
"""

from __future__ import annotations

import math

import control
import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.controller.design.leg import Direction
from hexapod_cosim.controller.gains import SlipGains, SuspensionGains
from hexapod_cosim.controller.kinematics import Array
from hexapod_cosim.controller.suspension import discretise
from hexapod_cosim.models import Robot

Response = NDArray[np.complex128]


def creep_damping(robot: Robot, load: float) -> float:
    """N s/m    c = mu f_n k_t, eq. 5 at small slip, under a normal force [N]"""
    return robot.friction.mu * load * robot.friction.slope


def contact_stiffness(robot: Robot, load: float) -> float:
    """N/m    df/d delta = 3/2 K^(2/3) f^(1/3) of the Hertz contact under a normal force [N]"""
    return float(1.5 * robot.contact.stiffness ** (2.0 / 3.0) * load ** (1.0 / 3.0))


def tangential_plant(direction: Direction, *, creep: float, period: float) -> control.StateSpace:
    """Sampled plant, inputs u, u', output -f."""
    j, d, k = direction.inertia, direction.damping, direction.stiffness
    a = [[0.0, 1.0], [-k / j, -(d + creep) / j]]
    b = [[0.0, 0.0], [k / j, d / j]]
    return control.sample_system(control.ss(a, b, [[0.0, creep]], [[0.0, 0.0]]), period, method="zoh")


def normal_plant(direction: Direction, *, mass: float, contact: float, period: float) -> control.StateSpace:
    """Sampled plant, inputs u, u', output -f; mass: the torso's share over this leg [kg]."""
    foot, d, k = direction.inertia, direction.damping, direction.stiffness
    a = [
        [0.0, 1.0, 0.0, 0.0],
        [-(contact + k) / foot, -d / foot, k / foot, d / foot],
        [0.0, 0.0, 0.0, 1.0],
        [k / mass, d / mass, -k / mass, -d / mass],
    ]
    b = [[0.0, 0.0], [k / foot, d / foot], [0.0, 0.0], [-k / mass, -d / mass]]
    return control.sample_system(control.ss(a, b, [[contact, 0.0, 0.0, 0.0]], [[0.0, 0.0]]), period, method="zoh")


def delay(periods: float, *, period: float) -> control.StateSpace:
    """A delay of whole periods (rounded up) as a discrete system."""
    count = math.ceil(periods)
    return control.ss(control.tf([1.0], [1.0] + [0.0] * count, period))


def slip_law(gains: SlipGains) -> control.TransferFunction:
    """The PID with its force filter in continuous time, force to shift."""
    s = control.tf("s")
    pid = gains.kp + gains.ki / s + gains.kd * s / (gains.derivative_time * s + 1.0)
    return pid / (gains.filter_time * s + 1.0)


def sampled_slip_law(gains: SlipGains, *, period: float) -> control.StateSpace:
    """The PID as it runs (Tustin, part by part), outputs: the shift and its difference quotient."""
    s = control.tf("s")
    smooth = control.sample_system(1.0 / (gains.filter_time * s + 1.0), period, method="bilinear")
    integral = control.sample_system(1.0 / s, period, method="bilinear")
    derivative = control.sample_system(s / (gains.derivative_time * s + 1.0), period, method="bilinear")
    law = control.ss(smooth * (gains.kp + gains.ki * integral + gains.kd * derivative))
    states, identity = law.nstates, np.eye(1)
    # difference quotient (u - u-)/h: one more state, the last shift
    a = np.block([[law.A, np.zeros((states, 1))], [law.C, np.zeros((1, 1))]])
    b = np.vstack([law.B, law.D])
    c = np.block([[law.C, 0.0 * identity], [law.C / period, -identity / period]])
    return control.ss(a, b, c, np.vstack([law.D, law.D / period]), period)


def sampled_slip_response(gains: SlipGains, omega: Array, *, period: float) -> Response:
    """The same in closed form, for searching: (frequencies, 2, 1)."""
    z = np.exp(1j * omega * period)
    s = 2.0 / period * (z - 1.0) / (z + 1.0)
    pid = gains.kp + gains.ki / s + gains.kd * s / (gains.derivative_time * s + 1.0)
    shift = pid / (gains.filter_time * s + 1.0)
    return np.stack([shift, shift * (1.0 - 1.0 / z) / period], axis=1)[:, :, None]


def sampled_suspension(gains: SuspensionGains, *, period: float) -> control.StateSpace:
    """The suspension as it runs: x+ = A x + B f and the new state is used at once; outputs z, z'."""
    a, b = discretise(gains, period=period)
    return control.ss(a, b.reshape(2, 1), a, b.reshape(2, 1), period)


def frequencies(period: float) -> Array:
    """rad/s    a logarithmic grid up to the Nyquist frequency"""
    return np.geomspace(0.05, math.pi / period * 0.999, 1000)


def response(system: control.StateSpace, omega: Array, *, period: float) -> Response:
    """C (z I - A)^-1 B + D at z = e^(i omega h), all frequencies at once: (frequencies, outputs, inputs)."""
    z = np.exp(1j * omega * period)[:, None, None]
    states = np.asarray(system.A).shape[0]
    if states == 0:
        return np.broadcast_to(np.asarray(system.D), (len(omega), *np.shape(system.D))).astype(np.complex128)
    right = np.broadcast_to(np.asarray(system.B, dtype=np.complex128), (len(omega), *np.shape(system.B)))
    return np.asarray(system.C @ np.linalg.solve(z * np.eye(states) - np.asarray(system.A), right) + system.D)


def quick_margins(loop: Response) -> tuple[float, float]:
    """Gain margin [dB] and phase margin [deg] of a loop (frequencies,) by linear interpolation; inf where there is no crossing."""
    size, angle = np.abs(loop), np.angle(loop)
    crossed = np.flatnonzero((angle[:-1] * angle[1:] < 0.0) & (loop.real[:-1] < 0.0) & (loop.real[1:] < 0.0))
    part = loop.imag[crossed] / (loop.imag[crossed] - loop.imag[crossed + 1])
    real = np.abs(loop.real[crossed] + part * (loop.real[crossed + 1] - loop.real[crossed]))
    unity = np.flatnonzero((size[:-1] - 1.0) * (size[1:] - 1.0) < 0.0)
    part = np.log(size[unity]) / (np.log(size[unity]) - np.log(size[unity + 1]))
    gap = np.abs(np.angle(-loop))
    phase = gap[unity] + part * (gap[unity + 1] - gap[unity])
    return -20.0 * math.log10(real.max(initial=1e-30)) if len(real) else math.inf, math.degrees(phase.min()) if len(phase) else math.inf


def loop_margins(loop: control.StateSpace, *, period: float) -> tuple[float, float, float]:
    """Gain margin [dB], phase margin [deg] and crossover [rad/s] by python-control; inf or nan where there is no crossing."""
    omega = frequencies(period)
    data = control.frd(response(loop, omega, period=period)[:, 0, 0], omega, smooth=True)
    gain, phase, _, _, crossover, _ = control.stability_margins(data)
    return (
        20.0 * math.log10(gain) if 0.0 < gain < math.inf else math.inf,
        float(phase) if math.isfinite(phase) else math.inf,
        float(crossover),
    )
