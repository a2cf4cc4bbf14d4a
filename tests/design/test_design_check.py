"""The designed loop on the FMU: a small spread of the feet goes as the linear loop predicts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hexapod_cosim.controller import Gains
from hexapod_cosim.controller.design.loci import worst_margins
from hexapod_cosim.controller.design.paper import PaperLoops, scaled
from hexapod_cosim.cosim.design.gains import design_for, standing_plants
from hexapod_cosim.cosim.design.verification import check_design
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
    assert check.simulated.max() > 500.0  # N/m    of legs and feet that creep


def test_a_large_spread_does_not(gains: Gains) -> None:
    """The FMU's loop is not linear: friction saturates."""
    assert check_design(load_robot("athena"), gains, spread=0.01).error > 4.0 * AGREEMENT


@pytest.mark.parametrize(("by", "grows"), [(0.8, False), (1.25, True)])
@pytest.mark.parametrize(
    ("stance", "load", "feet", "kind"),
    [("tripod LF LR RM", 0.1, 3, "gain"), ("six legs", 1.0, 6, "static")],
)
def test_a_disturbance_of_the_fmu_grows_where_the_margin_ends(
    gains: Gains, stance: str, load: float, feet: int, kind: str, by: float, grows: bool
) -> None:
    """Three feet shake, six push against each other.

    by: shares over those at which the margin says that the standing robot becomes unstable.
    """
    robot = load_robot("athena")
    loops = PaperLoops(robot, standing_plants(robot, PERIOD), gains.requirements, period=PERIOD)
    loci = loops.loci(f"{stance}, load {load:g}, gears slip", gains.paper)
    critical = 10.0 ** (getattr(worst_margins(loci, loops.omega), kind) / 20.0)
    check = check_design(
        robot,
        replace(gains, paper=scaled(gains.paper, by * critical)),
        stance=stance,
        load=load,
        gears_stick=False,
        push=np.eye(3 * feet)[2],  # the first foot upwards
        spread=1e-6,
    )
    third = len(check.time) // 3
    for force in (check.predicted, check.simulated):
        change = abs(np.diff(force))
        assert bool(change[2 * third :].max() > change[third : 2 * third].max()) is grows
