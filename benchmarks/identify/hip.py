"""Measures the hysteresis of a simulated hip as lukas/hexapod measured its own, and prints the rows
of docs/reality.md.

usage: python -m benchmarks.identify.hip

The real robot lay on its belly and moved one leg in the air. Its hip dwelt 3.1 s at 42.955, 47.133,
51.143 and again 47.133 degrees above the horizon; the last 1.0 s at 47.133 degrees is compared.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from hexapod_cosim.extensions.identify.bench.log import BenchLog
from hexapod_cosim.extensions.identify.bench.pendulum import Bench
from hexapod_cosim.models import load_robot
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.records import Servo
from hexapod_cosim.models.servos.motor import position_gain
from hexapod_cosim.models.servos.presets import measured_servo

# github.com/lukas/hexapod e76fa13, artifacts/l2_belly_rest_hysteresis_d4908236/
# l2_hysteresis_loop_table.txt: means of its six repetitions, as the last four of `loops`
REAL = (0.5021, 0.4377, -0.0644, 4.41)
VOLTAGE = 11.25  # V  of the robot; a servo for less gets its own voltage
LOW, MIDDLE, HIGH = (math.radians(angle) for angle in (42.955, 47.133, 51.143))
MOVE, DWELL, WINDOW = 0.9, 3.1, 1.0  # s
SLOW = 0.02  # rad/s  of the goal that does not stop
ROW = 0.05  # s
LEG = 0.0118, 0.091  # kg m, m  straight, of models/sts3215_hexapod.toml; length of its inertia
SHARES = (0.5, 1.0, 2.0)  # of the leg's weight


def steps() -> tuple[Array, Array]:
    """Returns times [s] and goals [rad above the horizon] of the real robot's cycle."""
    stages = [(LOW, LOW), (LOW, MIDDLE), (MIDDLE, HIGH), (HIGH, MIDDLE)]
    local = np.arange(0.0, MOVE + DWELL - 0.5 * ROW, ROW)
    share = 0.5 - 0.5 * np.cos(np.pi * np.minimum(local / MOVE, 1.0))
    return with_times(np.concatenate([start + (end - start) * share for start, end in stages]))


def slow() -> tuple[Array, Array]:
    """Returns times [s] and goals [rad above the horizon] of a slow motion up and down."""
    up = np.arange(LOW, HIGH, SLOW * ROW)
    return with_times(np.concatenate([up, up[::-1]]))


def with_times(goal: Array) -> tuple[Array, Array]:
    """Returns the times [s] of goals, and these."""
    return np.asarray(ROW * np.arange(len(goal)), dtype=float), goal


def log(servo: Servo, share: float, course: tuple[Array, Array]) -> BenchLog:
    """Returns a log without readings, of a hip that holds a share of the leg's weight."""
    time, goal = course
    moment, length = LEG
    hanging = goal + 0.5 * math.pi
    none, ones = np.zeros_like(time), np.ones_like(time)
    return BenchLog(
        where="hip", motor="sts3215", gain=servo.kp / position_gain(servo, 1.0), register=32.0,
        mass=share * moment / length, rod=0.0, length=length, trajectory="hip", time=time,
        goal=hanging, angle=hanging, speed=none, duty=none, on=ones,
        voltage=min(VOLTAGE, servo.voltage) * ones,
    )  # fmt: skip


def loops(servo: Servo, shares: Sequence[float]) -> Array:
    """Returns (shares, 5) under shares of the leg's weight: hysteresis at SLOW and of the dwells
    [deg], errors below the goal after the steps up and down [deg], duty after the step up [%].
    """
    time, goal = steps()
    swing = Bench([log(servo, one, (time, goal)) for one in shares]).simulate(servo, 0.0, 0.0)
    below = np.degrees(goal[:, None] + 0.5 * math.pi - swing.angle[:, 0])
    ends = [round(k * (MOVE + DWELL) / ROW) for k in (2, 4)]
    up, down = (slice(end - round(WINDOW / ROW), end) for end in ends)
    duty = 100.0 * swing.duty[up, 0].mean(axis=0)
    time, goal = slow()
    swing = Bench([log(servo, one, (time, goal)) for one in shares]).simulate(servo, 0.0, 0.0)
    half, k = len(goal) // 2, int(np.searchsorted(goal[: len(goal) // 2], MIDDLE))
    moving = np.degrees(swing.angle[2 * half - 1 - k, 0] - swing.angle[k, 0])
    first, second = below[up].mean(axis=0), below[down].mean(axis=0)
    return np.column_stack([moving, first - second, first, second, duty])


def real_row() -> str:
    """Returns the row of the real hip."""
    return "| real hip | 1 | | {:.2f} | {:.2f} | {:.2f} | {:.1f} |".format(*REAL)


def rows(name: str, servo: Servo) -> Iterator[str]:
    """Yields the rows of a servo."""
    for share, (*angles, duty) in zip(SHARES, loops(servo, SHARES).tolist(), strict=True):
        texts = " | ".join(f"{angle:.2f}" for angle in angles)
        yield f"| {name} | {share:g} | {texts} | {duty:.1f} |"


def main() -> None:
    """Prints the table."""
    servos = {name: measured_servo(name).servo for name in ("sts3215_12v", "sts3215_m1")}
    servos["sts3215_hexapod"] = load_robot("sts3215_hexapod").servo
    print(real_row())
    for name, servo in servos.items():
        print("\n".join(rows(name, servo)))


if __name__ == "__main__":
    main()
