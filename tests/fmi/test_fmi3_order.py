"""Tests FMI 3.0: instantiation, order of calls, functions that are not offered, reset."""

from __future__ import annotations

import ctypes
import math
from pathlib import Path

import pytest
from fmi3_plant import Plant3
from fmi_plant import ERROR, OK

H = 0.005  # s, communication step
NAN, INF = math.nan, math.inf


@pytest.mark.parametrize(
    "arguments",
    [
        {"token": "{0}"},
        {"token": None},
        {"name": None},
        {"name": ""},
        {"kind": "ScheduledExecution"},
    ],
)
def test_a_wrong_instantiation_is_refused_with_a_message(
    plant_library: Path, arguments: dict[str, str | None]
) -> None:
    with Plant3(plant_library, **arguments) as plant:  # type: ignore[arg-type]
        assert plant.handle is None
        assert "got" in plant.last_message
        assert "expected" in plant.last_message


def test_a_missing_instance_is_an_error(plant_library: Path) -> None:
    library = ctypes.CDLL(str(plant_library))
    library.fmi3FreeInstance(None)
    assert library.fmi3Reset(None) == ERROR


ENTER: tuple[object, ...] = ("fmi3EnterInitializationMode", False, 0.0, 0.0, False, 0.0)
EXIT, END, RESET, EVENT, STEP_MODE, CONTINUOUS = (
    (f"fmi3{name}",)
    for name in (
        "ExitInitializationMode",
        "Terminate",
        "Reset",
        "EnterEventMode",
        "EnterStepMode",
        "EnterContinuousTimeMode",
    )
)
STEP: tuple[object, ...] = ("fmi3DoStep", 0.0, H, True, None, None, None, None)
UPDATE: tuple[object, ...] = ("fmi3UpdateDiscreteStates", None, None, None, None, None, None)
SET_TIME: tuple[object, ...] = ("fmi3SetTime", 0.0)
STATES: tuple[object, ...] = ("fmi3GetContinuousStates", (ctypes.c_double * 70)(), 70)
COMPLETED: tuple[object, ...] = ("fmi3CompletedIntegratorStep", True, None, None)
COUNT: tuple[object, ...] = ("fmi3GetNumberOfContinuousStates", ctypes.byref(ctypes.c_size_t()))
WALKS = {
    "plain": ("CoSimulation", False, (ENTER, EXIT, STEP, END, END, RESET, ENTER, EXIT)),
    "events": (
        "CoSimulation",
        True,
        (
            ENTER,
            EXIT,
            UPDATE,
            STEP_MODE,
            STEP,
            EVENT,
            UPDATE,
            UPDATE,
            STEP_MODE,
            EVENT,
            END,
            RESET,
            ENTER,
        ),
    ),
    "exchange": (
        "ModelExchange",
        False,
        (
            COUNT,
            ENTER,
            STATES,
            EXIT,
            UPDATE,
            SET_TIME,
            CONTINUOUS,
            SET_TIME,
            STATES,
            COMPLETED,
            EVENT,
            UPDATE,
            CONTINUOUS,
            END,
            RESET,
        ),
    ),
}
EVERY = (
    ENTER,
    EXIT,
    STEP,
    END,
    EVENT,
    STEP_MODE,
    CONTINUOUS,
    UPDATE,
    SET_TIME,
    STATES,
    COMPLETED,
    COUNT,
)
# calls of EVERY that are legal after each call of a walk, by the standard's state machines and the
# liberties that fmi3.c names
LEGAL: dict[str, dict[str, tuple[tuple[object, ...], ...]]] = {
    "plain": {"": (ENTER,), "init": (EXIT,), "run": (STEP, END), "end": (END,)},
    "events": {
        "": (ENTER,),
        "init": (EXIT,),
        "event": (UPDATE, STEP_MODE, END),
        "run": (STEP, END, EVENT),
        "end": (END,),
    },
    "exchange": {
        "": (ENTER, COUNT),
        "init": (EXIT, STATES, COUNT),
        "event": (UPDATE, CONTINUOUS, SET_TIME, STATES, END, COUNT),
        "run": (EVENT, SET_TIME, STATES, COMPLETED, END, COUNT),
        "end": (END, STATES, COUNT),
    },
}
LEADS = {
    "EnterInitializationMode": "init",
    "Terminate": "end",
    "Reset": "",
    "EnterEventMode": "event",
    "EnterStepMode": "run",
}


def mode_after(call: tuple[object, ...], mode: str, walk: str) -> str:
    """Returns the mode after a legal call."""
    name = str(call[0]).removeprefix("fmi3")
    if name == "ExitInitializationMode":
        return "run" if walk == "plain" else "event"
    return "run" if name == "EnterContinuousTimeMode" else LEADS.get(name, mode)


@pytest.mark.parametrize("walk", WALKS)
def test_calls_are_legal_in_the_standard_s_order_only(plant_library: Path, walk: str) -> None:
    kind, events, calls = WALKS[walk]
    mode, seen = "", set()
    with Plant3(plant_library, kind=kind, events=events) as plant:
        for call in calls:
            for other in EVERY:
                if other not in LEGAL[walk][mode]:
                    assert plant.call(str(other[0]), *other[1:]) == ERROR, (walk, mode, other[0])
                    assert str(other[0])[:15] in plant.last_message
            seen.add(mode)
            assert plant.call(str(call[0]), *call[1:]) == OK, (
                walk,
                mode,
                call[0],
                plant.last_message,
            )
            mode = mode_after(call, mode, walk)
    assert seen == set(LEGAL[walk])


NOT_OFFERED: tuple[tuple[object, ...], ...] = (
    ("fmi3EnterConfigurationMode",),
    ("fmi3ExitConfigurationMode",),
    ("fmi3EvaluateDiscreteStates",),
    ("fmi3GetNumberOfVariableDependencies", ctypes.c_uint(0), None),
    ("fmi3GetVariableDependencies", ctypes.c_uint(0), None, None, None, None, 0),
    ("fmi3ActivateModelPartition", ctypes.c_uint(0), 0.0),
)


@pytest.mark.parametrize("call", NOT_OFFERED, ids=lambda call: str(call[0]))
def test_functions_that_are_not_offered_return_an_error_with_a_message(
    running3: Plant3, call: tuple[object, ...]
) -> None:
    assert running3.call(str(call[0]), *call[1:]) == ERROR
    assert str(call[0]) in running3.last_message
    assert running3.step(0.0, H).status == OK


@pytest.mark.parametrize(
    ("start", "stop"), [(NAN, None), (INF, None), (0.0, NAN), (1.0, 0.5), (1e12, None)]
)
def test_an_invalid_experiment_is_refused(plant3: Plant3, start: float, stop: float | None) -> None:
    assert plant3.enter_initialization(start, stop) == ERROR
    assert "fmi3EnterInitializationMode" in plant3.last_message
    assert plant3.enter_initialization() == OK
