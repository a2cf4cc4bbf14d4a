"""Repeats a recorded walk with the FMU's binaries for other platforms, each called by a small C
program, under an emulator where necessary.
"""

from __future__ import annotations

import os
import shutil
import struct
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import fmpy
import pytest

from hexapod_cosim.cosim.common.plant_files import fmi_headers
from hexapod_cosim.cosim.export.cross_build import (
    COMPILE,
    TARGETS,
    compiler_environment,
    find_compiler,
    user_cache,
)
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.run.single_run import simulate
from hexapod_cosim.cosim.scenario.reading import load_scenario

REPEATER = Path(__file__).resolve().parents[1] / "native" / "repeater.c"
ARM_LIBRARIES = Path("/usr/aarch64-linux-gnu")
DURATION = 1.5  # s    of walking: touch-downs and lift-offs of all feet
TIMEOUT = 300  # s
ATTEMPTS = 5  # builds for Windows were seen to hang
EVERYTHING = os.environ.get("HEXAPOD_PLATFORMS") == "all"  # as `make test-platforms` sets it


@dataclass(frozen=True)
class Emulator:
    """Describes how programs for a target run on this machine: required programs, command, form of
    paths.
    """

    needs: tuple[str, ...] = ()
    command: tuple[str, ...] = ()
    drive: str = ""


EMULATORS = {
    "x86_64-linux": Emulator(),
    "aarch64-linux": Emulator(
        ("qemu-aarch64", str(ARM_LIBRARIES / "lib" / "libc.so.6")),
        ("qemu-aarch64", "-L", str(ARM_LIBRARIES)),
    ),
    "x86_64-windows": Emulator(("wine",), ("wine",), "Z:"),
}


def missing(target: str) -> list[str]:
    """Returns the programs that must be installed to run programs for a target."""
    return [
        need
        for need in EMULATORS[target].needs
        if shutil.which(need) is None and not Path(need).is_file()
    ]


def record_walk(fmu: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Records a walk over flat ground and returns the inputs of every step in the form that
    repeater.c reads.
    """
    rows: list[list[float]] = []
    inputs, step = [entry for entry in described(fmu) if entry.causality == "input"], Fmu.step

    def recorded(plant: Fmu, t: float, h: float) -> None:
        block = plant.block([entry.name for entry in inputs])
        block.get()
        rows.append(block.values.tolist())
        step(plant, t, h)

    monkeypatch.setattr(Fmu, "step", recorded)
    scenario = replace(load_scenario("walk_flat"), control="kinematic", duration=DURATION)
    simulate(scenario, fmu=fmu)
    outputs = [entry for entry in described(fmu) if entry.causality == "output"]
    words = [
        [len(entries), *(entry.valueReference for entry in entries)]
        for entries in (inputs, outputs)
    ]
    head = [*words, [len(rows), pattern(scenario.macro_step)]]
    return (
        "\n".join(
            " ".join(map(str, line)) for line in [*head, *(list(map(pattern, row)) for row in rows)]
        )
        + "\n"
    )


@cache
def described(fmu: Path) -> list[Any]:
    """Returns the FMU's Real variables."""
    return [
        entry
        for entry in fmpy.read_model_description(str(fmu)).modelVariables
        if entry.type == "Real"
    ]


def pattern(value: float) -> str:
    """Returns the bits of a double in hexadecimal."""
    return f"{struct.unpack('<Q', struct.pack('<d', value))[0]:016x}"


def number(word: str) -> float:
    """Returns the double with these bits."""
    return float(struct.unpack("<d", struct.pack("<Q", int(word, 16)))[0])


def build_repeater(target: str, folder: Path) -> Path:
    """Builds the calling program for a target."""
    program = folder / ("repeater.exe" if "windows" in target else "repeater")
    flags = (
        "-target",
        TARGETS[target].triple,
        "-mcpu=baseline",
        *COMPILE,
        "-s",
    )  # the system libraries are compiled once for libraries and programs
    libraries = [] if "windows" in target else ["-ldl"]
    command = [
        *find_compiler().command,
        *flags,
        "-isystem",
        str(fmi_headers()),
        str(REPEATER),
        *libraries,
        "-o",
        str(program),
    ]
    environment = compiler_environment(folder, user_cache())
    for attempt in range(ATTEMPTS):
        try:
            subprocess.run(
                command,
                check=True,
                capture_output=True,
                env=environment,
                timeout=TIMEOUT / ATTEMPTS,
            )
            break
        except subprocess.TimeoutExpired:
            assert attempt < ATTEMPTS - 1, f"the compiler hangs: {command}"
    return program


def run_repeater(
    target: str, program: Path, library: Path, guid: str, resources: str, inputs: Path
) -> subprocess.CompletedProcess[str]:
    """Repeats a recorded walk; returns the outputs of every step."""
    emulator, environment = EMULATORS[target], dict(os.environ)
    if emulator.drive:
        environment |= {
            "WINEPREFIX": str(program.parents[1] / "wine"),
            "WINEDEBUG": "-all",
            "WINEDLLOVERRIDES": "mscoree,mshtml=",
        }
    paths: Sequence[str] = [
        f"{emulator.drive}{library.as_posix()}",
        guid,
        resources,
        f"{emulator.drive}{inputs.as_posix()}",
    ]
    command = [*emulator.command, str(program), *paths]
    return subprocess.run(
        command,
        check=False,
        capture_output=True,
        text=True,
        errors="replace",
        env=environment,
        timeout=TIMEOUT,
    )


def patient(target: str) -> None:
    """Skips Windows if its system libraries were never built, which takes minutes."""
    if (
        target == "x86_64-windows"
        and not EVERYTHING
        and not list((user_cache() / "binaries").glob(f"*-{target}-*"))
    ):
        pytest.skip("the first binary for Windows takes minutes: make test-platforms")
