"""Tests the rate of the dissipated energy on soft ground: feet that sink, that are lifted and that
stand; what importers' solvers integrate.
"""

from __future__ import annotations

import ctypes as ct
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from mirror import HxInput
from plant import Plant
from states import changed

from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.actuator import gear_friction
from hexapod_cosim.models.dynamics import Command
from hexapod_cosim.models.soil import law
from hexapod_cosim.models.soil.law import lost_power
from hexapod_cosim.models.soil.presets import soil_preset
from hexapod_cosim.models.statics import standing

ATHENA = load_robot("athena")
LOST = 51  # number of the dissipated energy among the coordinates
HEIGHT = 2  # of the torso
SAME = 1e-9  # relative: the same sums in another order


def on_soil(name: str, pad: float = 0.025) -> Robot:
    robot = changed(ATHENA, foot={"pad_radius": pad}, body={"contact": "off"})
    return replace(robot, soil=soil_preset(name).soil)


def standing_in(core: ct.CDLL, robot: Robot, height: float = 0.0) -> Plant:
    pose = standing(robot)
    start: dict[str, Any] = {"quaternion": pose.quaternion, "angle": pose.angle}
    return Plant(core, robot, position=np.add(pose.position, (0.0, 0.0, height)), **start)


def pushing(robot: Robot, *force: float) -> Command:
    return Command(angle_ref=robot.stance, push_force=np.array(force))


def depths(out: Any) -> list[tuple[float, float, float]]:
    """Returns plastic depth, depth [m] and sinking speed [m/s] of all feet in contact."""
    foot = out.foot
    return [
        (float(foot.sinkage[leg]), float(foot.penetration[leg]), -float(foot.velocity[leg][2]))
        for leg in np.flatnonzero(foot.contact)
    ]


def other_losses(robot: Robot, out: Any) -> float:
    """Returns the power [W] that shear and gears take."""
    force, velocity = np.array(out.foot.force), np.array(out.foot.velocity)
    shear = -float(np.sum(force[:, :2] * velocity[:, :2]))
    return shear - float(np.sum(gear_friction(robot.servo, out.speed) * out.speed))


@pytest.mark.parametrize("pad", [0.0, 0.025])
@pytest.mark.parametrize("name", ["dry_sand", "clay", "granular", "mud"])
def test_sinking_feet_lose_what_the_soil_does_not_store(
    core: ct.CDLL, name: str, pad: float
) -> None:
    """The weight and a push press all feet into the soil, and then another lifts them."""
    robot = on_soil(name, pad)
    plant, sinking, rising = standing_in(core, robot, 0.001), 0, 0
    for k in range(40):
        command = pushing(robot, 5.0, 0.0, -30.0 if k < 25 else 80.0)
        plant.step(0.004 * (k + 1), command)
        out = plant.output(command)
        feet = depths(out)
        lost = sum(lost_power(robot.soil, robot.foot, *foot) for foot in feet)
        expected = lost + other_losses(robot, out)
        assert plant.rates(command)[LOST] == pytest.approx(expected, rel=SAME, abs=1e-9)
        sinking += sum(dz > 1e-3 for _, _, dz in feet)
        rising += sum(dz < -1e-3 for _, _, dz in feet)
    assert sinking > 12
    assert rising >= 2


def test_the_rate_while_feet_sink_sums_up_to_the_books(core: ct.CDLL) -> None:
    """By Simpson's rule over readings every 0.5 ms, of which each ends a step of the integrator."""
    robot, h = on_soil("dry_sand"), 5e-4
    plant = standing_in(core, robot)
    for k in range(100):
        plant.step(0.005 * (k + 1), pushing(robot, 0.0, 0.0, 0.0))
    start, command = plant.time, pushing(robot, 0.0, 0.0, -40.0)
    plant.step(start + h, command)
    begin, rates = plant.output(command).energy.dissipated, [plant.rates(command)[LOST]]
    for k in range(80):
        plant.step(start + (k + 2) * h, command)
        rates.append(plant.rates(command)[LOST])
    taken = plant.output(command).energy.dissipated - begin
    summed = h / 3.0 * (rates[0] + rates[-1] + 4.0 * sum(rates[1::2]) + 2.0 * sum(rates[2:-1:2]))
    assert taken > 0.02
    assert summed == pytest.approx(taken, rel=1e-3)


@pytest.mark.parametrize(
    ("name", "pad"),
    [("dry_sand", 0.0), ("dry_sand", 0.025), ("granular", 0.0), ("granular", 0.025), ("mud", 0.0)],
)
def test_the_derivative_of_the_rate_of_sinking_feet_is_that_of_its_differences(
    core: ct.CDLL, name: str, pad: float
) -> None:
    """Differences of order 4 towards deeper feet, because the other side is that of unloading. They
    begin 10 nm deeper: the plant's links are off their joints by less, its coordinates are not.
    """
    robot = on_soil(name, pad)
    plant, command = standing_in(core, robot, 0.001), pushing(robot, 0.0, 0.0, -60.0)
    down, h, sinking = np.zeros(70), 1e-6, 0
    down[HEIGHT] = -1.0
    for k in range(25):
        plant.step(0.004 * (k + 1), command)
        feet = depths(plant.output(command))
        yields = [law.is_yielding(robot.soil, robot.foot, *foot) for foot in feet]
        if len(feet) < 6 or not all(yields) or min(dz for _, _, dz in feet) < 1e-3:
            continue
        sinking += 1
        d_rate, _ = plant.tangent(command, np.zeros(ct.sizeof(HxInput) // 8), down)
        x, rates = plant.coordinates, []
        for node in range(5):
            plant.coordinates = x + (node * h + 1e-8) * down
            rates.append(plant.rates(command)[LOST])
        plant.coordinates = x
        expected = np.dot(rates, [-25 / 12, 4.0, -3.0, 4 / 3, -0.25]) / h
        assert d_rate[LOST] == pytest.approx(expected, rel=1e-4, abs=1e-6)
    assert sinking > 2
