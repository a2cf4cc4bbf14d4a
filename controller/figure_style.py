"""Defines the style of all static figures.

Their width and font size suit a page of two columns, and colour-blind readers can distinguish the
colours.
"""

from __future__ import annotations

from typing import Any

WIDTH = 7.2  # in
DPI = 200  # of PNGs
PALETTE = ("#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7", "#000000")  # Okabe and Ito
SETTINGS: dict[str, Any] = {
    "font.size": 8.0,
    "axes.titlesize": 8.0,
    "axes.labelsize": 8.0,
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "legend.fontsize": 7.5,
    "axes.titley": 1.0,  # the default place, without a search for ticks above
    "axes.xmargin": 0.0,
    "axes.linewidth": 0.6,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "grid.linewidth": 0.5,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "svg.fonttype": "none",
    "svg.hashsalt": "hexapod",
    "figure.constrained_layout.use": True,
}
# metadata by format: equal data, equal files
UNDATED: dict[str, dict[str, Any]] = {"png": {}, "svg": {"Date": None}}
