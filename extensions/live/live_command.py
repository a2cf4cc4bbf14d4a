"""`hexapod live`: a robot that is driven in a browser, in real time."""

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
from hexapod_cosim.cosim.cli.running import given_gains
from hexapod_cosim.cosim.cli.terminal import (
    refuse_unused,
    show_files,
    show_json,
    show_text,
    waiting,
)
from hexapod_cosim.cosim.control.controllers import check_control
from hexapod_cosim.cosim.scenario.controls import parse_controls
from hexapod_cosim.cosim.scenario.records import CONTROLS, Scenario
from hexapod_cosim.cosim.scenario.scenario import load_scenario

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
    from hexapod_cosim.extensions.live.server import LiveServer  # noqa: PLC0415  slow to import
    from hexapod_cosim.extensions.live.settings import (  # noqa: PLC0415
        Choices,
        control_texts,
        live_scenario,
    )

    plan = load_scenario(scenario, overrides=settings or [])
    given = parse_controls(control or [plan.control], where="--control")
    check_control(plan, given)
    plan = replace(plan, control=given[0].text)
    found, refusal = _gains_of(live_scenario(plan), given_gains(gains))
    able = CONTROLS if found is not None else ("kinematic",)
    texts = {one.label: one.text for one in given} | control_texts(plan, able)
    refused = {name: refusal for name in CONTROLS if name not in able}
    with waiting("starting the robot"):
        server = LiveServer(Choices(plan, texts, refused), found, port=port)
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
    from hexapod_cosim.cosim.run.preparation import chosen_gains  # noqa: PLC0415  a slow import

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
