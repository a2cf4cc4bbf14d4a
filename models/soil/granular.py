"""Computes the resistance of granular media to plates by direction (resistive force theory).

The stress on a plate at depth |z| is sigma_{z,x} = zeta alpha_{z,x}(beta, gamma) |z|, with the
plate's angle beta (0: horizontal) and the angle gamma of its motion (90 deg: straight down). Plane
form of Li, Zhang and Goldman 2013; angles in rad, alpha in the unit of its coefficients.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

from hexapod_cosim.models.schema import Number

Coefficient = Annotated[float, Number("N/cm^3")]


@dataclass(frozen=True, kw_only=True)
class Coefficients:
    """Fourier coefficients of alpha_z and alpha_x of a medium."""

    A00: Coefficient
    A10: Coefficient
    B11: Coefficient
    B01: Coefficient
    Bm11: Coefficient
    C11: Coefficient
    C01: Coefficient
    Cm11: Coefficient
    D10: Coefficient


def _forward(beta: float, gamma: float) -> tuple[float, float, float]:
    """Returns the mirrored angles with |gamma| <= pi/2, and the sign of alpha_x."""
    if abs(gamma) <= math.pi / 2:
        return beta, gamma, 1.0
    return -beta, math.copysign(math.pi, gamma) - gamma, -1.0


def alpha_z(medium: Coefficients, beta: float, gamma: float) -> float:
    """Returns the vertical stress per depth of a plate, > 0 upwards."""
    b, g, _ = _forward(beta, gamma)
    even = medium.A00 + medium.A10 * math.cos(2 * b) + medium.B01 * math.sin(g)
    return even + medium.B11 * math.sin(2 * b + g) + medium.Bm11 * math.sin(-2 * b + g)


def alpha_x(medium: Coefficients, beta: float, gamma: float) -> float:
    """Returns the horizontal stress per depth of a plate, > 0 against its motion ahead."""
    b, g, sign = _forward(beta, gamma)
    odd = medium.C01 * math.cos(g) + medium.D10 * math.sin(2 * b)
    return sign * (odd + medium.C11 * math.cos(2 * b + g) + medium.Cm11 * math.cos(-2 * b + g))


def foot_resistances(medium: Coefficients) -> dict[str, float]:
    """Returns what a soil's law needs of the medium, by the fields of `Soil`.

    alpha_down and alpha_side of plates moving down, alpha_ahead of a plate on edge moving ahead,
    and the friction angle of a horizontal plate moving ahead, atan(alpha_x/alpha_z).
    """
    down, side = alpha_z(medium, 0.0, math.pi / 2), alpha_z(medium, math.pi / 2, math.pi / 2)
    ahead = alpha_x(medium, math.pi / 2, 0.0)
    angle = math.atan2(alpha_x(medium, 0.0, 0.0), alpha_z(medium, 0.0, 0.0))
    return {
        "alpha_down": down,
        "alpha_side": side,
        "alpha_ahead": ahead,
        "friction_angle": angle,
    }
