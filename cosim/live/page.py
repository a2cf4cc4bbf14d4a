"""Renders the page of a live robot: one HTML file with the viewer."""

from __future__ import annotations

from typing import Any

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from hexapod_cosim.cosim.common.control_style import all_styles
from hexapod_cosim.cosim.live.settings import FLAT, OWN, Choices, shown_speed
from hexapod_cosim.cosim.report.page import viewer_script
from hexapod_cosim.cosim.report.payload import as_json
from hexapod_cosim.cosim.scenario.controls import control_of
from hexapod_cosim.models import HexapodError
from hexapod_cosim.models.ground.catalogue import CATALOGUE

TEMPLATE, BUNDLE = "live.html.jinja", "live.js"


def render_page(choices: Choices) -> str:
    """Returns the page. Raises HexapodError when the viewer was not built."""
    script = viewer_script(BUNDLE)
    if script is None:
        raise HexapodError(
            "the page needs the viewer, which is not installed", got=f"no {BUNDLE}",
            fix="install the package without HX_VIEWER=OFF",
        )  # fmt: skip
    labels = list(choices.controls)
    return (
        _environment()
        .get_template(TEMPLATE)
        .render(
            title=choices.scenario.title,
            robot=choices.scenario.robot,
            setup=Markup(as_json(describe(choices))),
            styles=all_styles(labels),
            viewer=script,
        )
    )


def describe(choices: Choices) -> dict[str, Any]:
    """Returns what the page needs to know before the loop tells more."""
    grounds = [{"name": name, "title": _ground_title(name)} for name in choices.grounds]
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


def _ground_title(name: str) -> str:
    if name == OWN:
        return "of the scenario"
    return "flat" if name == FLAT else CATALOGUE[name].about.lower()


def _environment() -> Environment:
    """Returns the templates of this folder; they include the report's style sheets."""
    folders = [PackageLoader("hexapod_cosim.cosim", name) for name in ("live", "report")]
    return Environment(
        loader=ChoiceLoader(folders), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
