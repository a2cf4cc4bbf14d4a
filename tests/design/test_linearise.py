"""The linearised FMU agrees with the FMU for small motions and with closed forms for a standing
robot.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hexapod_cosim.controller import LegSolver
from hexapod_cosim.controller.design.closed import disturbed
from hexapod_cosim.controller.design.loci import response
from hexapod_cosim.controller.design.paper import shifted
from hexapod_cosim.controller.design.standing import ANGLES, StandingPlant, weight_share
from hexapod_cosim.cosim.design.gain_design import STANCES, level_fmu
from hexapod_cosim.cosim.design.linearise import STATES, Bench, linearise
from hexapod_cosim.cosim.design.standing import StanceError, rest
from hexapod_cosim.cosim.interface.names import foot_vector_names
from hexapod_cosim.models import Robot, load_robot

PERIOD = 0.005  # s
ROBOTS = ("athena", "phantomx_mk4")
# 1    of a column's size: third derivatives of contact and friction over differences of 1e-6 m and
# 1e-5 m/s
HALVED = 1e-4
ROUNDING = 1e-5  # N/m and the like    of forces of 10 N over 1e-6 m
# 1    of the largest force change: second derivatives over motions some hundred times the
# differences
PREDICTED = 2e-3
SMALL = 1e-4  # rad    of the inputs' changes there
# 1    slope of friction and stiffness of the contact, of the robot's own
STUCK, HARD = (
    300.0,
    100.0,
)
# 1    what still creeps of a force in 0.3 s, and the contact's compliance beside the leg's
YIELDED = 0.01
# rad/s, 1    what the load does to the legs' stiffness by leaning on them
SLOW, STIFFENED = (
    1e-2,
    0.1,
)
BALANCE = 1e-4  # 1    of the force: rest is reached to 1e-3 m/s
pytestmark = pytest.mark.usefixtures("plant_build")


def yielded(robot: Robot, plant: StandingPlant, force: np.ndarray) -> np.ndarray:
    """Returns by how much the servos yield at the standing feet (3 n) [m] to forces (3 n) [N]."""
    jacobian = LegSolver(robot).jacobian(plant.angle)[plant.standing]
    soft = jacobian @ jacobian.transpose(0, 2, 1) / robot.servo.kp
    moved: np.ndarray = np.einsum("nij,nj->ni", soft, force.reshape(-1, 3))
    return moved.reshape(-1)


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("stance", ["six legs", "tripod LF LR RM"])
def test_halving_the_differences_changes_little(name: str, stance: str) -> None:
    robot = load_robot(name)
    with level_fmu(robot) as fmu:
        motion, inputs = rest(fmu, robot, standing=STANCES[stance], load=1.0)
        bench = Bench(
            fmu,
            robot,
            coulomb_friction=robot.servo.coulomb_friction,
            slope=robot.friction.slope,
            period=PERIOD,
        )
        whole, half = (
            bench.differences(motion, inputs),
            bench.differences(motion, inputs, scale=0.5),
        )
    for one, other in zip(whole, half, strict=True):
        size = np.abs(one).max(axis=0)
        assert np.all(np.abs(one - other).max(axis=0) <= HALVED * size + ROUNDING)


@pytest.mark.parametrize("stance", ["six legs", "tripod LM RF RR"])
@pytest.mark.parametrize("friction", [0.05, 0.0])
def test_small_inputs_move_the_fmu_as_predicted(stance: str, friction: float) -> None:
    """Random angles, speeds and torques, each on its own scale, change outputs and states."""
    robot = load_robot("athena")
    changes = (
        np.random.default_rng(1).standard_normal((30, 3 * ANGLES))
        * np.repeat([1.0, 10.0, 40.0], ANGLES)
        * SMALL
    )
    with level_fmu(robot) as fmu:
        motion, inputs = rest(fmu, robot, standing=STANCES[stance], load=1.0)
        plant = linearise(fmu, robot, motion, inputs, period=PERIOD, coulomb_friction=friction)
        bench = Bench(
            fmu, robot, coulomb_friction=friction, slope=robot.friction.slope, period=PERIOD
        )
        bench.start(motion, inputs)
        state, still = np.zeros(STATES), bench.force()
        forces, predicted = [], []
        for k, change in enumerate(changes):
            forces.append(bench.force() - still)
            predicted.append(plant.system.C[:ANGLES] @ state)
            bench.set_inputs(inputs + np.concatenate([change, np.zeros(6)]))
            bench.step(k)
            state = plant.system.A @ state + plant.system.B @ change
        found = bench.motion().less(motion)
    assert np.abs(np.array(forces)).max() > 100.0 * SMALL
    np.testing.assert_allclose(
        forces, predicted, rtol=0.0, atol=PREDICTED * np.abs(predicted).max()
    )
    np.testing.assert_allclose(found, state, rtol=0.0, atol=PREDICTED * np.abs(state).max())


def test_a_foot_shifted_by_what_its_leg_yields_to_a_force_is_pushed_by_minus_that_force() -> None:
    """So a share of 1 would cancel the softness of the legs. Six stuck feet work against each
    other: three components of each force, without sum and moment.
    """
    robot = load_robot("athena")
    hard = replace(robot.contact, stiffness=HARD * robot.contact.stiffness)
    point = replace(robot.foot, radius=1e-4)  # a round foot rolls, so that its centre gives way
    sticky = replace(
        robot,
        foot=point,
        friction=replace(robot.friction, slope=STUCK * robot.friction.slope),
        contact=hard,
    )
    with level_fmu(sticky) as fmu:
        motion, inputs = rest(
            fmu, replace(sticky, friction=robot.friction), standing=STANCES["six legs"], load=1.0
        )
        plant = linearise(
            fmu, sticky, motion, inputs, period=PERIOD, coulomb_friction=0.0, scale=0.1
        )
        bench = Bench(fmu, robot, coulomb_friction=0.0, slope=sticky.friction.slope, period=PERIOD)
        bench.start(motion, inputs)
        points = fmu.block(foot_vector_names("position"))
        points.get()
        feet = points.values.reshape(6, 3)
    rows = np.concatenate(
        [[np.eye(3), [[0, -z, y], [z, 0, -x], [-y, x, 0]]] for x, y, z in feet]
    ).reshape(6, 2, 3, 3)
    balance = rows.transpose(1, 2, 0, 3).reshape(6, 18)
    inner = np.linalg.svd(balance)[2][6:]
    for force in inner:
        shift = yielded(sticky, plant, force)
        _, forces = disturbed(shifted(sticky, plant), shift, duration=0.3)
        np.testing.assert_allclose(forces[:, -1], -force, atol=YIELDED)


@pytest.mark.parametrize("stance", list(STANCES))
@pytest.mark.parametrize("load", [0.1, 1.0])
def test_the_feet_carry_the_load_asked_for_and_do_not_squeeze(stance: str, load: float) -> None:
    robot = load_robot("athena")
    with level_fmu(robot) as fmu:
        motion, inputs = rest(fmu, robot, standing=STANCES[stance], load=load)
        plant = linearise(fmu, robot, motion, inputs, period=PERIOD, coulomb_friction=0.0)
    total = load * len(STANCES[stance]) * weight_share(robot)
    assert plant.standing.sum() == len(STANCES[stance])
    assert plant.force[:, 2].sum() == pytest.approx(total, rel=BALANCE)
    assert plant.load(robot).mean() == pytest.approx(load, rel=BALANCE)
    assert np.abs(plant.force[:, :2]).max() < 1e-3 * total


def test_no_shift_carries_less_than_the_weight_for_long() -> None:
    """After constant upward shifts the foot forces add up to the weight again.

    No force along the ground remains.
    """
    robot = load_robot("athena")
    with level_fmu(robot) as fmu:
        motion, inputs = rest(fmu, robot, standing=STANCES["tripod LF LR RM"], load=1.0)
        plant = linearise(fmu, robot, motion, inputs, period=PERIOD, coulomb_friction=0.0)
    force = np.zeros(9)
    force[2::3] = 1.0, 2.0, -0.5
    shift = yielded(robot, plant, force)
    _, forces = disturbed(shifted(robot, plant), shift, duration=4.0)
    sums = forces.reshape(3, 3, -1).sum(axis=0)
    assert np.abs(sums).max() > 0.1
    np.testing.assert_allclose(sums[:, -1], 0.0, atol=1e-3)


def test_slow_squeezing_meets_friction_as_a_damper_that_goes_with_the_load() -> None:
    """f = c x' with c = mu f_n k_t, so that slow loci are twice as large under twice the load.

    The common push and twist of all feet meet nothing.
    """
    robot, loci = load_robot("athena"), []
    with level_fmu(robot) as fmu:
        for load in (0.5, 1.0):
            motion, inputs = rest(fmu, robot, standing=STANCES["six legs"], load=load)
            plant = linearise(fmu, robot, motion, inputs, period=PERIOD, coulomb_friction=0.0)
            flat = response(shifted(robot, plant), np.array([SLOW]))[0].reshape(6, 3, 6, 3)
            along = flat[:, :2, :, :2].reshape(12, 12)
            loci.append(np.sort(np.abs(np.linalg.eigvals(along)))[4:])
    np.testing.assert_allclose(loci[1] / loci[0], 2.0, rtol=STIFFENED)


def test_states_inputs_and_outputs_have_names() -> None:
    robot = load_robot("athena")
    with level_fmu(robot) as fmu:
        motion, inputs = rest(fmu, robot, standing=STANCES["six legs"], load=1.0)
        system = linearise(fmu, robot, motion, inputs, period=PERIOD, coulomb_friction=0.0).system
    assert system.input_labels[0] == "LF_coxa_angle_ref"
    assert system.input_labels[53] == "RR_tibia_torque_ref"
    assert system.output_labels[:3] == [f"LF_foot_force[{k}]" for k in (1, 2, 3)]
    assert system.state_labels[6] == "LF_coxa_angle"
    assert system.dt == PERIOD


def test_legs_that_do_not_hold_the_robot_are_refused() -> None:
    robot = load_robot("athena")
    with (
        level_fmu(robot) as fmu,
        pytest.raises(
            StanceError,
            match=r"does not stay on its legs: got 'the centre of mass at \(0, 1\) mm', "
            r"expected between LF LM",
        ),
    ):
        rest(fmu, robot, standing=("LF", "LM"), load=1.0)
