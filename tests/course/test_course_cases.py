"""The cases of the course: both splits, what they share and what they do not."""

from __future__ import annotations

import math
import tomllib
from collections import Counter
from collections.abc import Iterator
from typing import Any

import pytest

from hexapod_cosim.cosim.scenario.controls import control_of
from hexapod_cosim.cosim.scenario.reading import scenario_robot
from hexapod_cosim.extensions.course.records import (
    CLASSES,
    FOLDER,
    Case,
    Course,
    CourseError,
    load_course,
    run_scenario,
)
from hexapod_cosim.models import load_robot

KINEMATIC = control_of("kinematic")
JUDGED, TUNED = load_course("judge"), load_course("tune")
# physical keys of which the splits may share a value, each with its reason
SHARED: dict[str, list[Any]] = {
    "command.vx": [0.0],  # a turn on the spot
    "torso.com[1]": [0.0],  # a payload above the middle
    "torso.com[2]": [0.0],
    "terrain.stone_distance": [0.04],  # the stones' size and depth differ
    "soil": ["mud"],
}


def entries() -> Iterator[tuple[str, dict[str, Any]]]:
    """Yields the class and the table of each case."""
    for kind in CLASSES:
        for entry in tomllib.loads((FOLDER / f"{kind}.toml").read_text(encoding="utf-8"))["case"]:
            yield kind, entry


def physical(case: Case) -> dict[str, Any]:
    """Returns what decides a walk, as tables."""
    table = case.scenario.to_table()
    return {key: value for key, value in table.items() if key not in ("title", "seed")}


def test_both_splits_have_the_same_cases_and_no_name_twice() -> None:
    assert [case.name for case in JUDGED.cases] == [case.name for case in TUNED.cases]
    assert [case.kind for case in JUDGED.cases] == [case.kind for case in TUNED.cases]
    counts = Counter([*CLASSES, *(case.name for case in JUDGED.cases)])
    assert max(counts.values()) == 1


def test_every_case_file_is_a_class() -> None:
    assert {path.stem for path in FOLDER.iterdir()} == {"course", *CLASSES}


def test_no_walk_is_in_both_splits() -> None:
    tuned = [physical(case) for case in TUNED.cases]
    assert not [case.name for case in JUDGED.cases if physical(case) in tuned]


def test_the_splits_share_no_seed_and_so_no_random_surface() -> None:
    assert not set(JUDGED.seeds) & set(TUNED.seeds)
    most = load_course("judge", seeds=1000).seeds
    assert max(most) < min(TUNED.seeds)
    for course in (JUDGED, TUNED):
        case = next(case for case in course.cases if case.name == "rough_10")
        seeds = [
            run_scenario(case, control=KINEMATIC, seed=seed).settings["terrain"]["seed"]
            for seed in course.seeds
        ]
        assert seeds == list(course.seeds)


def test_every_value_that_a_case_sets_differs_between_its_splits() -> None:
    for _, entry in entries():
        judge, tune = entry["judge"], entry["tune"]
        assert judge.keys() == tune.keys(), entry["name"]
        for key in judge:
            if judge[key] not in SHARED.get(key, ()):
                assert judge[key] != tune[key], f"{entry['name']}: {key}"


def test_no_commanded_speed_is_in_both_splits() -> None:
    speeds = [
        {
            value
            for case in course.cases
            for command in case.scenario.commands
            for value in (command.vx, command.vy, command.yaw_rate)
            if value
        }
        for course in (JUDGED, TUNED)
    ]
    assert not speeds[0] & speeds[1]


def test_payloads_shift_the_centre_of_mass_as_their_text_says() -> None:
    mass = load_robot("athena").torso.mass
    loads = {
        "payload_2kg": (2.0, 0.0, 0.0),
        "payload_front": (1.5, 0.08, 0.05),
        "payload_side": (1.5, 0.0, -0.07),
        "payload_rear_sticking": (1.5, -0.09, 0.0),
    }
    for name, (load, x, y) in loads.items():
        found = next(case for case in JUDGED.cases if case.name == name).scenario.parameters
        assert found["torso.mass"] == pytest.approx(mass + load, abs=1e-6)
        assert found["torso.com[1]"] == pytest.approx(load * x / (mass + load), abs=1e-6)
        assert found["torso.com[2]"] == pytest.approx(load * y / (mass + load), abs=1e-6)


def test_a_sweep_rises_and_differs_in_the_height_alone() -> None:
    for name, key in (("rough", "max_height"), ("stairs", "step_height")):
        cases = [case for case in JUDGED.cases if case.sweep == name]
        heights = [case.height for case in cases]
        assert heights == sorted(set(heights))
        assert len(heights) >= 4
        for case in cases:
            terrain = dict(case.scenario.settings["terrain"])
            assert terrain.pop(key) == case.height
            other = dict(cases[0].scenario.settings["terrain"])
            other.pop(key)
            assert terrain == other
    assert all(math.isnan(case.height) for case in JUDGED.cases if not case.sweep)


def test_cases_are_chosen_by_name_and_by_class() -> None:
    found = load_course(
        "judge", names=["soil", "flat_same"], quick=True, settings=["gait.period=1.25"]
    )
    assert [case.name for case in found.cases] == ["flat_same", "sand", "sand_wide", "mud"]
    assert found.seeds == (0, 1, 2)
    assert {case.scenario.settings["gait"]["period"] for case in found.cases} == {1.25}
    assert found.hash == JUDGED.hash == TUNED.hash


@pytest.mark.parametrize(
    ("split", "names", "text"), [("test", [], "split"), ("tune", ["rough_11"], "rough_10")]
)
def test_an_unknown_split_or_case_is_refused(split: str, names: list[str], text: str) -> None:
    with pytest.raises(CourseError, match=text):
        load_course(split, names=names)


@pytest.mark.parametrize("course", [JUDGED, TUNED], ids=["judge", "tune"])
def test_the_robot_of_each_case_suits_its_ground(course: Course) -> None:
    for case in course.cases:
        for seed in (0, 1009):
            scenario_robot(run_scenario(case, control=KINEMATIC, seed=seed))
