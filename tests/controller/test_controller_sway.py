"""Tests the measured centre of mass, to which the load plan moves, and the torso that sways
against the swinging legs under a payload.
"""

from __future__ import annotations

import numpy as np
import pytest
from gains import PERIOD, make_gains, unwatched
from standing import DEPTH, HOME, ROBOT, WEIGHT, Laws, make_laws, plan, rest, shared

from hexapod_cosim.controller import (
    BodyCommand,
    Controller,
    LegSolver,
    Measurement,
    Parts,
    make_gait,
)
from hexapod_cosim.controller.comply.support import Support
from hexapod_cosim.controller.comply.sway import Sway
from hexapod_cosim.controller.sense.load_adaptation import LoadAdaptation
from hexapod_cosim.controller.walk.inverse_dynamics import InverseDynamics, Neighbours
from hexapod_cosim.controller.walk.posture import Posture
from hexapod_cosim.models import load_robot

ROBOTS = ["athena", "phantomx_mk4"]
ROUND_OFF = 1e-12  # m
HEAVY = 1.4  # 1    weight over that of the model


class Weighed(LoadAdaptation):
    """Knows the weight of a payload and keeps it."""

    def __init__(self, weight_ratio: float, narrowing: float) -> None:
        super().__init__(rating=1.0, squeeze=0.6, narrows=True, cycle=1.0, period=PERIOD)
        self.weight_ratio, self.narrowing = weight_ratio, narrowing

    def weigh(self, weight_ratio: float) -> None:
        """Leaves the weight as it is."""


def walk(
    name: str, *, sway: bool, weight_ratio: float = HEAVY, narrowing: float = 1.0
) -> Controller:
    """Returns a controller of an amble whose feet feel nothing, without slow loops."""
    robot = load_robot(name)
    controller = Controller(
        robot,
        period=PERIOD,
        gait=make_gait(robot, "amble"),
        gains=make_gains(robot),
        parts=Parts(sway=sway, posture=False, path=False),
    )
    assert controller.compliant is not None
    controller.compliant.adaptation = Weighed(weight_ratio, narrowing)
    return unwatched(controller)


def pushes(controller: Controller, steps: int) -> np.ndarray:
    """Returns the forces along x (n,) that the ground must exert on the planned walk of a robot
    whose torso carries the payload [N].

    Steps at the ends of sections, at which no acceleration is known, are left out.
    """
    found, measurement = [], Measurement(angle=controller.stance.copy())
    assert controller.compliant is not None
    dynamics = controller.compliant.dynamics
    for step in range(steps):
        out = controller.step(step * PERIOD, BodyCommand(vx=0.06), measurement)
        before, now, after = controller.plan.before, controller.plan.now, controller.plan.after
        if before is not None and after is not None:
            three = (before, now, after)
            masses, poses = tuple(x.masses for x in three), tuple(x.pose for x in three)
            motion = Neighbours(masses, poses)  # type: ignore[arg-type]
            demand = dynamics.demand(motion, out.speed_ref, now.posture, HEAVY)
            found.append(HEAVY * demand.push.real)
    return np.array(found)


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("weight_ratio", [1.2, 2.0])
@pytest.mark.parametrize("step", [2e-3 + 0j, 2e-3j])
def test_the_centre_of_mass_stays_when_feet_move_and_a_torso_with_a_payload_sways(
    name: str, step: complex, weight_ratio: float
) -> None:
    robot = load_robot(name)
    legs = LegSolver(robot)
    dynamics = InverseDynamics(robot, legs, period=PERIOD)
    payload = (weight_ratio - 1.0) * dynamics.total_mass  # kg
    controller = walk(name, sway=True)
    sway, feet = Sway(dynamics, legs, active=True), controller.plan.now.feet
    x, y, z = dynamics.stance.T
    home, level = x + 1j * y, Posture.of(np.zeros(3), np.zeros(3))

    def moment(feet: np.ndarray, torso: complex) -> complex:
        """The sum of m p in the walking frame, of feet in it and a torso that has moved."""
        masses = dynamics.place(legs.pose(feet - torso, z), torso, 0.0, level)
        links = (dynamics.mass * masses.ground).sum()
        return complex(links + (dynamics.torso_mass + payload) * masses.torso_ground)

    guess = sway.guess(feet._replace(plane=home + step), weight_ratio)
    placed = dynamics.place(legs.pose(home + step - guess, z), guess, 0.0, level)
    without = moment(home + step, 0j) - moment(home, 0j)
    for moved, most in ((guess, 5e-3), (sway.of(guess, placed, weight_ratio), 1e-4)):
        left = moment(home + step, moved) - moment(home, 0j)
        assert abs(left) < most * abs(without)


def test_a_walk_with_sway_needs_a_hundredth_of_the_push_at_most() -> None:
    """Of a robot with a payload, on feet that swing. Shares alone would leave an eighth."""
    still, swaying = (pushes(walk("athena", sway=on), 900)[300:] for on in (False, True))
    assert np.sqrt((swaying**2).mean()) < 0.01 * np.sqrt((still**2).mean())


@pytest.mark.parametrize("sway", [False, True])
def test_a_standing_foot_keeps_its_place_on_the_ground(sway: bool) -> None:
    """Seen from the torso that sways it moves, but the torso moves by as much."""
    controller, measurement = walk("athena", sway=sway), Measurement()
    last, ways = None, []
    for step in range(900):
        controller.step(step * PERIOD, BodyCommand(vx=0.06, yaw_rate=0.1), measurement)
        now = controller.plan.now
        ways.append(abs(now.torso))
        turn = np.exp(1j * now.feet.turn)
        ground = now.feet.way + turn * (now.torso + now.plane - now.shift)
        stands = controller.plan.paths.clock.standing & (controller.plan.at > 0)
        if last is not None:
            assert np.abs(np.where(stands, ground - last, 0.0)).max() < ROUND_OFF
        last = ground
    assert (max(ways) > 1e-3) == sway
    assert max(ways) < 5e-3  # m


def test_the_torso_does_not_sway_without_payload_or_part_and_under_other_controls() -> None:
    robot = load_robot("athena")
    for controller in (
        walk("athena", sway=False),
        walk("athena", sway=True, weight_ratio=1.09, narrowing=0.0),
        Controller(robot, period=PERIOD, gait=make_gait(robot)),
    ):
        for step in range(300):
            controller.step(step * PERIOD, BodyCommand(vx=0.06), Measurement())
            assert controller.plan.now.torso == 0.0


# Tests the measured centre of mass: the load plan moves to where the load is.

CYCLE = round(make_gait(ROBOT).period / PERIOD)  # periods
TURNED = 1e-9  # m; round-off and the ridge of the shares


def support() -> Support:
    return Support(ROBOT, make_gait(ROBOT), make_gains(ROBOT).support, rest=rest(ROBOT))


def loads(place: complex) -> np.ndarray:
    """Returns forces (6, 3) of a robot that stands on all legs with its mass at a place."""
    force = np.zeros((6, 3))
    force[:, 2] = support().share_normal(HOME, np.ones(6), WEIGHT, WEIGHT * place)
    return force


def feel(laws: Laws, place: complex, steps: int) -> None:
    """Lets the robot stand, with a plan that follows the measured centre of mass."""
    share, still = support(), rest(ROBOT)
    for _ in range(steps):
        moment = still.moment + still.weight * laws.lean
        shares = share.shares(HOME, np.ones(6), still._replace(moment=moment))
        plan(laws)
        laws.planned = laws.planned._replace(shares=shares)
        laws.feel(loads(place))


def test_the_plan_reaches_the_centre_of_load_by_e_in_a_gait_cycle() -> None:
    laws, place = make_laws(), 0.01 - 0.02j
    feel(laws, place, CYCLE)
    assert laws.lean == pytest.approx(place * (1.0 - np.exp(-1.0)), abs=TURNED)
    feel(laws, place, 20 * CYCLE)
    assert laws.lean == pytest.approx(place, abs=1e-7)
    centre = laws.planned.shares.normal @ HOME / laws.planned.weight
    assert centre == pytest.approx(place, abs=1e-7)


def test_the_distance_is_limited_and_centred_loads_have_none() -> None:
    laws = make_laws()
    feel(laws, 0j, CYCLE)
    assert abs(laws.lean) < TURNED
    feel(laws, 0.09 + 0.0j, 20 * CYCLE)
    assert laws.lean.real == 0.4 * DEPTH
    assert abs(laws.lean.imag) < TURNED


def test_a_doubted_sensor_stops_the_estimate() -> None:
    laws = make_laws()
    plan(laws, height=0.0)
    force = shared(laws)
    force[3] = 0.0
    for _ in range(3 * CYCLE):
        laws.feel(0.9 * force)
    before = laws.lean
    assert laws.doubted[3]
    laws.feel(0.9 * force)
    assert laws.lean == before
