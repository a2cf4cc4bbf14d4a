"""Maps the plant's variables to arrays by leg, joint and axis, without copying.

All values stand in one row: outputs, Boolean outputs (flags), inputs. The FMU fills and reads the
row and a recorder copies it in one piece. The outputs that a controller needs come first, so that
each quantity is contiguous.
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
from hexapod_cosim.cosim.master.faulty_sensors import InnerSensors
from hexapod_cosim.cosim.master.force_sensor import ForceSensor
from hexapod_cosim.cosim.master.protocols import Plant
from hexapod_cosim.cosim.scenario.records import SERVO_FAULTS
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
ACCELERATION = joint_names("acceleration_ref")  # FMUs of earlier versions lack these
PUSH = [*vector_names("torso.push_force"), *vector_names("torso.push_torque")]
CONTACT = foot_names("contact")
DEAD, STUCK = (SERVO_FAULTS.index(name) + 1 for name in ("dead", "stuck"))


class Signals:
    """The plant's blocks of variables and array views of them.

    `sensor` models the feet's force sensors, `inner` those of joints and attitude; None means ideal
    ones.

    Attributes: `names` and `values` of the whole row, flags as 0 and 1; its blocks `outputs`,
    `flags` and `inputs`; `measurement`, which the controller reads; `push` (6,), which the loop
    writes: force [N] and torque [N m] on the torso, world axes; `servo_faults` (6, 3) of the
    present macro-step, which the loop sets: 0 none, else 1 + index in SERVO_FAULTS.
    """

    def __init__(
        self,
        plant: Plant,
        *,
        sensor: ForceSensor | None = None,
        inner: InnerSensors | None = None,
    ) -> None:
        outputs, inputs = plant.names("output"), plant.names("input")
        flags = plant.names("output", "Boolean")
        check_plant_variables(outputs, inputs, flags)
        output_names = _move_first([name for names in MEASURED.values() for name in names], outputs)
        flag_names = _move_first(CONTACT, flags)
        planned = ACCELERATION if set(ACCELERATION) <= set(inputs) else []
        commanded = [name for names in COMMANDED.values() for name in names]
        input_names = [*commanded, *PUSH, *planned]
        self.names = (*output_names, *flag_names, *input_names)
        self.values: NDArray[np.float64] = np.zeros(len(self.names))
        output_row, self._flag_row, input_row = np.split(
            self.values, np.cumsum([len(output_names), len(flag_names)])
        )
        self.outputs = plant.block(output_names, output_row)
        self.inputs = plant.block(input_names, input_row)
        self.flags = plant.block(flag_names)
        commands, self.push, accelerations = np.split(
            input_row, np.cumsum([len(commanded), len(PUSH)])
        )
        self._angle_ref, self._speed_ref, self._torque_ref = commands.reshape(-1, LEGS, JOINTS)
        self._acceleration_ref = accelerations.reshape(-1, LEGS, JOINTS)
        self._contact = np.zeros(LEGS, dtype=bool)
        self._touching = self.flags.values[:LEGS]
        self._sensor, self._inner = sensor, inner
        self.measurement = self._make_measurement()
        self.servo_faults: NDArray[np.int8] | None = None
        self._stuck = np.zeros((LEGS, JOINTS), dtype=bool)  # in the last macro-step
        self._stuck_at = np.zeros((LEGS, JOINTS))  # rad

    def _make_measurement(self) -> Measurement:
        views, begin = {}, 0
        for key, names in MEASURED.items():
            views[key] = self.outputs.values[begin : begin + len(names)]
            begin += len(names)
        self._force = views["foot_force"].reshape(LEGS, len(AXES))
        self._angle, self._speed = (views[key].reshape(LEGS, JOINTS) for key in ("angle", "speed"))
        self._torso = views["quaternion"], views["angular_velocity"]
        inner = self._inner
        return Measurement(
            angle=self._angle if inner is None else inner.angle,
            speed=self._speed if inner is None else inner.speed,
            foot_force=self._force if self._sensor is None else self._sensor.force,
            contact=self._contact if self._sensor is None else self._sensor.contact,
            quaternion=self._torso[0] if inner is None else inner.quaternion,
            angular_velocity=self._torso[1] if inner is None else inner.angular_velocity,
        )

    def read(self) -> None:
        """Reads the plant's outputs and updates the measurement."""
        self.outputs.get()
        self.flags.get()
        self._contact[...] = self._touching
        self._flag_row[...] = self.flags.values
        if self._sensor is not None:
            self._sensor.read(self._force, self._touching)
        if self._inner is not None:
            self._inner.read(self._angle, self._speed, *self._torso)

    def write(self, command: JointCommand) -> None:
        """Writes a joint command and the present push to the plant's inputs."""
        self._angle_ref[...] = command.angle_ref
        self._speed_ref[...] = command.speed_ref
        self._torque_ref[...] = command.torque_ref
        self._acceleration_ref[...] = command.acceleration_ref
        self.hold()

    def hold(self) -> None:
        """Writes the last joint command again, and the present push."""
        if self.servo_faults is not None:
            self._break_servos(self.servo_faults)
        self.inputs.set()

    def _break_servos(self, fault: NDArray[np.int8]) -> None:
        """Replaces the commands of servos with faults. Servos know the true angles."""
        dead, stuck = fault == DEAD, fault == STUCK
        angle, broken = self._angle, dead | stuck
        begun = stuck & ~self._stuck
        self._stuck, self._stuck_at[begun] = stuck, angle[begun]
        self._angle_ref[stuck] = self._stuck_at[stuck]
        self._speed_ref[stuck] = 0.0
        self._angle_ref[dead] = angle[dead]
        self._speed_ref[dead] = self._speed[dead]
        self._torque_ref[broken] = 0.0
        self._acceleration_ref[:, broken] = 0.0


def _move_first(names: Sequence[str], among: Sequence[str]) -> list[str]:
    """Returns all names `among`, with `names` moved to the front."""
    return [*names, *(name for name in among if name not in set(names))]


def check_plant_variables(
    outputs: Sequence[str], inputs: Sequence[str], flags: Sequence[str]
) -> None:
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
