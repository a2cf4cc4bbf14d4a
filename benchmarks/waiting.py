"""How long people wait for commands: a stopwatch table, cold and warm.

usage: python -m benchmarks.waiting [NAME ...]

A row is a command in a new process. Cold is its first run with an empty cache of the user, warm the
faster of two further runs. Processor times depend less on other programs.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

HEXAPOD = str(Path(sys.executable).with_name("hexapod"))
SHORT = ("--engine", "compiled", "--set", "outputs.plots=false")
NEW_ROBOT = """
import time
from dataclasses import replace
from hexapod_cosim.cosim.run.designs import designed_gains
from hexapod_cosim.models import load_robot
robot = load_robot("athena")
mass = 2.7 + 1e-9 * (time.time_ns() % 10**6)  # another one each time
designed_gains(replace(robot, torso=replace(robot.torso, mass=mass)), 0.005)
"""
# name -> words after hexapod, or a program; {out}: a folder
COMMANDS: Mapping[str, tuple[str, ...]] = {
    "help": ("--help",),
    "list": ("list", "scenarios"),
    "completion": (),
    "export": ("export", "-o", "{out}/athena.fmu"),
    "validate": ("validate", "{out}/athena.fmu"),
    "walk": ("simulate", "walk_flat", *SHORT, "-o", "{out}/walk"),
    "walk and report": ("simulate", "walk_flat", "--engine", "compiled", "-o", "{out}/report"),
    "compliant walk": ("simulate", "walk_flat", "--control=compliant", *SHORT, "-o", "{out}/own"),
    "gains of a new robot": (sys.executable, "-c", NEW_ROBOT),
    "compare": ("compare", "walk_flat", "--control=kinematic", "--control=compliant",
                "-o", "{out}/compare"),
}  # fmt: skip


@dataclass(frozen=True)
class Wait:
    """Times of a command [s]."""

    wall: float
    processor: float


def main(names: list[str]) -> None:
    """Prints the table of all commands or of those named."""
    unknown = set(names) - set(COMMANDS)
    if unknown:
        sys.exit(f"unknown: got {', '.join(unknown)}, expected {', '.join(COMMANDS)}")
    columns = ("command", "cold, s", "warm, s", "cold, processor s", "warm, processor s")
    print(f"| {' | '.join(columns)} |\n{'|---' * len(columns)}|")
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "XDG_CACHE_HOME": f"{folder}/cache"}
        for name in names or COMMANDS:
            cold, *others = (measured(name, folder, environment) for _ in range(3))
            warm = min(others, key=lambda wait: wait.wall)
            times = (cold.wall, warm.wall, cold.processor, warm.processor)
            print(f"| {name} | {' | '.join(f'{value:.2f}' for value in times)} |", flush=True)


def measured(name: str, folder: str, environment: Mapping[str, str]) -> Wait:
    """Returns the times of one run. Exits if it fails; a robot that fell (3) is no failure."""
    words = [word.format(out=folder) for word in COMMANDS[name]]
    command = words if name == "gains of a new robot" else [HEXAPOD, *words]
    if name == "completion":
        completing = {"_HEXAPOD_COMPLETE": "complete_bash", "COMP_WORDS": "hexapod li"}
        environment = {**environment, **completing, "COMP_CWORD": "1"}
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    wall, after = time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode not in (0, 3):
        sys.exit(f"{name} failed:\n{done.stderr}")
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Wait(wall, used)


if __name__ == "__main__":
    main(sys.argv[1:])
