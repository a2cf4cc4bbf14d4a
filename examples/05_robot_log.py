"""Writes the log of a robot whose numbers differ from its robot file, for `hexapod identify`.

usage: python examples/05_robot_log.py [log.mcap]

A plant FMU with other servos, friction and payload stands for the real robot. It stands until it
has sagged under its payload, then the log begins: half a second of standing still, and a walk.
Sensors with noise read it. The log holds what a robot could record.
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import hexapod_cosim
from hexapod_cosim.cosim.logs.mcap_writer import write_mcap
from hexapod_cosim.cosim.master.recorder import Recording

SECRET = {"servo.kp": 34.0, "servo.coulomb_friction": 0.08, "friction.mu": 0.55, "torso.mass": 2.9}
EXACT = {"solver.tolerance": 1e-6}
BEFORE = 1.5  # s    of standing before the log begins
WALK = [
    {"time": BEFORE + 0.5, "vx": 0.08},
    {"time": BEFORE + 1.5, "vx": 0.05, "yaw_rate": 0.25},
    {"time": BEFORE + 2.5, "vx": 0.05, "vy": 0.04, "pitch": 0.06},
]
NOISE = {  # standard deviations of the sensors, by the end of the columns' names
    ".angle": 1e-3,  # rad
    ".speed": 0.02,  # rad/s
    ".torque": 0.03,  # N m
    ".foot.normal_force": 0.3,  # N
    "torso.position[1]": 5e-4,  # m
    "torso.position[2]": 5e-4,
    "torso.position[3]": 5e-4,
    "torso.roll": 1e-3,  # rad
    "torso.pitch": 1e-3,
    "torso.yaw": 1e-3,
    "imu.angular_velocity[1]": 0.01,  # rad/s
    "imu.angular_velocity[2]": 0.01,
    "imu.angular_velocity[3]": 0.01,
    "imu.specific_force[1]": 0.1,  # m/s2
    "imu.specific_force[2]": 0.1,
    "imu.specific_force[3]": 0.1,
}
COMMANDS = (".angle_ref", ".speed_ref")


def robot_log(seed: int = 1) -> Recording:
    """Returns the log of four seconds: commands as they were sent, readings with noise."""
    settings = {"duration": BEFORE + 4.0, "command": WALK, **SECRET, **EXACT}
    whole = hexapod_cosim.simulate("walk_flat", "kinematic", settings=settings).recording
    recording = whole.rows(slice(int(np.searchsorted(whole.time, BEFORE - 1e-9)), None))
    rng = np.random.default_rng(seed)
    names, columns = ["time"], [recording.time - BEFORE]
    for name in recording.names:
        noise = next((size for end, size in NOISE.items() if name.endswith(end)), None)
        if noise is not None and not name.startswith("controller."):
            names.append(name)
            columns.append(recording.column(name) + noise * rng.standard_normal(len(columns[0])))
        elif name.endswith(COMMANDS):
            names.append(name)
            columns.append(recording.column(name))
    return Recording(tuple(names), np.column_stack(columns))


def main() -> None:
    """Writes the log, for good where a path is given, and prints how to identify the robot."""
    log = robot_log()
    with TemporaryDirectory() as folder:
        path = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(folder) / "log.mcap"
        write_mcap(log, path)
        print(f"{path.name}: {len(log.time)} rows, {len(log.names) - 1} columns")
    if len(sys.argv) < 2:
        print("the log is deleted again; keep it: python 05_robot_log.py log.mcap")
    print("identify it with: hexapod identify log.mcap --robot athena -o out/identified")


if __name__ == "__main__":
    main()
