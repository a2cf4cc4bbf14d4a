"""Measures the paper's control against the others in one gait, and writes docs/control/paper.md.

usage: python -m benchmarks.control.paper [--quick]

Each table is a median over the seeds of the judged walk, or over the judged cases of the course.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks import BUILD, ROOT
from benchmarks.control.figures import draw_feet, draw_front
from benchmarks.control.tables import markdown, put_into
from hexapod_cosim.controller import Gains
from hexapod_cosim.cosim.results.summary import Summary
from hexapod_cosim.cosim.run.batch import run_batch
from hexapod_cosim.cosim.run.preparation import design_key, designed_gains
from hexapod_cosim.cosim.scenario.scenario import load_scenario
from hexapod_cosim.cosim.scenario.variation import STANDARD
from hexapod_cosim.extensions.course.reading import load_course
from hexapod_cosim.extensions.course.records import read_entries
from hexapod_cosim.extensions.course.runs import Run, run_course

PAGE = ROOT / "docs" / "control" / "paper.md"
CONTROLS = ("kinematic", "paper", "compliant")
WALKS = {"tripod": "own", "amble": "chosen"}  # gait: stance in which all controls walk it
LAWS = ("tanh", "bristle")
SHARES = (0.0, 0.1, 0.2, 0.3, 0.38, 0.5, 0.6, 0.7)  # 1    of a tripod
DEFAULT = 0.38  # 1    the default share
HEIGHT = 0.5 / 0.38  # 1    height_share over share
# metric -> heading and factor to its unit
COLUMNS = {
    "slip_per_metre": ("slip [mm/m]", 1e3),
    "peak_force": ("peak [BW]", 1.0),
    "loading_rate": ("loading [BW/s]", 1.0),
    "foot_error_stance": ("feet from plan [mm]", 1e3),
    "roll_rms": ("roll [mrad]", 1e3),
    "torque_rms": ("torque [N m]", 1.0),
    "electrical_cost": ("electrical cost", 1.0),
    "servo_load_max": ("hottest servo", 1.0),
    "path_error": ("path error [mm/m]", 1e3),
}
GROUND = {"slip": "slip", "peak": "peak", "loading": "loading", "electrical": "electrical"}
PARTS = {
    "all parts": (),
    "without share and lift": ("paper_share",),
    "without PID": ("paper_pid",),
    "without suspension": ("paper_suspension",),
}
CONDITIONS = {
    "as judged": [],
    "rubber of 1e4 N/m^1.5": ["contact.stiffness=1e4"],
    "rubber of 1e5 N/m^1.5": ["contact.stiffness=1e5"],
    "rubber of 1e7 N/m^1.5": ["contact.stiffness=1e7"],
    "servos 30 % softer than told": ["parameters.servo.kp=28.0"],
    "servos 30 % stiffer than told": ["parameters.servo.kp=52.0"],
    "forces 10 ms late": ["sensors.foot_force_delay=10 ms"],
    "forces 20 ms late": ["sensors.foot_force_delay=20 ms"],
    "forces 30 ms late": ["sensors.foot_force_delay=30 ms"],
    "friction 0.3": ["friction.mu=0.3"],
    "soil: mud, pads of 25 mm": ["soil=mud", "foot.pad_radius=0.025"],
    "sensor of LM dead from 4 s": ["events=[{time=4, leg='LM', fault='dead'}]"],
}
Walked = Mapping[str, float]  # medians of the metrics


def settings_of(walk: str, law: str) -> list[str]:
    return [f"walk.stance={WALKS[walk]}", f"friction.law={law}", "outputs.plots=false"]


def walked(
    control: str, settings: Sequence[str], seeds: range, paper: Mapping[str, float] | None = None
) -> Walked:
    """Returns the medians over seeds of the judged flat walk; NaN where a run did not walk.

    paper: gains of the paper's control that differ from the designed ones.
    """
    plan = load_scenario("walk_flat", overrides=[*settings, f"control={control}"])
    named = {key: value for key, value in plan.settings.items() if key != "gait"}
    plan = replace(plan, variation=STANDARD, settings=named)
    plans = [replace(plan, seed=seed) for seed in seeds]
    with closing(run_batch(plans, gains=changed(plans[0], paper), compiled=True)) as runs:
        return medians(list(runs))


def changed(plan: Any, paper: Mapping[str, float] | None) -> Gains | None:
    """Returns the designed gains with other gains of the paper's control, None without others."""
    if paper is None:
        return None
    gains = designed_gains(*design_key(plan))
    return replace(gains, paper=replace(gains.paper, **paper))


def medians(runs: Sequence[Summary]) -> Walked:
    return {name: float(np.median([run.metrics[name] for run in runs])) for name in COLUMNS}


def change(value: float, reference: float) -> str:
    return f"{100.0 * (value / reference - 1.0):+.0f} %"


def flat_table(seeds: range) -> str:
    """Returns the flat walk under all controls, in both walks and under both friction laws."""
    rows = []
    for walk in WALKS:
        for law in LAWS:
            found = {name: walked(name, settings_of(walk, law), seeds) for name in CONTROLS}
            for name, values in found.items():
                row = [walk, law, name]
                for metric, (_, scale) in COLUMNS.items():
                    cell = f"{scale * values[metric]:.3g}"
                    if name != CONTROLS[0]:
                        cell += f" ({change(values[metric], found[CONTROLS[0]][metric])})"
                    row.append(cell)
                rows.append(row)
    return markdown(
        ["gait", "friction", "control", *(title for title, _ in COLUMNS.values())], rows
    )


def ground_table(kinds: Sequence[str], seeds: int | None) -> str:
    """Returns success, and changes in the median over the judged cases, by class of ground."""
    rows = []
    for walk in WALKS:
        for law in LAWS:
            for kind in kinds:
                rows += list(_ground_rows(walk, law, kind, seeds))
    return markdown(["ground", "gait", "friction", "control", "arrive", *GROUND.values()], rows)


def _ground_rows(walk: str, law: str, kind: str, seeds: int | None) -> Iterator[list[str]]:
    course = load_course("judge", names=[kind], seeds=seeds, settings=settings_of(walk, law))
    runs = list(run_course(course, read_entries(CONTROLS)))
    for control in CONTROLS:
        own = [run for run in runs if run.control == control]
        arrived = f"{sum(run.success for run in own)} of {len(own)}"
        cells = [_ground_change(runs, control, name) for name in GROUND]
        yield [kind, walk, law, control, arrived, *cells]


def _ground_change(runs: Sequence[Run], control: str, name: str) -> str:
    """Returns the median over cases of the change of a figure from kinematic control.

    The figure of a case is its median over the runs that arrived under both controls.
    """
    if control == CONTROLS[0]:
        return ""
    by_place = {(run.case, run.seed, run.control): run for run in runs}
    changes = []
    for case in dict.fromkeys(run.case for run in runs):
        pairs = [
            (run.values[name], other.values[name])
            for run in runs
            if run.case == case and run.control == control
            for other in [by_place[case, run.seed, CONTROLS[0]]]
            if run.success and other.success
        ]
        if pairs:
            ours, theirs = np.median(np.array(pairs), axis=0)
            changes.append(ours / theirs)
    return change(float(np.median(changes)), 1.0) if changes else "-"


def front(seeds: range) -> Mapping[str, Sequence[Walked]]:
    """Returns the flat walk over the shares, by gait and friction law."""
    found = {}
    for walk in WALKS:
        for law in LAWS:
            found[f"{walk}, {law}"] = [
                walked(
                    "paper",
                    settings_of(walk, law),
                    seeds,
                    {"share": share, "height_share": HEIGHT * share},
                )
                for share in SHARES
            ]
    return found


def front_table(found: Mapping[str, Sequence[Walked]]) -> str:
    """Returns slip and energy over the share."""
    rows = []
    for number, share in enumerate(SHARES):
        row = [f"**{share:g}**" if share == DEFAULT else f"{share:g}"]
        for values in found.values():
            one = values[number]
            row.append(f"{1e3 * one['slip_per_metre']:.0f}, {one['electrical_cost']:.2f}")
        rows.append(row)
    return markdown(["share", *found], rows)


def pid_table(seeds: range) -> str:
    """Returns slip over the gains of the PID in a tripod."""
    rows = []
    for yielded in (0.0, 0.15, 0.3, 0.6, 1.0):
        for rate in (0.0, 3.0, 10.0):
            row = [f"{yielded:g}", f"{rate:g}"]
            for law in LAWS:
                values = walked(
                    "paper",
                    settings_of("tripod", law),
                    seeds,
                    {"yield_share": yielded, "return_rate": rate},
                )
                slip, error = values["slip_per_metre"], values["foot_error_stance"]
                row.append(f"{1e3 * slip:.0f} mm/m, {1e3 * error:.2f} mm")
            rows.append(row)
    return markdown(["yield_share", "return_rate [1/s]", *LAWS], rows)


def survival_table(seeds: range) -> str:
    """Returns changes from kinematic control by conditions that differ from the design's."""
    names = ("slip_per_metre", "peak_force", "foot_error_stance", "electrical_cost")
    rows = []
    for title, more in CONDITIONS.items():
        row = [title]
        for walk in WALKS:
            for law in LAWS:
                settings = [*settings_of(walk, law), *more]
                theirs, ours = (walked(name, settings, seeds) for name in CONTROLS[:2])
                row.append(" ".join(change(ours[name], theirs[name])[:-2] for name in names))
        rows.append(row)
    heads = [f"{walk}, {law}" for walk in WALKS for law in LAWS]
    return markdown(["condition", *heads], rows)


def parts_table(seeds: int | None) -> str:
    """Returns changes from kinematic control without each part, on flat and uneven ground."""
    kinds = ("flat_tanh", "flat_sticking", "rough", "stairs")
    entries = ["kinematic", "paper"]
    rows = []
    for walk in WALKS:
        for title, off in PARTS.items():
            switches = [f"compliance.{part}=false" for part in off]
            row = [walk, title]
            for kind in kinds:
                settings = [*settings_of(walk, "tanh"), *switches]
                settings = settings[:1] + settings[2:] if kind.startswith("flat") else settings
                course = load_course("judge", names=[kind], seeds=seeds, settings=settings)
                runs = list(run_course(course, read_entries(entries)))
                cells = [_ground_change(runs, "paper", name)[:-2] for name in GROUND]
                row.append(" ".join(cells))
            rows.append(row)
    return markdown(["gait", "parts", *kinds], rows)


def main(arguments: Sequence[str] | None = None) -> int:
    """Makes all tables and figures; with --quick few seeds, written into build/bench."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.control.paper")
    parser.add_argument("--quick", action="store_true", help="few seeds; the page stays as it is")
    given = parser.parse_args(arguments)
    seeds = range(2) if given.quick else range(10)
    few = range(1) if given.quick else range(3)
    images = BUILD / "control" if given.quick else ROOT / "docs" / "images"
    images.mkdir(parents=True, exist_ok=True)
    shares = front(few)
    tables = {
        "paper flat": flat_table(seeds),
        "paper ground": ground_table(("rough", "stairs"), 1 if given.quick else None),
        "paper front": front_table(shares),
        "paper pid": pid_table(few),
        "paper survival": survival_table(few),
        "paper parts": parts_table(1 if given.quick else 3),
    }
    draw_front(images / "paper_front.svg", shares, SHARES, DEFAULT)
    draw_feet(images / "paper_feet.svg")
    if not given.quick:
        put_into((PAGE,), tables)
    print("\n\n".join(f"{name}\n\n{table}" for name, table in tables.items()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
