"""Proposes a walk that tells numbers which a log leaves open.

Some walks are simulated with the identified robot. The sensitivity of their readings, with the
noise that was found, and the information of the log together predict the deviation of each number
before the walk is recorded.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import tomlkit
from numpy.typing import NDArray

from hexapod_cosim.cosim.common.temporary import TemporaryFolder
from hexapod_cosim.cosim.export.plant_export import export_fmu
from hexapod_cosim.cosim.interface.names import joint_names
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.run.single_run import simulate
from hexapod_cosim.cosim.scenario.scenario import scenario_from_table
from hexapod_cosim.cosim.scenario.tables import read_tables, with_values
from hexapod_cosim.extensions.identify.experiment import Experiment
from hexapod_cosim.extensions.identify.fitting.differences import FINE
from hexapod_cosim.extensions.identify.fitting.problem import Problem
from hexapod_cosim.extensions.identify.fitting.rank import TOLD
from hexapod_cosim.extensions.identify.identified import Identified
from hexapod_cosim.extensions.identify.identify import TOLERANCE
from hexapod_cosim.extensions.identify.log import Log
from hexapod_cosim.extensions.identify.log_plant import LogPlant
from hexapod_cosim.extensions.identify.unknowns import START
from hexapod_cosim.models import HexapodError, Robot

Array = NDArray[np.float64]
DURATION = 3.0  # s    of a walk
SCENARIO = "walk_flat"


@dataclass(frozen=True)
class Walk:
    """A walk that may be recorded."""

    title: str
    settings: Mapping[str, Any]  # keys of the scenario


@dataclass(frozen=True)
class Proposal:
    """What a walk would add to a log."""

    title: str
    settings: Mapping[str, Any]
    tells: tuple[str, ...]  # numbers that the log leaves open and both would tell
    deviations: Mapping[str, float]  # of all numbers with both, in those of what was known
    median: float  # of the deviations of the numbers that the log leaves open


def walks(robot: Robot) -> tuple[Walk, ...]:
    """Returns the walks that are tried, at the speed of the robot's gait."""
    speed, period = robot.gait.stride / robot.gait.period, robot.gait.period
    height = 0.1 * abs(float(np.mean([leg.links[2].length for leg in robot.legs])))
    sway = [
        {"time": 0.0, "vx": 0.3 * speed, "pitch": 0.08, "height": height},
        {"time": 1.0, "vx": 0.3 * speed, "pitch": -0.08, "roll": 0.08, "height": -height},
        {"time": 2.0, "vx": 0.3 * speed, "roll": -0.08, "height": height},
    ]
    return (
        Walk("A walk straight ahead", {"command": [{"vx": speed}]}),
        Walk(
            "A fast walk with high steps",
            {
                "command": [{"vx": speed}],
                "gait.period": 0.6 * period,
                "gait.step_height": 1.5 * robot.gait.step_height,
            },
        ),
        Walk("A walk sideways", {"command": [{"vy": 0.7 * speed}]}),
        Walk("A turn on the spot", {"command": [{"yaw_rate": 3.0 * speed}]}),
        Walk("A slow walk with a swaying torso", {"command": sway}),
    )


def propose(found: Identified, file: str) -> list[Proposal]:
    """Returns the walks with what each would add, the best one first.

    file: the robot file from which the robot was identified, or its name. A walk that the robot
    cannot make is left out.
    """
    untold = [one.key for one in found.estimates if not one.told]
    proposals = []
    with TemporaryFolder("propose") as folder:
        path = export_fmu(found.file, folder / "robot.fmu")
        with LogPlant(path, TOLERANCE) as plant:
            for walk in walks(found.robot) if untold else ():
                try:
                    proposals.append(
                        _judged(plant, found, _recorded(found, walk, file), walk, untold)
                    )
                except HexapodError:
                    continue
    return sorted(proposals, key=lambda one: (-len(one.tells), one.median))


def _judged(
    plant: LogPlant, found: Identified, log: Log, walk: Walk, untold: Sequence[str]
) -> Proposal:
    """Returns what a walk with the commands of a log adds to the logs. Raises HexapodError."""
    own = [row for row in found.fit.rows if row.group != START]
    experiment = Experiment(
        log=log,
        number=0,
        columns=found.experiments[0].columns,
        fitted=slice(1, len(log.time)),
        held_out=slice(0, 0),
    )
    problem = Problem(plant, found.file, [experiment], own)
    problem.noise = {key: found.fit.noise[key] for key in experiment.channels}
    keep = [k for k, row in enumerate(found.fit.rows) if row.group != START]
    z = found.fit.z[keep]
    problem.leave_out_jumps(z)
    problem.leave_out_bent(z)
    sensitivity = problem.jacobian(z, FINE)[: -len(own)]
    known = np.linalg.inv(found.fit.covariance[np.ix_(keep, keep)])
    both = np.linalg.inv(known + sensitivity.T @ sensitivity)
    pairs = zip(own, np.sqrt(np.diag(both)), strict=True)
    deviations = {row.key: float(value) for row, value in pairs}
    left = [deviations[key] for key in untold]
    return Proposal(
        walk.title,
        walk.settings,
        tuple(key for key in untold if deviations[key] < TOLD),
        deviations,
        float(np.median(left)),
    )


def _recorded(found: Identified, walk: Walk, file: str) -> Log:
    """Returns commands of a walk, and the readings of the robot file's robot that walks it.

    Raises HexapodError for a walk that the robot cannot make.
    """
    table, where = read_tables(SCENARIO)
    settings = {**walk.settings, "duration": DURATION, "outputs.plots": False}
    scenario = scenario_from_table(with_values(table, settings), where=where)
    recording = simulate(replace(scenario, robot=file)).recording
    names = [*joint_names("angle_ref"), *joint_names("speed_ref")]
    columns = [name for name in found.experiments[0].columns if name in recording.names]
    wanted = ("time", *names, *columns)
    # readings that runs do not record, as currents, are predicted all the same
    return Log(Recording(wanted, recording.columns(wanted)), walk.title)


def scenario_text(proposal: Proposal, robot: str) -> str:
    """Returns the scenario file of a proposed walk, for the robot of a file beside it."""
    table, _ = read_tables(SCENARIO)
    changed = with_values(table, {**proposal.settings, "duration": 20.0})
    changed |= {"title": proposal.title, "robot": robot}
    return tomlkit.dumps(changed)
