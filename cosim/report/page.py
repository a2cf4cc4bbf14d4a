"""Renders pages from templates, for all kinds of reports."""

from __future__ import annotations

import base64
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from hexapod_cosim.cosim.common.control_style import all_styles
from hexapod_cosim.cosim.common.plant_files import plant_folders

FOLDER = Path("viewer")  # in the plant's folder, where CMake installs the bundle
VIEWER = "viewer.js"
NO_VIEWER = (
    "Replay and plots are left out: "
    "this installation was built without the viewer (HX_VIEWER=OFF). "
    "`pip install` without that option, then `hexapod report` of this folder, adds them."
)


@cache
def environment(package: str = "") -> Environment:
    """Returns the templates of this folder; reports extend `base.html.jinja`.

    package: whose folder has further templates, such as that of an extension.
    """
    packages = ["hexapod_cosim.cosim.report", *([package] if package else [])]
    return Environment(
        loader=ChoiceLoader([PackageLoader(one, "") for one in packages]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def render(
    template: str, *, controls: Iterable[str] = (), package: str = "", **content: Any
) -> str:
    """Renders a page with the colours of the figures; `controls` are the labels on it."""
    styles = all_styles(controls)
    return environment(package).get_template(template).render(styles=styles, **content)


def embedded(svg: Path) -> str:
    """Returns a picture as a URL that contains it."""
    return "data:image/svg+xml;base64," + base64.b64encode(svg.read_bytes()).decode("ascii")


def viewer_script() -> Markup | None:
    """Returns the newest installed viewer's JavaScript for a <script>; None if there is none."""
    places = [folder / FOLDER / VIEWER for folder in plant_folders()]
    found = [path for path in places if path.is_file()]
    if not found:
        return None
    text = max(found, key=lambda path: path.stat().st_mtime).read_text(encoding="utf-8")
    return Markup(text.replace("</script", "<\\/script"))
