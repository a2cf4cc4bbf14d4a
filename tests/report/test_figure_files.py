"""Tests figures in memory: drawing that is stopped, drawing in a thread, writing."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path

import matplotlib
import pytest
from matplotlib.backend_bases import RendererBase
from matplotlib.figure import Figure

from hexapod_cosim.controller.figure_style import SETTINGS
from hexapod_cosim.cosim.report import plots
from hexapod_cosim.cosim.report.figures import Figures, FigureThread, write_figures


@pytest.fixture
def two_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Replaces the figures of a report by two empty ones."""
    empty = plots.Drawing("Nothing", "Nothing.", lambda _views: Figure(figsize=(1.0, 1.0)))
    monkeypatch.setattr(plots, "FIGURES", {"one": empty, "two": empty})


@pytest.mark.usefixtures("two_figures")
def test_drawing_that_is_stopped_leaves_out_the_figures_that_follow() -> None:
    answers = iter([False, True])
    drawn = plots.draw_figures({}, lambda: next(answers))
    assert (set(drawn.images), drawn.skipped) == ({"one.png", "one.svg"}, {})


@pytest.mark.usefixtures("two_figures")
def test_a_thread_draws_the_same_bytes() -> None:
    with FigureThread({}) as thread:
        drawn = thread.result()
    assert drawn == plots.draw_figures({})
    assert set(drawn.images) == {"one.png", "one.svg", "two.png", "two.svg"}


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
    monkeypatch.setattr(plots, "FIGURES", {"one": plots.Drawing("", "", labelled)})
    drawn = plots.draw_figures({}).images
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

    monkeypatch.setattr(plots, "FIGURES", {"one": plots.Drawing("", "", counted)})
    assert set(plots.draw_figures({}).images) == {"one.png", "one.svg"}
    assert len(drawn) == 2


def test_an_error_of_drawing_arises_where_the_figures_are_asked_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fail(_views: plots.Views) -> Figure:
        raise ZeroDivisionError

    monkeypatch.setattr(plots, "FIGURES", {"one": plots.Drawing("", "", fail)})
    with FigureThread({}) as thread, pytest.raises(ZeroDivisionError):
        thread.result()


def test_files_of_skipped_figures_are_deleted(tmp_path: Path) -> None:
    for name in ("old.png", "old.svg", "other.txt"):
        (tmp_path / name).touch()
    files = write_figures(Figures({"new.svg": b"<svg/>"}, {"old": "not recorded"}), tmp_path)
    assert files == [tmp_path / "new.svg"]
    assert {path.name for path in tmp_path.iterdir()} == {"new.svg", "other.txt"}
