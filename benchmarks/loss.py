"""Measures walks that lose servos or legs, by control, loss and ground (docs/control/loss.md).

`python -m benchmarks.loss` writes benchmarks/results/loss.csv: percentages of walks.
"""

from __future__ import annotations

import csv
from argparse import ArgumentParser
from collections.abc import Iterator, Sequence
from contextlib import closing
from itertools import combinations, product
from pathlib import Path

from benchmarks import RESULTS
from hexapod_cosim.cosim.results.summary import REFUSED, Summary
from hexapod_cosim.cosim.run.batch import run_batch
from hexapod_cosim.cosim.scenario.events import WHOLE_LEG
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.models import JOINT_NAMES, LEG_NAMES

SEEDS = 1  # by default, as on the page
PATH, PEAK = 0.05, 0.8  # m/m, BW    largest path error and peak force of a good walk
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
    """Yields the walks of a row of the table: under both friction laws, the loss at 5 s."""
    fault, places = LOSSES[loss]
    for law, place, seed in product(("tanh", "bristle"), places, range(seeds)):
        events = ", ".join(
            f'{{time = 5.0, leg = "{leg}", joint = "{joint}", fault = "{fault}"}}'
            for leg, joint in place
        )
        overrides = [text.format(law=law, control=control) for text in WALK]
        overrides += [f"variation.{text}" for text in VARIATION]
        overrides += [*GROUNDS[ground], f"events=[{events}]", f"seed={seed}"]
        overrides += [f"terrain.seed={seed}"] if ground == "rubble" else []
        yield load_scenario("lost_leg", overrides=overrides)


def shares(summaries: Sequence[Summary]) -> list[str]:
    """Returns the shares of walks that arrived, and that kept PATH and PEAK too, in percent."""
    for run in summaries:
        if run.status == REFUSED:  # it says nothing about the walk
            raise SystemExit(run.reason)
    arrived = [run for run in summaries if run.success]
    kept = [run for run in arrived if run.metrics["path_error"] <= PATH]
    soft = [run for run in arrived if run.metrics["peak_force"] <= PEAK]
    return [f"{100.0 * len(runs) / len(summaries):.0f}" for runs in (arrived, kept, soft)]


def main() -> None:
    """Writes the table, a row as soon as its walks have ended."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=SEEDS)
    parser.add_argument("-o", dest="file", type=Path, default=RESULTS / "loss.csv")
    given = parser.parse_args()
    with given.file.open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(("control", "lost", "ground", "walks", "arrives", "path", "peak"))
        for control, loss, ground in product(("compliant", "paper"), LOSSES, GROUNDS):
            batch = run_batch(list(walks(control, loss, ground, given.seeds)), compiled=True)
            with closing(batch) as summaries:
                runs = list(summaries)
            table.writerow((control, loss, ground, len(runs), *shares(runs)))
            file.flush()


if __name__ == "__main__":
    main()
