"""Loops of many feet that share one law: the law times an eigenvalue of the plant, at every
frequency (generalised Nyquist).

All feet and directions have the same law l(z), so det(1 + l P) = product of (1 + l lambda_i) over
the eigenvalues of the plant's response P: every eigenlocus is a loop of one input and one output,
and has margins.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import control
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from hexapod_cosim.controller.design.standing import (
    StandingPlant,
    answers,
    axes_of,
    relieved,
    squeeze_matrix,
)
from hexapod_cosim.controller.plane import Array
from hexapod_cosim.models import Robot

Response = NDArray[np.complex128]
Plants = Mapping[str, StandingPlant]
SLOWEST = 0.1  # rad/s
RANK = 1e-6  # 1    of a singular value


def frequencies(period: float, count: int, *, slowest: float = SLOWEST) -> Array:
    """rad/s    a logarithmic grid up to the Nyquist frequency"""
    return np.geomspace(slowest, math.pi / period * 0.999, count)


def response(system: control.StateSpace, omega: Array) -> Response:
    """C (z I - A)^-1 B + D at z = e^(i omega h), all frequencies at once: (frequencies, outputs,
    inputs).
    """
    z = np.exp(1j * omega * system.dt)[:, None, None]
    states = system.nstates
    right = np.broadcast_to(system.B.astype(np.complex128), (len(omega), *system.B.shape))
    return np.asarray(system.C @ np.linalg.solve(z * np.eye(states) - system.A, right) + system.D)


def eigenloci(robot: Robot, plant: StandingPlant, omega: Array) -> tuple[Response, Response]:
    """Of a standing plant, as loops of negative feedback: tangential (2 n - 3, frequencies) and
    vertical (n, frequencies) [N/m].

    The common push and twist of all feet are no squeeze and have no locus.
    """
    answer = response(relieved(robot, plant), omega)
    loads, vertical = answers(robot, plant)
    flat, up = axes_of(len(loads))
    fight = squeeze_matrix(robot, plant)
    left, size, _ = np.linalg.svd(fight)
    basis = left[:, size > RANK]
    tangential = basis.T @ fight @ answer[:, flat][:, :, flat] * np.repeat(loads, 2) @ basis
    return tracked(np.linalg.eigvals(-tangential)), tracked(
        np.linalg.eigvals(-answer[:, up][:, :, up] * vertical)
    )


def tracked(values: NDArray[Any]) -> Response:
    """Eigenvalues (frequencies, n) as continuous loci (n, frequencies): each goes on with the
    nearest.
    """
    loci = values.astype(np.complex128)
    for before, here in pairwise(loci):
        here[:] = here[linear_sum_assignment(np.abs(before[:, None] - here))[1]]
    return np.ascontiguousarray(loci.T)


@dataclass(frozen=True, kw_only=True)
class Loci:
    """Eigenloci of plants on one grid of frequencies."""

    omega: Array  # rad/s
    names: tuple[str, ...]  # of the plant, for each locus
    values: Response  # (loci, frequencies)

    def finer(self, times: int) -> Loci:
        """With as many times the frequencies, by linear interpolation."""
        places = np.arange(len(self.omega))
        between = np.linspace(0.0, places[-1], times * len(self.omega))
        values = np.array([np.interp(between, places, locus) for locus in self.values])
        return Loci(
            omega=np.exp(np.interp(between, places, np.log(self.omega))),
            names=self.names,
            values=values,
        )


def all_loci(robot: Robot, plants: Plants, omega: Array) -> tuple[Loci, Loci]:
    """Tangential and vertical eigenloci of all plants, without the laws: the plants' own change
    slowly with the frequency.
    """
    found = {name: eigenloci(robot, plant, omega) for name, plant in plants.items()}
    tangential, vertical = (
        Loci(
            omega=omega, names=tuple(name for name, loci in found.items() for _ in loci[which]),
            values=np.concatenate([loci[which] for loci in found.values()]),
        )
        for which in (0, 1)
    )  # fmt: skip
    return tangential, vertical


@dataclass(frozen=True, kw_only=True)
class LoopMargins:
    """Of one loop; inf where it has no crossing."""

    gain: float  # dB
    phase: float  # deg
    delay: float  # s
    crossover: float  # rad/s    the highest; 0: none


def critical_size(loops: Response) -> Array:
    """1    (n,) largest size of each loop (n, frequencies) where it crosses the negative real
    axis, by linear interpolation; 0: nowhere
    """
    before, after = loops[:, :-1], loops[:, 1:]
    crossed = (before.imag * after.imag < 0.0) & (before.real < 0.0) & (after.real < 0.0)
    part = before.imag / np.where(crossed, before.imag - after.imag, 1.0)
    return np.asarray(
        np.where(crossed, -before.real - part * (after.real - before.real), 0.0).max(axis=1)
    )


def quick_margins(loop: Response, omega: Array) -> LoopMargins:
    """Margins of a loop (frequencies,) by linear interpolation."""
    size, gap, critical = np.abs(loop), np.abs(np.angle(-loop)), float(critical_size(loop[None])[0])
    unity = np.flatnonzero((size[:-1] - 1.0) * (size[1:] - 1.0) < 0.0)
    part = np.log(size[unity]) / (np.log(size[unity]) - np.log(size[unity + 1]))
    phase, at = (
        gap[unity] + part * (gap[unity + 1] - gap[unity]),
        omega[unity] * (omega[unity + 1] / omega[unity]) ** part,
    )
    lag = np.mod(np.angle(loop[unity]) + math.pi, 2.0 * math.pi)
    return LoopMargins(
        gain=-20.0 * math.log10(critical) if critical else math.inf,
        phase=math.degrees(phase.min(initial=math.inf)),
        delay=float((lag / at).min(initial=math.inf)),
        crossover=float(at.max(initial=0.0)),
    )


def loop_margins(loop: Response, omega: Array) -> LoopMargins:
    """Returns the margins of one loop, as python-control computes them."""
    data = control.frd(loop, omega, smooth=True)
    gains, phases, _, _, crossings, _ = control.stability_margins(data, returnall=True)
    more = [g for g in gains if g > 1.0]  # the gain that may come on top
    delays = np.radians(np.mod(phases, 360.0)) / crossings
    return LoopMargins(
        gain=20.0 * math.log10(min(more)) if more else math.inf,
        phase=float(np.abs(phases).min(initial=math.inf)),
        delay=float(delays.min(initial=math.inf)),
        crossover=float(crossings.max(initial=0.0)),
    )
