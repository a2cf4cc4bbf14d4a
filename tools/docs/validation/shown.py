"""Formats a result for a page: a table and a figure for light and for dark pages."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.figure import Figure

from hexapod_cosim.controller import figure_style

THEMES: Mapping[str, Mapping[str, Any]] = {
    "light": {"text.color": "#1f2430", "grid.color": "#9aa4b2", "axes.edgecolor": "#5b6472"},
    "dark": {"text.color": "#cfd6e4", "grid.color": "#6b7688", "axes.edgecolor": "#8791a3"},
}
PALETTE = (*figure_style.PALETTE[:5], "#56B4E9")  # black is invisible on a dark page
MARKERS = "osD^vP"


@dataclass(frozen=True, kw_only=True)
class Shown:
    """A result, ready for a page."""

    columns: Sequence[str] = ()
    rows: Iterable[Sequence[str]] = ()
    draw: Callable[[Figure], None] | None = None
    size: tuple[float, float] = (7.6, 3.6)  # inches
    alt: str = ""  # the figure in words

    def markdown(self, folder: Path, stem: str) -> str:
        """Returns the result in Markdown; writes `stem`-light.svg and `stem`-dark.svg into the
        folder.
        """
        parts = []
        if self.draw is not None:
            (folder / stem).parent.mkdir(parents=True, exist_ok=True)
            for theme in THEMES:
                self._save(folder / f"{stem}-{theme}.svg", theme)
                parts.append(
                    f"```{{image}} {stem}-{theme}.svg\n:class: only-{theme}\n:alt: {self.alt}\n```"
                )
        if self.columns:
            parts.append(
                "\n".join(
                    _line(row) for row in (self.columns, ["---"] * len(self.columns), *self.rows)
                )
            )
        return "\n\n".join(parts)

    def _save(self, path: Path, theme: str) -> None:
        colours = dict(THEMES[theme])
        same = dict.fromkeys(
            ("axes.labelcolor", "xtick.color", "ytick.color", "axes.titlecolor"),
            colours["text.color"],
        )
        with rc_context(
            {
                **figure_style.SETTINGS,
                **colours,
                **same,
                "axes.facecolor": "none",
                "svg.hashsalt": path.name,
                "svg.fonttype": "path",
            }
        ):
            figure = Figure(figsize=self.size)
            assert self.draw is not None
            self.draw(figure)
            figure.savefig(path, transparent=True, metadata={"Date": None})


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def short(value: float) -> str:
    """Formats a small number: 3.0e-12."""
    return "0" if value == 0.0 else f"{value:.1e}"
