"""Makes the JSON text with all that a report's viewer shows."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from hexapod_cosim.cosim.common.control_style import control_styles
from hexapod_cosim.cosim.report.columns import MOST_ROWS, Columns, choose, pack
from hexapod_cosim.cosim.report.geometry import (
    describe_ground,
    describe_robot,
    pack_surface,
    stride,
)
from hexapod_cosim.cosim.results.folder import StoredResult
from hexapod_cosim.cosim.results.window import CONTACT_SHARE
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.ground.surface import Surface

DASH = 1.5  # pixels per point of a dash


def make_payload(
    runs: Mapping[str, StoredResult], *, most_rows: int = MOST_ROWS
) -> tuple[dict[str, Any], list[str]]:
    """Returns the viewer's data of runs by control, and notes on the runs that were reduced.

    Those are runs with more than `most_rows` rows.
    """
    chosen = {label: choose(run.view, most_rows=most_rows) for label, run in runs.items()}
    surfaces = list(
        dict.fromkeys(run.view.surface for run in runs.values() if run.view.surface is not None)
    )
    parameters = next(iter(runs.values())).view.parameters if runs else {}
    styles = control_styles(runs)
    content = {
        "contact": CONTACT_SHARE,
        "surfaces": [pack_surface(surface, parameters) for surface in surfaces],
        "runs": [
            {"key": styles[label].key, "dash": [DASH * part for part in styles[label].dash]}
            | _describe(label, run, surfaces, chosen[label])
            for label, run in runs.items()
        ],
    }
    notes = [
        f"{label}: the page has every {every}. of {len(runs[label].view.recording.time)} rows."
        for label, (_, _, every) in chosen.items()
        if every > 1
    ]
    return content, notes + [_coarse(surface) for surface in surfaces if stride(surface) > 1]


def as_json(payload: Mapping[str, Any]) -> str:
    """Returns JSON that can stand in a <script>: it contains no "<"."""
    return json.dumps(payload, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


def _describe(
    label: str, run: StoredResult, surfaces: list[Surface], chosen: tuple[Array, Columns, int]
) -> dict[str, Any]:
    view, (time, columns, _) = run.view, chosen
    ground: dict[str, Any] = describe_ground(view.parameters)
    if view.surface is not None:
        ground["surface"] = surfaces.index(view.surface)
    about = {"label": label, "period": view.period, "robot": describe_robot(run), "ground": ground}
    return about | pack(time, columns)


def _coarse(surface: Surface) -> str:
    """Returns a note on a surface that is drawn with fewer nodes than it has."""
    every = stride(surface)
    return (
        f"The ground has {surface.height.size} heights around the walk, too many for a page: the "
        f"replay draws every {every}. of them along x and y."
    )
