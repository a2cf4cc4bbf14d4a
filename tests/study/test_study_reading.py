"""Study files: what is read from them, and the messages for mistakes."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
from studies import study_of

from hexapod_cosim.extensions.study.extension import list_studies
from hexapod_cosim.extensions.study.reading import load_study
from hexapod_cosim.extensions.study.records import Study, StudyError
from hexapod_cosim.models import HexapodError

TRAINING = {"scenarios": ["walk_flat"], "seeds": {"first": 10, "count": 3}}
JUDGED = {"training": TRAINING, "held_out": {"scenarios": ["ripple"], "seeds": 10}}
GAIN = {"gains.hold.path_rate": {"uniform": [0.5, 2.0], "relative": True}}


def optimisation(**changes: Any) -> dict[str, Any]:
    return {"optimise": {"metric": "slip_per_metre", "variables": GAIN, **JUDGED, **changes}}


@pytest.mark.parametrize("name", list_studies())
def test_studies_that_come_with_the_package_can_be_read(name: str) -> None:
    assert load_study(name).title


def test_names_with_dots_need_no_quotes_and_units_are_kept(tmp_path: Path) -> None:
    file = tmp_path / "one.toml"
    file.write_text(
        "[set]\ngait.period = 0.5\n[factors]\nfriction.mu = [0.3]\n"
        'terrain.incline = {linspace = [0, 10, 3], unit = "deg"}\n'
    )
    study = load_study(file)
    assert [factor.name for factor in study.factors] == ["friction.mu", "terrain.incline"]
    assert [study.factors[1].setting(value) for value in study.factors[1].values] == [
        "0.0 deg",
        "5.0 deg",
        "10.0 deg",
    ]
    assert study.cases["walk_flat"].table["gait"] == {"name": "tripod", "period": 0.5}


def test_a_scenario_may_be_a_file_beside_the_study_or_stand_in_it(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text("duration = 3.0\n[command]\nvx = 0.05\n")
    for text in (
        'scenario = "mine.toml"\n',
        "[scenario]\nduration = 3.0\n[scenario.command]\nvx = 0.05\n",
    ):
        (tmp_path / "study.toml").write_text(text)
        (case,) = load_study(tmp_path / "study.toml").cases.values()
        assert (case.table["duration"], case.table["command"]) == (3.0, {"vx": 0.05})


def test_several_seeds_differ_by_the_standard_variation_and_one_seed_is_the_plain_walk() -> None:
    def varied(study: Study) -> bool:
        return "variation" in next(iter(study.cases.values())).table

    assert varied(study_of({"seeds": 2}))
    assert not varied(study_of({}))
    assert varied(study_of({"variation": True}))
    assert not varied(study_of({"seeds": 2, "variation": False}))


@pytest.mark.parametrize(
    ("table", "parts"),
    [
        ({"sedes": 3}, ["unknown key", "sedes", "did you mean 'seeds'"]),
        ({"seeds": 0}, ["seeds", "got 0", "whole number >= 1"]),
        ({"controls": ["kinetic"]}, ["kinetic", "did you mean 'kinematic'"]),
        (
            {"design": "sobol", "factors": {"friction.mu": {"uniform": [0.1, 0.9]}}},
            ["points = 100"],
        ),
        ({"points": 4}, ["points", "got 4", "leave it out"]),
        ({"factors": {"friction.my": [0.3]}}, ["factors.friction.my", "did you mean"]),
        ({"factors": {"friction.mu": [-0.3]}}, ["factors.friction.mu", "got -0.3", ">= 0"]),
        (
            {"factors": {"friction.mu": {"uniform": [0.1, 0.9]}}},
            ["a distribution in a design 'grid'", "points = 100"],
        ),
        ({"factors": {"seed": [1]}}, ["a setting that a study gives", "got 'seed'"]),
        ({"factors": {"gains.hold.path_rat": [1.0]}}, ["unknown gain", "gains.hold.p"]),
        (
            {"factors": {"gains.hold.path_rate": [1.0]}, "controls": ["kinematic"]},
            ["a gain that no run has", 'add "compliant"'],
        ),
        (
            {"design": "list", "factors": {"friction.mu": [0.1, 0.2], "command.vx": [0.1]}},
            ["different lengths", 'design = "grid"'],
        ),
        ({"variation": "yes"}, ["variation", "got 'yes'", "true or false"]),
        (
            {"factors": {"gains.hold.path_rate": {"values": [1.0], "unit": "s"}}},
            ["not a gain's value", "leave the unit out"],
        ),
        (
            {"set": {"friction.mu": 0.5}, "factors": {"friction.mu": [0.3]}},
            ["set.friction.mu", "set and varied", "take one of them away"],
        ),
        (
            optimisation(metric="slip_per_meter"),
            ["optimise.metric", "did you mean 'slip_per_metre'"],
        ),
        (
            optimisation(constraints={"torque_rms": {"at_mots": 1.0}}),
            ["constraints.torque_rms", "did you mean 'at_most'"],
        ),
        (
            optimisation(variables={"gains.hold.path_rate": {"normal": [1, 1]}}),
            ["a variable without bounds"],
        ),
        (
            optimisation(held_out={"scenarios": ["ripple"], "seeds": {"first": 12, "count": 5}}),
            ["held-out seeds that are trained on", "got [12]", "name others"],
        ),
        (
            optimisation(training={"seeds": 3}),
            ["optimise.training.scenarios", "missing key", "add `scenarios = ...`"],
        ),
        (
            {"factors": {"gains.hold.path_rate": [math.nan]}},
            ["factors.gains.hold.path_rate", "got nan", "finite number"],
        ),
        ({"factors": {"gains.hold.ground_time": [0.0]}}, ["not a gain's value", "got 0.0", "> 0"]),
        ({"seeds": {"first": 2**63 - 2, "count": 5}}, ["seeds", "within 64 bits"]),
        (
            {"factors": {"friction.mu": [0.3], "friction": {"mu": [0.4]}}},
            ["given twice", "friction.mu", "take one away"],
        ),
        ({"factors": {"torso.mass": [2.7, "3 kg"]}}, ["factors.torso.mass", "values of one kind"]),
        (
            {"factors": {"torso.mass": {"values": [2.7], "unit": "kg"}}},
            ["factors.torso.mass", "got '2.7 kg'", "plain numbers"],
        ),
        (
            {"design": "sobol", "points": 4, "factors": {"robot": ["athena", "athana"]}},
            ["factors.robot", "did you mean 'athena'"],
        ),
        (
            {"factors": {f"torso.inertia[{k}]": {"linspace": [1, 2, 10**6]} for k in range(3)}},
            ["too many runs", "2000000000000000000", "10,000,000"],
        ),
        (
            {"set": {"outputs": {"plots": True}}},
            ["set.outputs.plots", "a setting that a study gives"],
        ),
        (
            {**optimisation(), "factors": {"friction.mu": [0.3]}},
            ["not a key of an optimisation", "factors"],
        ),
    ],
)
def test_a_mistake_is_named_with_its_place_and_a_fix(
    table: dict[str, Any], parts: list[str]
) -> None:
    with pytest.raises(HexapodError) as refused:
        study_of(table)
    for part in ["test.toml", *parts]:
        assert part in str(refused.value)


def test_numbers_of_a_parameter_are_in_its_own_unit_and_its_choices_are_names() -> None:
    study = study_of(
        {
            "factors": {
                "torso.mass": [2.7, 3],
                "parameters.torso.com[1]": [0.0],
                "contact.law": ["hertz", "flores"],
            }
        }
    )
    assert [factor.name for factor in study.factors] == [
        "torso.mass",
        "torso.com[1]",
        "contact.law",
    ]


def test_the_ends_of_long_lists_are_tried_too() -> None:
    values = [0.3 + 1e-3 * k for k in range(1000)]
    values[501] = -0.1
    with pytest.raises(StudyError, match=r"got -0\.1"):
        study_of({"factors": {"friction.mu": values}})


def test_what_is_no_study_is_refused(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match="did you mean 'monte_carlo'"):
        load_study("monte_calro")
    with pytest.raises(StudyError, match="cannot read the study"):
        load_study(tmp_path / "none.toml")
    (tmp_path / "bad.toml").write_text("seeds = \n")
    with pytest.raises(StudyError, match="not a TOML file"):
        load_study(tmp_path / "bad.toml")
    (tmp_path / "empty.toml").write_text("# nothing\n")
    with pytest.raises(StudyError, match=r"empty\.toml: an empty study: expected at least one key"):
        load_study(tmp_path / "empty.toml")
