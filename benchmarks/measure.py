"""Runs drivers and measures time, evaluations and the error against the converged solution."""

from __future__ import annotations

import hashlib
import json
import math
import os
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks import BUILD
from benchmarks.series import Series, command
from benchmarks.toolchain import Tools
from benchmarks.walks import DURATION

Array = NDArray[np.float64]

TIMEOUT = 300.0  # s    for one call of a driver
SHORT = 0.05  # s    shorter walks are repeated
REPEATS, REPEATED_TIME = 9, 0.15  # at most so many repeats, and about so many seconds in total


class DriverError(Exception):
    """A driver failed; the message is the driver's."""


@dataclass(frozen=True, kw_only=True)
class Run:
    """One walk by one method at one setting; error and seconds are inf if the engine failed."""

    engine: str
    method: str
    law: str
    setting: float
    walk: str
    error: float  # m    largest distance of the torso's path from the converged one
    seconds: float  # median over the repeats
    evaluations: float
    microseconds_per_evaluation: float  # NaN: unknown

    @property
    def realtime_factor(self) -> float:
        return DURATION / self.seconds


@dataclass
class Bench:
    """Runs drivers on walk files and compares with the converged paths."""

    tools: Tools
    walks: Mapping[str, Path]  # files by name
    errors: dict[str, str] = field(default_factory=dict)  # the last of each engine that failed
    _references: dict[str, Array] = field(default_factory=dict)

    def run(self, series: Series, setting: float, walk: str) -> Run:
        """Measures one walk; repeats short ones."""
        facts: dict[str, Any] = {
            "engine": series.engine,
            "method": series.method,
            "law": series.law,
            "setting": setting,
            "walk": walk,
        }
        try:
            printed, path = self.call(series.engine, series.method, setting, walk)
            if printed["seconds"][0] < SHORT:
                repeats = max(3, min(REPEATS, int(REPEATED_TIME / printed["seconds"][0])))
                printed, path = self.call(
                    series.engine, series.method, setting, walk, repeats=repeats
                )
            error = distance(path, self.reference(series, walk))
        except DriverError as failure:
            self.errors[series.engine] = str(failure).splitlines()[-1]
            return Run(
                error=math.inf,
                seconds=math.inf,
                evaluations=math.nan,
                microseconds_per_evaluation=math.nan,
                **facts,
            )
        each = printed["microseconds_per_evaluation"]
        return Run(
            error=error,
            seconds=median(printed["seconds"]),
            evaluations=printed["evaluations"],
            microseconds_per_evaluation=math.nan if each is None else each,
            **facts,
        )

    def call(
        self, engine: str, method: str, setting: float, walk: str, *, repeats: int = 1
    ) -> tuple[dict[str, Any], Array]:
        """Returns the printed values of a driver and its path (n + 1, 3) [m]. Raises
        DriverError.
        """
        out = BUILD / f"path-{os.getpid()}.bin"
        words = [
            *command(engine, self.tools),
            str(self.walks[walk]),
            method,
            repr(setting),
            str(repeats),
            str(out),
        ]
        printed = json.loads(call(words))
        path = np.fromfile(out).reshape(-1, 3)
        out.unlink()
        return printed, path

    def reference(self, series: Series, walk: str) -> Array:
        """Returns the converged path (n + 1, 3) [m]. Raises DriverError.

        The path is kept in build/bench until the walk or the driver changes.
        """
        engine, method, setting = series.reference
        key = f"{engine}-{method}-{setting:g}-{walk}"
        if key not in self._references:
            driver = Path(command(engine, self.tools)[-1])  # binary or script
            digest = hashlib.sha256(
                self.walks[walk].read_bytes() + driver.read_bytes()
            ).hexdigest()[:16]
            kept = BUILD / "converged" / f"{key}-{digest}.npy"
            if not kept.exists():
                kept.parent.mkdir(parents=True, exist_ok=True)
                np.save(kept, self.call(engine, method, setting, walk)[1])
            self._references[key] = np.load(kept)
        return self._references[key]


def call(words: list[str]) -> str:
    """Runs a command and returns the last line of its output. Raises DriverError."""
    try:
        done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=TIMEOUT)
    except subprocess.TimeoutExpired as error:
        raise DriverError(f"more than {TIMEOUT:g} s") from error
    lines = done.stdout.strip().splitlines()
    if done.returncode != 0 or not lines:
        raise DriverError(done.stderr.strip() or f"exit code {done.returncode}")
    return lines[-1]


def distance(path: Array, reference: Array) -> float:
    """Returns the largest distance between two paths [m], inf if one is not finite."""
    gap = np.linalg.norm(path - reference, axis=1).max()
    return float(gap) if np.isfinite(gap) else math.inf
