"""Runs a package's walk with the Python master and controller, with present measurements or with
those of one period before.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from hexapod_cosim.controller import BodyCommand, Controller, JointCommand, Measurement
from hexapod_cosim.cosim.interface.controller import ControllerSetup
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.master.loop import JointController, run
from hexapod_cosim.cosim.master.recorder import Recorder, Recording
from hexapod_cosim.cosim.master.signals import Signals
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.cosim.scenario.schedule import make_schedule


class DelayedController:
    """A controller whose commands follow from the measurements of the period before.

    Its state follows from the present measurements. It is equivalent to a controller FMU whose
    inputs are set after its outputs were read.
    """

    def __init__(self, controller: Controller) -> None:
        self.controller = controller
        self._before: Measurement | None = None

    def step(self, t: float, command: BodyCommand, measurement: Measurement) -> JointCommand:
        """Returns the joint commands for [t, t + period)."""
        state = self.controller.save()
        format_difference = self.controller.step(t, command, self._before or measurement)
        answer = JointCommand(
            **{name: np.array(value) for name, value in vars(format_difference).items()}
        )
        self.controller.restore(state)
        self.controller.step(t, command, measurement)
        self._before = copy(measurement)
        return answer


def copy(measurement: Measurement) -> Measurement:
    """Copies a measurement."""
    return Measurement(**{name: np.array(value) for name, value in vars(measurement).items()})


def walk(
    setup: ControllerSetup, fmu: Path, *, duration: float, overrides: list[str], late: bool
) -> Recording:
    """Simulates the walk with the setup's Python controller; returns rows after each step."""
    settings = [f"duration={duration}", f"macro_step={setup.period}", *overrides]
    schedule = make_schedule(load_scenario("walk_flat", overrides=settings))
    controller = setup.build()
    largest_difference: JointController = DelayedController(controller) if late else controller
    with Fmu(fmu) as plant:
        plant.initialise(0.0, duration)
        signals = Signals(plant)
        recorder = Recorder(signals, schedule.times, schedule.rows)
        outcome = run(plant, signals, largest_difference, schedule, recorder, h=setup.period)
    if outcome.cause is not None:
        raise outcome.cause
    return outcome.recording.rows(slice(1, None))
