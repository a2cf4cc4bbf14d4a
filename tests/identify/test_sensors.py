"""Sensors of a log: each kind has its own delay, forces and torques have biases, and a robot that
still moves where its log begins is named.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from secret_robots import Secret, secret_robot, with_column

from hexapod_cosim.extensions.identify.identified import Identified
from hexapod_cosim.extensions.identify.identify import identify
from hexapod_cosim.extensions.identify.identify_tables import warnings
from hexapod_cosim.extensions.identify.rigid.samples import force_biases
from hexapod_cosim.extensions.identify.start import moving_at_rest
from hexapod_cosim.models import LEG_NAMES, load_robot

KINDS = ("joints", "currents", "forces", "imu", "pose")


@pytest.fixture(scope="module")
def secret(plant_build: Path, tmp_path_factory: pytest.TempPathFactory) -> Secret:
    return secret_robot(4, tmp_path_factory.mktemp("late"), duration=1.8, groups=("sensor",))


@pytest.fixture(scope="module")
def found(secret: Secret) -> Identified:
    return identify([secret.log], load_robot("athena"), groups=("sensor",))


def test_each_kind_of_sensor_has_the_delay_that_it_had(secret: Secret, found: Identified) -> None:
    """Drawn between 1 and 9 ms; rows are 5 ms apart."""
    delays = [secret.values[f"delay.{kind}"] for kind in KINDS]
    assert max(delays) - min(delays) > 0.003
    own = {one.key: one.value for one in found.estimates}
    for kind, delay in zip(KINDS[:4], delays, strict=False):
        assert own[f"delay.{kind}"] == pytest.approx(delay, abs=2e-4), kind
    assert own["delay.pose"] == pytest.approx(delays[4], abs=2e-3)  # it moves slowly


def test_delays_and_biases_lie_within_their_intervals(secret: Secret, found: Identified) -> None:
    """35 numbers: 5 delays and biases of 6 columns of the IMU, 18 of torques, 6 of forces. Of 35,
    at most 5 are outside with a probability of 0.99.
    """
    told = [one for one in found.estimates if one.told]
    assert len(told) == 35
    assert sum(not one.low <= secret.values[one.key] <= one.high for one in told) <= 5
    assert warnings(found) == []


def test_the_bias_of_a_force_is_what_a_foot_in_the_air_reads(secret: Secret) -> None:
    """The readings' noise is 0.3 N; the most frequent of them are a tenth of it off."""
    biases = force_biases(secret.log, slice(20, None))
    for leg in LEG_NAMES:
        key = f"bias.{leg}.foot.normal_force"
        assert biases[key] == pytest.approx(secret.values[key], abs=0.15), leg


def test_the_force_of_a_robot_that_stands_is_no_bias(secret: Secret) -> None:
    standing = secret.log.part(slice(0, 100))
    assert set(force_biases(standing, slice(0, None)).values()) == {0.0}


def test_a_robot_that_moves_at_the_start_is_named(secret: Secret, found: Identified) -> None:
    """Its joint sags by 10 mrad in 0.5 s, which is 6.7 mrad from the first third to the last."""
    assert moving_at_rest(secret.log) == ""
    sagging = with_column(
        secret.log, "LM.femur.angle", lambda y: y + 0.02 * np.maximum(0.5 - secret.log.time, 0.0)
    )
    name, _, change = moving_at_rest(sagging).partition(" by ")
    assert name == "LM.femur.angle"
    assert float(change.removesuffix(" rad")) == pytest.approx(-0.0067, abs=0.0008)
    (experiment,) = found.experiments
    moved = replace(found, experiments=(replace(experiment, log=sagging),))
    assert "still moves at the start of robot 4" in warnings(moved)[0]
