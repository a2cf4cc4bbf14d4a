"""Holds the figures of a report as files in memory, drawn in a thread if the caller wishes."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Event
from typing import NamedTuple

from hexapod_cosim.controller.figure_style import UNDATED
from hexapod_cosim.cosim.common.closing import Closing
from hexapod_cosim.cosim.common.files import atomic_path
from hexapod_cosim.cosim.results.window import View


class Figures(NamedTuple):
    """Figures that were drawn and not yet written."""

    images: Mapping[str, bytes]  # content of each file by its name
    skipped: Mapping[str, str]  # by name of a figure, why it was not drawn


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


class FigureThread(Closing):
    """Draws the figures of runs in a thread of its own, from its creation on.

    The caller must not draw with matplotlib until result() has returned or close() was called: the
    style is a setting of the whole process. A with statement ends the thread at the next figure.
    """

    def __init__(self, views: Mapping[str, View]) -> None:
        self._views, self._stop = views, Event()
        self._threads = ThreadPoolExecutor(1, thread_name_prefix="figures")
        self._drawn = self._threads.submit(self._draw)

    def _draw(self) -> Figures:
        # imported only here because matplotlib is slow to import
        from hexapod_cosim.cosim.report.plots import draw_figures  # noqa: PLC0415

        return draw_figures(self._views, self._stop.is_set)

    def result(self) -> Figures:
        """Waits until all figures are drawn and returns them. Raises what drawing raised."""
        return self._drawn.result()

    def close(self) -> None:
        """Stops drawing after the present figure and waits for the thread."""
        self._stop.set()
        self._threads.shutdown(wait=True, cancel_futures=True)
