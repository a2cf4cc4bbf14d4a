"""Tests falls, warnings of friction, and which runs arrive at the end of the commanded path."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from walks import PARAMETERS, PERIOD, ROBOT, SyntheticRun

from hexapod_cosim.cosim.interface.names import foot_names
from hexapod_cosim.cosim.master.loop import COMPLETED
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.report.headline import headline
from hexapod_cosim.cosim.report.tables import comparison_rows
from hexapod_cosim.cosim.results.comparison import compare_runs
from hexapod_cosim.cosim.results.locomotion import describe_fall, found_faults, missed_end
from hexapod_cosim.cosim.results.metric_table import METRICS
from hexapod_cosim.cosim.results.side_by_side import compare_all, read_seeds, write_seeds
from hexapod_cosim.cosim.results.summary import Summary
from hexapod_cosim.cosim.results.warnings import friction_warnings
from hexapod_cosim.cosim.results.window import View

STANDING = 0.130  # m
SLOPE = {"terrain.kind": 2.0, "terrain.incline": 0.5}


class Run(SyntheticRun):
    """Ten seconds of a standing robot, which tests modify."""

    def __init__(self) -> None:
        super().__init__(speed=0.0)
        self.set("torso.position[3]", STANDING)
        self.touch(self.time >= 0.0)

    def touch(self, when: NDArray[np.bool_]) -> None:
        for name in foot_names("contact"):
            self.set(name, when)

    def lean(self, roll: float, pitch: float, *, when: NDArray[np.bool_] | None = None) -> None:
        """Sets the quaternion from z-y-x angles, as the FMU defines them."""
        a, b = 0.5 * roll, 0.5 * pitch
        leaning = [
            math.cos(a) * math.cos(b),
            math.sin(a) * math.cos(b),
            math.cos(a) * math.sin(b),
            -math.sin(a) * math.sin(b),
        ]
        for k, (value, upright) in enumerate(
            zip(leaning, [1.0, 0.0, 0.0, 0.0], strict=True), start=1
        ):
            self.set(
                f"torso.quaternion[{k}]",
                np.where(self.time >= 0.0 if when is None else when, value, upright),
            )

    def lower(self, height: float, begin: float, end: float) -> None:
        self.set(
            "torso.position[3]",
            np.where((self.time >= begin) & (self.time < end), height, STANDING),
        )

    def fall(self, **parameters: float) -> str:
        changed = PARAMETERS | {
            name.replace("__", "."): value for name, value in parameters.items()
        }
        return describe_fall(View(self.recording, changed, PERIOD), ROBOT)


@pytest.mark.parametrize(
    ("roll", "pitch", "falls"),
    [
        (0.59, 0.0, False),
        (-0.59, 0.0, False),
        (0.0, 0.59, False),
        (0.61, 0.0, True),
        (-0.61, 0.0, True),
        (0.0, 0.61, True),
        (0.0, -0.61, True),
        (0.41, 0.41, False),
        (0.45, 0.45, True),
    ],
)
def test_a_torso_that_leans_by_more_than_six_tenths_of_a_radian_has_fallen(
    roll: float, pitch: float, falls: bool
) -> None:
    """The direction does not matter: 0.41 and 0.41 are 0.57 together, 0.45 and 0.45 are 0.62."""
    run = Run()
    run.lean(roll, pitch, when=run.time >= 3.0)
    assert run.fall() == (
        "the robot fell at 3.000 s: its torso leaned by more than 0.6 rad" if falls else ""
    )


@pytest.mark.parametrize(
    ("heading", "roll", "pitch"),
    [(0.0, 0.0, -1.0), (math.pi / 2.0, 1.0, 0.0)],
    ids=["along x", "along y"],
)
def test_on_a_slope_a_torso_leans_against_the_slope(
    heading: float, roll: float, pitch: float
) -> None:
    """On a slope of 0.5 rad a torso along the slope is upright.

    A level one leans by 0.5 rad, and 0.15 rad more downhill is a fall.
    """
    for angle, falls in ((0.5, False), (0.0, False), (-0.15, True), (1.05, False), (1.15, True)):
        run = Run()
        run.lean(angle * roll, angle * pitch)
        assert bool(run.fall(**SLOPE, terrain__heading=heading)) == falls


@pytest.mark.parametrize(
    ("height", "lasts", "falls"),
    [(0.066, 5.0, False), (0.064, 0.45, False), (0.064, 0.55, True), (0.064, 5.0, True)],
)
def test_a_torso_below_half_its_height_for_half_a_second_has_fallen(
    height: float, lasts: float, falls: bool
) -> None:
    run = Run()
    run.lower(height, 2.0, 2.0 + lasts)
    assert run.fall() == (
        "the robot fell at 2.000 s: its torso was only 0.064 m above the ground" if falls else ""
    )


def test_the_height_that_counts_is_the_commanded_one() -> None:
    """At 190 mm, 60 mm above the start, 90 mm are less than half; at 90 mm, 40 mm below it, 64 mm
    are more.
    """
    run = Run()
    run.set("command.height", 0.06)
    run.lower(0.090, 2.0, 3.0)
    assert "fell at 2.000 s" in run.fall()
    run = Run()
    run.set("command.height", -0.04)
    run.lower(0.064, 2.0, 3.0)
    assert run.fall() == ""


@pytest.mark.parametrize(("height", "falls"), [(0.0401, False), (0.0399, True)])
def test_a_torso_that_lies_on_the_ground_has_fallen_at_once(height: float, falls: bool) -> None:
    """The default torso is 80 mm thick."""
    run = Run()
    run.lower(height, 2.0, 2.05)
    assert run.fall() == (
        "the robot fell at 2.000 s: its torso was only 0.0399 m above the ground" if falls else ""
    )


def dropped() -> Run:
    """Returns a drop from 1 m: the feet land at 0.5 s, the robot bounces up to 0.2 m and stands."""
    run = Run()
    run.touch((run.time >= 0.5) & ((run.time < 0.6) | (run.time >= 0.7)))
    run.set(
        "torso.position[3]",
        np.where(
            run.time < 0.5, 1.0, np.where((run.time >= 0.6) & (run.time < 0.7), 0.2, STANDING)
        ),
    )
    return run


def test_a_robot_that_is_dropped_and_stands_has_not_fallen() -> None:
    assert dropped().fall() == ""


def test_a_robot_turns_in_the_air_without_falling_and_falls_when_it_lands_so() -> None:
    run = dropped()
    run.lean(1.0, 0.0, when=run.time < 0.5)
    assert run.fall() == ""
    run.lean(1.0, 0.0, when=run.time < 0.501)
    assert "fell at 0.500 s: its torso leaned" in run.fall()


def parameters(**changes: float) -> dict[str, float]:
    return PARAMETERS | {name.replace("__", "."): value for name, value in changes.items()}


@pytest.mark.parametrize(
    "changes", [{"friction__mu": 0.0}, {"friction__law": 2.0}], ids=["mu = 0", "none"]
)
def test_level_ground_without_friction_is_warned_of(changes: dict[str, float]) -> None:
    assert friction_warnings(parameters(**changes)) == [
        "the ground has no friction: feet cannot push, and the robot does not get ahead"
    ]


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"friction__mu": 0.0}, "at 4.7 m/s2, without friction"),  # g sin 0.5
        ({"friction__law": 2.0}, "at 4.7 m/s2, without friction"),
        # g (sin 0.5 - 0.3 cos 0.5)
        ({"friction__mu": 0.3}, "at 2.12 m/s2, which friction (mu = 0.3) does not hold"),
    ],
)
def test_a_slope_that_friction_does_not_hold_is_warned_of_with_the_acceleration(
    changes: dict[str, float], says: str
) -> None:
    assert friction_warnings(parameters(**SLOPE, **changes)) == [
        f"the robot slides: the ground's slope pulls it downhill {says}"
    ]


# Which runs arrive at the end of the commanded path, and that comparisons count no others.

STUCK = "the robot did not arrive: it missed the end by 5.5 m per metre walked"


def run(control: str, seed: int, missed: str = "") -> Summary:
    metrics = dict.fromkeys(METRICS, 1.0 if control == "kinematic" else 0.1)
    return Summary(
        control=control, seed=seed, status=COMPLETED, upright=True, missed=missed, metrics=metrics
    )


@pytest.mark.parametrize(
    ("path", "turn", "text"),
    [
        (0.49, math.nan, ""),
        (5.5, math.nan, STUCK),
        (math.nan, 0.49, ""),
        (math.nan, 0.6, "missed the end by 0.6 rad per radian turned"),
        (math.nan, math.nan, "the robot did not get ahead"),
    ],
)
def test_a_robot_arrives_within_half_of_its_way(path: float, turn: float, text: str) -> None:
    found = missed_end({"path_error": path, "yaw_drift_per_radian": turn})
    assert text in found
    assert bool(text) == bool(found)


def test_a_stuck_robot_has_not_walked_and_is_not_praised() -> None:
    before = [run("kinematic", seed) for seed in range(3)]
    after = [run("mine", seed, missed=STUCK) for seed in range(3)]
    comparison = compare_all({"kinematic": before, "mine": after})
    assert comparison.walked == {"kinematic": 3, "mine": 0}
    assert comparison.losses[0] == f"mine, seed 0: {STUCK}"
    assert comparison_rows(comparison)[0]["values"] == ["3 of 3", "0 of 3"]
    said = "".join(part.text for part in headline(comparison.main))
    assert "less" not in said
    assert said.endswith("No pair of walks can be compared.")


def test_changes_are_of_the_pairs_in_which_both_arrived() -> None:
    before = [run("kinematic", seed) for seed in range(3)]
    after = [run("mine", 0, missed=STUCK), run("mine", 1), run("mine", 2)]
    assert compare_runs(before, after).changes["peak_force"].pairs == 2


def test_seeds_csv_keeps_who_arrived(tmp_path: Path) -> None:
    runs = [run("kinematic", 0), run("mine", 0, missed=STUCK)]
    write_seeds(tmp_path / "seeds.csv", runs)
    assert read_seeds(tmp_path / "seeds.csv") == {"kinematic": [runs[0]], "mine": [runs[1]]}


def test_what_the_controller_found_is_told_in_order_with_times_from_the_first_row() -> None:
    names = ("time", "controller.LF.absent", "controller.RM.outrun")
    rows = [[7.0, 0.0, 1.0], [7.5, 1.0, 1.0], [8.0, 1.0, 0.0], [8.5, 0.0, 0.0]]
    assert found_faults(Recording(names, np.array(rows))) == [
        {
            "time": 0.0,
            "text": "the command is too fast for the joints of RM: the body walks slower",
        },
        {"time": 0.5, "text": "the controller walks without LF"},
        {"time": 1.0, "text": "the command is no longer too fast for the joints of RM"},
        {"time": 1.5, "text": "the controller walks with LF again"},
    ]
