"""Identifies robots with secret numbers from their logs: are the intervals right, and how much
nearer does the identified robot come?

usage: PYTHONPATH=tests/identify python -m benchmarks.identify.robots [--robots 20] [--seconds 6]
       [--workers 1] [--table FILE.csv]

Each robot is drawn as the table of unknowns says of what is known beforehand, walks on the plant
FMU with an integrator tolerance of 1e-6, and is read through sensors with noise, delay and bias. A
robot whose row is in the table already is not identified again, so that an ended campaign goes on.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any

import numpy as np
from secret_robots import GROUPS, Secret, secret_robot

from hexapod_cosim.extensions.identify.identification import Identified, identify
from hexapod_cosim.models import load_robot

JUDGED = ("torque", "position", "attitude")  # channels of the goal: torque and pose
CHANNELS = ("angle", "speed", "torque", "normal_force", "gyroscope", "accelerometer", "position",
            "attitude")  # fmt: skip
GOAL_COVERED, GOAL_RATIO = 0.9, 10.0


@dataclass(frozen=True)
class Score:
    """How well a robot was identified."""

    determined: int  # numbers that the log determines
    covered: int  # of these within their 95 % intervals
    missed: tuple[str, ...]
    before: dict[str, float]  # by channel: error on held-out rows of the robot file's numbers,
    after: dict[str, float]  # and of those found, against readings without noise
    seconds: float  # of processor time
    left_out: tuple[str, ...] = ()  # good columns that the screening left out

    @property
    def ratios(self) -> dict[str, float]:
        """Error before over error after for each channel."""
        return {key: size / self.after[key] for key, size in self.before.items()}


def score(secret: Secret, found: Identified, seconds: float) -> Score:
    """Compares an identified robot with the secret one."""
    own = [one for one in found.estimates if one.determined]
    missed = tuple(one.key for one in own if not one.low <= secret.values[one.key] <= one.high)
    sides = (found.before, found.fit.predictions)
    before, after = (held_out_errors(secret, found, side[0]) for side in sides)
    bad = tuple(column.name for _, column in found.bad)
    return Score(
        determined=len(own), covered=len(own) - len(missed), missed=missed, before=before,
        after=after, seconds=seconds, left_out=bad,
    )  # fmt: skip


def held_out_errors(secret: Secret, found: Identified, predicted: np.ndarray) -> dict[str, float]:
    """Returns the root mean square errors of held-out rows by channel, without noise."""
    (experiment,) = found.experiments
    rows, channels = experiment.held_out, np.array(experiment.channels)
    places = [secret.columns.index(name) for name in experiment.columns]
    error = predicted[rows] - secret.clean[rows][:, places]
    return {
        key: float(np.sqrt(np.mean(error[:, channels == key] ** 2)))
        for key in dict.fromkeys(channels.tolist())
    }


def identified(seed: int, *, seconds: float) -> Score:
    """Makes the robot of a seed and identifies it from its log."""
    with TemporaryDirectory(prefix="hexapod-secret-") as folder:
        secret = secret_robot(seed, Path(folder), duration=seconds, groups=GROUPS)
    begin = process_time()
    found = identify([secret.log], load_robot("athena"), groups=GROUPS)
    return score(secret, found, process_time() - begin)


def run(seeds: Sequence[int], *, workers: int, seconds: float) -> Iterator[tuple[int, Score]]:
    """Identifies the robots of some seeds and yields each when it is ready."""
    one = partial(identified, seconds=seconds)
    if workers == 1:
        yield from ((seed, one(seed)) for seed in seeds)
        return
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        tasks = {pool.submit(one, seed): seed for seed in seeds}
        for task in as_completed(tasks):
            yield tasks[task], task.result()


def line(seed: int, one: Score) -> str:
    """Returns a robot's result as a line of text."""
    gains = ", ".join(f"{key} {value:.0f}" for key, value in one.ratios.items())
    missed = f"; outside: {', '.join(one.missed)}" if one.missed else ""
    wrong = f"; left out: {', '.join(one.left_out)}" if one.left_out else ""
    return (
        f"robot {seed}: {one.covered} of {one.determined} within their intervals{missed}; "
        f"held-out error down by {gains}; "
        f"{one.seconds:.0f} s{wrong}"
    )


def table_row(seed: int, one: Score, seconds: float) -> dict[str, Any]:
    """Returns the row of a robot in the table."""
    found: dict[str, Any] = {
        "robot": seed,
        "log_s": seconds,
        "determined": one.determined,
        "covered": one.covered,
        "outside": " ".join(one.missed),
        "left_out": " ".join(one.left_out),
        "processor_s": round(one.seconds, 1),
    }
    for side in ("before", "after"):
        own = getattr(one, side)
        found |= {f"{key}_{side}": f"{own[key]:.4g}" if key in own else "" for key in CHANNELS}
    return found


def read_table(path: Path) -> list[dict[str, str]]:
    """Returns the rows of a table; none where there is no file."""
    if not path.is_file():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def write_table(path: Path, rows: Sequence[dict[str, Any]]) -> None:
    """Writes the rows in the order of the robots' numbers."""
    path.parent.mkdir(parents=True, exist_ok=True)
    ordered = sorted(rows, key=lambda row: int(row["robot"]))
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(ordered[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(ordered)


def summary(rows: Sequence[dict[str, Any]]) -> dict[str, float]:
    """Returns the share of covered numbers and the median ratios of the judged channels."""
    determined = sum(int(row["determined"]) for row in rows)
    covered = sum(int(row["covered"]) for row in rows)
    found: dict[str, float] = {
        "robots": len(rows), "determined": determined, "covered": covered / max(determined, 1)
    }  # fmt: skip
    for key in JUDGED:
        ratios = [float(row[f"{key}_before"]) / float(row[f"{key}_after"]) for row in rows]
        found |= {key: float(np.median(ratios)), f"{key}_least": min(ratios)}
    return found | {"processor_s": float(np.median([float(row["processor_s"]) for row in rows]))}


def main() -> int:
    """Runs the campaign; the exit code is 1 when a goal is missed."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n\n")[0])
    parser.add_argument("--robots", type=int, default=20)
    parser.add_argument("--first", type=int, default=1, help="seed of the first robot")
    parser.add_argument("--seconds", type=float, default=6.0, help="of each log")
    parser.add_argument("--workers", type=int, default=1, help="robots at a time")
    parser.add_argument("--table", type=Path, help="CSV file to which rows are added")
    given = parser.parse_args()
    rows: list[dict[str, Any]] = list(read_table(given.table)) if given.table else []
    known = {int(row["robot"]) for row in rows}
    seeds = [seed for seed in range(given.first, given.first + given.robots) if seed not in known]
    for seed, one in run(seeds, workers=given.workers, seconds=given.seconds):
        print(line(seed, one), flush=True)
        rows.append(table_row(seed, one, given.seconds))
        if given.table:
            write_table(given.table, rows)
    found = summary(rows)
    print(json.dumps(found, indent=2))
    reached = found["covered"] >= GOAL_COVERED and all(
        found[key] >= GOAL_RATIO for key in JUDGED if not math.isnan(found[key])
    )
    print("goals reached" if reached else "goals missed")
    return int(not reached)


if __name__ == "__main__":
    raise SystemExit(main())
