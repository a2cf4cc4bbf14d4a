"""Renders the pages of this room: a headline, tables and figures of a log."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from jinja2 import ChoiceLoader, PackageLoader

from hexapod_cosim.cosim.common.control_style import all_styles
from hexapod_cosim.cosim.report.page import environment
from hexapod_cosim.extensions.identify.comparison import Difference
from hexapod_cosim.extensions.identify.log import CHANNELS

TEMPLATE = "log.html.jinja"
TITLES = {channel.key: channel.title for channel in CHANNELS}
COLUMNS = ("channel", "unit", "columns", "spread", "rms error", "largest error", "in", "at [s]")


@dataclass(frozen=True, kw_only=True)
class Section:
    """A table and pictures below a heading."""

    title: str
    caption: str = ""
    columns: Sequence[str] = ()
    rows: Sequence[Sequence[str]] = ()
    left: int = 1  # number of columns that are texts
    pictures: Mapping[str, str] = field(default_factory=dict)  # data URLs by title


def rendered(sections: Sequence[Section], **content: Any) -> str:
    """Returns a page. content: title, headline, lead, warnings, command, facts, source."""
    own = environment()
    loaders = [PackageLoader("hexapod_cosim.extensions", "identify"), own.loader]
    pages = own.overlay(loader=ChoiceLoader([each for each in loaders if each is not None]))
    template = pages.get_template(TEMPLATE)
    return template.render(styles=all_styles(()), sections=sections, **content)


def number(value: float) -> str:
    """Returns a number with four digits."""
    return f"{value:.4g}"


def difference_rows(differences: Sequence[Difference]) -> list[list[str]]:
    """Returns the rows of a table with COLUMNS."""
    return [
        [
            TITLES[one.channel],
            one.unit,
            str(one.columns),
            number(one.spread),
            number(one.rms),
            number(one.largest),
            one.name,
            number(one.at),
        ]
        for one in differences
    ]
