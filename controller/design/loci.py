"""Computes the eigenloci of plants with many feet, and the margins of loops (generalised Nyquist).

All feet and directions have the same law l(z), so det(1 + l P) = product of (1 + l lambda_i) over
the eigenvalues lambda_i of the plant's response P. Each eigenlocus times the law is therefore a
loop of one input and one output, and has margins.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import control
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from hexapod_cosim.controller.design.standing import StandingPlant
from hexapod_cosim.controller.plane import Array
from hexapod_cosim.models import Robot

Response = NDArray[np.complex128]
Plants = Mapping[str, StandingPlant]
FindLoci = Callable[[Robot, StandingPlant, Array], tuple[Response, Response]]
SLOWEST = 0.1  # rad/s    lowest frequency of a grid
AT_ONCE = 32  # frequencies whose matrices are in the processor's cache together


def frequencies(period: float, count: int, *, slowest: float = SLOWEST) -> Array:
    """Returns a logarithmic grid (count,) of frequencies up to the Nyquist frequency [rad/s]."""
    return np.geomspace(slowest, math.pi / period * 0.999, count)


def response(system: control.StateSpace, omega: Array) -> Response:
    """Returns C (z I - A)^-1 B + D at z = e^(i omega h): (frequencies, outputs, inputs)."""
    parts = [omega[k : k + AT_ONCE] for k in range(0, len(omega), AT_ONCE)]
    return np.concatenate([_response_at(system, np.exp(1j * part * system.dt)) for part in parts])


def _response_at(system: control.StateSpace, z: NDArray[np.complex128]) -> Response:
    """Returns C (z I - A)^-1 B + D at several z: (len(z), outputs, inputs)."""
    matrices = np.zeros((len(z), *system.A.shape), dtype=np.complex128)
    matrices -= system.A
    diagonal = np.arange(system.nstates)
    matrices[:, diagonal, diagonal] += z[:, None]
    right = np.broadcast_to(system.B.astype(np.complex128), (len(z), *system.B.shape))
    left = system.C.astype(np.complex128)
    return np.asarray(left @ np.linalg.solve(matrices, right) + system.D)


def tracked(values: NDArray[Any]) -> Response:
    """Sorts eigenvalues (frequencies, n) into continuous loci (n, frequencies).

    From one frequency to the next, the sum of the distances within the loci is least.
    """
    loci = values.astype(np.complex128)
    for before, after in pairwise(loci):
        after[:] = after[linear_sum_assignment(np.abs(before[:, None] - after))[1]]
    return np.ascontiguousarray(loci.T)


@dataclass(frozen=True, kw_only=True)
class Loci:
    """Eigenloci of plants on one grid of frequencies."""

    omega: Array  # rad/s
    names: tuple[str, ...]  # of the plant, for each locus
    values: Response  # (loci, frequencies)

    def finer(self, times: int) -> Loci:
        """Returns the loci on a grid with `times` as many frequencies, by linear interpolation."""
        places = np.arange(len(self.omega))
        between = np.linspace(0.0, places[-1], times * len(self.omega))
        values = np.array([np.interp(between, places, locus) for locus in self.values])
        return Loci(
            omega=np.exp(np.interp(between, places, np.log(self.omega))),
            names=self.names,
            values=values,
        )


def all_loci(robot: Robot, plants: Plants, omega: Array, *, of: FindLoci) -> tuple[Loci, Loci]:
    """Returns the tangential and vertical eigenloci of all plants, without the laws.

    of: the function that computes those of one plant.
    """
    found = {name: of(robot, plant, omega) for name, plant in plants.items()}
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
    """Margins of one loop; inf where it has no crossing."""

    gain: float  # dB
    phase: float  # deg
    delay: float  # s
    crossover: float  # rad/s    the highest; 0: none


def critical_size(loops: Response) -> Array:
    """Returns the largest magnitude (n,) at which each loop crosses the negative real axis [1].

    loops: (n, frequencies), interpolated linearly. A loop without a crossing has 0.
    """
    before, after = loops[:, :-1], loops[:, 1:]
    crossed = (before.imag * after.imag < 0.0) & (before.real < 0.0) & (after.real < 0.0)
    part = before.imag / np.where(crossed, before.imag - after.imag, 1.0)
    return np.asarray(
        np.where(crossed, -before.real - part * (after.real - before.real), 0.0).max(axis=1)
    )


def quick_margins(loop: Response, omega: Array) -> LoopMargins:
    """Estimates the margins of a loop (frequencies,) by linear interpolation."""
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
    more = [g for g in gains if g > 1.0]  # factors by which the gain may grow
    delays = np.radians(np.mod(phases, 360.0)) / crossings
    return LoopMargins(
        gain=20.0 * math.log10(min(more)) if more else math.inf,
        phase=float(np.abs(phases).min(initial=math.inf)),
        delay=float(delays.min(initial=math.inf)),
        crossover=float(crossings.max(initial=0.0)),
    )
