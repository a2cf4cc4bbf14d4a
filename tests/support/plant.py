"""Calls the C plant from Python: instances, definitions of robots, and internal functions through
the probe.
"""

from __future__ import annotations

import ctypes as ct
from collections.abc import Iterable
from types import SimpleNamespace
from typing import Any

import numpy as np
from mirror import (
    BODIES,
    BODY_STATE,
    HEADER,
    JOINTS,
    LEGS,
    MULTIPLIERS,
    OK,
    Doubles,
    HxCoordinates,
    HxDefinition,
    HxInput,
    HxOutput,
    Real,
)

from hexapod_cosim.models import (
    BODY_CONTACTS,
    CONTACT_LAWS,
    FRICTION_LAWS,
    METHODS,
    PROJECTIONS,
    SELF_CONTACTS,
    SERVO_DRIVES,
    SERVO_MODES,
    SOIL_LAWS,
    TERRAINS,
    Leg,
    Link,
    Robot,
)
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.dynamics import Accelerations, Command


class PlantError(Exception):
    """A call failed: its status and message."""

    def __init__(self, status: int, message: str) -> None:
        super().__init__(message)
        self.status = status


def bound(core: ct.CDLL) -> ct.CDLL:
    """Declares the types of the library's functions; may be called repeatedly."""
    return HEADER.bind(core)


def pointer(array: Array) -> Any:
    """Returns a double * to a contiguous array, which must outlive its use."""
    return array.ctypes.data_as(Doubles)


def passed(argument: Any) -> Any:
    """Converts an argument of a probe function to C."""
    if isinstance(argument, np.ndarray):
        return pointer(np.ascontiguousarray(argument))
    if isinstance(argument, ct.Structure):
        return ct.byref(argument)
    if isinstance(argument, Plant):
        return ct.c_void_p(argument.handle)
    return Real(argument) if isinstance(argument, float) else argument


def probed(function: Any, *arguments: Any, size: int) -> Array:
    """Calls a probe function and returns the `size` doubles that it writes to its last argument."""
    out = np.full(size, np.nan)
    function(*map(passed, arguments), pointer(out))
    return out


def asked(function: Any, *arguments: Any) -> float:
    """Calls a probe function and returns its double."""
    function.restype = Real
    return float(function(*map(passed, arguments)))


def put(target: Any, values: Any) -> None:
    """Copies nested numbers into a ctypes array of the same shape."""
    for index, value in enumerate(values):
        if isinstance(value, Iterable):
            put(target[index], value)
        else:
            target[index] = value


def flat(record: Any) -> Array:
    """Returns a copy of a structure of doubles as an array."""
    return np.frombuffer(bytes(record))


def seen(value: Any) -> Any:
    """Returns a copy of a structure as a namespace, with arrays as numpy arrays."""
    if isinstance(value, ct.Structure):
        names = [field[0] for field in value._fields_]
        return SimpleNamespace(**{name: seen(getattr(value, name)) for name in names})
    return np.array(value) if isinstance(value, ct.Array) else value


def definition(robot: Robot, **initial: Any) -> Any:
    """Returns the HxDefinition of a robot, which need not be valid.

    initial: position, quaternion, velocity, angular_velocity, angle, speed. By default the robot is
    at rest in its stance, 1 m above the ground.
    """
    d: Any = HxDefinition()
    d.torso.mass = robot.torso.mass
    put(d.torso.com, robot.torso.com)
    put(d.torso.inertia, robot.torso.inertia)
    for target, leg in zip(d.leg, robot.legs, strict=True):
        _put_leg(target, leg)
    d.foot_radius, d.foot_pad_radius = robot.foot.radius, robot.foot.pad_radius
    _put_settings(d, robot)
    start = {
        "position": (0.0, 0.0, 1.0),
        "quaternion": (1.0, 0.0, 0.0, 0.0),
        "angle": robot.stance,
    } | initial
    for name, values in start.items():
        put(getattr(d.initial, name), values)
    return d


def _put_leg(target: Any, leg: Leg) -> None:
    put(target.hip_position, leg.hip_position)
    target.hip_yaw = leg.hip_yaw
    for place, link in zip(target.link, leg.links, strict=True):
        _put_link(place, link)


def _put_link(target: Any, link: Link) -> None:
    target.mass, target.length, target.offset_y, target.offset_z = (
        link.mass,
        link.length,
        link.offset_y,
        link.offset_z,
    )
    put(target.com, link.com)
    put(target.inertia, link.inertia)
    put(target.axis, link.axis)
    target.angle_min, target.angle_max = link.angle_min, link.angle_max


def _put_settings(d: Any, robot: Robot) -> None:
    d.contact.law = 1 + CONTACT_LAWS.index(robot.contact.law)
    d.friction.law = 1 + FRICTION_LAWS.index(robot.friction.law)
    d.servo.mode = 1 + SERVO_MODES.index(robot.servo.mode)
    d.servo.drive = 1 + SERVO_DRIVES.index(robot.servo.drive)
    d.solver.method = 1 + METHODS.index(robot.solver.method)
    d.solver.projection = 1 + PROJECTIONS.index(robot.solver.projection)
    d.terrain.kind = 1 + TERRAINS.index(robot.terrain.kind)
    d.soil.law = 1 + SOIL_LAWS.index(robot.soil.law)
    for section in (
        "contact",
        "friction",
        "servo",
        "baumgarte",
        "solver",
        "terrain",
        "soil",
        "body",
    ):
        target, source = getattr(d, section), getattr(robot, section)
        for name, kind in target._fields_:
            if kind is Real:
                setattr(target, name, getattr(source, name, 1.0))  # terrain.grid: the first
    d.body.contact = 1 + BODY_CONTACTS.index(robot.body.contact)
    d.body.self_contact = 1 + SELF_CONTACTS.index(robot.body.self_contact)
    for name in ("torso_box", "torso_centre"):
        put(getattr(d.body, name), getattr(robot.body, name))
    put(d.gravity, robot.gravity)


def inputs(command: Command, lock: Array | None = None) -> Any:
    """Returns the HxInput of a command and of locks (6, 3)."""
    i: Any = HxInput()
    for name in (
        "angle_ref",
        "speed_ref",
        "torque_ref",
        "push_force",
        "push_torque",
        "acceleration_ref",
    ):
        put(getattr(i, name), getattr(command, name))
    put(i.weakness, np.broadcast_to(1.0 - np.asarray(command.power.strength), (LEGS, JOINTS)))
    put(i.lock, np.zeros((LEGS, JOINTS)) if lock is None else lock)
    return i


class Plant:
    """A plant of a robot. Failed calls raise PlantError and leave the plant unchanged."""

    def __init__(self, core: ct.CDLL, robot: Robot, **initial: Any) -> None:
        self.core = bound(core)
        self.robot = robot
        self.handle = self.core.hx_plant_create()
        self.reset(definition(robot, **initial))

    def __del__(self) -> None:
        self.core.hx_plant_destroy(self.handle)

    def _check(self, status: int) -> None:
        if status != OK:
            raise PlantError(status, self.message)

    @property
    def message(self) -> str:
        """The message of the last failure."""
        return bytes(self.core.hx_plant_message(self.handle)).decode()

    @property
    def time(self) -> float:
        """The present time [s]."""
        return float(self.core.hx_plant_time(self.handle))

    def reset(self, start: Any, t: float = 0.0) -> None:
        """Resets the plant with an HxDefinition."""
        self._check(self.core.hx_plant_reset(self.handle, start, t))

    def hold(self) -> Command:
        """Returns the command that holds the stance."""
        return Command(angle_ref=self.robot.stance)

    def step(self, t_end: float, command: Command | None = None, lock: Array | None = None) -> None:
        """Steps to t_end [s] under a command, by default that of the stance, and locks (6, 3)."""
        given = inputs(command or self.hold(), lock)
        self._check(self.core.hx_plant_step(self.handle, given, t_end))

    def step_ramp(self, t_end: float, command: Command, rate: Command) -> None:
        """Steps to t_end [s] under a command that changes at a rate [1/s]."""
        self._check(self.core.hx_plant_step_ramp(self.handle, inputs(command), inputs(rate), t_end))

    def step_to_event(self, t_end: float, command: Command, *, stop: bool = True) -> bool:
        """Steps to t_end [s], with `stop` to the next event at most; returns whether there was an
        event.
        """
        event = ct.c_int()
        self._check(
            self.core.hx_plant_step_to_event(
                self.handle, inputs(command), t_end, stop, ct.byref(event)
            )
        )
        return bool(event.value)

    def output_record(self, command: Command | None = None) -> Any:
        """Returns the HxOutput of the present state under a command."""
        result = HxOutput()
        self.core.hx_plant_output(self.handle, inputs(command or self.hold()), result)
        return result

    def output(self, command: Command | None = None) -> Any:
        """Returns the output as a namespace of floats and arrays."""
        return seen(self.output_record(command))

    def save(self) -> bytes:
        """Returns the plant's state as bytes."""
        buffer = ct.create_string_buffer(self.core.hx_plant_state_size())
        self.core.hx_plant_get_state(self.handle, buffer)
        return buffer.raw

    def restore(self, saved: bytes) -> None:
        """Restores a state returned by save()."""
        self._check(self.core.hx_plant_set_state(self.handle, saved, len(saved)))

    @property
    def bodies(self) -> Array:
        """Returns the bodies, shape (19, 13)."""
        body = np.zeros((BODIES, BODY_STATE))
        self.core.hx_plant_get_bodies(self.handle, pointer(body))
        return body

    @bodies.setter
    def bodies(self, body: Array) -> None:
        self._check(self.core.hx_plant_set_bodies(self.handle, pointer(np.ascontiguousarray(body))))

    @property
    def coordinates(self) -> Array:
        """Returns torso, angles, speeds, work and bristles, shape (70,)."""
        x = HxCoordinates()
        self.core.hx_plant_get_coordinates(self.handle, x)
        return flat(x)

    @coordinates.setter
    def coordinates(self, x: Array) -> None:
        self._check(
            self.core.hx_plant_set_coordinates(
                self.handle, self.time, HxCoordinates.from_buffer_copy(x.tobytes())
            )
        )

    def rates(self, command: Command | None = None) -> Array:
        """Returns the time derivatives of the coordinates under a command, shape (70,)."""
        dx = HxCoordinates()
        self.core.hx_plant_rates(self.handle, inputs(command or self.hold()), dx)
        return flat(dx)

    def rates_of_kernels(self, command: Command) -> dict[str, Array]:
        """Returns the rates of the bodies (19, 13) from every kernel of the build that runs on this
        machine, by the kernel's name.
        """
        self.core.hx_probe_kernel.restype = ct.c_char_p
        found = {}
        for index in range(8):
            rate = np.zeros((BODIES, BODY_STATE))
            asked = ct.c_void_p(self.handle), ct.byref(inputs(command)), pointer(rate)
            name = self.core.hx_probe_kernel(index, *asked)
            if name:
                found[name.decode()] = rate
        return found

    def rates_between(self, command: Command, dx: Array, h: float) -> Array:
        """Returns the derivative of the rates (70,) along a change of the coordinates (70,), by
        central differences of a step h. The plant is left at the last of their points.
        """
        x, sides = self.coordinates, []
        for sign in (1.0, -1.0):
            self.coordinates = x + sign * h * dx
            sides.append(self.rates(command))
        return np.asarray((sides[0] - sides[1]) / (2.0 * h))

    def tangent(self, command: Command, d_input: Array, dx: Array) -> tuple[Array, Any]:
        """Returns derivatives of the rates (70,) and of the HxOutput along a change of the input
        (60,) and of the coordinates (70,).
        """
        change, d_rate, d_output = (
            HxInput.from_buffer_copy(d_input.tobytes()),
            HxCoordinates(),
            HxOutput(),
        )
        moved = HxCoordinates.from_buffer_copy(dx.tobytes())
        self._check(
            self.core.hx_plant_tangent(
                self.handle, inputs(command), change, moved, d_rate, d_output
            )
        )
        return flat(d_rate), d_output

    def accelerations(self, command: Command | None = None) -> Accelerations:
        """Returns the accelerations of (eq. 1) at the present state.

        The plant does not output the gear torque, which stays 0.
        """
        dv, multipliers = np.zeros((BODIES, 6)), np.zeros((BODIES - 1, MULTIPLIERS))
        drive, gear = np.zeros((LEGS, JOINTS)), np.zeros((LEGS, JOINTS))
        places = [pointer(array) for array in (dv, multipliers, drive)]
        self.core.hx_plant_accelerations(self.handle, inputs(command or self.hold()), *places)
        return Accelerations(dv, multipliers, drive, gear)
