"""Tries the friction models M1 to M6 on the first seconds of logs.

Each model is fitted with all other numbers, and judged by the Bayesian information criterion, the
sum of squares over the noise plus log(readings) for each number (Schwarz, Annals of Statistics 6,
1978). So a model with more terms must explain more.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from hexapod_cosim.cosim.common.temporary import TemporaryFolder
from hexapod_cosim.cosim.export.plant_export import export_fmu
from hexapod_cosim.extensions.identify.experiment import Experiment
from hexapod_cosim.extensions.identify.fitting.output_error import (
    COARSE,
    SEARCHED,
    misfit_cost,
    searched,
)
from hexapod_cosim.extensions.identify.fitting.problem import Problem
from hexapod_cosim.extensions.identify.log_plant import LogPlant
from hexapod_cosim.extensions.identify.numbers.friction_models import with_friction_model
from hexapod_cosim.extensions.identify.unknowns import chosen_unknowns, value_before
from hexapod_cosim.models import Robot
from hexapod_cosim.models.servos.presets import FRICTION_MODELS

SECONDS = 2.0  # of each log on which the models are tried


@dataclass(frozen=True)
class FrictionTrial:
    """How well a friction model explains the logs."""

    model: str  # "m1" to "m6"
    numbers: int  # that were fitted
    cost: float  # sum of squares over the readings' noise
    criterion: float  # that, and log(readings) for each number: the least is best


def tried_models(
    experiments: Sequence[Experiment],
    robot: Robot,
    groups: Sequence[str],
    watch: Callable[[], None],
) -> list[FrictionTrial]:
    """Returns the friction models with how well each explains the logs, the best one first.

    Args:
        experiments: the logs without bad columns.
        robot: the robot file's.
        groups: numbers that are fitted with those of the friction.
        watch: called after each simulation.

    Raises HexapodError for a servo without a model of its motor.
    """
    logs = [one.log for one in experiments]
    found: list[FrictionTrial] = []
    known: dict[str, float] = {}
    variants = {model: with_friction_model(robot, model) for model in FRICTION_MODELS}
    for model, variant in variants.items():
        rows = chosen_unknowns(variant, logs, groups)
        before = {row.key: value_before(row, variant) for row in rows}
        start = np.array([
            row.distance(known.get(row.key, before[row.key]), before[row.key]) for row in rows
        ])  # fmt: skip
        with TemporaryFolder("friction") as folder:
            path = export_fmu(variant, folder / "robot.fmu")
            with LogPlant(path) as plant:
                plant.watch = watch
                whole = Problem(plant, variant, experiments, rows)
                short = whole.shortened(SECONDS, parameters=COARSE, most=SEARCHED)
                z = searched(short, start, lambda _text: None)
                cost = misfit_cost(short, z)
        known |= {
            row.key: row.value(float(own), before[row.key])
            for row, own in zip(rows, z, strict=True)
        }
        count = sum(int(own.sum()) for own in short.all_known())
        found.append(FrictionTrial(model, len(rows), cost, cost + len(rows) * math.log(count)))
    return sorted(found, key=lambda one: one.criterion)
