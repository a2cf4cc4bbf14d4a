"""The headline of a report, its tables, and a report without the viewer."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from command import Call

from hexapod_cosim.cosim.common.files import write_json
from hexapod_cosim.cosim.master.loop import COMPLETED
from hexapod_cosim.cosim.report import writing
from hexapod_cosim.cosim.report.headline import cards, creep_note, headline, plain_headline
from hexapod_cosim.cosim.results.comparison import Comparison, compare_runs
from hexapod_cosim.cosim.results.metric_table import METRICS
from hexapod_cosim.cosim.results.summary import Summary
from hexapod_cosim.models.ground.table import make_surface


def comparison(
    after: Mapping[str, float], *, seeds: int = 4, before: Mapping[str, float] | None = None
) -> Comparison:
    """Returns runs with metrics `before` and `after`, 1 by default."""
    return compare_runs(
        _runs("kinematic", before or {}, seeds),
        _runs("compliant", {**(before or {}), **after}, seeds),
    )


def _runs(
    control: str, metrics: Mapping[str, float], seeds: int, fallen: int = 0
) -> Sequence[Summary]:
    """Returns runs of which the first `fallen` fell."""
    values = dict.fromkeys(METRICS, 1.0) | dict(metrics)
    return [
        Summary(
            control=control, seed=seed, status=COMPLETED, upright=seed >= fallen, metrics=values
        )
        for seed in range(seeds)
    ]


def sentence(result: Comparison) -> str:
    return "".join(part.text for part in headline(result))


def test_the_headline_tells_gains_and_costs_and_marks_them() -> None:
    result = comparison({"slip_per_metre": 0.25, "roll_rms": 0.5, "servo_load_max": 1.5})
    assert sentence(result) == (
        "Against kinematic control, compliant walks with 75 % less slip and 50 % less rolling, "
        "and costs 50 % more torque on the hottest servo."
    )
    assert [(part.text, part.verdict) for part in headline(result) if part.verdict] == [
        ("75 % less slip", "better"),
        ("50 % less rolling", "better"),
        ("50 % more torque on the hottest servo", "worse"),
    ]


def test_slip_which_an_assumed_slope_makes_comes_last_and_with_a_note() -> None:
    assert [card.name for card in cards(comparison({}).changes)][-1] == "slip per metre"
    facts: Any = SimpleNamespace(parameters={"friction.law": 1.0})
    assert "friction.slope" in creep_note(facts)


def test_the_headline_names_the_largest_effects_of_all_metrics() -> None:
    ratios = {"roll_rms": 0.9, "path_error": 0.1, "peak_force": 0.8, "slip_per_metre": 0.4}
    result = comparison(ratios | {"loading_rate": 0.7, "yaw_drift": 3.0, "pitch_rms": 1.2})
    assert sentence(result) == (
        "Against kinematic control, compliant walks with 90 % less error of the path, 60 % less "
        "slip and 30 % less jolt on landing, and costs 3.0 times the drift of the heading and "
        "20 % more pitching."
    )


@pytest.mark.parametrize(
    ("kind", "keys", "law", "noted"),
    [
        ("", {}, 1.0, True),
        ("", {}, 2.0, False),  # the whole plane is soil
        ("sand", {}, 1.0, False),
        ("rubble", {}, 1.0, True),
        ("wave", {}, 3.0, False),
        ("plane", {"patch": [{"x": 1.0, "y": 0.0, "size": 1.0, "soil": "mud"}]}, 1.0, False),
        ("plane", {"patch": [{"x": 1.0, "y": 0.0, "size": 1.0, "mu": 0.2}]}, 1.0, True),
    ],
)
def test_the_note_on_slip_is_for_ground_where_the_law_of_friction_acts(
    kind: str, keys: dict[str, Any], law: float, noted: bool
) -> None:
    surface = make_surface(kind, keys) if kind else None
    friction = {"friction.law": 1.0, "soil.law": law}
    facts: Any = SimpleNamespace(parameters=friction)
    assert bool(creep_note(facts, surface)) == noted


def test_the_headline_of_a_robot_that_turns_on_the_spot_is_per_radian() -> None:
    turned = dict.fromkeys(
        (
            "slip_per_metre",
            "cost_of_transport",
            "electrical_cost",
            "heat",
            "path_error",
            "yaw_drift",
        ),
        math.nan,
    )
    result = comparison(turned | {"slip_per_radian": 0.25, "cost_per_radian": 2.0}, before=turned)
    assert sentence(result) == (
        "Against kinematic control, compliant walks with 75 % less slip, "
        "and costs 2.0 times the motor work per radian."
    )
    assert ("slip per radian", "1.00 → 0.250 mm/rad") not in [
        (card.name, card.values) for card in cards(result.changes)
    ]
    assert ("slip per radian", "1000 → 250 mm/rad") in [
        (card.name, card.values) for card in cards(result.changes)
    ]


def test_the_headline_names_no_gain_where_there_is_none() -> None:
    assert (
        sentence(comparison({"slip_per_metre": 3.0}))
        == "Against kinematic control, compliant brings 3.0 times the slip."
    )
    assert "changes nothing" in sentence(comparison({}))
    assert "changes nothing" in sentence(comparison({"slip_per_metre": 1.0 + 1e-6}))


@pytest.mark.parametrize(
    ("fallen", "verdicts"),
    [
        ((8, 0), {"kinematic": "worse", "compliant": "better"}),
        ((0, 8), {"kinematic": "better", "compliant": "worse"}),
        ((8, 8), {}),
    ],
)
def test_the_headline_tells_falls_before_anything_else(
    fallen: tuple[int, int], verdicts: dict[str, str]
) -> None:
    better = {"slip_per_metre": 0.1}
    runs = compare_runs(
        _runs("kinematic", {}, 10, fallen[0]), _runs("compliant", better, 10, fallen[1])
    )
    assert sentence(runs).startswith(
        f"The robot did not walk to the end under kinematic in {fallen[0]} of 10 "
        f"and under compliant in {fallen[1]} of 10 runs. "
        "Where both walked, against kinematic control, compliant walks with 90 % less slip"
    )
    assert {
        part.text.split()[0]: part.verdict for part in headline(runs)[:4] if part.verdict
    } == verdicts


@pytest.mark.parametrize("fallen", [(4, 0), (0, 4), (4, 4)])
def test_the_headline_compares_nothing_where_no_two_walked(fallen: tuple[int, int]) -> None:
    runs = compare_runs(
        _runs("kinematic", {}, 4, fallen[0]),
        _runs("compliant", {"slip_per_metre": 0.1}, 4, fallen[1]),
    )
    assert "less" not in sentence(runs)
    assert "changes nothing" not in sentence(runs)
    assert sentence(runs).endswith("No pair of walks can be compared.")


def test_the_headline_tells_what_was_too_short_from_what_is_the_same() -> None:
    short = comparison(dict.fromkeys(METRICS, math.nan), before=dict.fromkeys(METRICS, math.nan))
    assert "too short to measure" in sentence(short)


def test_cards_show_units_that_people_read_and_the_interval() -> None:
    before, after = (
        {"slip_per_metre": 0.3, "height_rms": 9.1e-4},
        {"slip_per_metre": 0.03, "height_rms": 4.56e-5},
    )
    height, *_, slip = cards(comparison(after, before=before).changes)
    assert (slip.change, slip.values, slip.interval) == (
        "−90.0 %",
        "300 → 30.0 mm/m",
        "(−90.0 to −90.0 %)",
    )
    assert (height.change, height.values, height.verdict) == (
        "−95.0 %",
        "0.910 → 0.046 mm",
        "better",
    )
    single = comparison({"slip_per_metre": 0.5}, seeds=1)
    assert all(card.interval == "" for card in cards(single.changes))


def facts_of(control: str, simulated: float, *, speed: float) -> Any:
    """Returns the facts of a run that its headline needs."""
    walk = SimpleNamespace(mean_speed=speed)
    return SimpleNamespace(control=control, simulated=simulated, walk=walk)


def test_a_single_run_is_described_by_speed_feet_and_cost() -> None:
    facts = facts_of("compliant", 10.0, speed=0.0801)
    (part,) = plain_headline({"foot_error_stance": 0.00214, "cost_of_transport": 0.4239}, facts)
    assert part.text == (
        "Compliant control, 10 s: 80.1 mm/s, standing feet 2.14 mm from their plan, "
        "cost of transport 0.424."
    )
    facts = facts_of("compliant", 10.0, speed=math.nan)
    (part,) = plain_headline({"foot_error_stance": None}, facts)
    assert part.text == "Compliant control, 10 s."
    (part,) = plain_headline({"foot_error_stance": 1.4e-16}, facts)
    assert part.text == "Compliant control, 10 s."


@pytest.mark.usefixtures("undrawn")
def test_without_the_viewer_a_report_has_its_tables_and_says_how_to_get_the_rest(
    call: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(writing, "viewer_script", lambda: None)
    code, _, _ = call("simulate", "stand", "-o", tmp_path / "out", "--set", "duration=0.2")
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert code == 0
    assert "<script" not in page
    assert "HX_VIEWER" in page
    shown = {name for name in METRICS if "_per_radian" not in name} - {"slip_net_per_metre"}
    assert all(f"<code>{name}</code>" in page for name in shown)
    assert "_per_radian" not in page  # it did not turn


def test_a_page_has_nothing_from_elsewhere_and_forbids_it(call: Call, tmp_path: Path) -> None:
    assert call("simulate", "stand", "-o", tmp_path / "out", "--set", "duration=0.2")[0] == 0
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "default-src 'none'" in page
    assert page.count("<script") == page.count("</script>") == 2  # the recording and the viewer
    markup = re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL)
    links = re.findall(r'(?:src|href)="([^"]*)"', markup)
    assert all(link.startswith(("plots/", "data:image/")) for link in links)
    assert "@import" not in markup
    assert "url(" not in markup


def test_a_report_made_again_is_the_same_whatever_columns_the_csv_has(
    call: Call, tmp_path: Path
) -> None:
    folder = tmp_path / "out"
    assert (
        call(
            "simulate",
            "stand",
            "-o",
            folder,
            "--set",
            "duration=0.2",
            "--set",
            "outputs.csv=['torso.*']",
        )[0]
        == 0
    )
    page = (folder / "report.html").read_bytes()
    assert (folder / "results.csv").read_text(encoding="utf-8").splitlines()[0].count(",") < 40
    assert call("report", folder)[0] == 0
    assert (folder / "report.html").read_bytes() == page


@pytest.mark.usefixtures("undrawn")
def test_a_report_bears_the_name_of_the_walk_that_was_run(call: Call, tmp_path: Path) -> None:
    changed = ("--set", "duration=0.2", "--set", "robot=phantomx_mk4", "--set", "friction.mu=0.4")
    assert call("simulate", "stand", "-o", tmp_path / "out", *changed)[0] == 0
    title = re.search(
        "<h1>(.*)</h1>", (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    )
    assert title is not None
    assert title[1].endswith(", robot=phantomx_mk4, friction.mu=0.4")


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("run.json", "[]", "no status"),
        ("run.json", '{"hello": 1}', "no status"),
        ("run.json", '{"status": "completed"}', "a file without walk"),
        ("metrics.json", "3", "a table of metrics"),
        ("scenario.toml", None, "the scenario that was run"),
        ("results.parquet", "no such thing", "results.parquet"),
    ],
)
def test_a_damaged_folder_is_reported_in_a_paragraph_and_left_as_it_is(
    call: Call, tmp_path: Path, name: str, content: str | None, message: str
) -> None:
    folder = tmp_path / "out"
    assert (
        call(
            "simulate",
            "stand",
            "-o",
            folder,
            "--set",
            "duration=0.2",
            "--set",
            "outputs.plots=false",
        )[0]
        == 0
    )
    (folder / name).unlink()
    if content is not None:
        (folder / name).write_text(content, encoding="utf-8")
    before = sorted(path.name for path in folder.iterdir())
    code, out, err = call("report", folder)
    assert (code, out) == (1, "")
    assert message in err
    assert "unexpected" not in err
    assert len(err.strip().splitlines()) == 1
    assert sorted(path.name for path in folder.iterdir()) == before


def test_a_folder_of_an_extension_that_is_not_installed_is_named(
    call: Call, tmp_path: Path
) -> None:
    write_json(tmp_path / "run.json", {"kind": "dance", "status": "completed"})
    code, _, err = call("report", tmp_path)
    assert code == 1
    assert "install the extension that wrote it" in " ".join(err.split())


def test_a_report_is_made_again_from_gains_that_json_cannot_hold(
    call: Call, tmp_path: Path
) -> None:
    folder = tmp_path / "out"
    set_up = ("--set", "duration=0.2", "--set", "outputs.plots=false")
    assert call("simulate", "stand", "-o", folder, *set_up)[0] == 0
    facts = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    facts["gains"] = {"robot": "athena", "margins": {"gain": math.inf, "phase": 60.5}}
    write_json(folder / "run.json", facts)
    assert '"gain": null' in (folder / "run.json").read_text(encoding="utf-8")
    code, _, err = call("report", folder)
    assert (code, err) == (0, "")
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "phase = 60.5" in page
    assert "gain = null" not in page
