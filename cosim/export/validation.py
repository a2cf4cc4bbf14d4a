"""Validates FMUs: with fmpy's checks, then by a trial of the binary in a process of its own."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from fmpy import read_model_description, simulate_fmu
from fmpy.model_description import ValidationError
from fmpy.simulation import instantiate_fmu

from hexapod_cosim.cosim.common.archives import unpack
from hexapod_cosim.cosim.common.binaries import refuse_incomplete
from hexapod_cosim.cosim.common.own_process import ProcessEndedError, call_in_process
from hexapod_cosim.cosim.common.plant_files import fmi2_platform, fmi3_platform, packed_binary
from hexapod_cosim.cosim.common.temporary import TemporaryFolder
from hexapod_cosim.cosim.interface.descriptions import (
    open_description,
    refuse_other_kinds,
    refuse_unsafe,
)
from hexapod_cosim.models.errors import FmuError

STEP, STEPS = 0.001, 5  # of the trial: their length [s] and their number
TIME_LIMIT = 60.0  # s, of the steps
PLATFORMS = {"2.0": fmi2_platform, "3.0": fmi3_platform}


class UnsoundFmuError(FmuError):
    """An FMU with problems; `found` goes into the JSON of the failure."""

    def __init__(self, path: Path, problems: Sequence[str]) -> None:
        super().__init__(
            "the FMU is not sound: problems",
            got=f"{len(problems)} of them",
            expected="none",
            fix="export it again with `hexapod export`",
            where=str(path),
        )
        self.found = {"fmu": str(path), "valid": False, "problems": list(problems)}


def find_problems(path: Path) -> list[str]:
    """Returns the problems of an FMU, one sentence each; empty for a valid FMU.

    The binary is tried only if fmpy finds nothing. Raises FmuError for a file that is no FMU.
    """
    refuse_unsafe(path)
    found = _problems_of_description(path)
    try:
        description = open_description(path)
    except FmuError as error:
        if not found:
            raise
        return [str(error), *(problem for problem in found if problem != error.got)]
    refuse_other_kinds(description, path, PLATFORMS)
    return found or _problems_of_a_trial(path, PLATFORMS[description.fmiVersion]())


def _problems_of_description(path: Path) -> list[str]:
    """Returns what fmpy finds, except in names of variables, which takes it seconds."""
    try:
        read_model_description(
            path, validate=True, validate_variable_names=False, validate_model_structure=True
        )
    except ValidationError as error:
        return [str(problem) for problem in error.problems]
    except Exception as error:  # fmpy's errors have no common type
        return [str(error)]
    return []


def _problems_of_a_trial(path: Path, platform: str) -> list[str]:
    """Returns why the FMU cannot be unpacked or run; a damaged binary may end the process.

    An FMU without a binary for this platform is unpacked and not run.
    """
    with TemporaryFolder("validate") as folder:
        try:
            unpack(path, folder)
            if not (folder / "binaries" / platform).is_dir():
                return []
            return [str(problem) for problem in call_in_process(try_unpacked, folder)]
        except FmuError as error:
            return [str(error)]
        except ProcessEndedError as error:
            return [
                "binaries: loading the FMU and stepping it ended the process: got "
                f"{error}, expected a step; fix: the binary is damaged or made for another "
                "system, export the FMU again"
            ]


def try_unpacked(folder: Path) -> list[str]:
    """Runs an unpacked FMU for a few steps in this process; returns the problems."""
    messages: list[str] = []
    try:
        description = read_model_description(str(folder), validate=False)
        for library in (folder / "binaries" / PLATFORMS[description.fmiVersion]()).iterdir():
            refuse_incomplete(library)
        fmu = instantiate_fmu(
            str(folder),
            description,
            "CoSimulation",
            library_path=packed_binary(folder, description.coSimulation.modelIdentifier),
            logger=lambda *message: messages.append(message[-1].decode(errors="replace")),
        )
        result = simulate_fmu(
            str(folder),
            validate=False,
            start_time=0.0,
            stop_time=STEPS * STEP,
            output_interval=STEP,
            timeout=TIME_LIMIT,
            model_description=description,
            fmu_instance=fmu,
        )
    except Exception as error:  # fmpy's errors have no common type
        return [f"binaries: {error}" + (f": got {messages[-1]!r}" if messages else "")]
    return list(result_problems(result))


def result_problems(result: Any) -> Iterator[str]:
    """Yields what is wrong with the recorded outputs: too few rows, values that are no numbers."""
    steps = len(result) - 1
    if steps != STEPS:
        yield f"binaries: the FMU takes no steps of {STEP} s: got {steps}, expected {STEPS}"
    for name in result.dtype.names:
        if not np.isfinite(result[name]).all():
            got = result[name][~np.isfinite(result[name])][0]
            yield f"{name}: got {got} within {steps} steps, expected finite numbers"
