"""Builds the rows of the table about height fields from their records."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from statistics import median
from typing import Any

from benchmarks.ground.cost import BLOCKS, FIELD, PLANE, SOIL
from benchmarks.ground.waves import FORCE_STEPS, MUJOCO
from benchmarks.series import OURS
from benchmarks.table import Row
from benchmarks.walks import DURATION

Record = Mapping[str, Any]

TARGETS = (1e-3, 1e-4, 1e-5)  # m    errors at which the engines are compared
LOAD_GOAL = 1.0  # s
COST_GOALS = {FIELD: 1.3, BLOCKS: 1.3, SOIL: 1.5}  # 1    time of a walk over the plane's
FIXED = {OURS: "rosw3-fixed", MUJOCO: "implicitfast-fixed"}  # whose forces are compared


def ground_rows(
    costs: Sequence[Record],
    walks: Sequence[Record],
    landings: Sequence[Record],
    maps: Sequence[Record],
) -> list[Row]:
    """Returns the rows of costs, walks, foot forces, landings and maps."""
    return [
        *_costs(costs),
        *_at_equal_error(walks),
        *_forces(walks),
        *_landings(landings),
        *_maps(maps),
    ]


def _costs(costs: Sequence[Record]) -> Iterator[Row]:
    """Yields the time of a walk over that of the same walk on the plane, by ground."""
    (plane,) = (cost for cost in costs if cost["ground"] == PLANE)
    for cost in costs:
        if cost is plane:
            continue
        more = cost["evaluations"] / plane["evaluations"]
        yield Row(
            figure=f"walk on {cost['ground']} ({cost['terrain']}), {more:.2f} x the evaluations: "
            "time over the plane's",
            unit="1",
            ours=cost["seconds"] / plane["seconds"],
            goal=COST_GOALS[cost["ground"]],
        )


def _at_equal_error(walks: Sequence[Record]) -> Iterator[Row]:
    """Yields each engine's fastest setting that meets an error in every walk, or the median one."""
    for target in TARGETS:
        for which, combine in (("every", max), ("median", median)):
            ours, theirs = (_fastest(walks, engine, target, combine) for engine in (OURS, MUJOCO))
            mine = math.nan if ours is None else ours[0]
            other = math.nan if theirs is None else theirs[0]
            reached = "not reached" if theirs is None else theirs[1]
            how = "" if ours is None else f" ({ours[1]})"
            yield Row(
                figure=f"height field, {which} walk within {target:g} m{how}: real time",
                unit="x",
                ours=mine,
                peer=f"mujoco, its own contact: {reached}",
                theirs=other,
                ratio=mine / other,
            )


def _fastest(
    walks: Iterable[Record], engine: str, target: float, combine: Callable[[list[float]], float]
) -> tuple[float, str] | None:
    """Returns the median real-time factor and the name of an engine's fastest setting.

    A setting counts if it and all finer ones of its method meet the error; `combine` makes one
    error of those of the walks.
    """
    groups: dict[str, dict[float, list[Record]]] = {}
    for walk in walks:
        if walk["engine"] == engine:
            groups.setdefault(walk["method"], {}).setdefault(walk["setting"], []).append(walk)
    found = []
    for method, settings in groups.items():
        for setting in sorted(settings):
            if combine([walk["error"] for walk in settings[setting]]) > target:
                break
            seconds = median(walk["seconds"] for walk in settings[setting])
            found.append((DURATION / seconds, f"{method} {setting:g}"))
    return max(found, default=None)


def _forces(walks: Sequence[Record]) -> Iterator[Row]:
    """Yields the error of the feet's normal forces, and their peak, by step."""
    for step in FORCE_STEPS:
        ours, theirs = (
            [
                walk
                for walk in walks
                if (walk["engine"], walk["method"], walk["setting"]) == (engine, method, step)
            ]
            for engine, method in FIXED.items()
        )
        if not ours:
            continue
        facts: dict[str, Any] = {"peer": "mujoco, its own contact" if theirs else ""}
        at = f"height field, steps of {1e3 * step:g} ms"
        yield Row(
            figure=f"{at}: RMS error of foot forces",
            unit="BW",
            ours=_middle(ours, "force_error"),
            theirs=_middle(theirs, "force_error"),
            **facts,
        )
        yield Row(
            figure=f"{at}: peak force over the converged one",
            unit="1",
            ours=_peak_share(ours),
            theirs=_peak_share(theirs),
            **facts,
        )


def _peak_share(walks: Sequence[Record]) -> float:
    """Returns the median of peak force over converged peak force, NaN without walks."""
    return median(walk["peak"] / walk["exact_peak"] for walk in walks) if walks else math.nan


def _middle(walks: Sequence[Record], key: str) -> float:
    """Returns the median of a figure over walks, NaN without walks."""
    return median(walk[key] for walk in walks) if walks else math.nan


def _landings(landings: Sequence[Record]) -> Iterator[Row]:
    """Yields the rebound from a level height field over that from the plane."""
    shares: dict[tuple[str, float], float] = {}
    for one in landings:
        if one["ground"] == "height field":
            (plane,) = (
                other["rebound"]
                for other in landings
                if (other["engine"], other["step"], other["ground"])
                == (one["engine"], one["step"], "plane")
            )
            shares[one["engine"], one["step"]] = one["rebound"] / plane
    for step in FORCE_STEPS:
        yield Row(
            figure=f"rebound at 3 m/s on 20 mm feet, steps of {1e3 * step:g} ms: field over plane",
            unit="1",
            ours=shares.get((OURS, step), math.nan),
            peer="mujoco" if (MUJOCO, step) in shares else "",
            theirs=shares.get((MUJOCO, step), math.nan),
        )


def _maps(maps: Sequence[Record]) -> Iterator[Row]:
    """Yields the time to load the large map and its cost per evaluation over the small one's."""
    small, large = maps
    size = f"{large['nodes']} x {large['nodes']}"
    yield Row(
        figure=f"map of {size}: read and loaded", unit="s", ours=large["load"], goal=LOAD_GOAL
    )
    key = "microseconds_per_evaluation"
    yield Row(
        figure=f"map of {size}: time of an evaluation over {small['nodes']} x {small['nodes']}",
        unit="1",
        ours=large[key] / small[key],
    )
