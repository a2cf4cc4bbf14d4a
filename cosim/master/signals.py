"""Maps the plant's variables to arrays by leg, joint and axis, without copying.

All values stand in one row: outputs, Boolean outputs (flags), inputs, readings of sensors. The FMU
fills and reads the row and a recorder copies it in one piece. The outputs that a controller needs
come first, so that each quantity is contiguous.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.controller import BodyCommand, JointCommand, Measurement
from hexapod_cosim.cosim.interface.names import AXES, JOINTS, LEGS, joint_names, vector_names
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.master.fmu_block import FmuBlock
from hexapod_cosim.cosim.master.sensors import CONTACT, MEASURED, READINGS, Errors, Sensors
from hexapod_cosim.models import FmuError

COMMANDS = [f"command.{item.name}" for item in fields(BodyCommand)]
COMMANDED = {
    quantity: joint_names(quantity) for quantity in ("angle_ref", "speed_ref", "torque_ref")
}
JOINT_COMMANDS = [name for names in COMMANDED.values() for name in names]
ACCELERATION = joint_names("acceleration_ref")
# 0 unless a servo has a fault
SERVOS = [*joint_names("weakness"), *joint_names("lock")]
PUSH = [*vector_names("torso.push_force"), *vector_names("torso.push_torque")]
SHAPES = {"angle": (LEGS, JOINTS), "speed": (LEGS, JOINTS), "foot_force": (LEGS, len(AXES))}


class Signals:
    """The plant's blocks of variables and array views of them.

    `errors`: of sensors; None: there are none.

    Attributes: `names` and `values` of the recorded row, flags as 0 and 1; its blocks `outputs`,
    `flags` and `inputs`; `measurement`, which the controller reads; `push` (6,), which the loop
    writes: force [N] and torque [N m] on the torso, world axes.
    """

    def __init__(self, plant: Fmu, *, errors: Errors | None = None) -> None:
        outputs, inputs = plant.names("output"), plant.names("input")
        flags = plant.names("output", "Boolean")
        check_plant_variables(outputs, inputs, flags)
        output_names = _move_first(READINGS[: -len(CONTACT)], outputs)
        flag_names = _move_first(CONTACT, flags)
        input_names = [*JOINT_COMMANDS, *PUSH, *ACCELERATION]
        self.names = (*output_names, *flag_names, *input_names)
        self._row = np.zeros(len(self.names) + len(READINGS))
        output_row, self._flag_row, input_row, _ = np.split(
            self._row, np.cumsum([len(output_names), len(flag_names), len(input_names)])
        )
        self.values = self._row[: len(self.names)]
        self.outputs = plant.block(output_names, output_row)
        self.inputs = plant.block(input_names, input_row)
        self.flags = plant.block(flag_names)
        self._plant: Fmu = plant
        self._servos: FmuBlock | None = None
        commands, self.push, accelerations = np.split(
            input_row, np.cumsum([len(JOINT_COMMANDS), len(PUSH)])
        )
        self._angle_ref, self._speed_ref, self._torque_ref = commands.reshape(-1, LEGS, JOINTS)
        self._acceleration_ref = accelerations.reshape(LEGS, JOINTS)
        places = {name: place for place, name in enumerate(self.names)}
        self._sensors = Sensors(errors or Errors(), places, first=len(self.names))
        self._moment = -1  # of the last reading
        self.measurement = self._make_measurement()

    def _make_measurement(self) -> Measurement:
        """Returns views of true values, and of readings where sensors have errors."""
        views = {
            key: self._view(names).reshape(SHAPES.get(key, -1)) for key, names in MEASURED.items()
        }
        self._contact = self._view(CONTACT), np.zeros(LEGS, dtype=bool)
        return Measurement(contact=self._contact[1], **views)

    def _view(self, names: Sequence[str]) -> NDArray[np.float64]:
        first = self._sensors.measured[names[0]]  # of numbers that adjoin
        return self._row[first : first + len(names)]

    def read(self) -> None:
        """Reads the plant's outputs and updates the measurement."""
        self.outputs.get()
        self.flags.get()
        self._flag_row[...] = self.flags.values
        self._moment += 1
        self._sensors.read(self._moment, self._row)
        number, contact = self._contact
        contact[...] = number

    def write(self, command: JointCommand) -> None:
        """Writes a joint command and the present push to the plant's inputs."""
        self._angle_ref[...] = command.angle_ref
        self._speed_ref[...] = command.speed_ref
        self._torque_ref[...] = command.torque_ref
        self._acceleration_ref[...] = command.acceleration_ref
        self.hold()

    def set_servos(self, states: NDArray[np.float64]) -> None:
        """Writes the states (36,) of the servos, weaknesses and locks, where they have changed."""
        if self._servos is None or not np.array_equal(states, self._servos.values):
            self._servos = self._servos or self._plant.block(SERVOS)
            self._servos.values[...] = states
            self._servos.set()

    def hold(self) -> None:
        """Writes the last joint command again, and the present push."""
        self.inputs.set()


def _move_first(names: Sequence[str], among: Sequence[str]) -> list[str]:
    """Returns all names `among`, with `names` moved to the front."""
    return [*names, *(name for name in among if name not in set(names))]


def check_plant_variables(
    outputs: Sequence[str], inputs: Sequence[str], flags: Sequence[str]
) -> None:
    """Raises FmuError when the plant lacks a variable that every hexapod FMU has."""
    have = {*outputs, *inputs, *flags}
    missing = [
        name for name in (*READINGS, *JOINT_COMMANDS, *ACCELERATION, *PUSH) if name not in have
    ]
    if missing:
        got = f"no {missing[0]}" + (
            f" and {len(missing) - 1} more missing" if len(missing) > 1 else ""
        )
        raise FmuError(
            "not a hexapod plant",
            got=got,
            expected="the variables of every hexapod FMU",
            fix="use an FMU made by `hexapod export`",
        )
