"""Makes the JSON text with all that a report's viewer shows."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from hexapod_cosim.cosim.report.columns import MOST_ROWS, Chosen, choose
from hexapod_cosim.cosim.report.geometry import describe_ground, describe_robot
from hexapod_cosim.cosim.report.packing import pack
from hexapod_cosim.cosim.results.results import StoredResult
from hexapod_cosim.cosim.results.walk import CONTACT_SHARE


def make_payload(
    runs: Mapping[str, StoredResult], *, most_rows: int = MOST_ROWS
) -> tuple[dict[str, Any], list[str]]:
    """Returns the viewer's data of runs by control, and notes on the runs that were reduced.

    Those are runs with more than `most_rows` rows.
    """
    chosen = {label: choose(run.view, most_rows=most_rows) for label, run in runs.items()}
    thinned = [
        _note(label, run, chosen[label]) for label, run in runs.items() if chosen[label].bucket > 1
    ]
    content = {
        "contact": CONTACT_SHARE,
        "runs": [_describe(label, run, chosen[label]) for label, run in runs.items()],
    }
    return content, thinned


def as_json(payload: Mapping[str, Any]) -> str:
    """Returns JSON that can stand in a <script>: it contains no "<"."""
    return json.dumps(payload, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


def _describe(label: str, run: StoredResult, chosen: Chosen) -> dict[str, Any]:
    view = run.view
    about = {"label": label, "period": view.period, "bucket": chosen.bucket}
    return (
        about
        | {"robot": describe_robot(run), "ground": describe_ground(view.parameters)}
        | pack(chosen.time, chosen.columns)
    )


def _note(label: str, run: StoredResult, chosen: Chosen) -> str:
    """Returns a note on how the rows of a run were reduced."""
    rows = len(run.view.recording.time)
    return (
        f"{label}: {rows} rows were recorded, too many for a page. Curves show the least and the "
        f"largest value of every {chosen.bucket} rows, so that no peak is lost; "
        f"the replay shows {len(chosen.time)} of the rows."
    )
