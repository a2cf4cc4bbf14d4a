"""Discretises the virtual suspension m z'' + b z' + k z = f of a foot (C26). C: suspension.c.

f is the normal force, z lifts the foot towards the torso. The force is constant over a period, so
that the discretisation by the matrix exponential is exact.
"""

from __future__ import annotations

import math

import numpy as np

from hexapod_cosim.controller.gains import SuspensionGains
from hexapod_cosim.controller.plane import Array


def discretise(gains: SuspensionGains, *, period: float) -> tuple[Array, Array]:
    """Returns A (2, 2) and B (2,) of x(k+1) = A x(k) + B f(k), x = (z, z') (C26). period: [s].

    The matrix exponential has a closed form. With sigma = b/2m, omega^2 = k/m and
    mu^2 = sigma^2 - omega^2 it is

        z(t)  = e^(-sigma t) ((cosh mu t + sigma sinh(mu t)/mu) z + sinh(mu t)/mu z')
        z'(t) = e^(-sigma t) (-omega^2 sinh(mu t)/mu z + (cosh mu t - sigma sinh(mu t)/mu) z')
    """
    sigma, omega2 = 0.5 * gains.damping / gains.mass, gains.stiffness / gains.mass
    mu2 = sigma * sigma - omega2
    mu, decay = math.sqrt(abs(mu2)), math.exp(-sigma * period)
    x = mu * period
    # even = e^(-sigma t) cosh mu t    odd = e^(-sigma t) sinh(mu t)/mu
    if mu2 < 0.0:
        even, odd = decay * math.cos(x), decay * math.sin(x) / mu
    elif x < 1.0:
        even, odd = decay * math.cosh(x), decay * (math.sinh(x) / mu if x > 0.0 else period)
    else:  # strong damping: written so that neither exponential overflows
        slow, fast = math.exp(-omega2 / (sigma + mu) * period), math.exp(-(mu + sigma) * period)
        even, odd = 0.5 * (slow + fast), 0.5 * (slow - fast) / mu
    a = np.array([[even + sigma * odd, odd], [-omega2 * odd, even - sigma * odd]])
    # step response from rest: z(t) = (1 - a_00) f/k, z'(t) = odd f/m
    b = np.array([(1.0 - a[0, 0]) / gains.stiffness, odd / gains.mass])
    return a, b
