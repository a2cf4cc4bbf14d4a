"""Tests that the linearised FMU agrees with the FMU for small motions and with closed forms for a
standing robot.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hexapod_cosim.controller import LegSolver
from hexapod_cosim.controller.design.paper import ANGLES, StandingPlant, shifted, weight_share
from hexapod_cosim.controller.design.plots import disturbed
from hexapod_cosim.cosim.design.gains import STANCES, level_fmu
from hexapod_cosim.cosim.design.linearise import STATES, Bench, linearise
from hexapod_cosim.cosim.design.standing import StanceError, rest
from hexapod_cosim.cosim.interface.names import foot_vector_names
from hexapod_cosim.models import Robot, load_robot

PERIOD = 0.005  # s
# 1    of the largest force change: second derivatives over motions some hundred times the
# differences
PREDICTED = 2e-3
SMALL = 1e-4  # rad    of the inputs' changes there
# 1    slope of friction and stiffness of the contact, of the robot's own
STUCK, HARD = (300.0, 100.0)
# 1    what still creeps of a force in 0.3 s, and the contact's compliance beside the leg's
YIELDED = 0.01
BALANCE = 1e-4  # 1    of the force: rest is reached to 1e-3 m/s
NEEDS_LINEARISE = pytest.mark.usefixtures("plant_build")


def yielded(robot: Robot, plant: StandingPlant, force: np.ndarray) -> np.ndarray:
    """Returns by how much the servos yield at the standing feet (3 n) [m] to forces (3 n) [N]."""
    jacobian = LegSolver(robot).jacobian(plant.angle)[plant.standing]
    soft = jacobian @ jacobian.transpose(0, 2, 1) / robot.servo.kp
    moved: np.ndarray = np.einsum("nij,nj->ni", soft, force.reshape(-1, 3))
    return moved.reshape(-1)


@NEEDS_LINEARISE
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


@NEEDS_LINEARISE
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


@NEEDS_LINEARISE
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


@NEEDS_LINEARISE
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


@NEEDS_LINEARISE
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
