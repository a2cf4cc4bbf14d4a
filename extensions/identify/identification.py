"""Identifies a robot from its logs: screens their columns, fits its numbers, and judges them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass

import numpy as np

from hexapod_cosim.cosim.common.temporary import TemporaryFolder
from hexapod_cosim.cosim.export.plant import export_fmu
from hexapod_cosim.cosim.interface.names import vector_names
from hexapod_cosim.extensions.identify.experiment import Experiment
from hexapod_cosim.extensions.identify.fitting.judging import Fit, fit
from hexapod_cosim.extensions.identify.fitting.misfit import DETERMINED
from hexapod_cosim.extensions.identify.fitting.problem import Problem
from hexapod_cosim.extensions.identify.log import (
    HELD_OUT,
    Log,
    LogError,
    with_speed_references,
    without_readings,
)
from hexapod_cosim.extensions.identify.numbers import Unknown
from hexapod_cosim.extensions.identify.plant import LogPlant
from hexapod_cosim.extensions.identify.report import (
    Difference,
    channel_differences,
    column_differences,
)
from hexapod_cosim.extensions.identify.screening import BadColumn, screened
from hexapod_cosim.extensions.identify.start import rest_rows
from hexapod_cosim.extensions.identify.unknowns import GROUPS, START, changed_robot, chosen_unknowns
from hexapod_cosim.models import Robot
from hexapod_cosim.models.arrays import Array

FEWEST_DIGITS = 5  # of a value and its interval in texts


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
    deviation: float  # over that of what was known before: 1 where the logs say nothing
    alone: bool = True  # whether the logs determine it without numbers that they do not determine

    @property
    def determined(self) -> bool:
        """Whether the logs determine the number: they at least halve what was unknown of it."""
        return self.alone and self.deviation < DETERMINED

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

    file: Robot  # from which the search begins: as the robot file has it
    robot: Robot  # with the numbers found
    fit: Fit
    experiments: tuple[Experiment, ...]
    bad: tuple[tuple[int, BadColumn], ...]  # number of the log and column left out
    before: tuple[Array, ...]  # readings that the robot file predicts (rows, columns)

    @property
    def estimates(self) -> list[Estimate]:
        """The numbers of robot and sensors, in the order of the table of unknowns."""
        return [self._estimate(k, row) for k, row in enumerate(self.fit.rows) if row.group != START]

    def _estimate(self, k: int, row: Unknown) -> Estimate:
        """Returns what was found of a number."""
        before, kept = self.fit.before[row.key], bool(self.fit.kept[k])
        value = before if kept else self.fit.values[row.key]  # the file's to the last digit
        deviation = self.fit.deviations[row.key]
        low, high = row.interval(value, deviation)
        return Estimate(
            key=row.key,
            unit=row.unit,
            group=row.group,
            before=before,
            value=value,
            low=max(low, row.low),
            high=min(high, row.high),
            deviation=deviation,
            alone=bool(self.fit.alone[k]) and not kept,
        )

    def differences(self, part: str) -> list[tuple[Difference, Difference]]:
        """Returns the difference of each channel before and after. part: "fitted" or "held_out"."""
        sides = []
        for predictions in (self.before, self.fit.predictions):
            columns: list[Difference] = []
            for one, own in zip(self.experiments, predictions, strict=True):
                rows = getattr(one, part)
                columns += column_differences(one.log.part(rows), one.columns, own[rows])
            sides.append(channel_differences(columns))
        return list(zip(*sides, strict=True))


SETTLING = 0.1  # s    at the start of a log that is not compared: the first row has noise
TOLERANCE = {"solver.tolerance": 1e-5}  # differences of simulations need exact ones


def identify(
    logs: Sequence[Log],
    robot: Robot,
    *,
    groups: Sequence[str] = GROUPS,
    held_out: float = HELD_OUT,
    workers: int = 1,
    progress: Callable[[str], None] = lambda _text: None,
) -> Identified:
    """Finds a robot's numbers from logs.

    Args:
        logs: commands and readings; each begins with the robot standing still.
        robot: what is known of it.
        groups: which numbers of the table of unknowns are to be found.
        held_out: share of the rows at the end of each log that only judges the result.
        workers: simulations at a time, on which the result does not depend.
        progress: called when a step begins, with its name.

    Raises HexapodError for logs without readings, and where the plant cannot follow them.
    """
    # imported here: the command's help starts sooner
    from threadpoolctl import threadpool_limits  # noqa: PLC0415

    rows = chosen_unknowns(robot, logs, groups)
    # small matrices: threads of linear algebra would wait for each other
    with threadpool_limits(1), TemporaryFolder("identify") as folder:
        path = export_fmu(robot, folder / "robot.fmu", bare=True)
        with ExitStack() as open_plants:
            plants = [open_plants.enter_context(LogPlant(path, TOLERANCE)) for _ in range(workers)]
            progress("the columns of the log")
            experiments, bad = screen(plants[0], robot, logs, groups=groups, held_out=held_out)
            problem = Problem(plants, robot, experiments, rows)
            found = fit(problem, progress=progress)
            before = problem.predictions(np.zeros(len(rows)))
    return Identified(
        file=robot,
        robot=changed_robot(robot, rows, found.values),
        fit=found,
        experiments=tuple(experiments),
        bad=tuple(bad),
        before=tuple(before),
    )


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

    Raises LogError where no reading is left.
    """
    logs = [with_speed_references(log, robot) for log in logs]
    # With zeros of the angles unknown so are the forces by which standing feet push against each
    # other: no log shows these until each foot was lifted once, within a period of the gait.
    forget = robot.gait.period if "zero" in groups else 0.0
    experiments = [make_experiment(log, k, held_out, forget=forget) for k, log in enumerate(logs)]
    rows = chosen_unknowns(robot, logs, groups)
    simulated = Problem([plant], robot, experiments, rows).predictions(np.zeros(len(rows)))
    found, bad = [], []
    for one, own in zip(experiments, simulated, strict=True):
        wrong = screened(one, own)
        bad += [(one.number, column) for column in wrong]
        found.append(one.without([column.name for column in wrong]))
        if not found[-1].columns:
            raise LogError(
                "no column of the log can be used",
                got=f"{wrong[0].name}: {wrong[0].why}",
                expected="readings that follow the commands",
                fix="check names, units and signs of the columns, and the robot file",
                where=one.log.where,
            )
    return found, bad
