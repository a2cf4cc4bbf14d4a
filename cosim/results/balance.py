"""Warnings of energy balances that do not close, of one run and of many."""

from __future__ import annotations

from collections.abc import Sequence

UNBALANCED = 0.01  # share of the motors' work; a larger energy residual causes a warning
FIX = "tighten solver.tolerance or, with a fixed step, shorten solver.step"


def run_balance_warnings(residual: float) -> list[str]:
    """Warns where a run's balance misses more than metrics of energy can tolerate."""
    text = f"the energy balance does not explain {residual:.2%} of the motors' work: {FIX}"
    return [text] if residual > UNBALANCED else []


def balance_warnings(control: str, *, missing: int, runs: int, largest: float) -> list[str]:
    """Returns one warning for all runs under a control, or none.

    Args:
        control: of the runs.
        missing: number of runs whose residual is larger than UNBALANCED.
        runs: number of runs.
        largest: residual over the motors' work.
    """
    text = (
        f"{control}: the energy balance of {missing} of {runs} runs misses more than "
        f"{100.0 * UNBALANCED:g} %, at most {100.0 * largest:.3g} %: {FIX}"
    )
    return [text] if missing else []


def residual_warnings(control: str, residuals: Sequence[float]) -> list[str]:
    """Warns of the runs under a control with these residuals, NaN for runs without metrics."""
    above = [each for each in residuals if each > UNBALANCED]
    return balance_warnings(
        control, missing=len(above), runs=len(residuals), largest=max(above, default=0.0)
    )
