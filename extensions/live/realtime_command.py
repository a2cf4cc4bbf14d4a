"""`hexapod realtime`: how long the plant takes for a step, as a histogram."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from hexapod_cosim.cosim.cli.options import Json, Name, Settings
from hexapod_cosim.cosim.cli.terminal import (
    progress_bar,
    show_files,
    show_json,
    show_table,
    show_text,
    waiting,
)
from hexapod_cosim.cosim.scenario.controls import parse_control
from hexapod_cosim.cosim.scenario.scenario import load_scenario

STEPS = 200_000  # enough for 20 steps above the largest quantile

Control = Annotated[str, typer.Option("--control", metavar="CONTROL", help="What walks the robot.")]
Steps = Annotated[int, typer.Option("--steps", metavar="N", help="Number of macro-steps.")]
Step = Annotated[float, typer.Option("--step", metavar="S", help="Length of a macro-step [s].")]
Folder = Annotated[
    Path, typer.Option("-o", "--output", metavar="DIR", help="Where the histogram is written.")
]


def realtime(
    scenario: Name = "walk_flat",
    control: Control = "compliant",
    settings: Settings = None,
    step: Step = 0.001,
    steps: Steps = STEPS,
    output: Folder = Path("out/realtime"),
    json: Json = False,
) -> None:
    """Measure doStep of the plant in a walk: quantiles and histogram, touch-downs apart."""
    from hexapod_cosim.cosim.run.preparation import chosen_gains  # noqa: PLC0415
    from hexapod_cosim.extensions.live import realtime as live  # noqa: PLC0415  draws with Matplotlib
    from hexapod_cosim.extensions.live.settings import live_scenario  # noqa: PLC0415

    text = parse_control(control, where="--control").text
    plan = load_scenario(scenario, overrides=[*(settings or []), f"macro_step={step!r}"])
    plan = replace(plan, control=text)
    with waiting("designing the gains"):
        gains = chosen_gains(live_scenario(plan))
    with progress_bar("doStep", steps * step) as progress:
        times = live.measure(plan, step=step, count=steps, gains=gains, progress=progress)
    facts, files = live.facts_of(times), live.write(times, output)
    if json:
        show_json({**facts, "written": [str(path) for path in files]})
        return
    heading, rows = live.table_of(facts)
    show_text(
        f"{facts['steps']} steps of {1e3 * step:g} ms, {facts['touch_downs']} with a touch-down"
    )
    show_table(heading, rows, right=range(1, len(heading)))
    met = "met" if facts["goal_met"] else "not met"
    show_text(
        f"goal {met}: {100 * live.GOAL_SHARE:g} % below {live.GOAL:g} us and none above "
        f"{live.WORST:g} us of the thread's processor time"
    )
    show_files(files)
