"""Tests FMI 2.0 through the standard's C interface: order of calls, values, steps, log.

Other files test the physics.
"""

from __future__ import annotations

import ctypes
import math
import re
import shutil
import subprocess
from pathlib import Path

import fmpy
import fmpy.validation
import pytest
from fmi_plant import (
    ATHENA,
    DISCARD,
    DO_STEP_STATUS,
    ERROR,
    LAST_SUCCESSFUL_TIME,
    OK,
    PENDING_STATUS,
    TERMINATED,
    WARNING,
    Plant,
)  # fmt: skip

H = 0.005  # s, communication step
NAN, INF = math.nan, math.inf


def test_the_fmu_passes_fmpy_validation(athena_fmu: Path) -> None:
    assert fmpy.validation.validate_fmu(str(athena_fmu)) == []


def test_the_fmu_stands_still_in_fmpy(athena_fmu: Path) -> None:
    # m; the equilibria of the statics and of the plant differ far less than a foot's 0.66 mm of
    # sinkage
    settled = 1e-5
    result = fmpy.simulate_fmu(str(athena_fmu), output=["torso.position[3]", "torso.roll"])
    assert result["time"][-1] == pytest.approx(2.0)
    assert abs(result["torso.position[3]"] - result["torso.position[3]"][0]).max() < settled


def test_no_other_function_is_exported(plant_library: Path) -> None:
    nm = shutil.which("nm")
    assert nm is not None
    listing = subprocess.run(
        [nm, "-D", "--defined-only", str(plant_library)], capture_output=True, text=True, check=True
    ).stdout
    symbols = {line.split()[-1].split("@")[0] for line in listing.splitlines()}
    own = {symbol for symbol in symbols if not symbol.startswith(("fmi2", "fmi3"))}
    assert own == {"hx_shared_work_size", "hx_shared_work_use"}


def test_every_function_of_the_standard_is_exported(plant_library: Path) -> None:
    header = (Path(fmpy.__file__).parent / "c-code" / "fmi2Functions.h").read_text(encoding="utf-8")
    names = set(re.findall(r"FMI2_Export fmi2\w+TYPE\s+(fmi2\w+);", header))
    library = ctypes.CDLL(str(plant_library))
    assert len(names) == 44
    assert [name for name in sorted(names) if not hasattr(library, name)] == []


@pytest.mark.parametrize(
    ("function", "arguments"),
    [
        ("fmi2EnterEventMode", ()),
        ("fmi2EnterContinuousTimeMode", ()),
        ("fmi2SetTime", (0.0,)),
        ("fmi2GetDerivatives", (None, 0)),
        ("fmi2GetContinuousStates", (None, 0)),
        ("fmi2CancelStep", ()),
    ],
)
def test_functions_that_are_not_offered_return_an_error_with_a_message(
    running: Plant, function: str, arguments: tuple[object, ...]
) -> None:
    assert running.call(function, *arguments) == ERROR
    assert function in running.last_message
    assert running.step(0.0, H) == OK


@pytest.mark.parametrize(
    "arguments",
    [
        {"guid": "{00000000-0000-0000-0000-000000000000}"},
        {"guid": None},
        {"guid": ""},
        {"name": None},
        {"name": ""},
        {"kind": 7},
    ],
)
def test_a_wrong_instantiation_is_refused_with_a_message(
    plant_library: Path, arguments: dict[str, str | None]
) -> None:
    with Plant(plant_library, **arguments) as plant:  # type: ignore[arg-type]
        assert plant.component is None
        assert "got" in plant.last_message
        assert "expected" in plant.last_message
        assert plant.speakers == {arguments.get("name", "plant") or ""}


def test_a_missing_instance_is_an_error(plant_library: Path) -> None:
    library = ctypes.CDLL(str(plant_library))
    library.fmi2FreeInstance(None)
    assert library.fmi2Reset(None) == ERROR
    assert library.fmi2DoStep(None, ctypes.c_double(0), ctypes.c_double(H), 1) == ERROR


Call = tuple[object, ...]  # function, arguments
SETUP = ("fmi2SetupExperiment", 0, 0.0, 0.0, 0, 0.0)
ENTER, EXIT, END, RESET = (
    ("fmi2EnterInitializationMode",),
    ("fmi2ExitInitializationMode",),
    ("fmi2Terminate",),
    ("fmi2Reset",),
)
STEP = ("fmi2DoStep", 0.0, H, 1)


@pytest.mark.parametrize(
    ("legal", "illegal"),
    [
        ((), STEP),
        ((), EXIT),
        ((), END),
        ((SETUP,), STEP),
        ((SETUP, ENTER), ENTER),
        ((SETUP, ENTER), SETUP),
        ((SETUP, ENTER), STEP),
        ((SETUP, ENTER), END),
        ((SETUP, ENTER, EXIT), SETUP),
        ((SETUP, ENTER, EXIT), ENTER),
        ((SETUP, ENTER, EXIT), EXIT),
        ((SETUP, ENTER, EXIT, END), STEP),
        ((SETUP, ENTER, EXIT, END), ENTER),
        ((SETUP, ENTER, EXIT, RESET), STEP),
    ],
)
def test_calls_out_of_order_are_refused_and_change_nothing(
    plant: Plant, legal: tuple[Call, ...], illegal: Call
) -> None:
    for function, *arguments in legal:
        assert plant.call(str(function), *arguments) == OK
    assert plant.call(str(illegal[0]), *illegal[1:]) == ERROR
    assert str(illegal[0]) in plant.last_message
    assert plant.call("fmi2Reset") == OK
    assert plant.initialize().step(0.0, H) == OK


def test_no_step_goes_past_a_stop_time(plant: Plant) -> None:
    assert plant.call("fmi2SetupExperiment", 0, 0.0, 5.0, 1, 6.0) == OK
    assert plant.call("fmi2EnterInitializationMode") == OK
    assert plant.call("fmi2ExitInitializationMode") == OK
    assert plant.step(5.0, 0.5) == OK
    before = plant.everything()
    assert plant.step(5.5, 0.6) == ERROR
    assert "stop time, 6 s" in plant.last_message
    assert plant.everything() == before
    assert plant.step(5.5, 0.5 + 1e-16) == OK


@pytest.mark.parametrize(("start", "stop"), [(NAN, 1.0), (INF, 1.0), (0.0, -1.0), (0.0, NAN)])
def test_an_impossible_experiment_is_refused(plant: Plant, start: float, stop: float) -> None:
    assert plant.call("fmi2SetupExperiment", 0, 0.0, start, 1, stop) == ERROR


@pytest.mark.parametrize("tolerance", [NAN, -1.0, 0.0, 1e9])
def test_an_invalid_tolerance_is_ignored_with_a_warning(plant: Plant, tolerance: float) -> None:
    assert plant.call("fmi2SetupExperiment", 1, tolerance, 0.0, 0, 0.0) == WARNING
    assert plant.real("solver.tolerance") == ATHENA.variable("solver.tolerance").start


@pytest.mark.parametrize("size", [NAN, INF, -INF, 0.0, -H, 1e300])
def test_an_impossible_step_is_refused_and_changes_nothing(running: Plant, size: float) -> None:
    before = running.everything()
    assert running.step(0.0, size) == ERROR
    assert running.everything() == before
    assert running.step(0.0, H) == OK


@pytest.mark.parametrize("time", [NAN, INF, -H, H, 1e-6])
def test_a_step_from_another_time_is_refused(running: Plant, time: float) -> None:
    assert running.step(time, H) == ERROR
    assert "communication point" in running.last_message


def test_last_bit_differences_of_the_clock_are_adopted(running: Plant) -> None:
    third = 1.0 / 3.0 / 10.0
    assert running.step(0.0, third) == OK
    assert running.step(math.nextafter(third, 1.0), third) == OK
    time = ctypes.c_double()
    assert running.call("fmi2GetRealStatus", LAST_SUCCESSFUL_TIME, ctypes.byref(time)) == OK
    assert time.value == math.nextafter(third, 1.0) + third
    assert running.step(time.value, 1e-16) == OK
    assert running.step(time.value - 1e-16, 1e-17) == OK


def test_a_step_that_the_plant_cannot_take_is_discarded_and_changes_nothing(running: Plant) -> None:
    assert running.set_reals({"torso.push_force[3]": -1e9}) == OK
    before = running.everything()
    assert running.step(0.0, H) == DISCARD
    assert running.messages[-1][:2] == (DISCARD, "logStatusDiscard")
    assert running.everything() == before
    assert running.set_reals({"torso.push_force[3]": 0.0}) == OK
    assert running.step(0.0, H) == OK


def test_status_functions_return_known_values_and_discard_others(running: Plant) -> None:
    status, flag, number = ctypes.c_int(), ctypes.c_int(7), ctypes.c_double()
    assert running.step(0.0, NAN) == ERROR
    assert running.call("fmi2GetStatus", DO_STEP_STATUS, ctypes.byref(status)) == OK
    assert status.value == ERROR
    assert running.call("fmi2GetBooleanStatus", TERMINATED, ctypes.byref(flag)) == OK
    assert flag.value == 0
    assert running.call("fmi2GetRealStatus", PENDING_STATUS, ctypes.byref(number)) == DISCARD
    assert running.call("fmi2GetStringStatus", PENDING_STATUS, None) == DISCARD
    assert running.call("fmi2GetIntegerStatus", DO_STEP_STATUS, None) == DISCARD


def test_the_log_contains_the_chosen_categories(plant_library: Path) -> None:
    with Plant(plant_library) as quiet, Plant(plant_library, logging=True) as talking:
        quiet.initialize()
        talking.initialize()
        assert quiet.messages == []
        assert [category for _, category, _ in talking.messages] == ["logEvents"] * 2
        events = (ctypes.c_char_p * 1)(b"logEvents")
        assert quiet.call("fmi2SetDebugLogging", -1, ctypes.c_size_t(1), events) == OK
        assert talking.call("fmi2SetDebugLogging", 0, ctypes.c_size_t(0), None) == OK
        assert quiet.call("fmi2Reset") == OK
        assert talking.call("fmi2Reset") == OK
        assert [text for _, _, text in quiet.messages] == ["reset"]
        assert len(talking.messages) == 2


def categories(*names: str) -> tuple[ctypes.c_size_t, ctypes.Array[ctypes.c_char_p]]:
    return ctypes.c_size_t(len(names)), (ctypes.c_char_p * len(names))(
        *(name.encode() for name in names)
    )


def test_switching_categories_on_leaves_these_only_and_refusals(plant_library: Path) -> None:
    with Plant(plant_library, logging=True) as plant:
        plant.messages.clear()
        assert plant.call("fmi2SetDebugLogging", 1, *categories("logStatusWarning")) == OK
        assert plant.call("fmi2Reset") == OK
        assert plant.messages == []
        assert plant.step(0.0, H) == ERROR
        assert [category for _, category, _ in plant.messages] == ["logStatusError"]
        assert plant.call("fmi2SetDebugLogging", 1, *categories("logAll")) == OK
        assert plant.call("fmi2Reset") == OK
        assert plant.last_message == "reset"


def test_every_declared_log_category_is_known_and_no_other(plant: Plant) -> None:
    for name in ATHENA.log_categories:
        assert (
            plant.call(
                "fmi2SetDebugLogging", 1, ctypes.c_size_t(1), (ctypes.c_char_p * 1)(name.encode())
            )
            == OK
        )
    assert (
        plant.call(
            "fmi2SetDebugLogging", 1, ctypes.c_size_t(1), (ctypes.c_char_p * 1)(b"logRumours")
        )
        == ERROR
    )
    assert "logRumours" in plant.last_message
