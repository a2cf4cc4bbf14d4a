"""Tests saved states, reset and several instances: the bytes of an instance contain its whole
state.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from pathlib import Path

import pytest
from fmi_plant import ERROR, OK, Plant

H = 0.005  # s
PUSH = {"torso.push_force[1]": 10.0, "LF.femur.angle_ref": 0.5}


@pytest.fixture
def plant(plant_library: Path) -> Iterator[Plant]:
    with Plant(plant_library) as instance:
        yield instance.initialize()


def walk(plant: Plant, first: int, last: int) -> list[list[float]]:
    """Takes steps first..last - 1 under inputs that differ from step to step."""
    trace = []
    for k in range(first, last):
        assert (
            plant.set_reals(
                {"torso.push_force[1]": 3.0 * (k % 5), "RM.femur.angle_ref": 0.4 + 0.02 * (k % 7)}
            )
            == OK
        )
        assert plant.step(k * H, H) == OK
        trace.append(plant.everything())
    return trace


def test_a_restored_state_continues_bit_for_bit(plant: Plant) -> None:
    walk(plant, 0, 10)
    state = plant.save()
    first = walk(plant, 10, 20)
    assert plant.call("fmi2SetFMUstate", state) == OK
    assert walk(plant, 10, 20) == first
    plant.free(state)


def test_a_serialized_state_continues_in_another_instance_bit_for_bit(
    plant: Plant, plant_library: Path
) -> None:
    walk(plant, 0, 10)
    state = plant.save()
    data = plant.serialize(state)
    first = walk(plant, 10, 20)
    with Plant(plant_library) as other:
        status, copy = other.deserialize(data)
        assert status == OK
        assert other.call("fmi2SetFMUstate", copy) == OK
        assert walk(other, 10, 20) == first
        other.free(copy)
    plant.free(state)


def test_a_state_holds_the_mode(plant: Plant) -> None:
    state = plant.save()
    assert plant.call("fmi2Terminate") == OK
    assert plant.step(0.0, H) == ERROR
    assert plant.call("fmi2SetFMUstate", state) == OK
    assert plant.step(0.0, H) == OK
    plant.free(state)


@pytest.mark.parametrize("place", [0, 9, 13, 17, 30, 200, 4000, -1])
def test_a_single_damaged_byte_is_refused_and_changes_nothing(plant: Plant, place: int) -> None:
    state = plant.save()
    data = bytearray(plant.serialize(state))
    data[place] ^= 0x10
    before = plant.everything()
    status, copy = plant.deserialize(bytes(data))
    assert (status, copy.value) == (ERROR, None)
    assert "saved state" in plant.last_message
    assert plant.everything() == before
    plant.free(state)


def test_bytes_of_another_length_are_refused(plant: Plant) -> None:
    state = plant.save()
    data = plant.serialize(state)
    for wrong in (b"", data[:10], data[:-1], data + b"\0"):
        assert plant.deserialize(wrong)[0] == ERROR
    small = ctypes.create_string_buffer(len(data) - 1)
    assert (
        plant.call("fmi2SerializeFMUstate", state, small, ctypes.c_size_t(len(data) - 1)) == ERROR
    )
    plant.free(state)


def test_a_block_that_is_no_saved_state_is_refused(plant: Plant) -> None:
    state = plant.save()
    foreign = ctypes.create_string_buffer(len(plant.serialize(state)))
    assert plant.call("fmi2SetFMUstate", foreign) == ERROR
    copy = ctypes.create_string_buffer(len(foreign))
    assert (
        plant.call("fmi2SerializeFMUstate", foreign, copy, ctypes.c_size_t(len(foreign))) == ERROR
    )
    assert "no saved state" in plant.last_message
    assert foreign.raw == copy.raw == bytes(len(foreign))
    assert plant.call("fmi2SetFMUstate", None) == ERROR
    assert plant.step(0.0, H) == OK
    plant.free(state)


def test_a_reset_instance_equals_a_new_one(plant: Plant, plant_library: Path) -> None:
    assert plant.set_reals(PUSH) == OK
    walk(plant, 0, 20)
    assert plant.call("fmi2Reset") == OK
    with Plant(plant_library) as fresh:
        states = [plant.save(), fresh.save()]
        assert plant.serialize(states[0]) == fresh.serialize(states[1])
        assert plant.everything() == fresh.everything()
        for state in states:
            plant.free(state)
        assert walk(plant.initialize(), 0, 20) == walk(fresh.initialize(), 0, 20)
