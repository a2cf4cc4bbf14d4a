"""Installs the peers' wheels and builds the drivers, all in build/bench.

A peer that cannot be installed or built is reported with the reason and left out.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from benchmarks import BUILD, ROOT
from hexapod_cosim.cosim.export.plant import export_fmu
from hexapod_cosim.models import load_robot

REQUIREMENTS = Path(__file__).parent / "requirements.txt"
OUR_TARGETS = ("bench_plant", "bench_derivative", "bench_instances", "hexapod_c")
PEER_TARGETS = ("mujoco", "pinocchio")
QUICK_TARGETS = ("mujoco",)  # compiles in seconds; Pinocchio takes minutes
LAST_LINES = 3  # of a failed command's output


@dataclass(frozen=True)
class Tools:
    """Folders of the drivers and of the peers' Python; `missing` maps absent peers to the
    reason.
    """

    native: Path
    python: Path
    missing: dict[str, str]

    @property
    def fmu(self) -> Path:
        """The default robot's FMU with the installed binary."""
        return self.native / "athena.fmu"

    def driver(self, name: str) -> Path:
        """Returns the path of a native driver."""
        return self.native / f"bench_{name}"


def prepare(*, quick: bool) -> Tools:
    """Installs the peers' wheels and builds all drivers that are not up to date.

    Raises RuntimeError when our own drivers do not build.
    """
    python = _environment()
    missing = _install(python, ("mujoco",) if quick else None)
    native = BUILD / "native"
    configured = _configure(native, python)
    if configured:
        raise RuntimeError(f"the drivers cannot be configured: {configured}")
    for target in OUR_TARGETS:
        if error := _build(native, target):
            raise RuntimeError(f"{target} does not build: {error}")
    export_fmu(load_robot("athena"), native / "athena.fmu")
    for target in QUICK_TARGETS if quick else PEER_TARGETS:
        if error := _build(native, f"bench_{target}"):
            missing[target] = missing.get(target) or error
    return Tools(native, python, missing)


def _environment() -> Path:
    folder = BUILD / "venv"
    python = folder / "bin" / "python"
    if not python.exists():
        _run([sys.executable, "-m", "venv", str(folder)])
    return python


def _install(python: Path, chosen: tuple[str, ...] | None) -> dict[str, str]:
    """Installs the pinned wheels one by one; returns the errors by peer."""
    missing = {}
    for line in REQUIREMENTS.read_text(encoding="utf-8").splitlines():
        name = line.partition("==")[0]
        if not name or name.startswith("#") or (chosen is not None and name not in chosen):
            continue
        stamp = python.parents[1] / f".{line}"
        if not stamp.exists():
            error = _run(
                [
                    str(python),
                    "-m",
                    "pip",
                    "install",
                    "--quiet",
                    "--disable-pip-version-check",
                    line,
                ]
            )
            if error:
                missing[PACKAGES[name]] = error
            else:
                stamp.touch()
    return missing


PACKAGES = {"mujoco": "mujoco", "pin": "pinocchio", "cmeel-eigen": "pinocchio", "drake": "drake"}


def _configure(native: Path, python: Path) -> str:
    packages = next((python.parents[1] / "lib").glob("python3*/site-packages"))
    options = [
        "-DCMAKE_BUILD_TYPE=Release", f"-DPython_EXECUTABLE={sys.executable}",
        f"-DMUJOCO_DIR={packages / 'mujoco'}", f"-DCMEEL_PREFIX={packages / 'cmeel.prefix'}",
    ]  # fmt: skip
    return _run(["cmake", "-S", str(ROOT / "benchmarks"), "-B", str(native), *options])


def _build(native: Path, target: str) -> str:
    return _run(["cmake", "--build", str(native), "--target", target])


def _run(command: list[str]) -> str:
    """Runs a command; returns "", or the last lines of its output if it failed."""
    environment = os.environ | {
        "PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    }
    if shutil.which(command[0], path=environment["PATH"]) is None:
        return f"{command[0]} is not installed"
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    return (
        ""
        if done.returncode == 0
        else " / ".join((done.stderr or done.stdout).strip().splitlines()[-LAST_LINES:])
    )
