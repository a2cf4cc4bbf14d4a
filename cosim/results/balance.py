"""Warnings of energy balances that do not close, of one run and of many."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

UNBALANCED = 0.01  # share of the motors' work; a larger energy residual causes a warning
FIX = "tighten solver.tolerance or, with a fixed step, shorten solver.step"


@dataclass(frozen=True)
class Unbalanced:
    """The runs whose energy residual is larger than UNBALANCED."""

    count: int = 0
    largest: float = 0.0  # residual over the motors' work

    @classmethod
    def among(cls, residuals: ArrayLike) -> Unbalanced:
        """Returns those among runs with these residuals, NaN for runs without metrics."""
        values = np.asarray(residuals, dtype=np.float64)
        above = values[values > UNBALANCED]
        return cls(above.size, float(above.max(initial=0.0)))

    def warnings(self, control: str, *, runs: int) -> list[str]:
        """Returns one warning for all runs under a control, or none.

        Args:
            control: of the runs.
            runs: number of runs, balanced ones included.
        """
        text = (
            f"{control}: the energy balance of {self.count} of {runs} runs misses more than "
            f"{100.0 * UNBALANCED:g} %, at most {100.0 * self.largest:.3g} %: {FIX}"
        )
        return [text] if self.count else []


def run_balance_warnings(residual: float) -> list[str]:
    """Warns where a run's balance misses more than metrics of energy can tolerate."""
    text = f"the energy balance does not explain {residual:.2%} of the motors' work: {FIX}"
    return [text] if Unbalanced.among([residual]).count else []
