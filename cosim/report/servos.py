"""The load on each servo: its RMS torque over its continuous rating, for the report's table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from hexapod_cosim.cosim.interface.names import joint_names
from hexapod_cosim.cosim.results.folder import StoredResult
from hexapod_cosim.cosim.results.window import Array
from hexapod_cosim.models import JOINT_NAMES, LEG_NAMES

SIZE = (len(LEG_NAMES), len(JOINT_NAMES))


def servo_loads(run: StoredResult) -> Array | None:
    """Returns the loads (6, 3) over the judged walk; None where the run has no such metric.

    The rating is that by which the run's metric servo_load_max was computed.
    """
    walk, largest = run.view.window, run.metrics.get("servo_load_max")
    if walk is None or largest is None or not np.isfinite(largest):
        return None
    squares = walk.gained(joint_names("torque_squared")).reshape(SIZE)
    return np.asarray(largest * np.sqrt(squares / max(squares.max(), np.finfo(float).tiny)))


def servo_rows(runs: Mapping[str, StoredResult]) -> list[dict[str, Any]]:
    """Returns a row per leg: its name and, by control and joint, the loads in per cent as texts.

    There are no rows when no run has loads.
    """
    loads = {label: servo_loads(run) for label, run in runs.items()}
    if all(load is None for load in loads.values()):
        return []
    return [
        {
            "name": leg,
            "values": [
                "-" if load is None else f"{100.0 * load[k, j]:.0f}"
                for load in loads.values()
                for j in range(len(JOINT_NAMES))
            ],
        }
        for k, leg in enumerate(LEG_NAMES)
    ]
