"""`hexapod live`: a robot is driven in a browser; `hexapod realtime`: how long a step takes."""

from __future__ import annotations

import threading
import webbrowser
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from hexapod_cosim.controller import Gains, GainsError
from hexapod_cosim.cosim.cli.options import ControlNames, GainsFile, Json, Name, Settings
from hexapod_cosim.cosim.cli.runs import given_gains
from hexapod_cosim.cosim.cli.terminal import (
    progress_bar,
    refuse_unused,
    show_files,
    show_json,
    show_table,
    show_text,
    waiting,
)
from hexapod_cosim.cosim.control.controllers import check_control
from hexapod_cosim.cosim.scenario.controls import parse_control, parse_controls
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.cosim.scenario.records import CONTROLS, Scenario

Port = Annotated[
    int,
    typer.Option("--port", metavar="PORT", help="Listen on this port; by default on a free one."),
]
Browser = Annotated[
    bool, typer.Option("--browser/--no-browser", help="Open the page in the browser.")
]
Page = Annotated[
    Path | None,
    typer.Option(
        "--page",
        metavar="FILE",
        help="Write a page instead in which the default robot walks without a server, and stop.",
    ),
]

STEPS = 200_000  # enough for 20 steps above the largest quantile

Control = Annotated[str, typer.Option("--control", metavar="CONTROL", help="What walks the robot.")]
Steps = Annotated[int, typer.Option("--steps", metavar="N", help="Number of macro-steps.")]
Step = Annotated[float, typer.Option("--step", metavar="S", help="Length of a macro-step [s].")]
Folder = Annotated[
    Path, typer.Option("-o", "--output", metavar="DIR", help="Where the histogram is written.")
]

UNUSED = {  # what has no effect on the page without a server
    "scenario": "SCENARIO",
    "control": "--control",
    "settings": "--set",
    "gains": "--gains",
    "port": "--port",
}


def live(
    context: typer.Context,
    scenario: Name = "walk_flat",
    control: ControlNames = None,
    settings: Settings = None,
    gains: GainsFile = None,
    port: Port = 0,
    browser: Browser = True,
    page: Page = None,
    json: Json = False,
) -> None:
    """Drive the robot in a browser, in real time: keys or touch. Ctrl-C ends it."""
    if page is not None:
        fix = (
            "leave them out: the page has the default robot on flat ground; others need a server, "
            "`hexapod live` without --page"
        )
        refuse_unused(context, UNUSED, written="the page without a server", fix=fix)
        _write_page(page, json=json)
        return
    # imported only here because they are slow to import
    from hexapod_cosim.extensions.live import settings as live_settings  # noqa: PLC0415
    from hexapod_cosim.extensions.live.server import LiveServer  # noqa: PLC0415

    plan = load_scenario(scenario, overrides=settings or [])
    given = parse_controls(control or [plan.control], where="--control")
    check_control(plan, given)
    plan = replace(plan, control=given[0].text)
    found, refusal = _gains_of(live_settings.live_scenario(plan), given_gains(gains))
    able = CONTROLS if found is not None else ("kinematic",)
    texts = {one.label: one.text for one in given} | live_settings.control_texts(plan, able)
    refused = {name: refusal for name in CONTROLS if name not in able}
    with waiting("starting the robot"):
        server = LiveServer(live_settings.Choices(plan, texts, refused), found, port=port)
    with suppress(KeyboardInterrupt):  # the server may have taken the signal itself
        server.run(lambda url: _announce(url, browser=browser, json=json))
    if not json:
        show_text("stopped")


def _write_page(path: Path, *, json: bool) -> None:
    """Writes the page without a server."""
    from hexapod_cosim.extensions.live.static_page import write_static_page  # noqa: PLC0415  slow

    with waiting("building the page"):
        file = write_static_page(path)
    if json:
        show_json({"files": [str(file)]})
    else:
        show_files([file])


def _gains_of(plan: Scenario, given: Gains | None) -> tuple[Gains | None, str]:
    """Returns the gains of the built-in controls, or None and why there are none.

    plan: as the live robot walks it.
    Raises GainsError when the scenario's own control needs them.
    """
    from hexapod_cosim.cosim.run.plan import chosen_gains  # noqa: PLC0415  a slow import

    try:
        with waiting("designing the gains"):
            return chosen_gains(replace(plan, control="compliant"), given), ""
    except GainsError as error:
        if chosen_gains(plan, given) is not None:
            raise
        return None, str(error)


def _announce(url: str, *, browser: bool, json: bool) -> None:
    """Prints the page's address and opens it."""
    if json:
        show_json({"url": url})
    else:
        show_text(f"the robot walks at {url}")
        show_text("Ctrl-C ends it")
    if browser:
        threading.Thread(target=webbrowser.open, args=(url,), daemon=True).start()


def realtime(
    scenario: Name = "walk_flat",
    control: Control = "compliant",
    settings: Settings = None,
    step: Step = 0.001,
    steps: Steps = STEPS,
    output: Folder = Path("out/realtime"),
    json: Json = False,
) -> None:
    """Measure doStep of the plant in a walk: quantiles and histogram."""
    from hexapod_cosim.cosim.run.plan import chosen_gains  # noqa: PLC0415

    # imported here because it draws with Matplotlib
    from hexapod_cosim.extensions.live import realtime as live  # noqa: PLC0415
    from hexapod_cosim.extensions.live.settings import live_scenario  # noqa: PLC0415

    text = parse_control(control, where="--control").text
    plan = load_scenario(scenario, overrides=[*(settings or []), f"macro_step={step!r}"])
    plan = replace(plan, control=text)
    with waiting("designing the gains"):
        gains = chosen_gains(live_scenario(plan))
    with progress_bar("doStep", steps * step) as progress:
        times = live.measure(plan, step=step, count=steps, gains=gains, progress=progress)
    facts, files = live.facts_of(times, step), live.write(times, step, output)
    if json:
        show_json({**facts, "written": [str(path) for path in files]})
        return
    show_text(f"{facts['steps']} steps of {1e3 * step:g} ms")
    rows = [[clock, *(f"{us:.0f}" for us in of.values())] for clock, of in facts["times"].items()]
    heading = ["us", *facts["times"]["wall time"]]
    show_table(heading, rows, right=range(1, len(heading)))
    show_files(files)
