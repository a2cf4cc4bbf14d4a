"""Parametrises the inertia of a body so that all values are those of a possible body.

A body with mass m, first moment h and second moments S about the origin has the pseudo-inertia
[S h; h^T m] (4, 4), which is positive definite for every distribution of mass. It is factored as
U U^T with U = e^a [[e^d1, s12, s13, t1], [0, e^d2, s23, t2], [0, 0, e^d3, t3], [0, 0, 0, 1]], the
log-Cholesky parametrisation of Rucker and Wensing (Smooth parameterization of rigid-body inertia,
IEEE RA-L 2022). Then m = e^2a and the centre of mass is t, and any ten numbers a, d, s, t are those
of one body.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
ORDER = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))  # xx yy zz xy xz yz


@dataclass(frozen=True)
class BodyInertia:
    """Holds the log-Cholesky parameters of a body's inertia."""

    size: float  # a: half the logarithm of the mass in kg
    widths: tuple[float, float, float]  # d: logarithms of lengths in m
    shears: tuple[float, float, float]  # s12 s13 s23 [m]
    com: tuple[float, float, float]  # t [m]

    @property
    def mass(self) -> float:
        """Returns the mass [kg]."""
        return float(np.exp(2.0 * self.size))

    @property
    def inertia(self) -> tuple[float, ...]:
        """Returns the inertia about the centre of mass: xx yy zz xy xz yz [kg m2]."""
        d, (s12, s13, s23) = np.exp(self.widths), self.shears
        factor = np.array([[d[0], s12, s13], [0.0, d[1], s23], [0.0, 0.0, d[2]]])
        second = self.mass * factor @ factor.T  # about the centre of mass
        tensor = np.trace(second) * np.eye(3) - second
        return tuple(float(tensor[place]) for place in ORDER)

    def with_mass(self, mass: float) -> BodyInertia:
        """Returns the body with another mass [kg] and the same shape."""
        return replace(self, size=0.5 * float(np.log(mass)))

    def with_com(self, com: Sequence[float]) -> BodyInertia:
        """Returns the body with another centre of mass [m] and the same inertia about it."""
        x, y, z = (float(value) for value in com)
        return replace(self, com=(x, y, z))

    def scaled(self, factor: float) -> BodyInertia:
        """Returns the body with all its lengths about the centre of mass times a factor > 0."""
        d1, d2, d3 = (width + float(np.log(factor)) for width in self.widths)
        s12, s13, s23 = (shear * factor for shear in self.shears)
        return replace(self, widths=(d1, d2, d3), shears=(s12, s13, s23))


def body_inertia(mass: float, com: Sequence[float], inertia: Sequence[float]) -> BodyInertia:
    """Returns the parameters of a body.

    Args:
        mass: kg, above 0.
        com: centre of mass (3,) [m].
        inertia: about it, xx yy zz xy xz yz [kg m2]; it satisfies the triangle inequality
            strictly.

    Raises ValueError for an inertia of no possible body.
    """
    tensor = np.zeros((3, 3))
    for (i, j), value in zip(ORDER, inertia, strict=True):
        tensor[i, j] = tensor[j, i] = value
    second = (0.5 * np.trace(tensor) * np.eye(3) - tensor) / mass
    try:
        lower = np.linalg.cholesky(second[::-1, ::-1])  # of the reversed matrix: upper U
    except np.linalg.LinAlgError as error:
        raise ValueError(f"no body has the inertia {list(inertia)}") from error
    factor = lower[::-1, ::-1]
    widths, x = np.log(np.diag(factor)), [float(value) for value in com]
    return BodyInertia(
        size=0.5 * float(np.log(mass)),
        widths=(float(widths[0]), float(widths[1]), float(widths[2])),
        shears=(float(factor[0, 1]), float(factor[0, 2]), float(factor[1, 2])),
        com=(x[0], x[1], x[2]),
    )
