"""Environment steps per second of fmugym on the plant's FMU.

fmugym 0.2.0 requires an older Gymnasium than ours, of which it uses the spaces alone, so it is
installed without its requirements into a folder of its own. Its environment steps one FMU through
fmpy in Python; the FMU, its solver, the commands and the numbers observed are those of our
environment.
"""

from __future__ import annotations

import importlib
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from benchmarks import BUILD
from benchmarks.environment_steps import steps_per_second, walking_action, ways
from hexapod_cosim.cosim.interface.names import vector_names
from hexapod_cosim.cosim.master.sensors import MEASURED
from hexapod_cosim.cosim.master.signals import JOINT_COMMANDS
from hexapod_cosim.extensions.gym.batch import export_plant, grounds
from hexapod_cosim.extensions.gym.settings import JOINTS, RATE, EnvSettings
from hexapod_cosim.models.records import Array

VERSION = "0.2.0"
FOLDER = BUILD / f"fmugym-{VERSION}"
INPUTS = JOINT_COMMANDS[:JOINTS]  # the angles
OUTPUTS = [
    *MEASURED["angle"],
    *MEASURED["speed"],
    *MEASURED["quaternion"],
    *MEASURED["angular_velocity"],
    *vector_names("torso.velocity"),
    *vector_names("torso.position"),
]
LARGEST = 1e3  # of the spaces' bounds, which fmugym needs finite


def table(duration: float) -> str:
    """Returns a line with the speeds of fmugym and of ours, both one robot in one thread."""
    try:
        _install()
    except RuntimeError as error:
        return f"fmugym {VERSION} is missing: {error}"
    settings, steps = EnvSettings(duration=2.0 * duration), round(duration * RATE)
    processor, path = _theirs(settings, steps)
    ours = steps_per_second(settings, count=1, threads=1, steps=steps)[1]
    apart = float(np.abs(path - ways(settings, 1, steps)[:, 0]).max())
    return "\n".join(
        [
            f"fmugym {VERSION} on the same FMU, one robot, one thread",
            "environment              steps/s of processor time",
            f"fmugym                   {steps / processor:25.0f}",
            f"ours, one robot          {ours:25.0f}",
            f"largest distance of the two paths: {1e3 * apart:.6f} mm",
        ]
    )


def _install() -> None:
    """Installs fmugym into its folder. Raises RuntimeError with pip's last line."""
    if not (FOLDER / "fmugym").is_dir():
        options = ["--quiet", "--no-deps", "--target", str(FOLDER)]
        done = subprocess.run(
            [sys.executable, "-m", "pip", "install", *options, f"fmugym=={VERSION}"],
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode:
            raise RuntimeError((done.stderr.strip() or "pip failed").splitlines()[-1])
    if str(FOLDER) not in sys.path:
        sys.path.append(str(FOLDER))


def _box(fmugym: Any, names: list[str]) -> Any:
    """Returns a space of fmugym with a bounded number for each name."""
    space = fmugym.VarSpace("space")
    for name in names:
        space.add_var_box(name, np.array([-LARGEST], np.float32), np.array([LARGEST], np.float32))
    return space


def _theirs(settings: EnvSettings, steps: int) -> tuple[float, Array]:
    """Walks with fmugym; returns the processor time [s] and the path (steps, 3) [m]."""
    fmugym: Any = importlib.import_module("fmugym")  # installed by _install

    class Walk(fmugym.FMUGym):  # type: ignore[misc]
        """The plant's FMU as fmugym steps it."""

        def _noisy_init(self) -> dict[int, float]:
            return {}

        def compute_reward(self, *_: Any, **__: Any) -> float:
            return 0.0

    robots = grounds(settings)
    stance = np.array([leg.stance for leg in robots[0].legs]).ravel()
    commands = [stance + settings.action_scale * walking_action(k, 1)[0] for k in range(steps)]
    with TemporaryDirectory(prefix="hexapod-fmugym-") as folder:
        path = export_plant(robots, Path(folder))
        walk = Walk(
            fmugym.FMUGymConfig(
                str(path),
                stop_time=2.0 * steps / RATE,
                sim_step_size=1.0 / RATE,
                action_step_size=1.0 / RATE,
                inputs=_box(fmugym, INPUTS),
                outputs=_box(fmugym, OUTPUTS),
                random_vars=fmugym.VarSpace("none"),
            )
        )
        order = {name: place for place, name in enumerate(walk.input_dict)}
        places = [INPUTS.index(name) for name in order]
        shown = list(walk.output_dict)
        position = [shown.index(name) for name in vector_names("torso.position")]
        walk.reset()
        began, path_walked = time.process_time(), []
        for command in commands:
            observation, *_ = walk.step(command[places])
            path_walked.append(observation[position])
        spent = time.process_time() - began
        walk.close()
    return spent, np.array(path_walked, dtype=float)
