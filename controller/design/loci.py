"""Computes frequency responses and the eigenloci of loops with many feet, and their margins.

The loop of n feet is a matrix L(z). Its eigenvalues over frequency, the eigenloci, are loops of one
input and one output: det(1 + L) = product of (1 + locus). So each of them has margins, which hold
for a change of gain or phase that is the same for all feet (generalised Nyquist criterion).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import control
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from hexapod_cosim.controller.plane import Array

Response = NDArray[np.complex128]
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
class LoopMargins:
    """Margins of loops; inf where they have no crossing."""

    gain: float  # dB
    phase: float  # deg
    static: float  # dB    of the gain, at frequency 0: no crossing, but an eigenvalue of 1


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


def worst_margins(loops: Response, omega: Array) -> LoopMargins:
    """Returns the margins of the worst of the loops (n, frequencies).

    python-control computes them for two loops: the one that crosses the negative real axis furthest
    out, and the one that is largest somewhere.
    """
    chosen = {int(critical_size(loops).argmax()), int(np.abs(loops).max(axis=1).argmax())}
    found = [loop_margins(loops[number], omega) for number in sorted(chosen)]
    return LoopMargins(
        gain=min(m.gain for m in found),
        phase=min(m.phase for m in found),
        static=static_margin(loops),
    )


def static_margin(loops: Response) -> float:
    """Returns the least gain margin of loops at the lowest frequency of their grid [dB].

    A positive feedback of springs is a loop on the negative real axis, which it does not cross.
    """
    size = float((-loops[..., 0].real).max())
    return -20.0 * math.log10(size) if size > 0.0 else math.inf


def loop_margins(loop: Response, omega: Array) -> LoopMargins:
    """Returns the margins of one loop (frequencies,), as python-control computes them."""
    data = control.frd(loop, omega, smooth=True)
    gains, phases, *_ = control.stability_margins(data, returnall=True)
    more = [gain for gain in gains if gain > 1.0]  # factors by which the gain may grow
    return LoopMargins(
        gain=20.0 * math.log10(min(more)) if more else math.inf,
        phase=float(np.abs(phases).min(initial=math.inf)),
        static=static_margin(loop),
    )
