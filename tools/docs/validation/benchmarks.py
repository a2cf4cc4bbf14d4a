"""Reads benchmarks/results: agreement with other engines, speed, and effect of the control."""

from __future__ import annotations

import csv
from collections import defaultdict
from collections.abc import Iterator, Mapping
from pathlib import Path
from statistics import median

import numpy as np
from matplotlib.figure import Figure

from tools.docs.stage import ROOT
from tools.docs.validation.shown import Shown, short

RESULTS = ROOT / "benchmarks" / "results"
ENGINES = {
    "hexapod": "this plant",
    "mujoco": "MuJoCo",
    "pinocchio": "Pinocchio",
    "simbody": "Simbody",
}
OURS, OF_OURS = "hexapod", ("rosw3", "ros2", "dp54")
GAITS, SPEEDS = ("tripod", "ripple", "wave"), ("0.04", "0.08", "0.12", "0.16")
SHOWN = {
    "slip_per_metre": "slip",
    "peak_force": "peak force",
    "loading_rate": "loading rate",
    "cost_of_transport": "cost of transport",
}


def machines() -> list[Path]:
    """Returns the folders with measurements of speed."""
    return sorted(path.parent for path in RESULTS.glob("*/walks.csv"))


def _rows(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def peers() -> Shown:
    """Returns the distance of each engine's finest setting from the converged path of the same
    law.
    """
    best: dict[tuple[str, str], tuple[float, float, str]] = {}
    for key, group in _settings(machines()[-1]):
        engine, method, setting = key
        errors = median(group), max(group), setting
        best[engine, method] = min(best.get((engine, method), errors), errors)
    rows = [
        (ENGINES[engine], f"`{method}`", setting, short(middle), short(worst))
        for (engine, method), (middle, worst, setting) in sorted(best.items())
        if engine != OURS or method in OF_OURS
    ]
    return Shown(
        columns=(
            "engine",
            "method",
            "step or tolerance",
            "median over the walks [m]",
            "furthest walk [m]",
        ),
        rows=rows,
    )


def _settings(folder: Path) -> Iterator[tuple[tuple[str, str, str], list[float]]]:
    groups: Mapping[tuple[str, str, str], list[float]] = defaultdict(list)
    for row in _rows(folder / "walks.csv"):
        if row["law"] == "plant" and row["engine"] in ENGINES:
            groups[row["engine"], row["method"], row["setting"]].append(float(row["error"]))
    yield from groups.items()


def speed() -> Shown:
    """Returns the table of the last benchmark without figures that were not measured."""
    rows = [row for row in _rows(machines()[-1] / "table.csv") if row["ours"] != "nan"]
    return Shown(
        columns=("figure", "this plant", "unit", "peer", "theirs"),
        rows=[
            (row["figure"], _figure(row["ours"]), row["unit"], row["peer"], _figure(row["theirs"]))
            for row in rows
        ],
    )


def _figure(text: str) -> str:
    return "" if text == "nan" else f"{float(text):.4g}"


def control() -> Shown:
    """Shows the changes from kinematic to compliant control by gait and speed, for both robots."""
    tables = {
        robot: _changes(RESULTS / "control" / f"grid_{robot}.csv")
        for robot in ("athena", "phantomx_mk4")
    }

    def draw(figure: Figure) -> None:
        panels = figure.subplots(len(tables), len(SHOWN), sharex=True, sharey=True)
        for number, (robot, changes) in enumerate(tables.items()):
            line = panels[number]
            for axes, (metric, title) in zip(line, SHOWN.items(), strict=True):
                values = np.array(
                    [
                        [changes.get((f"{gait}, {speed} m/s", metric), np.nan) for speed in SPEEDS]
                        for gait in GAITS
                    ]
                )
                axes.imshow(100.0 * values, cmap="PuOr", vmin=-100.0, vmax=100.0, aspect="auto")
                axes.grid(visible=False)
                axes.set_xticks(range(len(SPEEDS)), SPEEDS)
                axes.set_yticks(range(len(GAITS)), GAITS)
                for (i, k), value in np.ndenumerate(values):
                    shade = "white" if abs(value) > 0.6 else "black"
                    axes.text(
                        k,
                        i,
                        "" if np.isnan(value) else f"{100.0 * value:+.0f}",
                        ha="center",
                        va="center",
                        color=shade,
                        fontsize=8,
                    )
                if number == 0:
                    axes.set_title(title, fontsize=9)
                if number == len(tables) - 1:
                    axes.set_xlabel("m/s")
            line[0].set_ylabel(robot)

    return Shown(
        draw=draw,
        size=(8.6, 4.2),
        alt="Changes in per cent by gait and speed of four metrics, for two robots",
    )


def _changes(path: Path) -> dict[tuple[str, str], float]:
    return {
        (row["case"], row["metric"]): float(row["relative"])
        for row in _rows(path)
        if row["relative"]
    }
