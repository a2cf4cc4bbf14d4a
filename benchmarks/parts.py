"""Measures the plant alone: right-hand side, instructions, many instances, steep laws."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from typing import Any

from benchmarks.measure import Bench, call
from benchmarks.series import Series
from benchmarks.toolchain import Tools

ROUNDS, VISITS = 25, 400  # of native/derivative.c
REPEATS = 7
COUNTS = (1, 4, 16, 64, 256)  # instances
TOLERANCE = 1e-3  # of the instances' error control

Figures = dict[str, float]


def derivatives(tools: Tools, walks: Sequence[Path]) -> dict[str, Figures]:
    """Returns the time of one evaluation by kernel, "plain" and with "multipliers" [us].

    The times are medians over the walks.
    """
    results = [
        json.loads(call([str(tools.driver("derivative")), str(walk), str(REPEATS)]))
        for walk in walks
    ]
    return {
        kernel: {kind: median(one[kernel][kind] for one in results) for kind in results[0][kernel]}
        for kernel in results[0]
    }


def instructions(tools: Tools, walk: Path, kernels: Sequence[str]) -> Figures:
    """Returns the instructions of one evaluation by kernel, without and with multipliers.

    Callgrind counts them; the result is empty without valgrind.
    """
    if shutil.which("valgrind") is None:
        return {}
    found = {}
    for kernel in kernels:
        for kind, flag in (("plain", "0"), ("multipliers", "1")):
            count = _counted(
                [str(tools.driver("derivative")), str(walk), "1", kernel, flag], "measure*"
            )
            if count:  # 0: valgrind's processor does not have the kernel
                found[f"{kernel} {kind}"] = count / (ROUNDS * VISITS)
    return found


def instructions_per_step(bench: Bench, series: Series, setting: float, walk: str) -> float:
    """Returns the instructions of one macro-step, mean over a walk. NaN without valgrind."""
    if shutil.which("valgrind") is None:
        return float("nan")
    path = bench.walks[walk]
    words = [
        str(bench.tools.driver("plant")),
        str(path),
        series.method,
        repr(setting),
        "1",
        str(path.with_suffix(".counted")),
    ]
    return _counted(words, "hx_plant_step") / VISITS


def _counted(words: Sequence[str], function: str) -> float:
    options = ["--tool=callgrind", "--callgrind-out-file=/dev/null", f"--toggle-collect={function}"]
    done = subprocess.run(
        ["valgrind", *options, *words], capture_output=True, text=True, check=False
    )
    found = re.search(r"refs:\s+([\d,]+)", done.stderr)
    return float(found[1].replace(",", "")) if found and done.returncode == 0 else 0.0


def instances(tools: Tools, walk: Path) -> list[dict[str, Any]]:
    """Returns, by number of plants stepped in turn: time of a macro-step with own work spaces and
    with a shared one [us], bytes of an instance, allocations.
    """
    results = []
    for count in COUNTS:
        line = call([str(tools.driver("instances")), str(walk), repr(TOLERANCE), str(count)])
        results.append({"instances": count, **json.loads(line)})
    return results


def crowding(results: Sequence[dict[str, Any]]) -> float:
    """Returns the time of a macro-step among the most plants, which share a work space, over that
    of a plant alone.
    """
    alone, crowd = (each["shared_microseconds_per_step"] for each in (results[0], results[-1]))
    return float(crowd / alone)


def resident_bytes(results: Sequence[dict[str, Any]]) -> float:
    """Returns the growth of the process per instance [bytes], NaN if the system does not report
    it.
    """
    first, last = results[0], results[-1]
    if None in (first["resident_per_instance"], last["resident_per_instance"]):
        return float("nan")
    grown = (
        last["resident_per_instance"] * last["instances"]
        - first["resident_per_instance"] * first["instances"]
    )
    return float(grown / (last["instances"] - first["instances"]))


def cost_of(
    bench: Bench, series: Series, setting: float, pairs: Sequence[tuple[str, str]]
) -> float:
    """Returns the time of changed walks over that of the unchanged ones at one setting.

    The median is over pairs (changed, unchanged); inf if the engine failed.
    """
    return median(
        bench.run(series, setting, changed).seconds / bench.run(series, setting, plain).seconds
        for changed, plain in pairs
    )
