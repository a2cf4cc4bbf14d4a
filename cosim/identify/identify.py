"""Identifies a robot from its logs: screens their columns, fits, and judges what they tell."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.export.export import export_fmu
from hexapod_cosim.cosim.identify.command_screening import check_commands
from hexapod_cosim.cosim.identify.comparison import (
    Difference,
    channel_differences,
    column_differences,
)
from hexapod_cosim.cosim.identify.experiment import Experiment
from hexapod_cosim.cosim.identify.fitting.output_error import Fit, Progress, fit
from hexapod_cosim.cosim.identify.fitting.problem import TO_DEVIATION, Problem
from hexapod_cosim.cosim.identify.fitting.workers import simulating_workers
from hexapod_cosim.cosim.identify.log import CHANNELS, HELD_OUT, Log, LogError, without_readings
from hexapod_cosim.cosim.identify.log_plant import LogPlant
from hexapod_cosim.cosim.identify.rigid.linear_start import LinearStart, linear_start
from hexapod_cosim.cosim.identify.screening import BadColumn, misfits, screened
from hexapod_cosim.cosim.identify.start import rest_rows
from hexapod_cosim.cosim.identify.unknowns import (
    ELASTIC,
    GROUPS,
    START,
    changed_robot,
    chosen_unknowns,
)
from hexapod_cosim.cosim.interface.names import vector_names
from hexapod_cosim.cosim.run.worker_pool import processor_count
from hexapod_cosim.models import Robot

Array = NDArray[np.float64]
TOLD = 0.5  # of the prior deviation: a number with less is told by the logs
QUANTILE = 1.959963985  # of a normal distribution, for 95 %
FEWEST_DIGITS = 5  # of a value and its interval in texts
NEAR = 0.8  # correlation of two numbers that is reported
SETTLING = 0.1  # s    at the start of a log that is not compared: the first row has noise
LONG = 4000  # rows from which on worker processes save more time than they take to start
TOLERANCE = {"solver.tolerance": 1e-5}  # differences of simulations need exact ones


@dataclass(frozen=True)
class Estimate:
    """What was found of one number."""

    key: str
    unit: str
    group: str
    before: float
    value: float
    low: float  # of the 95 % interval
    high: float
    deviation: float  # over that of what was known before: 1 where the logs tell nothing
    partner: str  # the number with which it is correlated most
    correlation: float

    @property
    def told(self) -> bool:
        """Whether the logs tell the number: they at least halve what was unknown of it."""
        return self.deviation < TOLD

    @property
    def interval(self) -> str:
        """The 95 % interval as a text, with the digits in which its ends differ, and one more."""
        return f"{self._text(self.low)} to {self._text(self.high)}"

    @property
    def found(self) -> str:
        """The value as a text, with the digits of the interval."""
        return self._text(self.value)

    def _text(self, value: float) -> str:
        largest, width = max(abs(self.low), abs(self.high)), self.high - self.low
        digits = math.ceil(math.log10(largest / width)) + 2 if width > 0.0 else FEWEST_DIGITS
        return f"{value:.{max(FEWEST_DIGITS, digits)}g}"


@dataclass(frozen=True)
class Identified:
    """A robot identified from logs."""

    file: Robot  # as the robot file has it
    robot: Robot  # with the numbers found
    fit: Fit
    experiments: tuple[Experiment, ...]
    bad: tuple[tuple[int, BadColumn], ...]  # number of the log and column left out
    before: tuple[Array, ...]  # readings that the robot file predicts (rows, columns)
    linear: LinearStart | None  # what linear least squares tell
    lacking: str  # what the logs lack for these

    @property
    def estimates(self) -> list[Estimate]:
        """The numbers of robot and sensors, in the order of the table of unknowns."""
        found, deviations = [], self.fit.deviations
        own = np.sqrt(np.diag(self.fit.covariance))
        correlation = self.fit.covariance / np.outer(own, own) - np.eye(len(own))
        for k, row in enumerate(self.fit.rows):
            if row.group == START:
                continue
            value, deviation = self.fit.values[row.key], deviations[row.key]
            low, high = row.interval(value, QUANTILE * deviation)
            other = int(np.argmax(np.abs(correlation[k])))
            found.append(
                Estimate(
                    row.key, row.unit, row.group, self.fit.before[row.key], value,
                    max(low, row.low), min(high, row.high), deviation,
                    self.fit.rows[other].key, float(correlation[k, other]),
                )
            )  # fmt: skip
        return found

    @property
    def rank(self) -> int:
        """Number of independent combinations that the logs tell better than was known before."""
        return int(np.sum(self.fit.singular > 1.0))

    def held_out(self) -> list[tuple[Difference, Difference]]:
        """Returns the difference of each channel on the held-out rows, before and after."""
        return self._differences("held_out")

    def fitted(self) -> list[tuple[Difference, Difference]]:
        """Returns the difference of each channel on the fitted rows, before and after."""
        return self._differences("fitted")

    def _differences(self, part: str) -> list[tuple[Difference, Difference]]:
        sides = []
        for predictions in (self.before, self.fit.predictions):
            columns: list[Difference] = []
            for one, own in zip(self.experiments, predictions, strict=True):
                rows = getattr(one, part)
                columns += column_differences(one.log.part(rows), one.columns, own[rows])
            sides.append(channel_differences(columns))
        return list(zip(*sides, strict=True))


def identify(
    logs: Sequence[Log],
    robot: Robot,
    *,
    groups: Sequence[str] = GROUPS,
    held_out: float = HELD_OUT,
    workers: int = 1,
    progress: Progress | None = None,
) -> Identified:
    """Finds a robot's numbers from logs.

    Args:
        logs: commands and readings; each begins with the robot standing still.
        robot: what is known of it.
        groups: which numbers of the table of unknowns are to be found.
        held_out: share of the rows at the end of each log that only judges the result.
        workers: number of processes, on which the result does not depend. With more than one, the
            calling script needs `if __name__ == "__main__"`.
        progress: called with what is being done.

    Raises HexapodError for logs without readings and where the plant cannot follow them.
    """
    # imported here: the command's help starts sooner
    from threadpoolctl import threadpool_limits  # noqa: PLC0415

    report: Callable[[str], None] = progress or (lambda _text: None)
    rows = chosen_unknowns(robot, logs, groups)
    # small matrices: threads of linear algebra would wait for each other
    with threadpool_limits(1), TemporaryDirectory(prefix="hexapod-identify-") as folder:
        path = export_fmu(robot, Path(folder) / "robot.fmu")
        place = Path(folder) / "workers"
        with (
            LogPlant(path, TOLERANCE) as plant,
            simulating_workers(workers, path, robot, TOLERANCE, place) as pool,
        ):
            report("the columns of the log")
            experiments, bad = screen(plant, robot, logs, groups=groups, held_out=held_out)
            report("linear least squares")
            linear, lacking = linear_start(experiments, robot, rows)
            start = linear.z(rows, robot) if linear else None
            problem = Problem(plant, robot, experiments, rows, pool)
            found = fit(problem, start=start, progress=report)
            late = _misfits(problem, found)
            if late:
                bad += late
                report("again, without columns that do not fit")
                experiments = _without(experiments, late)
                problem = Problem(plant, robot, experiments, rows, pool)
                found = fit(problem, start=start, progress=report)
            before = problem.predictions(np.zeros(len(rows)))
    return Identified(
        file=robot,
        robot=changed_robot(robot, rows, found.values),
        fit=found,
        experiments=tuple(experiments),
        bad=tuple(bad),
        before=tuple(before),
        linear=linear,
        lacking=lacking,
    )


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
    for one, error, counted in zip(problem.experiments, errors, problem.counted, strict=True):
        typical = [
            TO_DEVIATION * float(np.median(np.abs(column[own]))) if own.any() else 0.0
            for column, own in zip(error.T, counted.T, strict=True)
        ]
        bad += [(one.number, column) for column in misfits(one, np.array(typical))]
    return bad


CHANNEL_TITLES = {channel.key: channel.title for channel in CHANNELS}
