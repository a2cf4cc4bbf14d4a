"""The designed loop on the FMU: a small spread of the feet goes as the linear loop predicts."""

from __future__ import annotations

from dataclasses import replace

import pytest

from hexapod_cosim.controller import Gains
from hexapod_cosim.controller.design.paper import scaled
from hexapod_cosim.cosim.design.design_check import check_design
from hexapod_cosim.cosim.design.gain_design import design_for
from hexapod_cosim.models import load_robot

PERIOD = 0.005  # s
AGREEMENT = 5e-3  # 1    of the largest force
pytestmark = pytest.mark.usefixtures("plant_build")


@pytest.fixture(scope="module")
def gains(plant_build: object) -> Gains:
    return design_for(load_robot("athena"), PERIOD)


@pytest.mark.parametrize("stance", ["six legs", "tripod LF LR RM"])
def test_a_small_spread_goes_as_the_linear_loop_predicts(gains: Gains, stance: str) -> None:
    check = check_design(load_robot("athena"), gains, stance=stance)
    assert check.error < AGREEMENT
    assert check.simulated.max() > 500.0  # N/m    before the laws answer
    assert abs(check.simulated[-1]) < 0.1 * check.simulated.max()


def test_a_large_spread_does_not(gains: Gains) -> None:
    """The FMU's loop is not linear: friction saturates."""
    assert check_design(load_robot("athena"), gains, spread=0.01).error > 4.0 * AGREEMENT


@pytest.mark.parametrize(("by", "shakes"), [(0.8, False), (1.25, True)])
def test_the_fmu_shakes_where_the_gain_margin_ends(gains: Gains, by: float, shakes: bool) -> None:
    """by: shares over those at which the margin says that the worst plant becomes unstable."""
    critical = 10.0 ** (gains.margins.paper_gain_margin / 20.0)
    check = check_design(
        load_robot("athena"),
        replace(gains, paper=scaled(gains.paper, by * critical)),
        stance="tripod LF LR RM",
        load=0.1,
        gears_stick=False,
        spread=1e-6,
    )
    for force in (check.predicted, check.simulated):
        late = abs(force[2 * len(force) // 3 :]).max()
        assert bool(late > abs(force[: len(force) // 3]).max()) is shakes
