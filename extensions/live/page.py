"""Renders the page of a live robot: one HTML file with the viewer."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from markupsafe import Markup

from hexapod_cosim.cosim.report.page import VIEWER, render, viewer_script
from hexapod_cosim.cosim.report.payload import as_json
from hexapod_cosim.cosim.scenario.reading import scenario_robot
from hexapod_cosim.extensions.live.settings import FLAT, OWN, Choices
from hexapod_cosim.models import HexapodError
from hexapod_cosim.models.ground.table import CATALOGUE

TEMPLATE = "live.html.jinja"
ABOUTS = {
    "kinematic": "Plays the planned joint angles; feels neither ground nor attitude.",
    "paper": "Moves feet back to their plan, by joint angles, foot forces and attitude.",
    "compliant": "Plans the forces of the feet and commands torques: softer landings, less slip.",
}


def render_page(
    choices: Choices, more: Mapping[str, Any] | None = None, *, module: str = ""
) -> str:
    """Returns the page with its viewer.

    Args:
        choices: the scenario and what the page may change.
        more: what a page without a server reads besides.
        module: the robot as WebAssembly in base64, for a page without a server.

    Raises HexapodError when the viewer was not built.
    """
    script = viewer_script()
    if script is None:
        raise HexapodError(
            "the page needs the viewer, which is not installed", got=f"no {VIEWER}",
            fix="install the package without HX_VIEWER=OFF",
        )  # fmt: skip
    return render(
        TEMPLATE,
        controls=list(choices.controls),
        package=__package__,
        title=choices.scenario.title,
        robot=choices.scenario.robot,
        setup=Markup(as_json(_describe(choices) | dict(more or {}))),
        viewer=script,
        module=module,
    )


def _describe(choices: Choices) -> dict[str, Any]:
    """Returns the choices of the page (viewer/messages.ts)."""
    own = scenario_robot(choices.scenario).terrain.name.replace("_", " ")
    about = {OWN: f"{own}, as in this scenario", FLAT: "a horizontal plane"}
    about |= {name: entry.about for name, entry in CATALOGUE.items()}
    return {
        "controls": list(choices.controls),
        "abouts": ABOUTS,
        "refused": choices.refused,
        "gaits": list(choices.gaits),
        "grounds": [{"name": name, "about": about[name]} for name in choices.grounds],
    }
