"""Checks masses and inertias of bodies."""

from __future__ import annotations

import math

import numpy as np

from hexapod_cosim.models.errors import RobotError
from hexapod_cosim.models.kinematics import inertia_matrix

# a thin rod satisfies the triangle inequality with equality; rounding to four digits may violate it
INERTIA_ROUNDING = 1e-3


def check_inertia(mass: float, inertia: tuple[float, ...], extent: float, where: str) -> None:
    """Checks the inertia of a body. Raises RobotError.

    It must be positive definite, its principal moments must satisfy the triangle inequality, and
    its radius of gyration must be at most `extent` [m].
    """
    moments = np.linalg.eigvalsh(inertia_matrix(inertia))
    shown = [float(f"{moment:.4g}") for moment in moments]
    fix = "check units (kg m2), the reference point (centre of mass) and the signs of the products"
    if moments[0] <= 0.0:
        what = "inertia not positive definite"
        expected = "principal moments > 0"
        raise RobotError(what, got=shown, expected=expected, fix=fix, where=where + ".inertia")
    if moments[0] + moments[1] < (1.0 - INERTIA_ROUNDING) * moments[2]:
        expected = "principal moments of which no one exceeds the sum of the others"
        what = "inertia of no possible body"
        raise RobotError(what, got=shown, expected=expected, fix=fix, where=where + ".inertia")
    radius = math.sqrt(float(moments.sum()) / (2.0 * mass))
    if radius > extent:
        expected = f"a radius of gyration of at most {extent:.3g} m for matter of this extent"
        what = "inertia too large for the mass"
        got = f"{radius:.3g} m"
        raise RobotError(what, got=got, expected=expected, fix=fix, where=where + ".inertia")


def check_com(com: tuple[float, ...], extent: float, where: str) -> None:
    """Raises RobotError for a centre of mass further than `extent` [m] from its frame."""
    if math.hypot(*com) > extent:
        what = "centre of mass outside the body"
        expected = f"within {extent:.3g} m of the frame"
        fix = "check the unit (m)"
        raise RobotError(what, got=com, expected=expected, fix=fix, where=where + ".com")
