"""The FMUs as WebAssembly components, after the draft fmi-ls-wasm: run in wasmtime."""

from __future__ import annotations

import zipfile
from dataclasses import replace
from functools import cache
from importlib import util
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
import wasmtime
from command import Call
from numpy.typing import NDArray
from wasmtime import component as model

from hexapod_cosim.controller import make_gait
from hexapod_cosim.cosim.export import wit
from hexapod_cosim.cosim.export.controller_export import export_controller
from hexapod_cosim.cosim.export.plant_export import export_fmu
from hexapod_cosim.cosim.export.platforms import choose_platforms
from hexapod_cosim.cosim.export.wasm_component import resource_module
from hexapod_cosim.cosim.interface.controller_interface import ControllerSetup
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.run.single_run import simulate
from hexapod_cosim.cosim.scenario.scenario import load_scenario
from hexapod_cosim.models import FmuError, load_robot
from hexapod_cosim.models.ground.table import read_terrain

STEP = 0.005  # s
OUTPUTS = 619  # Reals of the plant
# rad  of joint angles; each derivative is a difference over one step
ROUND_OFF = 1e-14
MEMORY = 2_500_000  # bytes that a component may have


@cache
def compiled_component(fmu: Path) -> tuple[Any, wasmtime.Engine, model.Component]:
    """Returns an FMU's description and its component, compiled once."""
    description, engine = fmpy.read_model_description(str(fmu)), wasmtime.Engine()
    name = f"binaries/wasm32-wasip2/{description.coSimulation.modelIdentifier}.wasm"
    with zipfile.ZipFile(fmu) as archive:
        return description, engine, model.Component(engine, archive.read(name))


class Component:
    """An instance of the co-simulation FMU in a component, with what it has logged."""

    def __init__(self, fmu: Path, *, token: str | None = None) -> None:
        description, engine, compiled = compiled_component(fmu)
        self.logged: list[tuple[str, str, str, str]] = []
        self.store = wasmtime.Store(engine)
        self.store.set_limits(memory_size=MEMORY)
        linker = model.Linker(engine)
        with linker.root() as root, root.add_instance(wit.CALLBACKS) as callbacks:
            callbacks.add_func(wit.LOG_MESSAGE, lambda _, *words: self.logged.append(words))
        self.made = linker.instantiate(self.store, compiled)
        self.functions: dict[str, Any] = {}
        self.instance = self.call(
            "[static]co-simulation-instance.instantiate-co-simulation",
            "robot",
            description.guid if token is None else token,
            "",
            False,
            True,
            False,
            False,
            [],
        )

    def call(self, name: str, *arguments: object, interface: str = wit.CO_SIMULATION) -> Any:
        """Calls an exported function and frees what it returned."""
        found = self.functions.get(name)
        if found is None:
            where = self.made.get_export_index(self.store, interface)
            place = self.made.get_export_index(self.store, name, where)
            assert place is not None, name
            found = self.made.get_func(self.store, place)
            assert found is not None, name
            self.functions[name] = found
        result = found(self.store, *arguments)
        found.post_return(self.store)
        return result

    def do(self, name: str, *arguments: object) -> Any:
        """Calls a method of the instance."""
        return self.call(f"[method]co-simulation-instance.{name}", self.instance, *arguments)

    def start(self) -> None:
        """Initializes the instance at 0 s."""
        assert self.do("enter-initialization-mode", None, 0.0, None) == "ok"
        assert self.do("exit-initialization-mode") == "ok"


def references(fmu: Path, causality: str) -> list[int]:
    """Returns the value references of the FMU's Float64 variables of a causality."""
    return [
        one.valueReference
        for one in fmpy.read_model_description(str(fmu)).modelVariables
        if one.causality == causality and one.type == "Float64"
    ]


@pytest.fixture(scope="module")
def plant(plant_build: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("component")
    return export_fmu(load_robot("athena"), folder / "a.fmu", fmi=3, platforms=["wasm"])


@pytest.fixture(scope="module")
def component(plant: Path) -> Component:
    return Component(plant)


def real_names(fmu: Fmu, causality: str) -> list[str]:
    """Returns the names of an FMI 2 FMU's Real variables of a causality."""
    return [
        one.name
        for one in fmu.description.modelVariables
        if one.causality == causality and one.type == "Real"
    ]


def reals(fmu: Fmu, causality: str) -> NDArray[np.float64]:
    """Returns the values of these variables."""
    block = fmu.block(real_names(fmu, causality))
    block.get()
    return block.values.copy()


def walk_of(fmu: Path) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns inputs and outputs of an FMI 2 FMU at each of the 300 steps of the platform test."""
    inputs: list[NDArray[np.float64]] = []
    outputs: list[NDArray[np.float64]] = []
    step = Fmu.step

    def recorded(plant: Fmu, t: float, h: float) -> None:
        inputs.append(reals(plant, "input"))
        step(plant, t, h)
        outputs.append(reals(plant, "output"))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Fmu, "step", recorded)
        scenario = load_scenario("walk_flat")
        simulate(replace(scenario, control="kinematic", duration=300 * STEP), fmu=fmu)
    return np.array(inputs), np.array(outputs)


def test_the_plant_has_the_bits_of_the_native_one_over_a_walk(
    plant: Path, component: Component, athena_fmu: Path
) -> None:
    inputs, outputs = walk_of(athena_fmu)
    given, seen = references(plant, "input"), references(plant, "output")
    assert component.instance is not None
    component.start()
    found = []
    for number, row in enumerate(inputs):
        assert component.do("set-float64", given, row.tolist()) == "ok"
        result = component.do("do-step", number * STEP, STEP, True)
        assert getattr(result, "last-successful-time") == number * STEP + STEP
        found.append(component.do("get-float64", seen))
    assert outputs.shape == (300, OUTPUTS)
    page = Path(__file__).parents[2] / "docs/platforms.md"
    assert f"300 steps with {OUTPUTS} real outputs" in page.read_text(encoding="utf-8")
    assert np.array_equal(np.array(found).view(np.int64), outputs.view(np.int64))
    assert np.ptp(outputs, axis=0).max() > 0.1


def test_a_state_that_was_saved_is_restored_to_the_bit(plant: Path) -> None:
    component, seen = Component(plant), references(plant, "output")
    component.start()
    component.do("do-step", 0.0, STEP, True)
    state = component.do("get-fmu-state")
    ends = []
    for _ in range(2):
        component.do("do-step", STEP, STEP, True)
        ends.append(component.do("get-float64", seen))
        assert component.do("set-fmu-state", state) == "ok"
    assert ends[0] == ends[1]
    assert component.do("set-fmu-state", state[:-1]) == "error"
    assert component.do("get-float64", [0]) != []


def test_grids_of_the_ground_are_in_the_component(plant_build: Path, tmp_path: Path) -> None:
    robot = replace(
        load_robot("athena"),
        terrain=read_terrain({"kind": "wave", "platform_size": 0.0}, "wave"),
    )
    native = export_fmu(robot, tmp_path / "native.fmu")
    packed = export_fmu(robot, tmp_path / "packed.fmu", fmi=3, platforms=["wasm"])
    component = Component(packed)
    component.start()
    with Fmu(native, name="native") as fmu:
        fmu.initialise(0.0, 1.0)
        for number in range(10):
            fmu.step(number * STEP, STEP)
            component.do("do-step", number * STEP, STEP, True)
        expected = reals(fmu, "output")
    assert component.do("get-float64", references(packed, "output")) == expected.tolist()


def test_the_controller_gives_the_commands_of_the_native_one(
    plant_build: Path, tmp_path: Path
) -> None:
    robot = load_robot("athena")
    setup = ControllerSetup(robot=robot, gait=make_gait(robot), period=STEP, gains=None)
    native = export_controller(setup, tmp_path / "native.fmu")
    packed = export_controller(setup, tmp_path / "packed.fmu", fmi=3, platforms=["wasm"])
    component, seen = Component(packed), references(packed, "output")
    component.start()
    with Fmu(native, name="native") as fmu:
        fmu.initialise(0.0, 1.0)
        command = fmu.block(["command.vx"])
        command.values[:] = 0.08
        command.set()
        description = fmpy.read_model_description(str(packed))
        (forward,) = (one for one in description.modelVariables if one.name == "command.vx")
        assert component.do("set-float64", [forward.valueReference], [0.08]) == "ok"
        found, expected = [], []
        for number in range(200):
            fmu.step(number * STEP, STEP)
            component.do("do-step", number * STEP, STEP, True)
            found.append(component.do("get-float64", seen))
            expected.append(reals(fmu, "output"))
        names = real_names(fmu, "output")
    error = np.abs(np.array(found) - expected).max(axis=0)
    for order, quantity in enumerate(("angle_ref", "speed_ref", "acceleration_ref")):
        chosen = [name.endswith(f".{quantity}") for name in names]
        assert sum(chosen) == 18
        assert error[chosen].max() < ROUND_OFF / STEP**order
    assert np.ptp(expected, axis=0).max() > 0.1


def test_every_function_of_the_draft_is_exported_with_its_type(component: Component) -> None:
    for one in wit.FUNCTIONS:
        where = component.made.get_export_index(component.store, wit.CO_SIMULATION)
        assert component.made.get_export_index(component.store, one.exported, where), one.name
    assert len(wit.FUNCTIONS) == 57
    assert component.call("get-version", interface=wit.COMMON) == "3.0"


def test_what_is_refused_is_logged_with_what_was_expected(plant: Path) -> None:
    component = Component(plant, token="other")
    assert component.instance is None
    ((name, status, category, text),) = component.logged
    assert (name, status, category) == ("robot", "error", "logStatusError")
    assert "GUID: got 'other'" in text
    component = Component(plant)
    component.logged.clear()
    for refused in (
        component.do("get-float32", [0]),
        component.do("set-string", [0], ["walk"]),
        component.do("set-input-derivatives", [(0, 1)], [1.0]),
        component.do("get-clock", [0]),
        component.do("do-step", 0.0, STEP, True),
        component.do("get-adjoint-derivative", [0], [1], [1.0]),
        component.do("enter-configuration-mode"),
    ):
        assert refused == "error"
    assert len(component.logged) == 7
    said = [text for *_, text in component.logged]
    assert "fmi3DoStep: got a call before initialization mode" in said.pop(4)
    assert all("expected none" in text for text in said)
    assert component.do("get-float32", []) == []


def test_calls_leave_no_memory_behind(plant: Path) -> None:
    component = Component(plant)
    component.start()
    component.do("set-debug-logging", False, ["logEvents", "logStatusError"])
    state = component.do("get-fmu-state")
    for _ in range(20):  # 2 MB of states, 4 MB of texts, and 1.5 MB are left at first
        component.do("set-fmu-state", state)
        component.do("get-fmu-state")
        component.do("set-string", [0], ["x" * 100_000])
        component.do("set-debug-logging", False, ["y" * 100_000])
    component.instance.drop(component.store)


def test_the_fmu_is_valid_and_names_the_draft(call: Call, plant: Path, tmp_path: Path) -> None:
    code, out, err = call("validate", plant)
    assert (code, err) == (0, ""), out
    with zipfile.ZipFile(plant) as archive:
        names = archive.namelist()
    assert "extra/org.modelica.fmi-ls-wasm/manifest.xml" in names
    assert [name for name in names if name.startswith("binaries/")] == [
        "binaries/wasm32-wasip2/hexapod.wasm"
    ]


def test_without_the_assembler_the_error_says_how_to_get_it(
    call: Call, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    found = util.find_spec
    monkeypatch.setattr(util, "find_spec", lambda name: None if name == "wasmtime" else found(name))
    options = ("export", "--fmi", "3", "--platforms", "wasm", "-o", tmp_path / "a.fmu")
    code, _, err = call(*options)
    assert code != 0
    assert "no assembler of WebAssembly components: got 'no package wasmtime'" in err
    assert "[platforms]" in err
    assert not list(tmp_path.iterdir())


def test_webassembly_is_refused_in_fmi_2_and_is_not_among_all_platforms(
    call: Call, tmp_path: Path
) -> None:
    code, _, err = call("export", "--platforms", "wasm", "-o", tmp_path / "a.fmu")
    assert code != 0
    assert "add --fmi 3" in err
    assert not list(tmp_path.iterdir())
    assert "wasm32-wasip2" not in choose_platforms("all", fmi=3)
    assert choose_platforms(["wasm"], fmi=3) == choose_platforms(["wasm32-wasip2"], fmi=3)
    with pytest.raises(FmuError, match="contradicting"):
        choose_platforms(["wasm", "sources"], fmi=3)


def test_a_module_of_resources_fills_the_block_that_it_asks_for() -> None:
    engine = wasmtime.Engine()
    store, files = wasmtime.Store(engine), {"b": bytes(range(200)), "a/c.txt": b"walk"}
    memory = wasmtime.Memory(store, wasmtime.MemoryType(wasmtime.Limits(1, None)))
    sizes: list[int] = []
    number = wasmtime.ValType.i32()
    start = wasmtime.Func(store, wasmtime.FuncType([], []), lambda: None)

    def allocate(size: int) -> int:
        sizes.append(size)
        return 64

    block = wasmtime.Func(store, wasmtime.FuncType([number], [number]), allocate)
    module = wasmtime.Module(engine, resource_module(files))
    wasmtime.Instance(store, module, [memory, start, block])
    expected = b"a/c.txt\0\x04\0\0\0walk" + b"b\0\xc8\0\0\0" + bytes(range(200))
    assert sizes == [len(expected)]
    assert bytes(memory.read(store, 64, 64 + len(expected))) == expected
