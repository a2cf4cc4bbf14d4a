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
from fmi_plant import ATHENA, ERROR, LAST_SUCCESSFUL_TIME, OK, WARNING, Callbacks, Plant

from hexapod_cosim.cosim.export.start_values import start_values
from hexapod_cosim.cosim.interface.model_description import render_fmi2
from hexapod_cosim.cosim.interface.plant import load_interface
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


def test_the_callbacks_structure_need_not_outlive_the_instantiation(plant_library: Path) -> None:
    with Plant(plant_library) as plant:
        kept = ctypes.cast(plant._functions.logger, ctypes.c_void_p)
        ctypes.memset(ctypes.addressof(plant._functions), 0xFF, ctypes.sizeof(Callbacks))
        assert kept.value
        assert plant.step(0.0, H) == ERROR
        assert "fmi2DoStep" in plant.last_message


def test_initialisation_needs_no_set_up_experiment(plant: Plant) -> None:
    assert plant.call("fmi2EnterInitializationMode") == OK
    assert plant.call("fmi2ExitInitializationMode") == OK
    assert plant.step(0.0, H) == OK


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
