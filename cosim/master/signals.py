"""Which variable is what: the plant's outputs seen as arrays (leg, joint, axis), its inputs as
arrays to write. No copies: all are views.

All values stand in one row, outputs, flags, inputs, which the FMU fills and reads and which a
recorder copies in one piece. The outputs a controller needs come first, so that each is one
contiguous piece of it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.controller import JointCommand, Measurement
from hexapod_cosim.cosim.interface.names import (
    AXES,
    JOINTS,
    LEGS,
    foot_names,
    foot_vector_names,
    joint_names,
    vector_names,
)
from hexapod_cosim.cosim.master.force_sensor import ForceSensor
from hexapod_cosim.cosim.master.protocols import Plant
from hexapod_cosim.models import FmuError

MEASURED = {
    "angle": joint_names("angle"),
    "speed": joint_names("speed"),
    "foot_force": foot_vector_names("force"),
    "quaternion": vector_names("torso.quaternion", 4),
    "angular_velocity": vector_names("torso.angular_velocity"),
}
COMMANDED = {
    quantity: joint_names(quantity) for quantity in ("angle_ref", "speed_ref", "torque_ref")
}
ACCELERATION = joint_names("acceleration_ref")  # which plants made before have not
PUSH = [*vector_names("torso.push_force"), *vector_names("torso.push_torque")]
CONTACT = foot_names("contact")


class Signals:
    """The plant's blocks and the views on them. `sensor` stands between the feet and the
    measurement; None: what is measured is true.

    Attributes: names, values: of the whole row, flags as 0 and 1;  outputs, flags, inputs: its
    blocks;  measurement: what a robot senses; push: (6,) force [N] and torque [N m] on the torso,
    world axes, to be written.
    """

    def __init__(self, plant: Plant, *, sensor: ForceSensor | None = None) -> None:
        outputs, inputs, flags = (
            plant.names("output"),
            plant.names("input"),
            plant.names("output", "Boolean"),
        )
        refuse_foreign(outputs, inputs, flags)
        seen = _first([name for names in MEASURED.values() for name in names], outputs)
        flagged = _first(CONTACT, flags)
        planned = ACCELERATION if set(ACCELERATION) <= set(inputs) else []
        written = [*(name for names in COMMANDED.values() for name in names), *PUSH, *planned]
        self.names = (*seen, *flagged, *written)
        self.values: NDArray[np.float64] = np.zeros(len(self.names))
        output_row, self._flag_row, input_row = np.split(
            self.values, np.cumsum([len(seen), len(flagged)])
        )
        self.outputs, self.inputs = plant.block(seen, output_row), plant.block(written, input_row)
        self.flags = plant.block(flagged)
        self._angle_ref, self._speed_ref, self._torque_ref = input_row[: 3 * LEGS * JOINTS].reshape(
            3, LEGS, JOINTS
        )
        self.push: NDArray[np.float64] = input_row[3 * LEGS * JOINTS : len(written) - len(planned)]
        self._acceleration_ref = input_row[len(written) - len(planned) :].reshape(-1, LEGS, JOINTS)
        self._contact = np.zeros(LEGS, dtype=bool)
        self._touching = self.flags.values[:LEGS]
        self._sensor = sensor
        self.measurement = self._make_measurement()

    def _make_measurement(self) -> Measurement:
        views, at = {}, 0
        for key, names in MEASURED.items():
            views[key] = self.outputs.values[at : at + len(names)]
            at += len(names)
        self._force = views["foot_force"].reshape(LEGS, len(AXES))
        return Measurement(
            angle=views["angle"].reshape(LEGS, JOINTS),
            speed=views["speed"].reshape(LEGS, JOINTS),
            foot_force=self._force if self._sensor is None else self._sensor.force,
            contact=self._contact if self._sensor is None else self._sensor.contact,
            quaternion=views["quaternion"],
            angular_velocity=views["angular_velocity"],
        )

    def read(self) -> None:
        """Brings outputs and measurement up to date."""
        self.outputs.get()
        self.flags.get()
        self._contact[...] = self._touching
        self._flag_row[...] = self.flags.values
        if self._sensor is not None:
            self._sensor.read(self._force, self._touching)

    def write(self, command: JointCommand) -> None:
        """Hands a joint command, and the push as it stands, to the plant."""
        self._angle_ref[...] = command.angle_ref
        self._speed_ref[...] = command.speed_ref
        self._torque_ref[...] = command.torque_ref
        self._acceleration_ref[...] = command.acceleration_ref
        self.inputs.set()


def _first(names: Sequence[str], among: Sequence[str]) -> list[str]:
    """All names `among` which these are, these first."""
    return [*names, *(name for name in among if name not in set(names))]


def refuse_foreign(outputs: Sequence[str], inputs: Sequence[str], flags: Sequence[str]) -> None:
    """Raises FmuError when the plant lacks a variable that every hexapod FMU has."""
    have = {*outputs, *inputs, *flags}
    need = [
        name for names in (*MEASURED.values(), *COMMANDED.values(), PUSH, CONTACT) for name in names
    ]
    missing = [name for name in need if name not in have]
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
