"""Tests of what fuzzing found in the FMU: refused calls that changed the state, forged states."""

from __future__ import annotations

import ctypes
import struct
from pathlib import Path

import pytest
from fmi3_plant import ARRAYS, Plant3
from fmi_plant import ATHENA, DISCARD, ERROR, MODEL_EXCHANGE, OK, Plant

HEADER, CHECKSUM_AT = 64, 16  # bytes of a saved state (fmi/state.c)
INITIALIZATION, STEP = 2, 4
MODES = {"no mode": 0, "two modes": INITIALIZATION | STEP, "unknown": 64, "negative": -1}


def whole_state(plant: Plant | Plant3) -> bytes:
    """Returns the bytes of an instance's state."""
    state = plant.save()
    data = plant.serialize(state)
    plant.free(state)
    return data


@pytest.mark.parametrize("call", ["fmi2GetDirectionalDerivative", "fmi2GetRealOutputDerivatives"])
def test_a_refused_derivative_does_not_initialize(plant: Plant, call: str) -> None:
    assert plant.call("fmi2EnterInitializationMode") == OK
    before = whole_state(plant)
    parameter = ctypes.c_uint(ATHENA.variable("torso.mass").reference)
    value, order = ctypes.c_double(1.0), ctypes.c_int(1)
    one, pointer = ctypes.c_size_t(1), ctypes.byref
    if call == "fmi2GetDirectionalDerivative":
        known = ctypes.c_uint(0)
        status = plant.call(
            call, pointer(parameter), one, pointer(known), one, pointer(value), pointer(value)
        )
    else:
        status = plant.call(call, pointer(parameter), one, pointer(order), pointer(value))
    assert status == ERROR
    assert whole_state(plant) == before


def test_a_derivative_refused_for_its_numbers_does_not_initialize(plant: Plant) -> None:
    assert plant.call("fmi2EnterInitializationMode") == OK
    before = whole_state(plant)
    unknown = ctypes.c_uint(ATHENA.variable("LF.coxa.angle").reference)
    known = ctypes.c_uint(ATHENA.variable("LF.coxa.angle_ref").reference)
    seed, result, one = ctypes.c_double(float("inf")), ctypes.c_double(0.0), ctypes.c_size_t(1)
    places = [ctypes.byref(number) for number in (unknown, known, seed, result)]
    status = plant.call(
        "fmi2GetDirectionalDerivative", places[0], one, places[1], one, places[2], places[3]
    )
    assert status == ERROR
    assert "not finite" in plant.last_message
    assert whole_state(plant) == before


def test_model_exchange_refused_for_a_firmware_changes_nothing(plant_library: Path) -> None:
    with Plant(plant_library, kind=MODEL_EXCHANGE) as plant:
        plant.set_reals({"servo.goal_speed_max": 3.0})
        assert plant.call("fmi2EnterInitializationMode") == OK
        before = whole_state(plant)
        assert plant.call("fmi2ExitInitializationMode") == ERROR
        assert "a firmware whose memory" in plant.last_message
        assert whole_state(plant) == before


def test_a_refused_read_of_arrays_calculates_nothing(plant3: Plant3) -> None:
    before = whole_state(plant3)
    force, integer = ARRAYS["foot.force"], ARRAYS["terrain.kind"]
    references = (ctypes.c_uint * 2)(force.reference, integer.reference)
    values = (ctypes.c_double * 19)()
    sizes = ctypes.c_size_t(2), ctypes.c_size_t(19)  # 6 feet, 3 axes; 1
    assert plant3.call("fmi3GetFloat64", references, sizes[0], values, sizes[1]) == ERROR
    assert "terrain.kind" in plant3.messages[-1][2]
    assert whole_state(plant3) == before


def test_refused_continuous_states_change_nothing(plant_library: Path) -> None:
    n = len(ATHENA.states)
    count, x, rates = ctypes.c_size_t(n), (ctypes.c_double * n)(), (ctypes.c_double * n)()
    with Plant(plant_library, kind=MODEL_EXCHANGE) as plant:
        plant.initialize()
        assert plant.call("fmi2EnterContinuousTimeMode") == OK
        assert plant.call("fmi2GetContinuousStates", x, count) == OK
        assert plant.call("fmi2GetDerivatives", rates, count) == OK
        before = whole_state(plant)
        x[0] = 1e300
        assert plant.call("fmi2SetContinuousStates", x, count) == DISCARD
        assert "nothing was set" in plant.last_message
        assert whole_state(plant) == before


def forged(data: bytes, place: int, new: bytes, core: ctypes.CDLL) -> bytes:
    """Returns a state with other bytes and the checksum that belongs to them."""
    core.hx_checksum.argtypes = [ctypes.c_uint64, ctypes.c_char_p, ctypes.c_size_t]
    core.hx_checksum.restype = ctypes.c_uint64
    changed = data[:place] + new + data[place + len(new) :]
    inside = changed[HEADER:]
    checksum = struct.pack("=Q", core.hx_checksum(0, inside, len(inside)))
    return changed[:CHECKSUM_AT] + checksum + changed[CHECKSUM_AT + 8 :]


@pytest.mark.parametrize("mode", MODES.values(), ids=MODES)
def test_a_forged_state_in_a_mode_that_does_not_exist_is_refused(
    running: Plant, core: ctypes.CDLL, mode: int
) -> None:
    before = whole_state(running)
    status, state = running.deserialize(forged(before, HEADER, struct.pack("=i", mode), core))
    assert status == OK
    assert running.call("fmi2SetFMUstate", state) == ERROR
    assert "a damaged instance" in running.last_message
    assert whole_state(running) == before
    running.free(state)


def test_a_state_forged_without_a_change_is_restored(running: Plant, core: ctypes.CDLL) -> None:
    before = whole_state(running)
    status, state = running.deserialize(forged(before, HEADER, struct.pack("=i", STEP), core))
    assert status == OK
    assert running.call("fmi2SetFMUstate", state) == OK
    assert whole_state(running) == before
    running.free(state)
