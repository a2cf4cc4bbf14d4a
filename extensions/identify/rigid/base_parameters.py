"""Finds which combinations of inertial parameters the equations of motion hold, and their values.

Some parameters have no effect on the equations and others only in combination. The columns of the
regressor at motions drawn at random tell which: a QR factorisation with column pivoting picks as
many independent columns as its rank, and what the other columns are of these gives the
combinations, the base parameters (Gautier, Numerical calculation of the base inertial parameters of
robots, Journal of Robotic Systems 1991).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.extensions.identify.rigid.regressor import (
    EQUATIONS,
    GROUPS,
    PARAMETERS,
    Motion,
    body_parameters,
    frames,
    regressor,
)
from hexapod_cosim.models import JOINT_NAMES, Robot
from hexapod_cosim.models.kinematics import JOINTS, LEGS, rotation_matrix

Array = NDArray[np.float64]
RANK = 1e-9  # of the largest singular value: smaller ones are rounding errors
DRAWN = 40  # motions, each with 24 equations
NAMES = tuple(
    f"{body}.{name}"
    for body in ("torso", *JOINT_NAMES)
    for name in ("m", "mx", "my", "mz", "Jxx", "Jyy", "Jzz", "Jxy", "Jxz", "Jyz")
)
UNITS = ("kg", *["kg m"] * 3, *["kg m2"] * 6)
SMALLEST = 1e-9  # coefficient of a combination that is written


@dataclass(frozen=True)
class Base:
    """The base parameters of a kind of robot."""

    columns: tuple[int, ...]  # of the regressor, one for each base parameter
    combinations: Array  # (base parameters, 40): their coefficients of all parameters

    def names(self) -> list[str]:
        """Returns the combinations as texts."""
        pairs = zip(self.columns, self.combinations, strict=True)
        return [_text(column, row) for column, row in pairs]

    def values(self, parameters: Array) -> Array:
        """Returns the base parameters of the parameters (40,) of torso and links."""
        return np.asarray(self.combinations @ parameters)


def _text(column: int, row: Array) -> str:
    """Returns a combination as a sum, its own parameter first."""
    others = [k for k in np.flatnonzero(np.abs(row) > SMALLEST).tolist() if k != column]
    words = [NAMES[column]]
    for k in others:
        size = abs(row[k])
        factor = "" if abs(size - 1.0) < SMALLEST else f"{size:.4g} "
        words.append(f"{'+' if row[k] > 0.0 else '-'} {factor}{NAMES[k]}")
    return " ".join(words)


def drawn_motion(robot: Robot, count: int, seed: int = 0) -> Motion:
    """Returns motions at random about the stance."""
    rng = np.random.default_rng(seed)
    quaternions = np.array([1.0, 0.0, 0.0, 0.0]) + rng.normal(0.0, 0.3, (count, 4))
    joints = (count, LEGS, JOINTS)
    return Motion(
        angle=robot.stance + rng.normal(0.0, 0.5, joints),
        speed=rng.normal(0.0, 2.0, joints),
        acceleration=rng.normal(0.0, 10.0, joints),
        spin=rng.normal(0.0, 1.0, (count, 3)),
        spin_rate=rng.normal(0.0, 10.0, (count, 3)),
        lift=rng.normal(0.0, 5.0, (count, 3)) + np.array([0.0, 0.0, 9.81]),
        turn=np.array([rotation_matrix(p) for p in quaternions]),
    )


@lru_cache(maxsize=8)
def base_of(robot: Robot) -> Base:
    """Returns the base parameters of a robot, which follow from its lengths and axes."""
    from scipy.linalg import qr, solve_triangular  # noqa: PLC0415  slow to import

    drawn = regressor(frames(robot, drawn_motion(robot, DRAWN)))
    matrix = drawn.reshape(DRAWN * EQUATIONS, GROUPS * PARAMETERS)
    size = np.linalg.norm(matrix, axis=0)
    scale = np.where(size > 0.0, size, 1.0)
    _, upper, order = qr(matrix / scale, mode="economic", pivoting=True)
    diagonal = np.abs(np.diag(upper))
    rank = int(np.sum(diagonal > RANK * diagonal[0]))
    others = solve_triangular(upper[:rank, :rank], upper[:rank, rank:])
    combinations = np.zeros((rank, len(order)))
    combinations[np.arange(rank), order[:rank]] = 1.0
    # coefficients of the columns as they are, not at unit length
    combinations[:, order[rank:]] = others * scale[order[rank:]] / scale[order[:rank]][:, None]
    combinations[np.abs(combinations) < SMALLEST] = 0.0
    sorted_rows = np.argsort(order[:rank])
    columns = tuple(int(order[k]) for k in sorted_rows)
    return Base(columns, combinations[sorted_rows])


def group_parameters(robot: Robot) -> Array:
    """Returns the parameters (40,) of the torso and of the first leg's links."""
    return body_parameters(robot)[: 1 + JOINTS].ravel()


@dataclass(frozen=True)
class BaseEstimate:
    """Base parameters found by least squares, as what they differ by from the robot file's."""

    names: Sequence[str]
    units: Sequence[str]
    before: Array  # of the robot file
    values: Array
    deviations: Array  # standard
    condition: float  # of the scaled columns


def least_squares_base(base: Base, robot: Robot, matrix: Array, right: Array) -> BaseEstimate:
    """Returns the base parameters that equations tell.

    Args:
        base: of the robot.
        robot: as the robot file has it.
        matrix: equations in units of their noise (equations, 40 + others), first the columns of
            the inertial parameters, then those of numbers that are found besides.
        right: what the equations leave at the robot file's parameters (equations,).
    """
    columns = [*base.columns, *range(GROUPS * PARAMETERS, matrix.shape[1])]
    own = matrix[:, columns]
    size = np.linalg.norm(own, axis=0)
    scale = np.where(size > 0.0, size, 1.0)
    left, singular, turned = np.linalg.svd(own / scale, full_matrices=False)
    kept = singular > RANK * singular[0]
    inverse = np.where(kept, 1.0 / np.where(kept, singular, 1.0), 0.0)
    found = (turned.T * inverse) @ (left.T @ right) / scale
    free = max(len(right) - int(kept.sum()), 1)
    misfit = right - own @ found
    covariance = (turned.T * inverse**2) @ turned * float(misfit @ misfit) / free
    deviations = np.sqrt(np.diag(covariance)) / scale
    # a parameter with a part in directions that the equations do not hold is not told
    lost = (turned[~kept] ** 2).sum(axis=0) > RANK
    count = len(base.columns)
    before = base.values(group_parameters(robot))
    return BaseEstimate(
        names=base.names(),
        units=[UNITS[column % PARAMETERS] for column in base.columns],
        before=before,
        values=before + found[:count],
        deviations=np.where(lost, np.inf, deviations)[:count],
        condition=float(singular[0] / singular[kept][-1]),
    )
