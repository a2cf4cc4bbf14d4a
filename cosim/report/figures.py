"""Draws the figures of a report into memory, and writes them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from hexapod_cosim.controller.figure_style import DPI, SETTINGS, UNDATED
from hexapod_cosim.cosim.common.files import atomic_path
from hexapod_cosim.cosim.master.recorder import ColumnError
from hexapod_cosim.cosim.results.window import View

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Figures(NamedTuple):
    """Figures that were drawn and not yet written."""

    images: Mapping[str, bytes]  # content of each file by its name
    skipped: Mapping[str, str]  # by name of a figure, why it was not drawn


def draw_figures(views: Mapping[str, View], formats: Sequence[str] = ("svg",)) -> Figures:
    """Draws the figures of runs by control in formats of UNDATED. A PNG takes four times as long
    as an SVG.
    """
    # imported only here because matplotlib is slow to import
    import matplotlib  # noqa: PLC0415

    from hexapod_cosim.cosim.report.plots import DRAWINGS  # noqa: PLC0415

    images: dict[str, bytes] = {}
    skipped: dict[str, str] = {}
    with matplotlib.rc_context(SETTINGS | {"figure.constrained_layout.use": False}):
        for name, draw in DRAWINGS.items():
            try:
                figure = draw(views)
            except ColumnError as error:
                skipped[name] = str(error)
                continue
            place_axes(figure)
            images |= {f"{name}.{kind}": content for kind, content in figure_files(figure, formats)}
    return Figures(images, skipped)


def place_axes(figure: Figure) -> None:
    """Places the axes of a grid by margins and gaps in inches, below the figure's legend.

    Matplotlib's own layout takes twice as long as to write the figure as SVG.
    """
    width, height = figure.get_size_inches()
    left, right, bottom, top = 0.6, 0.12, 0.42, 0.45
    places = [(axis, place) for axis in figure.axes if (place := axis.get_subplotspec())]
    rows, columns = places[0][1].get_gridspec().get_geometry()
    inner = any(not place.is_first_col() and axis.get_ylabel() for axis, place in places)
    numbered = any(
        not place.is_last_row() and axis.xaxis.get_tick_params().get("labelbottom", True)
        for axis, place in places
    )
    beside, below = 0.7 if inner else 0.2, 0.55 if numbered else 0.3
    wide = (width - left - right - (columns - 1) * beside) / columns
    high = (height - bottom - top - (rows - 1) * below) / rows
    figure.subplots_adjust(
        left=left / width,
        right=1.0 - right / width,
        bottom=bottom / height,
        top=1.0 - top / height,
        wspace=beside / wide,
        hspace=below / high,
    )


def figure_files(
    figure: Figure, formats: Sequence[str] = tuple(UNDATED)
) -> Iterator[tuple[str, bytes]]:
    """Yields a figure's file in each format, as (format, content).

    The axes are placed once: savefig() would do so for each format, and before each would draw
    everything once more.
    """
    import matplotlib  # noqa: PLC0415

    figure.set_dpi(DPI)
    engine = figure.get_layout_engine()
    if engine is not None and figure.axes:
        engine.execute(figure)
    with matplotlib.rc_context({"figure.constrained_layout.use": False}):
        figure.set_layout_engine(None)
        for kind in formats:
            content = BytesIO()
            figure.savefig(content, format=kind, dpi=DPI, metadata=UNDATED[kind])
            yield kind, content.getvalue()


def write_figures(figures: Figures, folder: Path) -> list[Path]:
    """Writes figures into a folder, each file atomically, and returns the files.

    Files of skipped figures, from an earlier report, are deleted.
    """
    folder.mkdir(exist_ok=True)
    for name in figures.skipped:
        for kind in UNDATED:
            (folder / f"{name}.{kind}").unlink(missing_ok=True)
    files = [folder / name for name in figures.images]
    for path, content in zip(files, figures.images.values(), strict=True):
        with atomic_path(path) as temporary:
            temporary.write_bytes(content)
    return files
