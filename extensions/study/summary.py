"""Reads the results of a study's folder; writes summary.json."""

from __future__ import annotations

import re
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from hexapod_cosim.cosim.common.files import RUN_FILE, read_json, write_json
from hexapod_cosim.cosim.results.metric_table import OF_THE_RUN
from hexapod_cosim.cosim.results.summary import UNBALANCED
from hexapod_cosim.extensions.study.folder import MANIFEST
from hexapod_cosim.extensions.study.groups import LAST, Figures, Point, Runs, points_of
from hexapod_cosim.extensions.study.reading import study_from_table
from hexapod_cosim.extensions.study.records import Study
from hexapod_cosim.extensions.study.search import OPTIMUM, Trial, trials_of
from hexapod_cosim.extensions.study.store import FIGURES, WARNING_SEPARATOR, Store, quoted
from hexapod_cosim.models import HexapodError

SUMMARY = "summary.json"
POINT_METRICS = ("slip_per_metre", "cost_of_transport", "peak_force", "torque_rms")
MAX_POINTS = 4000  # kept for figures and tables; evenly chosen if there are more
MAX_REASONS = 30  # that are shown
NUMBER = re.compile(r"[0-9#]+(?:\.[0-9#]+)?")


@dataclass(frozen=True, kw_only=True)
class Results:
    """The results of a study so far."""

    study: Study
    manifest: Mapping[str, Any]
    facts: Mapping[str, Any]  # of run.json
    overall: Figures  # of all runs
    points: list[Point]  # MAX_POINTS at most
    of_points: int  # number of all points
    # numbers of runs by control, status and reason, the largest first
    failures: Mapping[tuple[str, str, str], int]
    # numbers of walks, and of walks with any metric, by scenario and control
    walks: Mapping[tuple[str, str], tuple[int, int]]
    unbalanced: Mapping[str, tuple[int, float]]  # number of runs and largest residual, by control
    trials: list[Trial]  # of an optimiser
    optimum: Mapping[str, Any] | None
    wall: float  # s    sum of the elapsed times of all runs

    @property
    def runs(self) -> int:
        """Number of runs."""
        return sum(self.overall.runs.values())


def stored_study(folder: Path) -> tuple[Study, dict[str, Any]]:
    """Reads the study of a folder and its manifest. Raises HexapodError when there is none."""
    try:
        manifest: dict[str, Any] = read_json(folder / MANIFEST)
    except HexapodError as error:
        raise HexapodError(
            "not a study's folder",
            got=str(folder),
            expected=f"a folder with {MANIFEST}",
            fix="give a folder written by `hexapod study`",
        ) from error
    where = str(folder / MANIFEST)
    study = study_from_table(manifest["study"], where=where, scenarios=manifest["scenarios"])
    # a study without a title has the name of its file
    return replace(study, title=manifest["title"]), manifest


def read_results(folder: Path) -> Results:
    """Reads the results of a study, also of one that runs, and writes summary.json.

    Raises HexapodError when the folder holds no study or its file of runs is damaged.
    """
    study, manifest = stored_study(folder)
    with closing(Store(folder, study)) as store:
        runs, optimised = Runs(study, store), study.optimise is not None
        names = POINT_METRICS
        points, count = points_of(runs, store, names=names, most=LAST if optimised else MAX_POINTS)
        results = Results(
            study=study,
            manifest=manifest,
            facts=read_json(folder / RUN_FILE),
            overall=runs.figures(),
            points=points,
            of_points=count,
            failures=failure_counts(store),
            walks=_walks(store),
            unbalanced=_unbalanced(store),
            trials=trials_of(runs, points) if optimised else [],
            optimum=read_json(folder / OPTIMUM) if (folder / OPTIMUM).exists() else None,
            wall=store.select("SELECT total(wall) FROM runs")[0][0],
        )
    write_json(folder / SUMMARY, summary_of(results))
    return results


def failure_counts(store: Store) -> dict[tuple[str, str, str], int]:
    """Returns the numbers of runs that did not walk, by control, status and reason."""
    store.database.create_function("kind", 2, _reason, deterministic=True)
    rows = store.select(
        "SELECT control, status, kind(reason, warnings) AS why, count(*) AS number FROM runs"
        " WHERE NOT walked GROUP BY control, status, why"
        f" ORDER BY number DESC, control, status, why LIMIT {MAX_REASONS}"
    )
    return {(control, status, why): number for control, status, why, number in rows}


def _reason(reason: str, warnings: str) -> str:
    """Returns why a run did not walk to the end, without the numbers in the text.

    So reasons that differ in numbers only are counted together.
    """
    text = reason or warnings.partition(WARNING_SEPARATOR)[0] or "the robot fell"
    return NUMBER.sub("#", text)


def _walks(store: Store) -> dict[tuple[str, str], tuple[int, int]]:
    """Returns the numbers of walks and of walks with any metric, by scenario and control."""
    figures = ", ".join(quoted(name) for name in FIGURES if name not in OF_THE_RUN)
    rows = store.select(
        f'SELECT "case", control, count(*), sum(coalesce({figures}) IS NOT NULL) FROM runs'
        ' WHERE walked GROUP BY "case", control ORDER BY min(run)'
    )
    return {(case, control): (walks, figured) for case, control, walks, figured in rows}


def _unbalanced(store: Store) -> dict[str, tuple[int, float]]:
    """Returns the runs whose energy balance does not close, by control."""
    rows = store.select(
        "SELECT control, count(*), max(energy_residual) FROM runs WHERE energy_residual > ?"
        " GROUP BY control ORDER BY control",
        (UNBALANCED,),
    )
    return {control: (count, largest) for control, count, largest in rows}


def summary_of(results: Results) -> dict[str, Any]:
    """Returns the content of summary.json: totals, means, changes, failures and the optimum."""
    overall = results.overall
    changes = {
        control: {name: change.as_table() for name, change in found.items()}
        for control, found in overall.changes.items()
    }
    if len(changes) > 1:  # by the other control
        paired = {"pairs": dict(overall.pairs), "changes": changes}
    else:
        paired = {
            "pairs": sum(overall.pairs.values()),
            "change": next(iter(changes.values()), {}),
        }
    return {
        "title": results.study.title,
        "runs": results.runs,
        "of": results.manifest["runs"],
        "points": results.of_points,
        "walked": dict(overall.walked),
        "run_by_control": dict(overall.runs),
        **paired,
        "means": {
            control: {
                name: {"mean": item.value, "half_width": item.half_width, "runs": item.runs}
                for name, item in means.items()
            }
            for control, means in overall.means.items()
        },
        "failures": [
            {"control": control, "status": status, "reason": reason, "runs": count}
            for (control, status, reason), count in results.failures.items()
        ],
        "optimum": results.optimum,
    }
