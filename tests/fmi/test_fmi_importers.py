"""Tests the behaviour of real importers that test_fmi.py and test_export.py do not cover: unusual
arguments, clocks and ends.
"""

from __future__ import annotations

import ctypes
import math
import shutil
from collections.abc import Callable
from pathlib import Path
from urllib.parse import quote

import fmpy
import pytest
from fmi_plant import ATHENA, ERROR, GUID, LAST_SUCCESSFUL_TIME, OK, WARNING, Callbacks, Plant
from memory import resident

from hexapod_cosim.cosim.export.start_values import start_values
from hexapod_cosim.cosim.interface.model_description import render_fmi2
from hexapod_cosim.cosim.interface.plant_interface import load_interface
from hexapod_cosim.models.robot import load_robot

H = 0.01  # s
TRUE = -1  # true as importers written in Basic or Fortran pass it
SETTABLE = {"Real": "fmi2SetReal", "Enumeration": "fmi2SetInteger", "Boolean": "fmi2SetBoolean"}


@pytest.fixture
def another(tmp_path: Path) -> tuple[str, Path]:
    """Returns GUID and resources of a robot that is not the compiled-in one."""
    interface = load_interface(load_robot("phantomx_mk4"))
    guid = render_fmi2(interface).guid
    folder = tmp_path / "größe 100% %41" / "resources"
    folder.mkdir(parents=True)
    (folder / "start_values.txt").write_text(start_values(interface, guid), encoding="utf-8")
    return guid, folder


def set_starts(plant: Plant) -> None:
    """Sets every variable with a start value to that value, type by type."""
    for kind, function in SETTABLE.items():
        variables = [
            variable
            for variable in ATHENA.variables
            if variable.start is not None and variable.type == kind
        ]
        if variables:
            references, values = (
                [variable.reference for variable in variables],
                [float(variable.start or 0) for variable in variables],
            )
            assert plant.set_references(function, references, values) == OK, plant.last_message


def time_of(plant: Plant) -> float:
    time = ctypes.c_double()
    assert plant.call("fmi2GetRealStatus", LAST_SUCCESSFUL_TIME, ctypes.byref(time)) == OK
    return time.value


@pytest.mark.parametrize(
    "form",
    [
        "file:////{path}",
        "file:////{path}/",
        "file:/{path}/",
        "file:///{quoted}/",
        "file://localhost/{quoted}",
    ],
)
def test_more_forms_of_the_resources_uri(
    plant_library: Path, another: tuple[str, Path], form: str
) -> None:
    guid, folder = another
    plain = folder.as_posix().removeprefix("/")
    with Plant(
        plant_library, guid=guid, resources=form.format(path=plain, quoted=quote(plain))
    ) as plant:
        assert plant.component, plant.messages


def test_library_and_resources_may_lie_in_read_only_folders_of_any_name(
    plant_library: Path, another: tuple[str, Path], read_only: Callable[[Path], None]
) -> None:
    guid, folder = another
    library = folder.parent / "binaries" / plant_library.name
    library.parent.mkdir()
    shutil.copy2(plant_library, library)
    read_only(folder.parent)
    with Plant(library, guid=guid, resources=folder.as_uri()) as plant:
        assert plant.initialize().step(0.0, H) == OK
    assert sorted(path.name for path in folder.iterdir()) == ["start_values.txt"]


def test_a_robot_with_other_numbers_does_not_run_without_its_resources(
    plant_library: Path, another: tuple[str, Path]
) -> None:
    with Plant(plant_library, guid=another[0], resources=None) as plant:
        assert plant.component is None
        assert "resources '(NULL)'" in plant.last_message


def test_callbacks_may_all_be_missing(plant_library: Path) -> None:
    library = ctypes.CDLL(str(plant_library))
    library.fmi2Instantiate.restype = ctypes.c_void_p
    instance = library.fmi2Instantiate(
        b"plant", 1, GUID.encode(), None, ctypes.byref(Callbacks()), 0, TRUE
    )
    assert instance
    assert (
        library.fmi2DoStep(ctypes.c_void_p(instance), ctypes.c_double(0.0), ctypes.c_double(H), 1)
        == ERROR
    )  # without a logger
    library.fmi2FreeInstance(ctypes.c_void_p(instance))


def test_the_callbacks_structure_need_not_outlive_the_instantiation(plant_library: Path) -> None:
    with Plant(plant_library) as plant:
        kept = ctypes.cast(plant._functions.logger, ctypes.c_void_p)
        ctypes.memset(ctypes.addressof(plant._functions), 0xFF, ctypes.sizeof(Callbacks))
        assert kept.value
        assert plant.step(0.0, H) == ERROR
        assert "fmi2DoStep" in plant.last_message


@pytest.mark.parametrize("name", ["x" * 10000, "größe", "%s%n"])
def test_instances_may_have_any_name(plant_library: Path, name: str) -> None:
    with Plant(plant_library, name=name) as plant:
        assert plant.initialize().step(0.0, H) == OK


def test_true_may_be_minus_one(plant_library: Path) -> None:
    with Plant(plant_library, logging=bool(TRUE)) as plant:
        assert plant.call("fmi2SetDebugLogging", TRUE, ctypes.c_size_t(0), None) == OK
        assert plant.call("fmi2SetupExperiment", TRUE, 1e-4, 0.0, TRUE, 1.0) == OK
        assert plant.call("fmi2EnterInitializationMode") == OK
        assert plant.call("fmi2ExitInitializationMode") == OK
        assert plant.call("fmi2DoStep", 0.0, 1.0, TRUE) == OK
        assert plant.step(1.0, 0.1) == ERROR  # the stop time was defined
        assert "stop time" in plant.last_message


def test_booleans_read_are_0_or_1(running: Plant) -> None:
    assert running.step(0.0, H) == OK
    contacts = ATHENA.references([name for name in ATHENA.by_name if name.endswith("foot.contact")])
    assert running.get_references("fmi2GetBoolean", contacts) == (OK, [1] * 6)


def test_initialisation_needs_no_set_up_experiment(plant: Plant) -> None:
    assert plant.call("fmi2EnterInitializationMode") == OK
    assert plant.call("fmi2ExitInitializationMode") == OK
    assert plant.step(0.0, H) == OK


def test_an_experiment_may_be_set_up_again(plant: Plant) -> None:
    assert plant.call("fmi2SetupExperiment", 0, 0.0, 5.0, 1, 6.0) == OK
    assert plant.initialize(start=2.0).step(2.0, H) == OK


@pytest.mark.parametrize("tolerance", [math.nan, math.inf, -math.inf, -1.0, 0.0, 1.0, 1e300])
def test_whatever_the_tolerance_the_results_are_the_same(
    plant: Plant, plant_library: Path, tolerance: float
) -> None:
    assert plant.call("fmi2SetupExperiment", TRUE, tolerance, 0.0, 0, 0.0) in (OK, WARNING)
    assert plant.call("fmi2EnterInitializationMode") == OK
    assert plant.call("fmi2ExitInitializationMode") == OK
    with Plant(plant_library) as other:
        assert other.initialize().step(0.0, H) == plant.step(0.0, H) == OK
        assert other.everything() == plant.everything()


def test_start_values_set_back_in_either_mode_change_nothing(
    plant: Plant, plant_library: Path
) -> None:
    set_starts(plant)
    assert plant.call("fmi2SetupExperiment", 0, 0.0, 0.0, 0, 0.0) == OK
    set_starts(plant)
    assert plant.call("fmi2EnterInitializationMode") == OK
    set_starts(plant)
    assert plant.everything()
    set_starts(plant)
    assert plant.call("fmi2ExitInitializationMode") == OK
    with Plant(plant_library) as other:
        other.initialize()
        assert plant.everything() == other.everything()
        assert plant.step(0.0, H) == other.step(0.0, H) == OK
        assert plant.everything() == other.everything()


def test_what_was_read_in_one_instance_can_be_set_in_another(
    running: Plant, plant_library: Path
) -> None:
    """Importers keep start values as double or text; values survive the conversion bit for bit."""
    names = [
        variable.name
        for variable in ATHENA.of_causality("input", "parameter")
        if variable.type == "Real"
    ]
    assert running.step(0.0, H) == OK
    values = [float(repr(value)) for value in running.reals(names)]
    with Plant(plant_library) as other:
        assert other.set_reals(dict(zip(names, values, strict=True))) == OK
        assert other.reals(names) == values


def test_outputs_read_in_initialisation_mode_are_those_of_the_first_communication_point(
    plant: Plant,
) -> None:
    assert plant.call("fmi2SetupExperiment", 0, 0.0, 0.0, 0, 0.0) == OK
    assert plant.call("fmi2EnterInitializationMode") == OK
    early = plant.everything()
    assert plant.call("fmi2ExitInitializationMode") == OK
    assert plant.everything() == early


def test_a_step_of_a_tenth_may_miss_its_last_bits(running: Plant) -> None:
    """The step is 0.3 - 0.2 = 0.09999999999999998, and the clock is at 0.30000000000000004."""
    for begin, size in (
        (0.0, 0.1),
        (0.1, 0.1),
        (0.2, 0.3 - 0.2),
        (0.1 + 0.2, 0.4 - 0.3),
        (0.4, 0.09999999999999998),
    ):
        assert running.step(begin, size) == OK, running.last_message
        assert time_of(running) == begin + size


@pytest.mark.parametrize("stop", [2.0, 2.0 - 1e-16, math.nextafter(2.0, 0.0)])
@pytest.mark.parametrize("size", [1e-16, 5e-324, 2e-16, 4.440892098500626e-16])
def test_an_extra_step_of_rounding_size_at_the_end_is_taken(
    plant: Plant, stop: float, size: float
) -> None:
    assert plant.call("fmi2SetupExperiment", 0, 0.0, 0.0, 1, stop) == OK
    assert plant.call("fmi2EnterInitializationMode") == OK
    assert plant.call("fmi2ExitInitializationMode") == OK
    for k in range(20):
        assert plant.step(0.1 * k, 0.1) == OK, plant.last_message
    before = plant.real("torso.position[3]")
    assert plant.step(2.0, size) == OK, plant.last_message
    assert plant.real("torso.position[3]") == pytest.approx(before, abs=1e-15)


@pytest.mark.parametrize("start", [0.3, 1.1, 1e3 / 3.0, -0.7, 1e6 + 0.1])
@pytest.mark.parametrize("side", [-math.inf, math.inf])
def test_a_first_step_may_miss_the_start_time_by_its_last_bit(
    plant: Plant, start: float, side: float
) -> None:
    begin = math.nextafter(start, side)
    assert plant.initialize(start=start).step(begin, H) == OK, plant.last_message
    assert time_of(plant) == begin + H


@pytest.mark.parametrize("summed", [True, False])
@pytest.mark.parametrize(("size", "count"), [(1.0 / 60.0, 5000), (0.1, 3000)])
def test_the_clock_follows_the_importer_over_many_steps(
    plant: Plant, size: float, count: int, summed: bool
) -> None:
    """`make test-endurance` runs a million steps."""
    assert plant.call("fmi2SetupExperiment", 0, 0.0, 0.0, 1, count * size) == OK
    assert plant.call("fmi2EnterInitializationMode") == OK
    assert plant.call("fmi2ExitInitializationMode") == OK
    time = 0.0
    for k in range(count):
        assert plant.step(time, size) == OK, plant.last_message
        assert time_of(plant) == time + size
        time = time + size if summed else (k + 1) * size


@pytest.mark.parametrize("size", [0.1, 0.001])
def test_a_clock_that_is_a_sum_of_a_million_steps_reaches_the_stop_time(
    plant: Plant, size: float
) -> None:
    """The importer adds up the communication points."""
    total = 0.0
    for _ in range(1_000_000):
        total += size
    assert abs(total - 1e6 * size) > 1e-9 * size  # s; error of an importer that adds up
    start = total - size  # the clock as after a step to the stop time
    assert plant.call("fmi2SetupExperiment", 0, 0.0, start, 1, 1e6 * size) == OK
    assert plant.call("fmi2EnterInitializationMode") == OK
    assert plant.call("fmi2ExitInitializationMode") == OK
    assert plant.step(start, size) == OK, plant.last_message
    assert plant.step(total, size) == ERROR


def test_instances_are_freed_in_any_mode(plant_library: Path) -> None:
    ways: tuple[tuple[str, ...], ...] = (
        (),
        ("fmi2EnterInitializationMode",),
        ("fmi2EnterInitializationMode", "fmi2ExitInitializationMode"),
        ("fmi2EnterInitializationMode", "fmi2ExitInitializationMode", "fmi2Terminate"),
        (
            "fmi2EnterInitializationMode",
            "fmi2ExitInitializationMode",
            "fmi2Terminate",
            "fmi2Terminate",
            "fmi2Reset",
        ),
    )
    for way in ways:
        with Plant(plant_library) as plant:
            assert [plant.call(function) for function in way] == [OK] * len(way)


def test_states_saved_at_every_step_take_only_the_memory_of_their_bytes(
    running: Plant,
) -> None:
    steps, states = 2000, []
    size = len(running.serialize(running.save()))
    before = resident()
    for k in range(steps):
        assert running.step(k * H / 10.0, H / 10.0) == OK
        states.append(running.save())
    assert (
        resident() - before < 1.1 * steps * size + 2e6
    )  # bytes; allocations round up, and Python has objects of its own
    assert running.call("fmi2SetFMUstate", states[0]) == OK
    assert running.step(H / 10.0, H / 10.0) == OK
    for state in states:
        running.free(state)


def test_a_state_may_be_freed_twice_or_be_null(running: Plant) -> None:
    state = running.save()
    running.free(state)
    running.free(state)
    assert running.call("fmi2FreeFMUstate", None) == OK


@pytest.mark.parametrize(
    "name", ["with space", "größe", "100%", "%41%20", "a#b?c", "日本語", "x" * 200]
)
def test_fmpy_runs_an_fmu_unpacked_anywhere(
    athena_fmu: Path, tmp_path: Path, name: str, read_only: Callable[[Path], None]
) -> None:
    copy = tmp_path / name / f"{name}.fmu"
    copy.parent.mkdir()
    shutil.copy2(athena_fmu, copy)
    unpacked = Path(fmpy.extract(str(copy), str(tmp_path / name / "unpacked")))
    read_only(copy.parent)
    result = fmpy.simulate_fmu(str(unpacked), stop_time=0.02, output=["torso.position[3]"])
    assert result["torso.position[3]"][-1] == pytest.approx(
        ATHENA.variable("initial.position[3]").start, abs=1e-6
    )


def test_a_walk_continues_after_every_kind_of_refusal(running: Plant, plant_library: Path) -> None:
    """An importer that ignores errors gets the same results as one without errors."""
    mistakes: list[Callable[[], int]] = [
        lambda: running.step(math.nan, H),
        lambda: running.step(0.0, -H),
        lambda: running.set_reals({"torso.push_force[1]": math.nan}),
        lambda: running.set_reals({"torso.mass": 1.0}),
        lambda: running.set_references("fmi2SetReal", [4_000_000], [0.0]),
        lambda: running.get_references("fmi2GetReal", [4_000_000])[0],
        lambda: running.deserialize(b"nonsense")[0],
        lambda: running.call("fmi2EnterInitializationMode"),
        lambda: running.call("fmi2SetFMUstate", None),
    ]
    with Plant(plant_library) as other:
        other.initialize()
        for k in range(20):
            assert mistakes[k % len(mistakes)]() == ERROR
            assert "got" in running.last_message
            assert running.step(k * H, H) == other.step(k * H, H) == OK
        assert running.everything() == other.everything()
