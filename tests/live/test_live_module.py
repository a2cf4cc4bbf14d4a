"""The robot as WebAssembly: the plant has the bits of the native one, and the robot walks."""

from __future__ import annotations

import ctypes as ct
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest
from mirror import HxOutput
from numpy.typing import NDArray

from hexapod_cosim.cosim.run.single_run import simulate
from hexapod_cosim.cosim.scenario.scenario import load_scenario
from hexapod_cosim.extensions.live.module import walker_module

wasmtime = pytest.importorskip("wasmtime")

LEGS, JOINTS = ("LF", "LM", "LR", "RF", "RM", "RR"), ("coxa", "femur", "tibia")
COMMANDS = ("angle_ref", "speed_ref", "torque_ref")  # the first 54 numbers of hxInput
OUTPUT = 5384  # bytes of hxOutput, all of which are compared
TRIPOD = (1.0, 0.75, 0.5, 0.03, 0.0)  # pattern, period, duty, step height, touch-down speed
AMBLE = (4.0, 1.125, 2 / 3, 0.03, 0.0)
KINEMATIC, COMPLIANT, PAPER = 1.0, 2.0, 3.0


class Module:
    """An instance of the module, whose functions take and return numbers."""

    def __init__(self) -> None:
        engine = wasmtime.Engine()
        self.store = wasmtime.Store(engine)
        instance = wasmtime.Instance(self.store, wasmtime.Module(engine, walker_module()), [])
        self.exports = instance.exports(self.store)
        self.call("_initialize")

    def call(self, name: str, *arguments: float) -> float:
        found: float = self.exports[name](self.store, *arguments)
        return found

    def read(self, place: float, size: int) -> bytes:
        return bytes(self.exports["memory"].read(self.store, int(place), int(place) + size))

    def write(self, place: float, data: bytes) -> None:
        self.exports["memory"].write(self.store, data, int(place))

    def start(self, control: float, gait: tuple[float, ...] = TRIPOD) -> None:
        self.write(self.call("hx_walker_wanted"), np.array([control, *gait]).tobytes())
        assert self.call("hx_walker_start", 0.7) == 0

    def position(self) -> NDArray[np.float64]:
        """Returns the torso's centre of mass [m], which follows the time in hxFrame."""
        return np.frombuffer(self.read(self.call("hx_walker_frame"), 32)[8:])


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
    module.start(KINEMATIC)
    different = 0
    assert ct.sizeof(HxOutput) == OUTPUT
    assert commands.shape == (300, 54)
    for step, row in enumerate(commands, start=1):
        ct.memmove(given, row.tobytes(), row.nbytes)
        module.write(module.call("hx_walker_input"), row.tobytes())
        assert core.hx_plant_step(plant, given, 0.005 * step) == 0
        core.hx_plant_output(plant, given, seen)
        place = module.call("hx_walker_replay", 0.005 * step)
        different += module.read(place, OUTPUT) != seen.raw[:OUTPUT]
    core.hx_plant_destroy(plant)
    assert different == 0
    assert np.linalg.norm(module.position()[:2]) > 0.05


@pytest.mark.parametrize("control", [KINEMATIC, COMPLIANT])
def test_the_robot_walks_as_fast_as_it_is_told(module: Module, control: float) -> None:
    module.start(control)
    module.call("hx_walker_command", 0.08, 0.0, 0.0, 0.0)
    assert module.call("hx_walker_advance", 1000) == 0
    assert module.position()[0] == pytest.approx(0.37, abs=0.03)  # it begins after half a cycle


FRAME = 8 * (1 + 3 + 4 + 3 + 3 + 18 + 6 + 18 + 6 + 1 + 1)  # bytes of hxFrame; `changing` is last


def change(module: Module, *walk: float) -> None:
    module.write(module.call("hx_walker_wanted"), np.array(walk).tobytes())
    assert module.call("hx_walker_change") == 0


def changing(module: Module) -> float:
    frame = module.read(module.call("hx_walker_frame"), FRAME)
    return float(np.frombuffer(frame)[-1])


def angles_of(module: Module) -> NDArray[np.float64]:
    """Returns the joint commands (18,) [rad], with which hxInput begins."""
    return np.frombuffer(module.read(module.call("hx_walker_input"), 8 * 18))


@pytest.mark.parametrize(("first", "then"), list(permutations((KINEMATIC, COMPLIANT, PAPER), 2)))
@pytest.mark.parametrize("gait", [TRIPOD, AMBLE], ids=["tripod", "amble"])
def test_the_control_changes_while_the_robot_walks(
    module: Module, first: float, then: float, gait: tuple[float, ...]
) -> None:
    for step in (380, 440, 500):
        module.start(first, gait)
        module.call("hx_walker_command", 0.08, 0.0, 0.0, 0.0)
        module.call("hx_walker_advance", step)
        angles, places = [angles_of(module)], [module.position()]
        change(module, then, *gait)
        for _ in range(300):
            assert module.call("hx_walker_advance", 1) == 0
            assert changing(module) == 0.0
            angles.append(angles_of(module))
            places.append(module.position())
        # rad    in a macro-step: walks at this speed need up to 0.021, compliant control adds up to
        # 0.004 when it lifts a foot that meets the ground early, and the paper's up to 0.018 when a
        # foot takes up its load
        assert np.abs(np.diff(angles, axis=0)).max() < (0.04 if PAPER in (first, then) else 0.03)
        ways = np.array(places)[50:, 0] - np.array(places)[:-50, 0]
        assert ways.min() > 0.5 * 0.25 * 0.08  # m    in a quarter of a second: it never stops
        assert np.array(places)[:, 2].min() > 0.12


def test_the_control_changes_during_a_change_of_gait(module: Module) -> None:
    module.start(KINEMATIC)
    module.call("hx_walker_command", 0.03, 0.0, 0.0, 0.0)
    module.call("hx_walker_advance", 400)
    change(module, KINEMATIC, *AMBLE)
    module.call("hx_walker_advance", 20)
    change(module, COMPLIANT, *AMBLE)
    for _ in range(5):  # the stages of the gait's change go on
        assert changing(module) == 1.0
        assert module.call("hx_walker_advance", 10) == 0
    assert module.call("hx_walker_advance", 600) == 0
    assert changing(module) == 0.0
    assert module.position()[0] > 0.06


@pytest.mark.parametrize("control", [KINEMATIC, COMPLIANT])
def test_the_gait_changes_while_the_robot_walks(module: Module, control: float) -> None:
    module.start(control)
    module.call("hx_walker_command", 0.04, 0.0, 0.0, 0.0)
    module.call("hx_walker_advance", 400)
    change(module, control, *AMBLE)
    stages, places = [], [module.position()[0]]
    for _ in range(500):
        assert module.call("hx_walker_advance", 1) == 0
        stages.append(changing(module))
        places.append(module.position()[0])
    # a swing of 0.375 s in the old gait, then a swing and a period of 1.125 s of the new one
    assert [stages.count(stage) for stage in (1.0, 2.0)] == [75, 300]
    assert stages[-1] == 0.0
    speeds = (np.array(places)[50:] - np.array(places)[:-50]) / 0.25
    assert speeds.min() > 0.03


def test_a_start_that_is_no_walk_says_why(module: Module) -> None:
    module.write(
        module.call("hx_walker_wanted"), np.array([KINEMATIC, 1.0, 0.75, 7.0, 0.03, 0.0]).tobytes()
    )
    assert module.call("hx_walker_start", 0.7) != 0
    text = module.read(module.call("hx_walker_message"), 200).partition(b"\0")[0].decode()
    assert "duty" in text
