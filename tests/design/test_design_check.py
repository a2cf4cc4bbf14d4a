"""The designed loop on the FMU: a small squeeze decays as the linear loop predicts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hexapod_cosim.controller import Gains
from hexapod_cosim.cosim.design.design_check import check_design
from hexapod_cosim.cosim.design.gain_design import design_for
from hexapod_cosim.models import load_robot

PERIOD = 0.005  # s
AGREEMENT = 5e-3  # 1    of the largest force, for squeezes of 3 % of a foot's load
pytestmark = pytest.mark.usefixtures("plant_build")


@pytest.fixture(scope="module")
def gains(plant_build: object) -> Gains:
    return design_for(load_robot("athena"), PERIOD)


@pytest.mark.parametrize("stance", ["six legs", "tripod LF LR RM"])
def test_a_small_squeeze_goes_as_the_linear_loop_predicts(gains: Gains, stance: str) -> None:
    check = check_design(load_robot("athena"), gains, stance=stance)
    assert check.error < AGREEMENT
    assert check.simulated.max() > 0.5  # before the law answers
    assert abs(check.simulated[-1]) < 0.01  # and it is gone in the end


def test_a_squeeze_is_three_per_cent_of_a_third_of_the_weight(gains: Gains) -> None:
    """The ATHENA-like robot weighs 54.936 N."""
    robot = load_robot("athena")
    same = check_design(robot, gains, squeeze=0.03 * 54.936 / 3.0).simulated
    np.testing.assert_allclose(check_design(robot, gains).simulated, same, atol=1e-9)


def test_a_large_squeeze_does_not(gains: Gains) -> None:
    """The FMU's loop is not linear: friction saturates."""
    assert check_design(load_robot("athena"), gains, squeeze=40.0).error > 4.0 * AGREEMENT


@pytest.mark.parametrize(("by", "shakes"), [(4.5, False), (9.0, True)])
def test_the_fmu_shakes_where_the_linear_loop_does(gains: Gains, by: float, shakes: bool) -> None:
    """The gain margin of 16.5 dB (6.7 times), under a third of the weight per leg, is also the
    FMU's.
    """
    eager = replace(
        gains,
        slip=replace(
            gains.slip, kp=by * gains.slip.kp, ki=by * gains.slip.ki, kd=by * gains.slip.kd
        ),
    )
    check = check_design(load_robot("athena"), eager, squeeze=1e-3)
    for force in (check.predicted, check.simulated):
        late = abs(force[2 * len(force) // 3 :]).max()
        assert bool(late > abs(force[: len(force) // 3]).max()) is shakes
