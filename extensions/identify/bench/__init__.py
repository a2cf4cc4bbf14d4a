"""One servo that turns a pendulum: its logs, their simulation, and the fit of the servo to them."""

from __future__ import annotations

import json
from pathlib import Path

from hexapod_cosim.cosim.common.files import why_unreadable
from hexapod_cosim.extensions.identify.bench import bam, kscale
from hexapod_cosim.extensions.identify.bench.log import BenchLog, check_log
from hexapod_cosim.extensions.identify.log import LogError


def is_bench_log(path: Path) -> bool:
    """Returns whether a file may be the log of a servo bench."""
    return path.suffix.lower() == ".json"


def read_bench_log(path: Path) -> BenchLog:
    """Reads a log of BAM or K-Scale. Raises LogError for another file and unusable rows."""
    try:
        table = json.loads(path.read_text(encoding="utf-8"))
        read = kscale.read if "actuator_id" in table else bam.read
        log = read(path, table)
    except (OSError, ValueError, KeyError, TypeError, IndexError) as error:
        raise LogError(
            "no log of a servo bench",
            got=why_unreadable(error, "such log"),
            expected="a JSON file of BAM or K-Scale with mass, length, kp and entries",
            fix="name the raw logs, as they were recorded",
            where=str(path),
        ) from error
    check_log(log)
    return log
