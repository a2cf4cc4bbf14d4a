"""Drives the plant with a controller of your own: any class with a `step` method.

usage: python examples/03_own_controller.py
"""

import numpy as np

import hexapod_cosim
from hexapod_cosim.controller import BodyCommand, JointCommand, Measurement
from hexapod_cosim.cosim.results.facts import Result
from hexapod_cosim.models import Robot


class Sway:
    """Swings all coxae to and fro around the stance."""

    def __init__(self, robot: Robot, amplitude: float = 0.1, frequency: float = 1.0) -> None:
        self.stance, self.amplitude = np.array(robot.stance), amplitude  # rad
        self.rate = 2.0 * np.pi * frequency  # rad/s

    def step(self, t: float, command: BodyCommand, measurement: Measurement) -> JointCommand:
        """Returns the joint commands for the next macro-step."""
        del command, measurement
        angle, speed = self.stance.copy(), np.zeros((6, 3))
        angle[:, 0] += self.amplitude * np.sin(self.rate * t)
        speed[:, 0] = self.rate * self.amplitude * np.cos(self.rate * t)
        return JointCommand(angle_ref=angle, speed_ref=speed)


def sway() -> Result:
    """Runs the controller for two seconds on the standing robot."""
    return hexapod_cosim.simulate("stand", Sway, settings={"duration": 2})


def main() -> None:
    """Prints how far the torso turned."""
    result = sway()
    yaw = result.recording.column("torso.yaw")
    print(
        f"{result.outcome.status}: the torso turns by {np.degrees(np.ptp(yaw)):.2f} deg"
        f" at {result.outcome.realtime_factor:.0f} x real time"
    )


if __name__ == "__main__":
    main()
