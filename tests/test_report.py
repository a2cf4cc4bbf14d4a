"""What a report says first, and what it does without its viewer."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import pytest
from command import Call

from hexapod_cosim.cosim import report
from hexapod_cosim.cosim.batch import Summary
from hexapod_cosim.cosim.comparison import Comparison, compare_runs
from hexapod_cosim.cosim.master import COMPLETED
from hexapod_cosim.cosim.metrics import METRICS
from hexapod_cosim.cosim.report.headline import cards, headline, plain_headline


def comparison(after: Mapping[str, float], *, seeds: int = 4, before: Mapping[str, float] | None = None) -> Comparison:
    """Runs whose metrics are 1 under kinematic control, and under compliant control too where `after` says nothing else."""
    return compare_runs(_runs("kinematic", before or {}, seeds), _runs("compliant", {**(before or {}), **after}, seeds))


def _runs(control: str, metrics: Mapping[str, float], seeds: int) -> Sequence[Summary]:
    values = dict.fromkeys(METRICS, 1.0) | dict(metrics)
    return [Summary(control=control, seed=seed, status=COMPLETED, upright=True, metrics=values) for seed in range(seeds)]


def sentence(result: Comparison) -> str:
    return "".join(part.text for part in headline(result))


def test_the_headline_tells_gains_and_costs_and_marks_them() -> None:
    result = comparison({"slip_per_metre": 0.25, "torque_rms": 1.5})
    assert sentence(result) == "Against kinematic control, compliant walks with 75% less slip, and costs 50% more motor torque."
    assert [(part.text, part.verdict) for part in headline(result) if part.verdict] == [
        ("75% less slip", "better"),
        ("50% more motor torque", "worse"),
    ]


def test_the_headline_names_no_gain_where_there_is_none() -> None:
    assert sentence(comparison({"slip_per_metre": 3.0})) == "Against kinematic control, compliant brings 3.0 times the slip."
    assert "changes nothing" in sentence(comparison({}))
    assert "changes nothing" in sentence(comparison({"slip_per_metre": 1.0 + 1e-6}))


def test_cards_show_units_that_people_read_and_the_interval() -> None:
    before, after = {"slip_per_metre": 0.3, "height_rms": 9.1e-4}, {"slip_per_metre": 0.03, "height_rms": 4.56e-5}
    slip, height, *_ = cards(comparison(after, before=before))
    assert (slip.change, slip.values, slip.interval) == ("−90.0 %", "300 → 30.0 mm/m", "(−90.0 to −90.0 %)")
    assert (height.change, height.values, height.verdict) == ("−95.0 %", "0.910 → 0.046 mm", "better")
    assert all(card.interval == "" for card in cards(comparison({"slip_per_metre": 0.5}, seeds=1)))


def test_a_single_run_is_told_in_speed_and_slip() -> None:
    facts = {"control": "compliant", "simulated": 10.0, "walk": {"mean_speed": 0.0801}}
    (part,) = plain_headline({"slip_per_metre": 0.0214}, facts)
    assert part.text == "Compliant control, 10 s: 80.1 mm/s, 21.4 mm of slip per metre walked."
    (part,) = plain_headline({"slip_per_metre": None}, facts)
    assert part.text == "Compliant control, 10 s."


def test_without_the_viewer_a_report_has_its_tables_and_says_how_to_get_the_rest(
    call: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(report, "viewer_script", lambda: None)
    code, _, _ = call("simulate", "stand", "-o", tmp_path / "out", "--set", "duration=0.2")
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert code == 0
    assert "<script" not in page
    assert "HX_VIEWER" in page
    assert all(f"<code>{name}</code>" in page for name in METRICS)


def test_a_page_has_nothing_from_elsewhere_and_forbids_it(call: Call, tmp_path: Path) -> None:
    assert call("simulate", "stand", "-o", tmp_path / "out", "--set", "duration=0.2")[0] == 0
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "default-src 'none'" in page
    assert page.count("<script") == page.count("</script>") == 2  # the recording and the viewer
    markup = re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL)
    assert all(link.startswith("plots/") for link in re.findall(r'(?:src|href)="([^"]*)"', markup))
    assert "@import" not in markup
    assert "url(" not in markup
