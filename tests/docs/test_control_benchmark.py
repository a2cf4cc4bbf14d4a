"""The cases that control is judged and tuned on, how they are walked, and the tables made of
them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from benchmarks import ROOT, pages
from benchmarks.control import __main__ as command
from benchmarks.control.cases import (
    DATA,
    Case,
    ablation,
    grid,
    judged_walk,
    robustness,
    seeds,
    sticking,
    tuning,
)
from benchmarks.control.measure import Section, measure
from benchmarks.control.tables import (
    BEGIN,
    END,
    cell,
    changes_table,
    put_into,
    robustness_table,
    write_csv,
)
from hexapod_cosim.controller import COMPLIANT_PARTS, make_gait
from hexapod_cosim.cosim.master.loop import COMPLETED
from hexapod_cosim.cosim.results.comparison import Comparison, change_of, compare_runs
from hexapod_cosim.cosim.results.metrics import METRICS
from hexapod_cosim.cosim.results.summary import NO_FIGURES, REFUSED, Summary
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.cosim.scenario.scenario import scenario_robot
from hexapod_cosim.cosim.scenario.variation import STANDARD
from hexapod_cosim.models import HexapodError, load_robot

ROBOTS = DATA["judged"]["robots"]
SAME_VALUE = 1e-6  # what differs by less is the same


def plans(cases: Sequence[Case], seed: int = 0) -> list[Scenario]:
    return [case.plan("compliant", seed) for case in cases]


def traits(plan: Scenario) -> dict[str, float]:
    """What makes a walk hard or easy."""
    gait = make_gait(load_robot(plan.robot), **dict(plan.settings.get("gait", {})))
    payload = (
        plan.parameters.get("torso.mass", load_robot(plan.robot).torso.mass)
        - load_robot(plan.robot).torso.mass
    )
    found = {"vx": plan.commands[0].vx, "mu": scenario_robot(plan).friction.mu, "payload": payload}
    return found | {"period": gait.period, f"duty of {gait.name}": gait.duty}


def values(cases: Sequence[Case]) -> dict[str, set[int]]:
    """All values of each trait, in multiples of what counts as the same."""
    found: dict[str, set[int]] = {}
    for plan in plans(cases):
        for name, value in traits(plan).items():
            found.setdefault(name, set()).add(round(value / SAME_VALUE))
    return found


def test_judging_and_tuning_share_no_value_of_any_trait_and_no_seed() -> None:
    judged = values(
        [*(case for robot in ROBOTS for case in grid(robot)), *ablation(), *robustness()]
    )
    tuned = values([case for robot in ROBOTS for case in tuning(robot)])
    assert set(judged) == set(tuned)
    for name, found in judged.items():
        assert not found & tuned[name], f"{name} stands in both sets"
    assert not (set(seeds("judged")) | set(seeds("robustness"))) & set(seeds("tuning"))


def test_the_sets_cover_what_they_promise() -> None:
    for robot in ROBOTS:
        told = [traits(plan) for plan in plans(grid(robot))]
        assert {one["vx"] for one in told} == {0.04, 0.08, 0.12, 0.16}
        assert {one["mu"] for one in told} == {0.4, 0.7, 0.9}
        assert {round(one["payload"], 9) for one in told} == {0.0, 1.0, 2.0}
        assert len({case.name for case in grid(robot)}) == len(grid(robot)) == 16
    assert len(seeds("judged")) == 10


def test_every_case_varies_by_the_standard_and_plots_nothing() -> None:
    for plan in plans([*grid("athena"), *tuning("athena"), *ablation(), *robustness()], seed=3):
        assert (plan.variation, plan.seed, plan.outputs.plots) == (STANDARD, 3, False)


def test_the_judged_walk_is_the_bundled_one() -> None:
    judged = judged_walk().plan("kinematic", 0)
    assert (judged.commands[0].vx, judged.duration, judged.settings["gait"]["name"]) == (
        0.08,
        10.0,
        "tripod",
    )
    assert judged.steps == 2000


def test_the_ablation_switches_each_part_alone_and_each_part_off() -> None:
    on = {
        case.name: {name for name in COMPLIANT_PARTS if getattr(plan.compliance, name)}
        for case, plan in zip(ablation(), plans(ablation()), strict=True)
    }
    assert on["no part"] == set()
    default = set(COMPLIANT_PARTS)
    assert on["by default"] == on["without squeeze"] == default
    for part in COMPLIANT_PARTS:
        assert on[f"{part} alone"] == {part}
        assert on[f"without {part}"] == default - {part}


def test_every_table_of_make_figures_has_its_place_on_a_page() -> None:
    names = ["all", "gait", "compliant", "heights", "goals", "worse"]
    places = dict.fromkeys((*names, "flat tanh", "flat bristle"), pages.PAGES)
    places["demo"] = (ROOT / "README.md",)
    for name, files in places.items():
        text = "".join(page.read_text(encoding="utf-8") for page in files)
        assert text.count(BEGIN.format(name)) == text.count(END.format(name)) == 1, name


def test_switches_say_nothing_to_kinematic_control() -> None:
    assert len({str(case.plan("kinematic", 0).to_table()) for case in ablation()}) == 1


def walked(scenarios: Sequence[Scenario], **_: Any) -> Iterator[Summary]:
    """Instead of a batch: the slip is the seed's number plus one, halved by compliance."""
    for plan in scenarios:
        slip = (plan.seed + 1.0) * (0.5 if plan.control == "compliant" else 1.0)
        figures = dict.fromkeys(METRICS, 1.0) | {"slip_per_metre": slip}
        yield Summary(
            control=plan.control, seed=plan.seed, status=COMPLETED, upright=True, metrics=figures
        )


def measured(
    monkeypatch: pytest.MonkeyPatch, *sections: Section
) -> tuple[dict[str, dict[str, Comparison]], int]:
    """What comes of sections, and in how many runs."""
    counted: list[Scenario] = []

    def counting(scenarios: Sequence[Scenario], **options: Any) -> Iterator[Summary]:
        counted.extend(scenarios)
        yield from walked(scenarios, **options)

    monkeypatch.setattr("benchmarks.control.measure.run_batch", counting)
    found = measure(sections)
    return {name: dict(cases) for name, cases in found.items()}, len(counted)


def test_what_cases_share_is_walked_once(monkeypatch: pytest.MonkeyPatch) -> None:
    parts, rest = (
        Section(name="a", cases=ablation(), seeds=range(3)),
        Section(name="b", cases=robustness()[:2], seeds=range(2)),
    )
    found, runs = measured(monkeypatch, parts, rest)
    variants = len(ablation()) + 1  # and kinematic control
    assert runs == 3 * variants + 2 * 2  # the judged walk of the second section is the first's
    assert list(found) == ["a", "b"]
    assert list(found["a"]) == [case.name for case in ablation()]
    assert found["a"]["by default"].seeds == [0, 1, 2]
    assert found["a"]["by default"].changes["slip_per_metre"].before == 2.0
    assert found["b"]["as judged"].changes["slip_per_metre"].before == 1.5
    assert found["b"]["as judged"].changes["slip_per_metre"].relative == pytest.approx(-0.5)


def test_a_case_that_this_version_does_not_know_is_left_out_and_said(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    cases = [judged_walk("all parts"), judged_walk("on glue", "friction.law=glue")]
    found, runs = measured(monkeypatch, Section(name="a", cases=cases, seeds=range(2)))
    assert runs == 4
    table = changes_table(found["a"])
    assert "| on glue |" not in table
    assert "Left out: on glue." in table
    assert "'glue'" in table
    assert "| all parts | 2 → 2 of 2 | -50 % |" in table


def test_the_ground_that_sticks_is_one_that_the_plant_knows() -> None:
    for case in sticking():
        assert scenario_robot(case.plan("compliant", 0)).friction.law == "bristle"


@pytest.mark.parametrize(
    ("name", "pairs", "text"),
    [
        ("slip_per_metre", [(1.0, 0.3), (1.0, 0.3)], "-70 %"),
        ("slip_per_metre", [(1.0, 0.3), (1.0, 0.32)], "-69 ± 13 %"),
        ("slip_per_metre", [(1.0, 0.9), (1.0, 1.2)], "≈ +5 ± 314 %"),
        ("slip_per_metre", [], "-"),
        ("yaw_drift", [(1e-6, 2e-6)] * 2, "≈ 0"),
        ("yaw_drift", [(1e-6, 0.2)] * 2, "0.2 rad/m"),
    ],
)
def test_a_cell_says_how_much_and_how_sure(
    name: str, pairs: list[tuple[float, float]], text: str
) -> None:
    assert cell(name, change_of(name, pairs)) == text


def comparison(*, fallback: float | None = None, status: str = COMPLETED) -> Comparison:
    figures = dict.fromkeys(METRICS, 0.01) if status == COMPLETED else NO_FIGURES
    runs = [
        [
            Summary(
                control=control,
                seed=seed,
                status=status,
                reason="" if status == COMPLETED else "legs too short",
                upright=True,
                fallback=fallback,
                metrics=figures,
            )
            for seed in range(2)
        ]
        for control in ("kinematic", "compliant")
    ]
    return compare_runs(runs[0], runs[1])


def test_the_robustness_table_shows_both_figures_and_the_fallback() -> None:
    table = robustness_table(
        {
            "as judged": comparison(),
            "a push": comparison(fallback=0.25),
            "a giant": comparison(status=REFUSED),
        }
    )
    assert "| as judged | 2 → 2 of 2 " + 5 * "| 10 → 10 " + "| 0.01 → 0.01 | - |" in table
    assert "| a push | 2 → 2 of 2 " + 5 * "| 10 → 10 " + "| 0.01 → 0.01 | 25% |" in table
    assert "Left out: a giant. legs too short" in table


def test_tables_take_their_place_in_the_pages_and_the_rest_stays(tmp_path: Path) -> None:
    pages = [tmp_path / "one.md", tmp_path / "two.md"]
    for page, name in zip(pages, "ab", strict=True):
        place = f"<!-- control:{name} -->\nold\n<!-- /control:{name} -->"
        page.write_text(f"Before.\n{place}\nAfter.\n")
    for table in ("new", "newer"):
        put_into(pages, {name: f"| {table} {name} |" for name in "ab"})
    texts = [
        "Before.\n<!-- control:a -->\n\n| newer a |\n\n<!-- /control:a -->\nAfter.\n",
        "Before.\n<!-- control:b -->\n\n| newer b |\n\n<!-- /control:b -->\nAfter.\n",
    ]
    assert [page.read_text() for page in pages] == texts
    with pytest.raises(HexapodError, match="<!-- control:c -->"):
        put_into(pages, {"a": "| newest |", "c": "| new |"})
    assert [page.read_text() for page in pages] == texts


def test_the_pages_have_one_place_for_every_table() -> None:
    text = "".join(page.read_text(encoding="utf-8") for page in command.PAGES)
    for section in command.sections():
        assert text.count(f"<!-- control:{section.name} -->") == 1
        assert text.count(f"<!-- /control:{section.name} -->") == 1


def test_the_csv_has_a_line_per_case_and_figure_of_merit(tmp_path: Path) -> None:
    write_csv(tmp_path / "a.csv", {"one": comparison(), "two": comparison(status=REFUSED)})
    lines = (tmp_path / "a.csv").read_text().splitlines()
    assert lines[0].startswith(
        "case,seeds,walked_kinematic,walked_compliant,metric,kinematic,compliant,relative,low,high"
    )
    assert len(lines) == 1 + 2 * (
        len(METRICS) - 2
    )  # realtime_factor and energy_residual are none of the control
    assert lines[1].startswith("one,2,2,2,foot_error_stance,0.01,0.01,0,0,0")
    assert lines[-1].startswith("two,2,0,0,slip_per_radian,,,")


def test_the_command_walks_a_quick_section_without_touching_the_pages(
    plant_build: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = [page.read_bytes() for page in command.PAGES]
    assert command.main(["--quick", "--only", "robustness"]) == 0
    out = capsys.readouterr().out
    assert "| slope of 10 degrees, upwards | 2 → 2 of 2 |" in out
    assert [page.read_bytes() for page in command.PAGES] == before


def test_an_unknown_section_is_refused_with_the_names_there_are(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with pytest.raises(SystemExit):
        command.main(["--only", "ablaton"])
    assert "no section 'ablaton': choose one of ablation" in capsys.readouterr().err


def test_a_table_without_a_single_walk_is_no_result() -> None:
    with pytest.raises(
        HexapodError, match="no case of this table could be walked: got 'legs too short'"
    ):
        command.expect_walks({"ablation": {"a giant": comparison(status=REFUSED)}})
    command.expect_walks(
        {"ablation": {"a giant": comparison(status=REFUSED), "as judged": comparison()}}
    )
