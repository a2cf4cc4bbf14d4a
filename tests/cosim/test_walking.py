"""The whole co-simulation.

Both robots walk for a minute, and the error falls with the macro-step.
"""

from __future__ import annotations

from pathlib import Path

import fmpy
import numpy as np
import pytest
from numpy.typing import NDArray

from hexapod_cosim.cosim.run.runner import Runner
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.models import LEG_NAMES, Robot, load_robot

COMMANDED, SHARE = 0.08, 0.10  # m/s, 1: how near to it the mean speed must come
LEVEL = 0.02  # rad    of roll and pitch in a walk on flat ground: a fall is beyond 0.6
SWAY, PERIOD, LOOK = 0.05, 1.0, 0.7  # rad, s, s
STEPS = (4e-3, 2e-3, 1e-3, 5e-4)  # s
# of the order by regression over a factor of eight: the next term of the error still shows
SLOPE = 0.15


@pytest.mark.usefixtures("plant_build")
@pytest.mark.parametrize(
    ("robot", "control"), [("athena", "compliant"), ("phantomx_mk4", "kinematic")]
)
def test_a_robot_walks_for_a_minute_at_the_commanded_speed_without_falling(
    robot: str, control: str
) -> None:
    """On the loop in C; its walks are those of the Python loop (test_walker.py)."""
    scenario = load_scenario(
        "walk_flat", overrides=[f"robot={robot}", f"control={control}", "duration=60"]
    )
    with Runner(everything=True) as runner:
        result = runner.simulate(scenario)
    assert result.completed
    recording = result.outcome.recording
    assert recording.time[-1] == pytest.approx(60.0)
    assert np.all(np.abs(recording.columns(["torso.roll", "torso.pitch"])) < LEVEL)
    height = recording.column("torso.position[3]")
    assert height.min() > 0.9 * height[0]
    position = recording.vector("torso.position")
    forward = position[-1, 0] - position[np.searchsorted(recording.time, 2.0), 0]
    assert forward / 58.0 == pytest.approx(COMMANDED, rel=SHARE)


def swaying(robot: Robot, ahead: float) -> NDArray[np.void]:
    """Returns joint commands that turn and lift the torso once per period, as input for fmpy.

    The commands at time t are those of the motion at t + ahead.
    """
    time = np.arange(0.0, LOOK + 2e-2, 1e-4)
    phase = 2.0 * np.pi * (time + ahead) / PERIOD
    angle, speed = 0.5 * SWAY * (1.0 - np.cos(phase)), np.pi * SWAY / PERIOD * np.sin(phase)
    columns = {"time": time}
    for leg, stance in zip(LEG_NAMES, robot.stance, strict=True):
        for joint, share, start in zip(("coxa", "femur"), (1.0, -0.5), stance[:2], strict=True):
            columns |= {
                f"{leg}.{joint}.angle_ref": start + share * angle,
                f"{leg}.{joint}.speed_ref": share * speed,
            }
    rows = np.zeros(len(time), dtype=[(name, np.float64) for name in columns])
    for name, values in columns.items():
        rows[name] = values
    return rows


def torso_at(fmu: Path, h: float, *, middle: bool) -> NDArray[np.float64]:
    """Returns torso position and yaw at LOOK after macro-steps of h.

    Commands are sampled at each step's start or middle and held.
    """
    result = fmpy.simulate_fmu(
        str(fmu),
        stop_time=LOOK,
        step_size=h,
        output_interval=h,
        start_values={"solver.tolerance": 1e-9},
        input=swaying(load_robot("athena"), 0.5 * h if middle else 0.0),
        output=["torso.position[1]", "torso.position[3]", "torso.yaw"],
    )
    row = int(np.argmin(np.abs(result["time"] - LOOK)))
    assert result["time"][row] == pytest.approx(LOOK)
    return np.array([result[name][row] for name in result.dtype.names[1:]])


@pytest.mark.parametrize(("middle", "order"), [(False, 1), (True, 2)])
def test_the_co_simulation_error_falls_with_the_macro_step(
    athena_fmu: Path, middle: bool, order: int
) -> None:
    """A command held from a step's start lags by h/2, which gives order 1.

    One sampled at the step's middle has no lag: order 2.
    """
    exact = torso_at(athena_fmu, 1.25e-4, middle=True)
    errors = [float(np.linalg.norm(torso_at(athena_fmu, h, middle=middle) - exact)) for h in STEPS]
    slope = np.polyfit(np.log(STEPS), np.log(errors), 1)[0]
    assert slope == pytest.approx(order, abs=SLOPE)
