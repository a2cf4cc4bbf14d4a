"""Identifies a robot from its logs: screens their columns, fits, and judges what they tell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.common.temporary import TemporaryFolder
from hexapod_cosim.cosim.export.plant_export import export_fmu
from hexapod_cosim.cosim.interface.names import vector_names
from hexapod_cosim.cosim.run.worker_pool import processor_count
from hexapod_cosim.extensions.identify.channel_screening import screened, turned_after_the_fit
from hexapod_cosim.extensions.identify.commands.command_screening import check_commands
from hexapod_cosim.extensions.identify.commands.speed_references import with_speed_references
from hexapod_cosim.extensions.identify.experiment import Experiment
from hexapod_cosim.extensions.identify.fitting.friction_search import tried_models
from hexapod_cosim.extensions.identify.fitting.judging import Fit
from hexapod_cosim.extensions.identify.fitting.output_error import fit
from hexapod_cosim.extensions.identify.fitting.problem import TO_DEVIATION, Problem
from hexapod_cosim.extensions.identify.fitting.progress import (
    AGAIN,
    COLUMNS,
    LINEAR,
    MODELS,
    Progress,
    Reporter,
)
from hexapod_cosim.extensions.identify.fitting.workers import simulating_workers
from hexapod_cosim.extensions.identify.identified import Identified
from hexapod_cosim.extensions.identify.log import HELD_OUT, Log, LogError, without_readings
from hexapod_cosim.extensions.identify.log_plant import LogPlant
from hexapod_cosim.extensions.identify.numbers.friction_models import BEST, with_friction_model
from hexapod_cosim.extensions.identify.numbers.servo import ELASTIC
from hexapod_cosim.extensions.identify.rigid.linear_start import linear_start
from hexapod_cosim.extensions.identify.screening import BadColumn, misfits
from hexapod_cosim.extensions.identify.start import rest_rows
from hexapod_cosim.extensions.identify.unknowns import GROUPS, changed_robot, chosen_unknowns
from hexapod_cosim.models import Robot
from hexapod_cosim.models.servos.presets import FRICTION_MODELS

Array = NDArray[np.float64]
SETTLING = 0.1  # s    at the start of a log that is not compared: the first row has noise
LONG = 4000  # rows from which on worker processes save more time than they take to start
TOLERANCE = {"solver.tolerance": 1e-5}  # differences of simulations need exact ones


def identify(
    logs: Sequence[Log],
    robot: Robot,
    *,
    groups: Sequence[str] = GROUPS,
    held_out: float = HELD_OUT,
    workers: int = 1,
    progress: Progress | None = None,
    friction: str | None = None,
) -> Identified:
    """Finds a robot's numbers from logs.

    Args:
        logs: commands and readings; each begins with the robot standing still.
        robot: what is known of it.
        groups: which numbers of the table of unknowns are to be found.
        held_out: share of the rows at the end of each log that only judges the result.
        workers: number of processes, on which the result does not depend. With more than one, the
            calling script needs `if __name__ == "__main__"`.
        progress: called when a step begins and after each simulation.
        friction: friction model of measured servos, "m1" to "m6", or "best" for the one that
            explains the logs best; None: the terms that the robot file has.

    Raises HexapodError for logs without readings, where the plant cannot follow them, and for a
    friction model of a servo without a motor.
    """
    if friction is not None:
        return _with_friction(logs, robot, friction, groups, held_out, workers, progress)
    # imported here: the command's help starts sooner
    from threadpoolctl import threadpool_limits  # noqa: PLC0415

    report = Reporter(progress)
    rows = chosen_unknowns(robot, logs, groups)
    # small matrices: threads of linear algebra would wait for each other
    with threadpool_limits(1), TemporaryFolder("identify") as folder:
        path = export_fmu(robot, folder / "robot.fmu")
        place = folder / "workers"
        with (
            LogPlant(path, TOLERANCE) as plant,
            simulating_workers(workers, path, robot, TOLERANCE, place) as pool,
        ):
            plant.watch = report.simulated
            if pool is not None:
                pool.watch = report.simulated
            report.begin(COLUMNS)
            experiments, bad = screen(plant, robot, logs, groups=groups, held_out=held_out)
            report.begin(LINEAR)
            linear, lacking = linear_start(experiments, robot, rows)
            start = linear.z(rows, robot) if linear else None
            problem = Problem(plant, robot, experiments, rows, pool)
            found = fit(problem, start=start, progress=report.begin)
            late = _misfits(problem, found)
            if late:
                bad += late
                report.begin(AGAIN)
                experiments = _without(experiments, late)
                problem = Problem(plant, robot, experiments, rows, pool)
                found = fit(problem, start=start, progress=report.begin)
            before = problem.predictions(np.zeros(len(rows)))
    return Identified(
        file=robot,
        robot=robot if found.rejected else changed_robot(robot, rows, found.values),
        fit=found,
        experiments=tuple(experiments),
        bad=tuple(bad),
        before=tuple(before),
        linear=linear,
        lacking=lacking,
    )


def _with_friction(
    logs: Sequence[Log],
    robot: Robot,
    friction: str,
    groups: Sequence[str],
    held_out: float,
    workers: int,
    progress: Progress | None,
) -> Identified:
    """Finds a robot's numbers with a friction model, or the best of all; see `identify`."""
    report, trials = Reporter(progress), []
    variant = with_friction_model(robot, FRICTION_MODELS[0] if friction == BEST else friction)
    with TemporaryFolder("identify") as folder:
        path = export_fmu(robot, folder / "robot.fmu")
        with LogPlant(path, TOLERANCE) as plant:
            plant.watch = report.simulated
            if friction == BEST:
                report.begin(MODELS)
                experiments, _ = screen(plant, robot, logs, groups=groups, held_out=held_out)
                trials = tried_models(experiments, robot, groups, report.simulated)
                variant = with_friction_model(robot, trials[0].model)
            found = identify(
                logs, variant, groups=groups, held_out=held_out, workers=workers, progress=progress
            )
            # what the robot file says, with its own friction
            rows = chosen_unknowns(robot, logs, groups)
            own = Problem(plant, robot, found.experiments, rows)
            before = tuple(own.predictions(np.zeros(len(rows))))
    kept = robot if found.rejected else found.robot
    return replace(found, robot=kept, before=before, given=robot, trials=tuple(trials))


def usual_workers(logs: Sequence[Log]) -> int:
    """Returns a number of processes for logs: that of processors, but 1 for short logs."""
    return processor_count() if sum(len(log.time) for log in logs) >= LONG else 1


def forgetting(robot: Robot, groups: Sequence[str]) -> float:
    """Returns how long a walk takes to forget what no log shows of its start [s].

    Elastic gears stand somewhere in their play. With zeros of the angles unknown, so are the forces
    by which standing feet push against each other. Both are so until each foot was lifted once,
    within a period of the gait.
    """
    return robot.gait.period if ELASTIC(robot) or "zero" in groups else 0.0


def make_experiment(log: Log, number: int, held_out: float, *, forget: float = 0.0) -> Experiment:
    """Returns the comparison of a log, with the readings that the FMU predicts.

    forget: how long rows from the first change of a command on are not compared, and none before
    [s]; 0: from the rest on.

    Raises LogError for a log without readings.
    """
    columns = log.measured
    if set(vector_names("torso.position")) - set(columns):  # a part of a position has no use
        columns = tuple(name for name in columns if not name.startswith("torso.position"))
    if not columns:
        raise without_readings(log)
    count = len(log.time)
    end = count - round(held_out * count)
    begin = int(np.searchsorted(log.time, log.time[0] + SETTLING))
    if rest_rows(log) == 1:  # without a rest the joints need longer to forget the first row
        begin *= 3
    if forget > 0.0:
        moved = log.time[rest_rows(log) - 1] + forget
        begin = max(begin, int(np.searchsorted(log.time, moved)))
    if not 0 < begin < end - 1:
        raise LogError(
            "a log that is too short",
            got=f"{log.time[-1] - log.time[0]:g} s",
            expected="several steps of a walk",
            fix="record a longer one",
            where=log.where,
        )
    return Experiment(
        log=log,
        number=number,
        columns=columns,
        fitted=slice(begin, end),
        held_out=slice(end, count),
    )


def screen(
    plant: LogPlant,
    robot: Robot,
    logs: Sequence[Log],
    *,
    groups: Sequence[str] = GROUPS,
    held_out: float = HELD_OUT,
) -> tuple[list[Experiment], list[tuple[int, BadColumn]]]:
    """Returns the comparisons of logs without dead and wrong columns of readings, and these.

    plant: of the robot file's robot. groups, held_out: as of `identify`.

    Raises WrongCommandsError for dead and wrong commands, LogError where no reading is left.
    """
    for log in logs:
        check_commands(log)
    logs = [with_speed_references(log, robot) for log in logs]
    forget = forgetting(robot, groups)
    experiments = [make_experiment(log, k, held_out, forget=forget) for k, log in enumerate(logs)]
    rows = chosen_unknowns(robot, logs, groups)
    problem = Problem(plant, robot, experiments, rows)
    simulated = problem.predictions(np.zeros(len(rows)))
    bad = [
        (one.number, column)
        for one, own in zip(experiments, simulated, strict=True)
        for column in screened(one, own)
    ]
    return _without(experiments, bad), bad


def _without(
    experiments: Sequence[Experiment], bad: Sequence[tuple[int, BadColumn]]
) -> list[Experiment]:
    """Returns the experiments without some columns. Raises LogError when none is left."""
    found = []
    for one in experiments:
        names = [column.name for number, column in bad if number == one.number]
        kept = one.without(names)
        if not kept.columns:
            first = next(column for number, column in bad if number == one.number)
            raise LogError(
                "no column of the log can be used",
                got=f"{first.name}: {first.why}",
                expected="readings that follow the commands",
                fix="check names, units and signs of the columns, and the robot file",
                where=one.log.where,
            )
        found.append(kept)
    return found


def _misfits(problem: Problem, found: Fit) -> list[tuple[int, BadColumn]]:
    """Returns the columns that the fit leaves far from the simulation."""
    bad = []
    errors = problem.errors(found.z)
    sides = zip(problem.experiments, errors, problem.counted, found.predictions, strict=True)
    for one, error, counted, predicted in sides:
        typical = [
            TO_DEVIATION * float(np.median(np.abs(column[own]))) if own.any() else 0.0
            for column, own in zip(error.T, counted.T, strict=True)
        ]
        wrong = misfits(one, np.array(typical)) + turned_after_the_fit(one, predicted)
        bad += [(one.number, column) for column in wrong]
    return bad
