"""Computes the disk margin of all loops together: every foot's gain and phase may change at once.

An eigenlocus has the margins of a change that is the same for all feet. The multi-loop disk margin
holds for changes that differ from channel to channel: each measured force is multiplied by its own
complex factor f = (1 + d/2)/(1 - d/2), |d| < alpha. The loop stays stable when alpha is below
1/mu(S - I/2), with S the sensitivity at the measured forces (Seiler, Packard, Gahinet: An
introduction to disk margins, IEEE Control Systems 40(5), 2020, skew 0). mu is bounded from above by
diagonal scaling, so the margin that is returned is safe.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import control
import numpy as np

from hexapod_cosim.controller.design.closed import compliant_law
from hexapod_cosim.controller.design.laws import Laws
from hexapod_cosim.controller.design.loci import Response, frequencies, response
from hexapod_cosim.controller.design.standing import StandingPlant, relieved
from hexapod_cosim.controller.plane import Array
from hexapod_cosim.models import Robot

COUNT = 200  # frequencies
SCALINGS = 30  # iterations of the diagonal scaling; it converges linearly


@dataclass(frozen=True)
class DiskMargin:
    """The least multi-loop disk margin over frequency, and where it lies."""

    alpha: float  # 1    radius of the disk
    frequency: float  # rad/s    at which it is least

    @property
    def gain(self) -> float:
        """The factor [dB] by which each gain may grow or shrink; infinite from alpha = 2 on."""
        half = 0.5 * self.alpha
        return 20.0 * math.log10((1.0 + half) / (1.0 - half)) if half < 1.0 else math.inf

    @property
    def phase(self) -> float:
        """The angle [deg] by which each phase may change."""
        return math.degrees(2.0 * math.atan(0.5 * self.alpha))


def disk_margin(loops: Response, omega: Array) -> DiskMargin:
    """Returns the disk margin of loops (frequencies, n, n) under negative feedback.

    omega: (frequencies,) [rad/s].
    """
    one = np.eye(loops.shape[-1])
    bounds = np.array([scaled_norm(np.linalg.inv(one + loop) - 0.5 * one) for loop in loops])
    worst = int(bounds.argmax())
    return DiskMargin(float(1.0 / bounds[worst]), float(omega[worst]))


def scaled_norm(matrix: Any) -> float:
    """Returns an upper bound of mu of a matrix (n, n) for one complex factor in each channel.

    It is the largest singular value after Osborne's scaling, which makes the norms of each row and
    column without their diagonal element equal, or that of the matrix itself if this is less.
    """
    size = np.abs(matrix) ** 2
    np.fill_diagonal(size, 0.0)
    scale = np.ones(len(matrix))
    for _ in range(SCALINGS):
        for k in range(len(scale)):
            row = scale[k] ** 2 * (size[k] / scale**2).sum()
            column = (size[:, k] * scale**2).sum() / scale[k] ** 2
            if row > 0.0 and column > 0.0:
                scale[k] *= (column / row) ** 0.25
    plain = np.linalg.norm(matrix, 2)
    return float(min(plain, np.linalg.norm(scale[:, None] * matrix / scale, 2)))


def all_feet(robot: Robot, plant: StandingPlant, laws: Laws) -> DiskMargin:
    """Returns the disk margin of all forces of all standing feet, both laws closed together."""
    omega = frequencies(laws.period, COUNT)
    law: control.StateSpace = compliant_law(robot, plant, laws)
    return disk_margin(-response(relieved(robot, plant), omega) @ response(law, omega), omega)
