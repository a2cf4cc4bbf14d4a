"""Drives the plant with a controller of your own: any object with a `step` method.

usage: python examples/03_own_controller.py
"""

import numpy as np

from hexapod_cosim.controller import BodyCommand, JointCommand, Measurement
from hexapod_cosim.cosim.master.loop import Outcome, run
from hexapod_cosim.cosim.master.recorder import Recorder
from hexapod_cosim.cosim.master.signals import Signals
from hexapod_cosim.cosim.run.run import open_plant
from hexapod_cosim.cosim.scenario.scenario import load_scenario
from hexapod_cosim.cosim.scenario.schedule import make_schedule
from hexapod_cosim.models import load_robot

AMPLITUDE, FREQUENCY = 0.1, 1.0  # rad, Hz


class Sway:
    """Swings all coxae to and fro around the stance."""

    def __init__(self, stance: np.ndarray) -> None:
        self.stance = stance

    def step(self, t: float, command: BodyCommand, measurement: Measurement) -> JointCommand:
        """Returns the joint commands for the next macro-step."""
        del command, measurement
        angle, speed = self.stance.copy(), np.zeros((6, 3))
        phase = 2.0 * np.pi * FREQUENCY * t
        angle[:, 0] += AMPLITUDE * np.sin(phase)
        speed[:, 0] = 2.0 * np.pi * FREQUENCY * AMPLITUDE * np.cos(phase)
        return JointCommand(angle_ref=angle, speed_ref=speed, torque_ref=np.zeros((6, 3)))


def sway() -> Outcome:
    """Runs the controller for two seconds on the standing robot."""
    scenario = load_scenario("stand", overrides=["duration=2"])
    schedule = make_schedule(scenario)
    with open_plant(scenario) as plant:
        plant.initialise(0.0, scenario.duration)
        signals = Signals(plant)
        recorder = Recorder(signals, schedule.times, schedule.rows)
        return run(
            plant,
            signals,
            Sway(load_robot("athena").stance),
            schedule,
            recorder,
            h=scenario.macro_step,
        )


def main() -> None:
    """Prints how far the torso turned."""
    outcome = sway()
    yaw = outcome.recording.column("torso.yaw")
    print(
        f"{outcome.status}: the torso turns by {np.degrees(np.ptp(yaw)):.2f} deg"
        f" at {outcome.realtime_factor:.0f} x real time"
    )


if __name__ == "__main__":
    main()
