"""Small variations are seeded, have the requested sizes, and drive no foot into the ground."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hexapod_cosim.cosim.interface.plant import load_interface
from hexapod_cosim.cosim.run.single_run import simulate
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.cosim.scenario.records import Command, Variation
from hexapod_cosim.cosim.scenario.variation import (
    ANGLE,
    POSITION,
    QUATERNION,
    STANDARD,
    _depths,
    delayed,
    draw,
    initial_values,
)
from hexapod_cosim.models import load_robot

ROBOT = load_robot("athena")
PARAMETERS = {
    entry.name: float(entry.start or 0.0)
    for entry in load_interface(ROBOT).variables
    if entry.causality == "parameter"
}
SEEDS = range(400)
SAMPLING = 0.1  # relative, of a deviation from 400 x 3 samples or more: five standard errors
EXACT = 1e-12  # m, rad


def depths(values: dict[str, float]) -> np.ndarray:
    position, quaternion, angle = (
        np.array([values[name] for name in names]) for names in (POSITION, QUATERNION, ANGLE)
    )
    return np.asarray(_depths(ROBOT, position, quaternion, angle))


def test_the_sizes_drawn_are_those_asked_for() -> None:
    drawn = [draw(STANDARD, seed=seed) for seed in SEEDS]
    assert np.std([one.rotation for one in drawn]) == pytest.approx(STANDARD.attitude, rel=SAMPLING)
    assert np.std([one.angle for one in drawn]) == pytest.approx(STANDARD.joint_angle, rel=SAMPLING)
    for values, largest in (
        ([one.height for one in drawn], STANDARD.height),
        ([one.command_delay for one in drawn], STANDARD.command_delay),
    ):
        assert min(values) >= 0.0
        assert max(values) <= largest
        assert np.mean(values) == pytest.approx(largest / 2.0, rel=SAMPLING)


def test_a_seed_draws_the_same_again_and_a_size_scales_it() -> None:
    once, twice = (
        draw(STANDARD, seed=3),
        draw(replace(STANDARD, attitude=2 * STANDARD.attitude), seed=3),
    )
    np.testing.assert_array_equal(once.angle, draw(STANDARD, seed=3).angle)
    np.testing.assert_array_equal(2.0 * once.rotation, twice.rotation)
    np.testing.assert_array_equal(once.angle, twice.angle)
    assert not np.array_equal(once.angle, draw(STANDARD, seed=4).angle)


@pytest.mark.parametrize("seed", range(4))
def test_no_foot_starts_deeper_in_the_ground_than_at_rest(seed: int) -> None:
    level = replace(STANDARD, height=0.0)
    rest, varied = (
        depths(PARAMETERS),
        depths(initial_values(ROBOT, PARAMETERS, draw(level, seed=seed))),
    )
    assert (varied - rest).max() == pytest.approx(0.0, abs=EXACT)  # and one foot is as deep
    drawn = draw(STANDARD, seed=seed)
    higher = depths(initial_values(ROBOT, PARAMETERS, drawn))
    np.testing.assert_allclose(varied - higher, drawn.height, atol=EXACT)


def test_attitude_and_angles_start_off_by_what_was_drawn() -> None:
    drawn = draw(STANDARD, seed=5)
    values = initial_values(ROBOT, PARAMETERS, drawn)
    np.testing.assert_allclose(
        [values[name] - PARAMETERS[name] for name in ANGLE], drawn.angle.ravel(), atol=EXACT
    )
    w, *xyz = (values[name] for name in QUATERNION)
    second_order = float(np.linalg.norm(drawn.rotation)) ** 2  # of turns: drawn, and that at rest
    assert np.linalg.norm([w, *xyz]) == pytest.approx(1.0)
    np.testing.assert_allclose(
        2.0 * np.array(xyz) - 2.0 * np.array([PARAMETERS[name] for name in QUATERNION[1:]]),
        drawn.rotation,
        atol=second_order,
    )


def test_commands_come_later_the_first_one_too_and_by_the_same_time() -> None:
    commands = (Command(vx=0.1), Command(time=2.0, vy=0.1))
    assert delayed(commands, 0.25) == (
        Command(),
        Command(time=0.25, vx=0.1),
        Command(time=2.25, vy=0.1),
    )
    assert delayed(commands, 0.0) == commands


def test_variations_of_no_size_change_nothing_bit_for_bit(athena_fmu: Path) -> None:
    plain = load_scenario("walk_flat", overrides=["duration=0.3"])
    runs = [
        simulate(scenario, fmu=athena_fmu)
        for scenario in (plain, replace(plain, variation=Variation()))
    ]
    np.testing.assert_array_equal(runs[0].outcome.recording.data, runs[1].outcome.recording.data)


def test_a_varied_run_begins_as_drawn_and_settles(athena_fmu: Path) -> None:
    scenario = load_scenario("stand", overrides=["duration=1.5"])
    plain, varied = (
        simulate(replace(scenario, seed=2, variation=chosen), fmu=athena_fmu)
        for chosen in (None, STANDARD)
    )
    heights = [result.outcome.recording.column("torso.position[3]") for result in (plain, varied)]
    assert heights[1][0] - heights[0][0] > draw(STANDARD, seed=2).height
    # m: feet creep on towards rest
    assert heights[1][-1] == pytest.approx(heights[0][-1], abs=2e-4)
    assert varied.facts.drawn is not None
    assert varied.facts.drawn["height"] == draw(STANDARD, seed=2).height
    assert plain.facts.drawn is None
