"""The robot as WebAssembly: the plant has the bits of the native one, and the robot walks."""

from __future__ import annotations

import ctypes as ct
from pathlib import Path

import numpy as np
import pytest
from mirror import HxOutput
from numpy.typing import NDArray

from hexapod_cosim.cosim.run.single_run import simulate
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.extensions.live.static_page import robot_module

wasmtime = pytest.importorskip("wasmtime")

LEGS, JOINTS = ("LF", "LM", "LR", "RF", "RM", "RR"), ("coxa", "femur", "tibia")
COMMANDS = ("angle_ref", "speed_ref", "torque_ref")  # the first 54 numbers of hxInput
OUTPUT = 5104  # bytes of hxOutput, all of which are compared
TRIPOD = (1, 0.75, 0.5, 0.03, 0.0)  # pattern, period, duty, step height, touch-down speed
AMBLE = (4, 1.125, 2 / 3, 0.03, 0.0)
KINEMATIC, COMPLIANT, PAPER = 1, 2, 3


class Module:
    """An instance of the module, whose functions take and return numbers."""

    def __init__(self) -> None:
        engine = wasmtime.Engine()
        self.store = wasmtime.Store(engine)
        instance = wasmtime.Instance(self.store, wasmtime.Module(engine, robot_module()), [])
        self.exports = instance.exports(self.store)
        self.exports["_initialize"](self.store)
        assert self.call("create") == 0

    def call(self, name: str, *arguments: float) -> int:
        found: int = self.exports[f"hx_page_{name}"](self.store, *arguments)
        return found

    def read(self, place: int, size: int) -> bytes:
        return bytes(self.exports["memory"].read(self.store, place, place + size))

    def write(self, place: int, data: bytes) -> None:
        self.exports["memory"].write(self.store, data, place)

    def start(self, control: int, gait: tuple[float, ...] = TRIPOD, speed: float = 0.08) -> None:
        assert self.call("gait", *gait) == 0
        assert self.call("start", control, 0.7) == 0
        self.speed = speed

    def advance(self, steps: int) -> None:
        assert self.call("advance", steps, self.speed, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0) == 0

    def plant(self, name: str, *arguments: float) -> int:
        """Calls a function of the plant."""
        found: int = self.exports[f"hx_{name}"](self.store, *arguments)
        return found

    def more_memory(self) -> int:
        """Returns the address of 64 kB that nobody uses."""
        pages: int = self.exports["memory"].grow(self.store, 1)
        return pages * 65536

    def values(self) -> NDArray[np.float64]:
        """The row of values of the page (extensions/live/viewer/local.ts)."""
        return np.frombuffer(self.read(self.call("values"), 8 * 152))

    def position(self) -> NDArray[np.float64]:
        """Returns the torso's centre of mass [m]."""
        return self.values()[79:82]

    def walk(self, steps: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Returns joint commands (steps, 18) [rad] and the torso's positions (steps, 3) [m]."""
        angles, places = [], []
        for _ in range(steps):
            self.advance(1)
            angles.append(self.values()[95:113])
            places.append(self.position())
        return np.array(angles), np.array(places)


@pytest.fixture(scope="module")
def module() -> Module:
    return Module()


@pytest.fixture(scope="module")
def commands(athena_fmu: Path) -> NDArray[np.float64]:
    """Joint commands (300, 54) of a recorded walk of 1.5 s under compliant control."""
    scenario = load_scenario("walk_flat", overrides=["duration=1.5", "control=compliant"])
    recording = simulate(scenario, fmu=athena_fmu).recording
    names = [f"{leg}.{joint}.{name}" for name in COMMANDS for leg in LEGS for joint in JOINTS]
    return np.ascontiguousarray(recording.columns(names)[:-1])


def test_the_plant_has_the_bits_of_the_native_one(
    module: Module, core: ct.CDLL, commands: NDArray[np.float64]
) -> None:
    core = ct.CDLL(core._name)  # types of arguments of its own
    core.hx_plant_create.restype = ct.c_void_p
    core.hx_plant_reset.argtypes = [ct.c_void_p, ct.c_void_p, ct.c_double]
    core.hx_plant_step.argtypes = [ct.c_void_p, ct.c_void_p, ct.c_double]
    core.hx_plant_output.argtypes = [ct.c_void_p, ct.c_void_p, ct.c_void_p]
    core.hx_plant_destroy.argtypes = [ct.c_void_p]
    definition, given, seen = (ct.create_string_buffer(size) for size in (20000, 4000, 20000))
    core.hx_definition_default(definition)
    core.hx_input_default(given)
    plant = core.hx_plant_create()
    assert core.hx_plant_reset(plant, definition, 0.0) == 0
    ours, space = module.plant("plant_create"), module.more_memory()
    at_definition, at_input, at_output = space, space + 20000, space + 24000
    module.plant("definition_default", at_definition)
    module.plant("input_default", at_input)
    assert module.plant("plant_reset", ours, at_definition, 0.0) == 0
    different = 0
    assert ct.sizeof(HxOutput) == OUTPUT
    assert commands.shape == (300, 54)
    for step, row in enumerate(commands, start=1):
        ct.memmove(given, row.tobytes(), row.nbytes)
        module.write(at_input, row.tobytes())
        assert module.plant("plant_step", ours, at_input, 0.005 * step) == 0
        module.plant("plant_output", ours, at_input, at_output)
        assert core.hx_plant_step(plant, given, 0.005 * step) == 0
        core.hx_plant_output(plant, given, seen)
        different += module.read(at_output, OUTPUT) != seen.raw[:OUTPUT]
    core.hx_plant_destroy(plant)
    assert different == 0


@pytest.mark.parametrize("control", [KINEMATIC, COMPLIANT])
def test_the_robot_walks_as_fast_as_it_is_commanded(module: Module, control: int) -> None:
    module.start(control)
    module.advance(1000)
    assert module.position()[0] == pytest.approx(0.37, abs=0.03)  # it begins after half a cycle


@pytest.mark.parametrize(
    ("first", "then"), [(KINEMATIC, COMPLIANT), (COMPLIANT, PAPER), (PAPER, KINEMATIC)]
)
def test_the_control_changes_while_the_robot_walks(module: Module, first: int, then: int) -> None:
    module.start(first, AMBLE)
    module.advance(440)
    assert module.call("control", then) == 0
    angles, places = module.walk(300)
    # rad    in a macro-step: walks at this speed need up to 0.021, and the paper's control adds up
    # to 0.018 when a foot takes up its load
    assert np.abs(np.diff(angles, axis=0)).max() < 0.04
    ways = places[50:, 0] - places[:-50, 0]
    assert ways.min() > 0.5 * 0.25 * 0.08  # m    in a quarter of a second: it never stops


def test_gait_and_friction_change_while_the_robot_walks(module: Module) -> None:
    module.start(KINEMATIC, speed=0.04)
    module.advance(400)
    assert module.call("gait", *AMBLE) == 0
    assert module.call("friction", 0.4) == 0
    _, places = module.walk(500)
    assert (places[50:, 0] - places[:-50, 0]).min() > 0.03 * 0.25


def test_a_gait_that_is_no_walk_is_refused(module: Module) -> None:
    assert module.call("gait", 1, 0.75, 7.0, 0.03, 0.0) != 0
