"""Compares the C plant with the equations in numpy and with Pinocchio, at random states."""

from __future__ import annotations

import ctypes as ct
from collections.abc import Iterator

import numpy as np
from states import changed, distance, random_bodies, random_command
from test_plant_dynamics import MODES, ROBOTS, at
from test_twin_pinocchio import pinocchio_accelerations

from hexapod_cosim.models import Robot
from hexapod_cosim.models.constraints import constraints
from hexapod_cosim.models.contact.geometry import standing_damping
from hexapod_cosim.models.dynamics import accelerations, joint_torques
from tools.docs.validation.shown import Shown, short

SEEDS = range(8)


def agreement(core: ct.CDLL) -> Shown:
    """Returns the largest differences over robots, servo modes and states.

    Differences are relative to the largest entry.
    """
    dense = np.max(
        [difference for robot in ROBOTS.values() for difference in _dense(core, robot)], axis=0
    )
    pinocchio = max(
        difference for robot in ROBOTS.values() for difference in _pinocchio(core, robot)
    )
    return Shown(
        columns=("compared", "with", "largest relative difference"),
        rows=[
            (
                "accelerations of 19 bodies, O(n) in C",
                "the dense 204 x 204 system in numpy",
                short(float(dense[0])),
            ),
            ("90 multipliers (joint reactions)", "the same", short(float(dense[1]))),
            (
                "accelerations of the torso and of 18 joints",
                "Pinocchio's articulated-body algorithm",
                short(pinocchio),
            ),
        ],
    )


def _dense(core: ct.CDLL, robot: Robot) -> Iterator[tuple[float, float]]:
    for mode in MODES:
        moving = changed(robot, servo={"mode": mode})
        for seed in SEEDS:
            body, command = random_bodies(moving, seed, drift=1e-3), random_command(moving, seed)
            ours = at(core, moving, body).accelerations(command)
            theirs = accelerations(moving, body, command, standing_damping(moving, body))
            yield distance(ours.dv, theirs.dv), distance(ours.multipliers, theirs.multipliers)


def _pinocchio(core: ct.CDLL, robot: Robot) -> Iterator[float]:
    for seed in SEEDS:
        body, command = random_bodies(robot, seed), random_command(robot, seed)
        plant = at(core, robot, body)
        foot, dv = plant.output(command).foot, plant.accelerations(command).dv
        motor, gear = joint_torques(robot, body, command)
        push = np.concatenate([command.push_force, command.push_torque])
        theirs = pinocchio_accelerations(
            robot, body, motor + gear, np.stack([foot.position, foot.force], axis=1), push
        )
        yield distance(np.concatenate([dv[0], constraints(robot, body).G @ dv.ravel()]), theirs)
