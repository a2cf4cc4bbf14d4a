"""Runs a model in MuJoCo: `mujoco_ground.py MODEL COMMANDS INTEGRATOR STEP REPEATS OUT`.

MODEL is an MJCF file, COMMANDS an .npz file: `ctrl` (n, actuators), each row held over `h` [s];
`qpos`, `qvel` of the start; `names` of the geoms whose contact forces are read. OUT becomes an .npz
file: `path` (n + 1, 3) of the first free body [m], `speed` (n + 1,) of it along z [m/s], `force`
(n, geoms) normal forces at the begin of each row [N], `peak` (geoms,) over all steps. The printed
JSON line holds the loop's seconds of each repeat, without the forces, which a further run reads.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LONG = 1.0  # s    after which a walk is not repeated


def model_of(path: str, integrator: str, step: float) -> Any:
    """Reads a model and sets its integrator and its step [s]."""
    model = mujoco.MjModel.from_xml_path(path)
    model.opt.timestep = step
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    return model


def started(model: Any, job: Any) -> Any:
    """Returns the data of the start."""
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = job["qpos"], job["qvel"]
    mujoco.mj_forward(model, data)
    return data


def walked(model: Any, job: Any) -> tuple[float, Array, Array]:
    """Returns the loop's time [s], the path (n + 1, 3) [m] and the vertical speed (n + 1,)."""
    data, ctrl = started(model, job), job["ctrl"]
    path, speed = np.empty((len(ctrl) + 1, 3)), np.empty(len(ctrl) + 1)
    path[0], speed[0] = data.qpos[:3], data.qvel[2]
    steps = round(float(job["h"]) / model.opt.timestep)
    begin = time.perf_counter()
    for k, row in enumerate(ctrl):
        data.ctrl[:] = row
        mujoco.mj_step(model, data, steps)
        path[k + 1], speed[k + 1] = data.qpos[:3], data.qvel[2]
    seconds = time.perf_counter() - begin
    if not np.isfinite(path).all() or data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number:
        sys.exit("MuJoCo's state is not finite")
    return seconds, path, speed


def forces(model: Any, job: Any) -> tuple[Array, Array]:
    """Returns normal forces of the named geoms at the begin of each row, and their peaks."""
    data, ctrl = started(model, job), job["ctrl"]
    read = force_reader(model, [str(name) for name in job["names"]])
    force = np.empty((len(ctrl), len(job["names"])))
    peak = np.zeros(force.shape[1])
    steps = round(float(job["h"]) / model.opt.timestep)
    for k, row in enumerate(ctrl):
        data.ctrl[:] = row
        for step in range(steps):
            mujoco.mj_step(model, data)
            present = read(data)  # at the begin of this step
            if step == 0:
                force[k] = present
            np.maximum(peak, present, out=peak)
    return force, peak


def force_reader(model: Any, names: list[str]) -> Callable[[Any], Array]:
    """Returns a function that sums the normal forces of the contacts of each geom [N]."""
    column = {model.geom(name).id: k for k, name in enumerate(names)}
    wrench = np.zeros(6)

    def read(data: Any) -> Array:
        force = np.zeros(len(names))
        for number in range(data.ncon):
            geoms = data.contact[number].geom
            for geom in geoms:
                if int(geom) in column:
                    mujoco.mj_contactForce(model, data, number, wrench)
                    force[column[int(geom)]] += wrench[0]
        return force

    return read


def main(
    model_path: str, job_path: str, integrator: str, step: str, repeats: str, out: str
) -> None:
    """Runs, writes the results and prints the JSON line."""
    model = model_of(model_path, integrator, float(step))
    with np.load(job_path) as file:
        job = dict(file)
    seconds: list[float] = []
    while len(seconds) < int(repeats) and sum(seconds) < LONG:
        taken, path, speed = walked(model, job)
        seconds.append(taken)
    force, peak = forces(model, job)
    np.savez(out, path=path, speed=speed, force=force, peak=peak)
    print(json.dumps({"seconds": seconds}))


if __name__ == "__main__":
    if len(sys.argv) != 7:
        sys.exit("usage: mujoco_ground.py MODEL COMMANDS INTEGRATOR STEP REPEATS OUT")
    main(*sys.argv[1:])
