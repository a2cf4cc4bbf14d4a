"""Tests figures in memory, and the data in a report's page: precise enough,
small enough, and with all peaks.
"""

from __future__ import annotations

import base64
import json
import zlib
from itertools import combinations
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pytest
from matplotlib.backend_bases import RendererBase
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from hexapod_cosim.controller.figure_style import SETTINGS
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.report import plots
from hexapod_cosim.cosim.report.columns import MOST_ROWS, choose, pack
from hexapod_cosim.cosim.report.figures import Figures, draw_figures, place_axes, write_figures
from hexapod_cosim.cosim.report.payload import as_json
from hexapod_cosim.cosim.results.window import View

MOST_COLUMNS = 95  # of a run that recorded everything
REST = 800_000  # bytes of a report without its recordings
LARGEST = 8_000_000  # bytes of a report of a minute's walk
ROUND_OFF = 1e-12  # of doubles, relative to the column's largest value


def times(rows: int) -> np.ndarray[Any, np.dtype[np.float64]]:
    return np.linspace(0.0, 0.005 * (rows - 1), rows)


def unpacked(packed: dict[str, Any]) -> dict[str, np.ndarray[Any, Any]]:
    """Unpacks as the docstring of `pack` says, by sums of Python integers."""
    raw = zlib.decompress(base64.b64decode(packed["data"]))
    rows, names = packed["rows"], ["low", "high", *(name for name, _, _ in packed["columns"])]
    size = rows * len(names)
    assert len(raw) == 2 * size
    steps: dict[str, list[int]] = {}
    for k, name in enumerate(names):
        total, steps[name] = 0, []
        for place in range(k * rows, (k + 1) * rows):
            total = (total + raw[place] + 256 * raw[size + place]) % 65536
            steps[name].append(total)
    columns = {
        name: offset + scale * np.array(steps[name], dtype=float)
        for name, scale, offset in packed["columns"]
    }
    ticks = np.array(steps["low"], dtype=float) + 65536.0 * np.array(steps["high"], dtype=float)
    return columns | {"time": packed["start"] + packed["tick"] * ticks}


@pytest.fixture(scope="module")
def columns() -> dict[str, np.ndarray[Any, Any]]:
    rng = np.random.default_rng(3)
    return {
        "walk": np.linspace(-1.0, 4.8, 900),
        "noise": rng.normal(0.0, 1e-9, 900),
        "leaps": rng.choice([-1e6, 1e6], 900),
        "constant": np.full(900, 0.3),
        "spike": np.where(np.arange(900) == 417, 50.0, 0.0),
    }


def test_every_column_comes_back_within_half_a_step_of_its_range(
    columns: dict[str, np.ndarray[Any, Any]],
) -> None:
    back = unpacked(pack(times(900), columns))
    for name, values in columns.items():
        bound = np.ptp(values) / 131070 + ROUND_OFF * np.abs(values).max()
        assert np.abs(back[name] - values).max() <= bound, name


def test_times_come_back_to_the_microsecond_also_where_steps_differ() -> None:
    time = 7.0 + np.cumsum(np.random.default_rng(1).uniform(1e-4, 0.9, 900))
    assert np.abs(unpacked(pack(time, {}))["time"] - time).max() <= 0.51e-6
    assert (
        np.abs(unpacked(pack(1e4 * time, {}))["time"] - 1e4 * time).max()
        <= 1e4 * np.ptp(time) / 2**31
    )


def test_a_column_with_holes_is_left_out(columns: dict[str, np.ndarray[Any, Any]]) -> None:
    holed = columns | {"holed": np.where(np.arange(900) == 3, np.nan, 1.0)}
    assert list(unpacked(pack(times(900), holed))) == [*columns, "time"]


def test_a_long_recording_is_thinned_to_the_budget() -> None:
    rows = 3 * MOST_ROWS + 7
    names = ("time", "torso.roll", "torso.pitch", "torso.yaw")
    data = np.column_stack([0.001 * np.arange(rows), *(np.arange(rows) % k for k in (2, 3, 5))])
    time, columns, every = choose(View(Recording(names, data), {}, 1.0))
    assert (len(time), every) == (15_002, 4)
    np.testing.assert_array_equal(time, data[::4, 0])
    np.testing.assert_array_equal(columns["pitch"], np.degrees(np.unwrap(data[:, 2]))[::4])
    whole, _, every = choose(View(Recording(names, data[:400]), {}, 1.0))
    assert (len(whole), every) == (400, 1)


def test_a_minute_of_both_controls_fits_the_page_even_if_nothing_of_it_compresses() -> None:
    columns = {str(k): np.random.default_rng(k).uniform(size=12_001) for k in range(MOST_COLUMNS)}
    packed = pack(times(12_001), columns)
    assert 2 * len(packed["data"]) + REST < LARGEST


def test_json_cannot_end_the_script_it_stands_in() -> None:
    text = as_json({"label": "</script><script>alert(1)</script><!--"})
    assert "<" not in text
    assert json.loads(text)["label"].startswith("</script>")


# Tests figures in memory: drawing and writing.


def test_axes_leave_room_for_their_labels_and_for_the_legend() -> None:
    with matplotlib.rc_context(SETTINGS | {"figure.constrained_layout.use": False}):
        figure = Figure(figsize=(7.2, 3.8))
        for axes in figure.subplots(2, 3).flat:
            axes.set(ylabel="height [m]", title="title")
            axes.plot([0.0, 9.0], [0.0, 1.0])
        axes.set_xlabel("time [s]")
        legend = figure.legend(axes.lines, ["a curve"], loc="outside upper center")
        place_axes(figure)
        renderer = FigureCanvasAgg(figure).get_renderer()
        boxes = [axes.get_tightbbox(renderer) for axes in figure.axes]
        boxes.append(legend.get_window_extent(renderer))
    edges = np.array([box.extents for box in boxes if box is not None])  # px    x0, y0, x1, y1
    assert len(edges) == 7
    assert (edges[:, :2] >= 0.0).all()
    for one, other in combinations(edges, 2):
        apart = np.maximum(one[:2] - other[2:], other[:2] - one[2:])
        assert apart.max() > 0.0, (one, other)


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
    assert set(draw_figures({}, ("png", "svg")).images) == {"one.png", "one.svg"}
    assert len(drawn) == 2


def test_files_of_skipped_figures_are_deleted(tmp_path: Path) -> None:
    for name in ("old.png", "old.svg", "other.txt"):
        (tmp_path / name).touch()
    files = write_figures(Figures({"new.svg": b"<svg/>"}, {"old": "not recorded"}), tmp_path)
    assert files == [tmp_path / "new.svg"]
    assert {path.name for path in tmp_path.iterdir()} == {"new.svg", "other.txt"}
