"""Tests figures in memory: drawing and writing."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path

import matplotlib
import pytest
from matplotlib.backend_bases import RendererBase
from matplotlib.figure import Figure

from hexapod_cosim.controller.figure_style import SETTINGS
from hexapod_cosim.cosim.report import plots
from hexapod_cosim.cosim.report.figures import Figures, draw_figures, write_figures


def labelled(_views: plots.Views) -> Figure:
    """Two plots whose labels need room that only a layout gives them."""
    figure = Figure(figsize=(3.0, 2.0))
    for axes in figure.subplots(1, 2, sharey=True):
        axes.plot([0.0, 1e4], [0.0, 1e-3])
        axes.set(xlabel="long way\nin two lines", ylabel="height\n[m]", title="title")
    figure.supxlabel("both")
    return figure


def test_files_have_the_bytes_of_figures_that_are_laid_out_by_saving_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(plots, "DRAWINGS", {"one": labelled})
    drawn = draw_figures({}).images
    with matplotlib.rc_context(SETTINGS):
        figure = labelled({})
        for kind, metadata in (("png", {}), ("svg", {"Date": None})):
            content = BytesIO()
            figure.savefig(content, format=kind, dpi=200, metadata=metadata)
            assert drawn[f"one.{kind}"] == content.getvalue()
            figure.set_layout_engine("none")


def test_a_figure_is_drawn_once_for_each_file(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn = []

    class Counted(Figure):
        def draw(self, renderer: RendererBase) -> None:
            drawn.append(renderer)
            super().draw(renderer)

    def counted(_views: plots.Views) -> Figure:
        figure = Counted(figsize=(1.0, 1.0))
        figure.subplots()
        return figure

    monkeypatch.setattr(plots, "DRAWINGS", {"one": counted})
    assert set(draw_figures({}).images) == {"one.png", "one.svg"}
    assert len(drawn) == 2


def test_files_of_skipped_figures_are_deleted(tmp_path: Path) -> None:
    for name in ("old.png", "old.svg", "other.txt"):
        (tmp_path / name).touch()
    files = write_figures(Figures({"new.svg": b"<svg/>"}, {"old": "not recorded"}), tmp_path)
    assert files == [tmp_path / "new.svg"]
    assert {path.name for path in tmp_path.iterdir()} == {"new.svg", "other.txt"}
