"""Measures walks that lose servos or legs, by control, loss and ground (docs/control/loss.md).

`python -m benchmarks.loss` writes benchmarks/results/loss.csv, the percentages of walks that
arrived, kept PATH, kept PEAK, noticed the loss and regained their speed in time. With --pushes it
prints what pushes change instead.
"""

from __future__ import annotations

import csv
import math
from argparse import ArgumentParser
from collections.abc import Iterator, Sequence
from itertools import combinations, product
from multiprocessing import Pool
from pathlib import Path

import numpy as np

from benchmarks import RESULTS
from hexapod_cosim.cosim.results.facts import Result
from hexapod_cosim.cosim.results.summary import summarise
from hexapod_cosim.cosim.run.batch import process_runner
from hexapod_cosim.cosim.scenario.events import WHOLE_LEG
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.models import JOINT_NAMES, LEG_NAMES

FIGURES = ("arrives", "path", "peak", "noticed", "regained")
SEEDS = 1  # by default, as on the page
LOST, AMBLE = 5.0, 1.5  # s    time of the loss, and period of the gait
PATH, PEAK = 0.05, 0.8  # m/m, BW    largest path error and peak force of a good walk
REGAINED = 3.0  # s    longest time from the notice to the commanded speed
PACE, MEAN_TIME = 0.95, 2.0  # 1, s    share of the commanded speed, and time of its mean
WALK = ("duration=12", "friction.law={law}", "control={control}")
VARIATION = ("attitude=2e-3", "height=1e-3", "joint_angle=2e-3", "command_delay=1")
ROUGH = ("terrain.size=6", "terrain.vertical_scale=5e-4", "terrain.max_height=0.03")
STEPS = (
    "terrain.size=6",
    "terrain.num_steps=3",
    "terrain.step_height=0.02",
    "terrain.step_width=0.2",
)
GROUNDS = {
    "flat": ("command.vx=0.08",),
    "rubble": ("command.vx=0.08", "terrain.kind=random_uniform", *ROUGH),
    "slope": ("command.vx=0.06", "terrain.kind=slope", "terrain.incline=10 deg"),
    "stairs": ("command.vx=0.08", "duration=16", "terrain.kind=stairs", *STEPS),
}
SERVOS = [((leg, joint),) for leg, joint in product(LEG_NAMES, JOINT_NAMES)]
PAIRS = [  # no neighbours on one side
    ((LEG_NAMES[a], WHOLE_LEG), (LEG_NAMES[b], WHOLE_LEG))
    for a, b in combinations(range(len(LEG_NAMES)), 2)
    if b - a > 1 or (a, b) == (2, 3)
]
LOSSES: dict[str, tuple[str, Sequence[tuple[tuple[str, str], ...]]]] = {
    "a servo limp": ("limp", SERVOS),
    "a servo locked": ("locked", SERVOS),
    "a leg": ("limp", [((leg, WHOLE_LEG),) for leg in LEG_NAMES]),
    "two legs": ("limp", PAIRS),
}


def walks(control: str, loss: str, ground: str, seeds: int) -> Iterator[Scenario]:
    """Yields the walks of a row of the table: under both friction laws, the loss at LOST."""
    fault, places = LOSSES[loss]
    for law, place, seed in product(("tanh", "bristle"), places, range(seeds)):
        events = ", ".join(
            f'{{time = {LOST}, leg = "{leg}", joint = "{joint}", fault = "{fault}"}}'
            for leg, joint in place
        )
        overrides = [text.format(law=law, control=control) for text in WALK]
        overrides += [f"variation.{text}" for text in VARIATION]
        overrides += [*GROUNDS[ground], f"events=[{events}]", f"seed={seed}"]
        overrides += [f"terrain.seed={seed}"] if ground == "rubble" else []
        yield load_scenario("lost_leg", overrides=overrides)


def judged(scenario: Scenario) -> tuple[bool, ...]:
    """Runs a walk. Returns whether it arrived, and whether it did so within PATH, within PEAK, with
    a notice within one gait period, and at the commanded speed again within REGAINED of the notice.
    """
    result = process_runner().simulate(scenario)
    summary, notice = summarise(result), notice_time(result)
    noticed = notice is not None and notice - LOST <= result.facts.gait_period
    regained = slow_until(result) - (notice or LOST) <= REGAINED
    path, peak = summary.metrics["path_error"], summary.metrics["peak_force"]
    return tuple(
        summary.success and kept for kept in (True, path <= PATH, peak <= PEAK, noticed, regained)
    )


def notice_time(result: Result) -> float | None:
    """Returns the time of the first event that says which servo does not work [s]."""
    found = [
        float(event["time"])
        for event in result.facts.events
        if event["time"] >= LOST and "finds that the servo" in str(event["text"])
    ]
    return min(found, default=None)


def slow_until(result: Result) -> float:
    """Returns the last time from which the robot is slower than PACE for MEAN_TIME [s]."""
    time, way = result.recording.time, result.recording.column("torso.position[1]")
    ends = np.searchsorted(time, time + MEAN_TIME)
    begins = np.flatnonzero((time >= LOST) & (ends < len(time)))
    speed = (way[ends[begins]] - way[begins]) / MEAN_TIME
    slow = speed < PACE * result.scenario.commands[-1].vx
    return float(time[begins[slow]].max(initial=LOST))


def pushed(control: str, law: str) -> Iterator[Scenario]:
    """Yields walks with a push of 50 N for 0.2 s from 8 directions at 8 phases of the gait."""
    for phase, direction in product(range(8), range(8)):
        angle = 0.25 * math.pi * direction
        force = [round(50.0 * math.cos(angle), 6), round(50.0 * math.sin(angle), 6), 0.0]
        event = f"{{time = {4.0 + AMBLE * phase / 8}, duration = 0.2, force = {force}}}"
        overrides = ["duration=10", "command.vx=0.08", f"events=[{event}]"]
        overrides += [f"control={control}", f"friction.law={law}"]
        yield load_scenario("lost_leg", overrides=overrides)  # which names no gait


def push_figures(scenario: Scenario) -> tuple[float, float, float]:
    """Runs a walk. Returns whether it arrived, its peak force [BW] and its path error [m/m]."""
    summary = summarise(process_runner().simulate(scenario))
    return summary.success, summary.metrics["peak_force"], summary.metrics["path_error"]


def print_pushes() -> None:
    """Prints the figures of compliant control over those of kinematic control in its walk."""
    with Pool() as pool:
        for law in ("tanh", "bristle"):
            mine, other = (
                np.array(pool.map(push_figures, pushed(control, law), chunksize=1), dtype=float)
                for control in ("compliant", "kinematic@chosen")
            )
            ratio = mine[:, 1:] / other[:, 1:]
            print(f"{law}: {mine[:, 0].sum():.0f} of {len(mine)} arrive")
            print(f"peak and path, medians {np.median(ratio, axis=0).round(2)}")
            print(f"largest {ratio.max(axis=0).round(2)}")


def percentages(runs: Sequence[Sequence[bool]]) -> list[str]:
    """Returns the percentages of runs (walks, FIGURES) that are true."""
    return [f"{100.0 * share:.0f}" for share in np.mean(runs, axis=0)]


def main() -> None:
    """Writes the table, a row as soon as its walks have ended."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=SEEDS)
    parser.add_argument("-o", dest="file", type=Path, default=RESULTS / "loss.csv")
    parser.add_argument("--pushes", action="store_true")
    given = parser.parse_args()
    if given.pushes:
        print_pushes()
        return
    with given.file.open("w", encoding="utf-8", newline="") as file, Pool() as pool:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(("control", "lost", "ground", "walks", *FIGURES))
        for control, loss, ground in product(("compliant", "paper"), LOSSES, GROUNDS):
            runs = pool.map(judged, walks(control, loss, ground, given.seeds), chunksize=1)
            table.writerow((control, loss, ground, len(runs), *percentages(runs)))
            file.flush()


if __name__ == "__main__":
    main()
