"""Renders the page of a live robot: one HTML file with the viewer."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from typing import Any

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from hexapod_cosim.cosim.common.control_style import all_styles
from hexapod_cosim.cosim.report.page import VIEWER, viewer_script
from hexapod_cosim.cosim.report.payload import as_json
from hexapod_cosim.cosim.scenario.controls import control_of
from hexapod_cosim.extensions.live.settings import FLAT, OWN, Choices, shown_speed
from hexapod_cosim.models import HexapodError
from hexapod_cosim.models.ground.catalogue import CATALOGUE

TEMPLATE = "live.html.jinja"


def render_page(choices: Choices) -> str:
    """Returns the page of a loop. Raises HexapodError when the viewer was not built."""
    return fill_page(choices, describe(choices))


def fill_page(choices: Choices, setup: Mapping[str, Any], module: bytes | None = None) -> str:
    """Returns the page with its viewer.

    Args:
        choices: the scenario and the controls, for titles and colours.
        setup: what the viewer reads, as JSON.
        module: the robot as WebAssembly, for a page that needs no loop elsewhere.

    Raises HexapodError when the viewer was not built.
    """
    script = viewer_script()
    if script is None:
        raise HexapodError(
            "the page needs the viewer, which is not installed", got=f"no {VIEWER}",
            fix="install the package without HX_VIEWER=OFF",
        )  # fmt: skip
    return (
        _environment()
        .get_template(TEMPLATE)
        .render(
            title=choices.scenario.title,
            robot=choices.scenario.robot,
            setup=Markup(as_json(setup)),
            styles=all_styles(list(choices.controls)),
            viewer=script,
            module=None if module is None else base64.b64encode(module).decode("ascii"),
        )
    )


def describe(choices: Choices) -> dict[str, Any]:
    """Returns what the page needs to know before the loop tells more."""
    grounds = [{"name": name, "about": _about_ground(name)} for name in choices.grounds]
    return {
        "title": choices.scenario.title,
        "controls": [
            {"name": label, "title": label, "own": not control_of(text).is_builtin}
            for label, text in choices.controls.items()
        ],
        "refused": choices.refused,
        "gaits": list(choices.gaits),
        "grounds": grounds,
        "speed": shown_speed(choices),
    }


def _about_ground(name: str) -> str:
    own = {OWN: "of the scenario", FLAT: "a horizontal plane"}
    return own[name] if name in own else CATALOGUE[name].about


def _environment() -> Environment:
    """Returns the templates of this folder; they include the report's style sheets."""
    folders = [
        PackageLoader("hexapod_cosim.extensions", "live"),
        PackageLoader("hexapod_cosim.cosim", "report"),
    ]
    return Environment(
        loader=ChoiceLoader(folders), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
