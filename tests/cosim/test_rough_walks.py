"""Walks on uneven ground: what the feet that search for the ground are worth."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from gains import make_gains

from hexapod_cosim.cosim.results.result import Result
from hexapod_cosim.cosim.run.runner import Runner
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.models import load_robot

ROUGH = ("terrain.kind=random_uniform", "terrain.max_height=20 mm", "terrain.seed=5")
PEAK, LOADING, TILT = 0.8, 0.6, 0.7  # of kinematic control's figures, at most


@cache
def walk(control: str, *overrides: str) -> Result:
    scenario = load_scenario(
        "walk_flat", overrides=[f"control={control}", "duration=8.0", *overrides]
    )
    with Runner(everything=True) as runner:
        return runner.simulate(scenario, gains=make_gains(load_robot("athena")))


@pytest.mark.usefixtures("plant_build")
def test_on_rough_ground_feet_land_softer_and_the_torso_tilts_less() -> None:
    kinematic, compliant = (walk(control, *ROUGH).metrics for control in ("kinematic", "compliant"))
    assert compliant["peak_force"] < PEAK * kinematic["peak_force"]
    assert compliant["loading_rate"] < LOADING * kinematic["loading_rate"]
    for name in ("roll_rms", "pitch_rms"):
        assert compliant[name] < TILT * kinematic[name]


@pytest.mark.usefixtures("plant_build")
def test_no_leg_lifts_off_before_the_feet_that_land_stand() -> None:
    """At each lift-off, three other feet carry load, although the ground is up to 20 mm lower."""
    recording = walk("compliant", *ROUGH).outcome.recording
    legs = ("LF", "LM", "LR", "RF", "RM", "RR")
    swinging = recording.columns([f"controller.{leg}.swinging" for leg in legs]) > 0.5
    normal = recording.columns([f"{leg}.foot.normal_force" for leg in legs])
    lifts = np.flatnonzero((swinging[1:] & ~swinging[:-1]).any(axis=1)) + 1
    walking = lifts[recording.time[lifts] > 1.0]
    assert len(walking) > 5
    standing = ((normal[walking] > 0.5) & ~swinging[walking]).sum(axis=1)
    assert np.mean(standing >= 3) > 0.9
