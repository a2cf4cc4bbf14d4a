"""Tests that repeating, restoring and resetting a plant, and stepping other plants, change no bit
of its motion.
"""

from __future__ import annotations

import ctypes as ct

import numpy as np
import pytest
from plant import Plant, definition
from states import MACRO, changed, landing, lopsided, random_bodies, trail

from hexapod_cosim.models import METHODS, load_robot


@pytest.mark.parametrize("method", METHODS)
def test_a_rerun_gives_the_same_bits(core: ct.CDLL, method: str) -> None:
    robot = changed(
        load_robot("athena"), solver={"method": method, "step": 2e-5 if method == "rk4" else 0.0}
    )
    one, two = (trail(Plant(core, robot, **landing(robot)), 8) for _ in range(2))
    assert one == two
    assert len(set(one)) == len(one)


@pytest.mark.parametrize("mode", ["position", "torque", "kinematic"])
@pytest.mark.parametrize("law", ["tanh", "bristle"])
def test_restoring_at_any_point_gives_the_same_bits_in_another_instance(
    core: ct.CDLL, mode: str, law: str
) -> None:
    robot, other = (
        changed(lopsided(), servo={"mode": mode}, friction={"law": law}),
        load_robot("athena"),
    )
    whole = trail(Plant(core, robot, **landing(robot)), 12)
    touching = set()
    for k in (0, 3, 6, 9, 11):
        stranger = Plant(core, other)  # the other instance had another robot and another time
        stranger.step(0.01)
        stranger.restore(whole[k])
        assert stranger.save() == whole[k]
        touching.add(int(np.sum(stranger.output().foot.contact)))
        stranger.robot = robot
        assert trail(stranger, 11 - k, first=k + 1) == whole[k + 1 :]
    assert len(touching) > 1  # in the air as well as in contact


@pytest.mark.parametrize("law", ["tanh", "bristle"])
def test_a_reset_goes_back_to_the_exact_start(core: ct.CDLL, law: str) -> None:
    robot = changed(load_robot("athena"), friction={"law": law})
    plant = Plant(core, robot, **landing(robot))
    start = plant.save()
    first = trail(plant, 6)
    plant.reset(definition(robot, **landing(robot)))
    assert plant.save() == start
    assert trail(plant, 6) == first


def test_setting_the_bodies_restarts_the_energy_balance_at_the_same_time(core: ct.CDLL) -> None:
    robot = load_robot("athena")
    plant = Plant(core, robot, **landing(robot))
    trail(plant, 8)
    plant.bodies = random_bodies(robot, 4)
    output = plant.output()
    assert output.time == 8 * MACRO
    assert (
        output.energy.actuator_work,
        output.energy.dissipated,
        output.energy.residual,
        output.solver.steps,
    ) == (0.0, 0.0, 0.0, 0.0)
    assert np.array_equal(output.foot.contact != 0, output.foot.penetration > 0.0)


def test_a_start_time_shifts_the_time_and_nothing_else(core: ct.CDLL) -> None:
    robot = changed(load_robot("athena"), solver={"step": 2.0**-10})
    early, late = Plant(core, robot, **landing(robot)), Plant(core, robot)
    late.reset(definition(robot, **landing(robot)), 64.0)
    early.step(2.0**-5)
    late.step(64.0 + 2.0**-5)
    assert late.time == 64.0 + 2.0**-5
    assert (
        float(np.max(np.abs(early.bodies - late.bodies))) < 1e-9
    )  # touch-down is found to 1e-10 m
