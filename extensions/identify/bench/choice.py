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
    models: dict[str, Errors]  # means on the logs of one group that was held out


def splits(logs: Sequence[BenchLog], by: str) -> list[Split]:
    """Returns the logs without those of each group in turn, and these.

    by: a key of GROUPINGS. Raises HexapodError where all logs are in one group.
    """
    group = GROUPINGS[by]
    groups = sorted({group(log) for log in logs}, key=str)
    if len(groups) < 2:
        raise HexapodError(
            "no logs to hold out",
            got=f"{len(logs)} logs of the same {by}",
            expected="logs of at least two",
            fix=f"name further logs, or --hold-out {'|'.join(GROUPINGS)}",
            where="--hold-out",
        )
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
    parts = splits(logs, by)
    fits = {}
    if len(models) > 1:
        progress(f"{len(models)} models, judged without one {by}")
        found = fitted_and_judged(*parts[len(parts) // 2], robot, models)
        fits = {model: Errors.mean(own) for model, own in found.items()}
    model = next(
        key
        for key in models
        if not fits or fits[key].angle <= (1.0 + WORTH) * min(one.angle for one in fits.values())
    )
    progress(f"{model}, all logs and {len(parts)} times without one {by}")
    seen_parts, unseen_parts = zip(*parts, strict=True)
    errors = pool.map(fitted_and_judged, seen_parts, unseen_parts, repeat(robot), repeat([model]))
    whole = fit_servo(logs, robot, model)  # here, while the pool judges
    pairs = [
        pair for own, one in zip(unseen_parts, errors, strict=True)
        for pair in zip(own, one[model], strict=True)
    ]  # fmt: skip
    return Choice(model=model, fit=whole, held_out=tuple(pairs), models=fits)


def fitted_and_judged(
    seen: Sequence[BenchLog], unseen: Sequence[BenchLog], robot: Robot, models: Sequence[str]
) -> dict[str, list[Errors]]:
    """Returns the errors of fits of models over each of some logs that they did not see."""
    known: dict[str | None, ServoFit] = {}
    return {
        model: judged(fit_servo(seen, robot, model, seeds=1, known=known), unseen)
        for model in models
    }
