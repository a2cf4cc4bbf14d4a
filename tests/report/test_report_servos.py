"""The report's table of the load on each servo."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from command import Call
from walks import PARAMETERS, PERIOD, Walk

from hexapod_cosim.cosim.report.servos import servo_rows
from hexapod_cosim.cosim.results.folder import StoredResult
from hexapod_cosim.cosim.results.window import View


def stored(walk: Walk) -> StoredResult:
    view = View(walk.recording, PARAMETERS, PERIOD)
    return StoredResult(view, walk.metrics(), {}, "")


def test_each_servo_is_shown_with_its_load_in_per_cent_of_the_rating() -> None:
    """The rating is 1.2 N m."""
    busy, lazy = Walk(), Walk()
    busy.grow("LM.femur.torque_squared", 1.5**2)
    busy.grow("RM.tibia.torque_squared", 0.3**2)
    lazy.grow("RF.coxa.torque_squared", 0.12**2)
    rows = servo_rows({"kinematic": stored(busy), "compliant": stored(lazy)})
    found = {row["name"]: row["values"] for row in rows}
    assert sorted(found) == ["LF", "LM", "LR", "RF", "RM", "RR"]
    assert found["LM"] == ["0", "125", "0", "0", "0", "0"]
    assert found["RM"] == ["0", "0", "25", "0", "0", "0"]
    assert found["RF"] == ["0", "0", "0", "10", "0", "0"]
    assert found["LF"] == ["0"] * 6


def test_a_run_too_short_for_metrics_has_no_table_of_servos() -> None:
    assert servo_rows({"kinematic": stored(Walk(cycles=2.5))}) == []


@pytest.mark.usefixtures("undrawn")
def test_the_report_of_a_walk_shows_eighteen_loads_of_which_one_is_the_largest(
    call: Call, tmp_path: Path
) -> None:
    changes = ["--set", "duration=2.4", "--set", "gait.period=0.8"]
    assert call("simulate", "walk_flat", "-o", tmp_path, *changes)[0] == 0
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    table = page.partition("<h2>Load on each servo</h2>")[2].partition("</table>")[0]
    loads = [int(text) for text in re.findall(r'<td class="number">(\d+)</td>', table)]
    metrics = json.loads((tmp_path / "metrics.json").read_text(encoding="utf-8"))
    assert len(loads) == 18
    assert max(loads) == round(100.0 * metrics["servo_load_max"])
