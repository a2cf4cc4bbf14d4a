"""Identifies robots with secret numbers from their logs: are the intervals right, and how much
nearer does the identified robot come?

usage: PYTHONPATH=tests/support python -m benchmarks.identification [--robots 20] [--seconds 6]

Each robot is drawn as the table of unknowns says of what is known beforehand, walks on the plant
FMU with an integrator tolerance of 1e-6, and is read through sensors with noise, delay and bias.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time

import numpy as np
from secret_robots import GROUPS, Secret, secret_robot

from hexapod_cosim.cosim.identify.identify import Identified, identify, usual_workers
from hexapod_cosim.models import load_robot

JUDGED = ("torque", "position", "attitude")  # channels of the goal: torque and pose
GOAL_COVERED, GOAL_RATIO = 0.9, 10.0


@dataclass(frozen=True)
class Score:
    """How well a robot was identified."""

    told: int  # numbers that the log tells
    covered: int  # of these within their 95 % intervals
    missed: tuple[str, ...]
    ratios: dict[str, float]  # by channel: error before over after on held-out rows, without noise
    seconds: float  # of processor time, without that of worker processes


def score(secret: Secret, found: Identified, seconds: float) -> Score:
    """Compares an identified robot with the secret one."""
    told = [one for one in found.estimates if one.told]
    missed = [one.key for one in told if not one.low <= secret.values[one.key] <= one.high]
    return Score(len(told), len(told) - len(missed), tuple(missed), ratios(secret, found), seconds)


def ratios(secret: Secret, found: Identified) -> dict[str, float]:
    """Returns error before over error after for each channel, against readings without noise."""
    (experiment,), result = found.experiments, {}
    rows, channels = experiment.held_out, np.array(experiment.channels)
    places = [secret.columns.index(name) for name in experiment.columns]
    clean = secret.clean[rows][:, places]
    for key in dict.fromkeys(channels.tolist()):
        own = channels == key
        before, after = (
            float(np.sqrt(np.mean((side[0][rows] - clean)[:, own] ** 2)))
            for side in (found.before, found.fit.predictions)
        )
        result[key] = before / after
    return result


def run(seeds: Sequence[int], seconds: float) -> list[Score]:
    """Makes and identifies the robots of some seeds; prints a line for each."""
    scores = []
    with TemporaryDirectory(prefix="hexapod-secret-") as folder:
        for seed in seeds:
            secret = secret_robot(seed, Path(folder), duration=seconds, groups=GROUPS)
            begin = process_time()
            found = identify(
                [secret.log],
                load_robot("athena"),
                groups=GROUPS,
                workers=usual_workers([secret.log]),
            )
            one = score(secret, found, process_time() - begin)
            scores.append(one)
            gains = ", ".join(f"{key} {value:.0f}" for key, value in one.ratios.items())
            missed = f"; outside: {', '.join(one.missed)}" if one.missed else ""
            print(
                f"robot {seed}: {one.covered} of {one.told} within their intervals{missed}; "
                f"held-out error down by {gains}; {one.seconds:.0f} s",
                flush=True,
            )
    return scores


def summary(scores: Sequence[Score]) -> dict[str, float]:
    """Returns the share of covered numbers and the median ratios of the judged channels."""
    told, covered = sum(one.told for one in scores), sum(one.covered for one in scores)
    medians = {key: float(np.median([one.ratios[key] for one in scores])) for key in JUDGED}
    return {"robots": len(scores), "told": told, "covered": covered / max(told, 1), **medians}


def main() -> int:
    """Runs the campaign; the exit code is 1 when a goal is missed."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n\n")[0])
    parser.add_argument("--robots", type=int, default=20)
    parser.add_argument("--first", type=int, default=1, help="seed of the first robot")
    parser.add_argument("--seconds", type=float, default=6.0, help="of each log")
    given = parser.parse_args()
    scores = run(range(given.first, given.first + given.robots), given.seconds)
    found = summary(scores)
    print(json.dumps(found, indent=2))
    reached = found["covered"] >= GOAL_COVERED and all(
        found[key] >= GOAL_RATIO for key in JUDGED if not math.isnan(found[key])
    )
    print("goals reached" if reached else "goals missed")
    return int(not reached)


if __name__ == "__main__":
    raise SystemExit(main())
