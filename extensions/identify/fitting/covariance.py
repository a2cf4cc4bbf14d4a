"""Computes the information of readings from derivatives and from the spectra of the residuals.

White residuals of variance 1 give the information A = J' J of linear least squares. Coloured ones
change the covariance of the estimate to A^-1 M A^-1 with M = sum over frequencies f of
S(f) j(f)* j(f), where j is the discrete Fourier transform of the derivatives and S the spectrum of
the residuals (White, Econometrica 48, 1980; Newey and West, Econometrica 55, 1987, in the frequency
domain). The information is then A M^-1 A. So slow residuals widen the intervals of numbers with
slow effects, as zeros and biases, and leave those of numbers with fast ones.

The spectrum of a channel is its periodogram, averaged over its columns and over neighbouring
frequencies. The fit takes a part of the residuals away, which is the leverage of a frequency; the
periodogram is divided by what is left.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.models.arrays import Array

ORDINATES = 40  # of periodograms, at least about, whose mean is the spectrum at a frequency
LEAST_LEFT = 0.1  # share of a frequency that the fit is taken to leave, at least
NEGLIGIBLE = 1e-6  # information [1/prior^2]


@dataclass(frozen=True)
class Series:
    """Residuals of one channel of a log at equal steps of time, and their derivatives.

    Readings that do not count are 0, with their derivatives.
    """

    residuals: Array  # (rows, columns)  in deviations
    slopes: Array  # (rows, columns, numbers)  by z
    counted: float  # share of the readings that count

    @cached_property
    def waves(self) -> tuple[NDArray[np.complex128], Array]:
        """The Fourier transform of the derivatives, and how often each frequency counts."""
        return _waves(self.slopes)


def white_information(series: Sequence[Series]) -> Array:
    """Returns J' J (numbers, numbers): the information by white residuals [1/prior^2]."""
    flat = [one.slopes.reshape(-1, one.slopes.shape[-1]) for one in series]
    return np.asarray(sum(own.T @ own for own in flat))


def coloured_information(series: Sequence[Series]) -> Array:
    """Returns A M^-1 A (numbers, numbers): the information with the residuals' spectra."""
    white = white_information(series)
    covariance: Array = np.asarray(np.linalg.inv(white + np.eye(len(white))), dtype=np.float64)
    scores = np.zeros_like(white)
    for one in series:
        waves, weights = one.waves
        weights = np.multiply(weights, spectrum(one, covariance))
        scores += np.einsum("f,fci,fcj->ij", weights, waves.conj(), waves, optimize=True).real
    values, vectors = np.linalg.eigh(scores)
    across = vectors.T @ white
    kept = np.maximum(values, 0.0) + NEGLIGIBLE
    return np.asarray(across.T @ (across / kept[:, None]))


def spectrum(series: Series, covariance: Array) -> Array:
    """Returns the spectrum of a channel's residuals at the frequencies of `rfft`: 1 of white ones.

    covariance: of the numbers, for the leverage (numbers, numbers).
    """
    waves, _ = series.waves
    residuals, _ = _waves(series.residuals)
    columns = residuals.shape[1]
    power = np.sum(np.abs(residuals) ** 2, axis=1)
    leverage = np.einsum("fci,ij,fcj->f", waves, covariance, waves.conj(), optimize=True).real
    whole = columns * series.counted
    left = np.maximum(whole - leverage, LEAST_LEFT * whole)
    half = max(1, round(0.5 * (ORDINATES / columns - 1.0)))
    return _smoothed(power, half) / np.maximum(_smoothed(left, half), NEGLIGIBLE)


def _waves(values: Array) -> tuple[NDArray[np.complex128], Array]:
    """Returns the Fourier transform along the rows and how often each frequency counts, so that
    the weighted sum of squares is that of the values.
    """
    rows = len(values)
    waves = np.fft.rfft(values, axis=0) / np.sqrt(rows)
    weights = np.full(len(waves), 2.0)
    weights[0] = 1.0
    if rows % 2 == 0:
        weights[-1] = 1.0
    return waves, weights


def _smoothed(values: Array, half: int) -> Array:
    """Returns means over 2 half + 1 neighbours; beyond its ends a spectrum is mirrored."""
    half = min(half, len(values) - 1)
    padded = np.pad(values, half, mode="reflect")
    kernel = np.full(2 * half + 1, 1.0 / (2 * half + 1))
    return np.convolve(padded, kernel, mode="valid")
