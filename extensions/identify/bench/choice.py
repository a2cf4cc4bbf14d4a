"""Chooses a friction model: each is fitted to some logs and judged on those held out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from itertools import repeat

from hexapod_cosim.extensions.identify.bench.errors import Errors, judged
from hexapod_cosim.extensions.identify.bench.fit import ServoFit, fit_servo
from hexapod_cosim.extensions.identify.bench.log import GROUPINGS, BenchLog
from hexapod_cosim.extensions.identify.numbers.servo import TERMS
from hexapod_cosim.models import HexapodError, Robot

WORTH = 0.05  # a model with more terms has to lower the held-out error by this share
Split = tuple[list[BenchLog], list[BenchLog]]  # logs to fit, logs to judge


@dataclass(frozen=True)
class Choice:
    """The servo of the model that is worth its terms."""

    model: str
    fit: ServoFit  # to all logs
    held_out: tuple[tuple[BenchLog, Errors], ...]  # each log, by a fit that did not see its group
    models: dict[str, Errors]  # means over the held-out logs, of all models that were compared
    start: Errors  # likewise, of the servo that the search began at; offset and delay fitted
    robot: Robot  # with that servo


def splits(logs: Sequence[BenchLog], by: str) -> list[Split]:
    """Returns the logs without those of each group in turn, and these.

    by: a key of GROUPINGS. Raises HexapodError where all logs are in one group.
    """
    group = GROUPINGS[by]
    groups = sorted({group(log) for log in logs}, key=str)
    if len(groups) < 2:
        others = [key for key, one in GROUPINGS.items() if len({one(log) for log in logs}) > 1]
        got, expected = f"{by} {groups[0]} in each log", f"logs that differ in their {by}"
        fix = f"give --hold-out {'|'.join(others)}" if others else "name further logs"
        raise HexapodError("no logs to hold out", got=got, expected=expected, fix=fix)
    return [
        ([log for log in logs if group(log) != own], [log for log in logs if group(log) == own])
        for own in groups
    ]


def choose(
    logs: Sequence[BenchLog],
    robot: Robot,
    pool: Executor,
    *,
    by: str = "gain",
    models: Sequence[str] = tuple(TERMS),
    progress: Callable[[str], None] = lambda _text: None,
) -> Choice:
    """Fits a servo with the simplest model that is worth its terms.

    Args:
        logs: of one servo.
        robot: whose servo is where the search begins.
        pool: runs the fits.
        by: which logs are held out together: a key of GROUPINGS.
        models: that are compared, from the one with the fewest terms on.
        progress: called when a step begins.
    """
    seen, unseen = zip(*splits(logs, by), strict=True)
    progress(f"{', '.join(models)}: {len(seen)} times without one {by}")
    keys = (None, *models)  # None: the servo as it is
    found = list(pool.map(fitted_and_judged, seen, unseen, repeat(robot), repeat(keys)))
    errors = {key: [error for own in found for error in own[key]] for key in keys}
    fits = {key: Errors.mean(errors[key]) for key in models}
    start = Errors.mean(errors[None])
    best = min(one.angle for one in fits.values())
    most = (1.0 + WORTH) * best
    if best < start.angle:
        most = min(most, start.angle)
    model = next(key for key in models if fits[key].angle <= most)
    progress(f"{model}, all logs")
    return Choice(
        model=model,
        fit=fit_servo(logs, robot, model),
        held_out=tuple(zip([log for own in unseen for log in own], errors[model], strict=True)),
        models=fits,
        start=start,
        robot=robot,
    )


def fitted_and_judged(
    seen: Sequence[BenchLog], unseen: Sequence[BenchLog], robot: Robot, models: Sequence[str | None]
) -> dict[str | None, list[Errors]]:
    """Returns the errors of fits of models over each of some logs that they did not see; None: of
    the robot's own servo, with the bench's offset and delay fitted.
    """
    known: dict[str | None, ServoFit] = {}
    return {
        model: judged(fit_servo(seen, robot, model, seeds=1, known=known), unseen)
        for model in models
    }
