"""Tests effects of the controls: compliant control with gains chosen by hand, and feet that search
for the ground on uneven ground.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from gains import make_gains

from hexapod_cosim.controller import SWITCHES
from hexapod_cosim.cosim.results.facts import Result
from hexapod_cosim.cosim.run.runner import Runner
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.models import load_robot

NEEDS_CONTROLLER_WALKS = pytest.mark.usefixtures("plant_build")
ROBOTS = ("athena", "phantomx_mk4")
NOTHING = tuple(f"compliance.{part}=false" for part in SWITCHES)
SLIP_LEFT = 0.2  # of that under kinematic control, at most


@cache
def walk(robot: str, control: str, *overrides: str, duration: float = 4.0) -> Result:
    """Runs a straight walk."""
    scenario = load_scenario(
        "walk_flat",
        overrides=[f"robot={robot}", f"control={control}", f"duration={duration}", *overrides],
    )
    with Runner(everything=True) as runner:
        return runner.simulate(scenario, gains=make_gains(load_robot(robot)))


def outputs(result: Result) -> np.ndarray:
    """Returns the outputs of the FMU."""
    recording = result.outcome.recording
    return recording.columns(
        [name for name in recording.names if not name.startswith("controller.")]
    )


@NEEDS_CONTROLLER_WALKS
@pytest.mark.parametrize("robot", ROBOTS)
def test_compliance_without_a_planned_squeeze_takes_most_of_the_slip(robot: str) -> None:
    kinematic, compliant = (
        walk(robot, control, "compliance.squeeze=0") for control in ("kinematic", "compliant")
    )
    assert compliant.completed
    for name in ("slip_per_metre", "slip_net_per_metre"):
        assert compliant.metrics[name] < SLIP_LEFT * kinematic.metrics[name]
    for name in ("height_rms", "path_error", "peak_force"):
        assert compliant.metrics[name] < kinematic.metrics[name]
    assert compliant.facts.walk.fallback == 0.0


@NEEDS_CONTROLLER_WALKS
def test_the_planned_squeeze_takes_heat_from_the_servos_and_leaves_the_ground_some_slip() -> None:
    kinematic, none, some, most = (
        walk("athena", control, f"compliance.squeeze={squeeze}", "friction.law=bristle").metrics
        for control, squeeze in (
            ("kinematic", 0), ("compliant", 0), ("compliant", 0.48), ("compliant", 0.95)
        )
    )  # fmt: skip
    assert none["heat"] > 2.5 * kinematic["heat"]
    assert some["heat"] < 1.55 * kinematic["heat"]
    assert most["heat"] < 1.2 * kinematic["heat"]
    assert none["heat"] > some["heat"] > most["heat"]
    slips = [one["slip_per_metre"] for one in (none, some, most)]
    assert slips[0] < min(slips[1:])
    assert max(slips) < 0.6 * kinematic["slip_per_metre"]


@NEEDS_CONTROLLER_WALKS
def test_with_every_part_off_it_is_kinematic_control_bit_for_bit() -> None:
    off, kinematic = (
        walk("athena", "compliant", *NOTHING, duration=2.0),
        walk("athena", "kinematic", duration=2.0),
    )
    np.testing.assert_array_equal(outputs(off), outputs(kinematic))


@NEEDS_CONTROLLER_WALKS
def test_a_payload_is_carried_as_if_it_were_planned() -> None:
    mass = load_robot("athena").torso.mass + 1.5
    heights = [
        walk("athena", control, f"parameters.torso.mass={mass}")
        .outcome.recording.column("torso.position[3]")[-200:]
        .mean()
        - walk("athena", control).outcome.recording.column("torso.position[3]")[-200:].mean()
        for control in ("kinematic", "compliant")
    ]
    assert heights[0] < 0.0
    assert abs(heights[1]) < 0.25 * abs(heights[0])


@NEEDS_CONTROLLER_WALKS
def test_with_a_dead_sensor_it_walks_on_without_fallback() -> None:
    whole, hurt = (
        walk("athena", "compliant"),
        walk("athena", "compliant", 'events=[{time=0.5, leg="RM", fault="dead"}]'),
    )
    assert hurt.completed
    assert hurt.facts.walk.upright
    assert hurt.facts.walk.fallback == 0.0
    assert hurt.facts.walk.distance == pytest.approx(whole.facts.walk.distance, rel=0.03)
    doubted = [f"controller.{leg}.doubted" for leg in ("LF", "LM", "LR", "RF", "RM", "RR")]
    assert np.flatnonzero(hurt.outcome.recording.columns(doubted).any(axis=0)).tolist() == [4]
    assert not whole.outcome.recording.columns(doubted).any()
    assert hurt.metrics["slip_per_metre"] < walk("athena", "kinematic").metrics["slip_per_metre"]


@NEEDS_CONTROLLER_WALKS
@pytest.mark.parametrize("leg", ["RM"])
def test_a_dead_sensor_makes_no_foot_land_harder_on_level_ground(leg: str) -> None:
    """The foot whose sensor is silent is lowered until the sensor is doubted, and not for longer:
    otherwise it lifts a corner of the torso, which posture levels, and lands too high.
    """
    whole, hurt = (
        walk("athena", "compliant", f"events=[{event}]", duration=7.0)
        for event in ("", f'{{time=3.3, leg="{leg}", fault="dead"}}')
    )
    assert hurt.facts.walk.fallback == 0.0
    assert hurt.metrics["peak_force"] < 1.1 * whole.metrics["peak_force"]


# RM stands when its sensor fails
@NEEDS_CONTROLLER_WALKS
@pytest.mark.parametrize("law", ["tanh", "bristle"])
@pytest.mark.parametrize("event", ['time=2.2, fault="dead"', 'time=2.2, fault="stuck"'])
def test_a_sensor_that_fails_costs_little_on_rough_ground(law: str, event: str) -> None:
    setting = ("terrain.kind=random_uniform", "terrain.max_height=20 mm", f"friction.law={law}")
    for seed in (1, 2, 3):
        whole, hurt = (
            walk("athena", "compliant", *setting, f"seed={seed}", f"events=[{fault}]", duration=7.0)
            for fault in ("", f'{{leg="RM", {event}}}')
        )
        assert hurt.completed
        assert hurt.facts.walk.upright
        assert hurt.facts.walk.fallback == 0.0
        assert hurt.metrics["peak_force"] < 2.0 * whole.metrics["peak_force"]
        assert hurt.metrics["cost_of_transport"] < 1.2 * whole.metrics["cost_of_transport"]


# path errors of kinematic control change their sign with the weight, so they say nothing here
FIGURES = ("slip_per_metre", "height_rms", "roll_rms", "pitch_rms", "peak_force")


@NEEDS_CONTROLLER_WALKS
@pytest.mark.parametrize("error", ["contact.stiffness=1.07e4", "torso.mass=10"])
def test_on_ground_100_times_softer_or_with_2_3_times_the_weight_it_is_no_worse_than_kinematic(
    error: str,
) -> None:
    kinematic, compliant = (
        walk("athena", control, f"parameters.{error}", duration=6.0)
        for control in ("kinematic", "compliant")
    )
    for name in FIGURES:
        assert compliant.metrics[name] < kinematic.metrics[name], name
    assert compliant.metrics["slip_per_metre"] < 0.7 * kinematic.metrics["slip_per_metre"]
    assert compliant.facts.walk.fallback == 0.0


# Walks on uneven ground: what the feet that search for the ground are worth.

ROUGH = ("terrain.kind=random_uniform", "terrain.max_height=20 mm", "terrain.seed=5")
PEAK, LOADING, TILT = 0.8, 0.6, 0.7  # of kinematic control's figures, at most


@cache
def rough_walk(control: str, *overrides: str) -> Result:
    scenario = load_scenario(
        "walk_flat", overrides=[f"control={control}", "duration=8.0", *overrides]
    )
    with Runner(everything=True) as runner:
        return runner.simulate(scenario, gains=make_gains(load_robot("athena")))


@pytest.mark.usefixtures("plant_build")
def test_on_rough_ground_feet_land_softer_and_the_torso_tilts_less() -> None:
    kinematic, compliant = (
        rough_walk(control, *ROUGH).metrics for control in ("kinematic", "compliant")
    )
    assert compliant["peak_force"] < PEAK * kinematic["peak_force"]
    assert compliant["loading_rate"] < LOADING * kinematic["loading_rate"]
    for name in ("roll_rms", "pitch_rms"):
        assert compliant[name] < TILT * kinematic[name]


@pytest.mark.usefixtures("plant_build")
def test_no_leg_lifts_off_before_the_feet_that_land_stand() -> None:
    """At each lift-off, three other feet carry load, although the ground is up to 20 mm lower."""
    recording = rough_walk("compliant", *ROUGH).outcome.recording
    legs = ("LF", "LM", "LR", "RF", "RM", "RR")
    swinging = recording.columns([f"controller.{leg}.swinging" for leg in legs]) > 0.5
    normal = recording.columns([f"{leg}.foot.normal_force" for leg in legs])
    lifts = np.flatnonzero((swinging[1:] & ~swinging[:-1]).any(axis=1)) + 1
    walking = lifts[recording.time[lifts] > 1.0]
    assert len(walking) > 5
    standing = ((normal[walking] > 0.5) & ~swinging[walking]).sum(axis=1)
    assert np.mean(standing >= 3) > 0.9
