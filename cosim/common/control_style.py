"""Colours, dashes and marks by which figures and reports tell controls apart.

The built-in controls `kinematic` and `compliant` keep theirs; all others get the next style of a
palette, by their position.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

Dash = tuple[float, ...]  # lengths of strokes and gaps in points; () for a whole line


@dataclass(frozen=True, kw_only=True)
class ControlStyle:
    """The style of one control."""

    key: str  # name in style sheets
    light: str  # colour on a light page
    dark: str  # colour on a dark page
    dash: Dash
    marker: str  # of matplotlib


OWN = {
    "kinematic": ControlStyle(
        key="kinematic", light="#D55E00", dark="#ff9a55", dash=(4.0, 1.5), marker="s"
    ),
    "compliant": ControlStyle(
        key="compliant", light="#0072B2", dark="#5bb8f0", dash=(), marker="o"
    ),
}
# Okabe and Ito's other colours, darkened where they are too light on white
OTHERS = (
    ("#009E73", "#35c79b", (), "^"),
    ("#AA4499", "#e39fc5", (6.0, 1.5, 1.0, 1.5), "D"),
    ("#B8860B", "#e0cb5f", (2.0, 1.0), "v"),
    ("#000000", "#e8ebef", (1.0, 1.0), "P"),
    ("#6A3D9A", "#b79be8", (8.0, 2.0), "X"),
    ("#56737A", "#aab2bd", (3.0, 1.0, 1.0, 1.0), "*"),
)


def control_styles(labels: Iterable[str]) -> dict[str, ControlStyle]:
    """Returns a style for each label; beyond the palette's end, styles repeat."""
    found: dict[str, ControlStyle] = {}
    count = 0
    for label in labels:
        if label in OWN:
            found[label] = OWN[label]
            continue
        light, dark, dash, marker = OTHERS[count % len(OTHERS)]
        found[label] = ControlStyle(
            key=f"control-{count}", light=light, dark=dark, dash=dash, marker=marker
        )
        count += 1
    return found


def all_styles(labels: Iterable[str] = ()) -> list[ControlStyle]:
    """Returns the styles of the built-in controls and of further labels, each key once."""
    styles = [*OWN.values(), *control_styles(labels).values()]
    return list({style.key: replace(style) for style in styles}.values())
