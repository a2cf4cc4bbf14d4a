"""Tests FMI 3.0 through the standard's C interface: the same plant as in FMI 2.0, arrays, events,
order of calls, refusals, saved states.
"""

from __future__ import annotations

import ctypes
import math
import re
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmi3_plant import ARRAYS, Plant3
from fmi_plant import ATHENA, DISCARD, ERROR, OK, Plant

from hexapod_cosim.cosim.interface.model_description3 import (
    CAPABILITIES,
    CO_SIMULATION,
    EVENTS,
    MODEL_EXCHANGE,
)
from hexapod_cosim.cosim.interface.patterns import plain_name

H = 0.005  # s, communication step
DROP = 0.15  # m; a torso from this height falls for about 50 ms before the feet touch down
PUSH = 3.0  # N
NAN, INF = math.nan, math.inf


def dropped(plant: Plant3) -> Plant3:
    """Returns an instance above the ground, pushed, ready to step."""
    assert (
        plant.set({"initial.position": [0.0, 0.0, DROP], "torso.push_force": [PUSH, 0.0, 0.0]})
        == OK
    )
    return plant.initialize()


def to_end(plant: Plant3, end: float, *, size: float = H, enter: bool = False) -> list[float]:
    """Steps to the points of a regular grid and continues after early returns.

    Returns the times of the events.
    """
    time, k, events = 0.0, 1, []
    while time < end:
        step = plant.step(time, k * size - time)
        assert step.status == OK, plant.last_message
        assert step.early == (step.time < k * size)
        if step.event or step.early:
            events.append(step.time)
        if step.event and enter:
            assert plant.call("fmi3EnterEventMode") == OK
            assert plant.update() == (OK, [False] * 5)
            assert plant.call("fmi3EnterStepMode") == OK
        time, k = step.time, k + (not step.early)
    return events


def test_every_function_of_the_standard_is_exported(plant_library: Path) -> None:
    header = (Path(fmpy.__file__).parent / "c-code" / "fmi3Functions.h").read_text(encoding="utf-8")
    names = set(re.findall(r"FMI3_Export fmi3\w+TYPE\s+(fmi3\w+);", header))
    library = ctypes.CDLL(str(plant_library))
    assert len(names) == 75
    assert [name for name in sorted(names) if not hasattr(library, name)] == []
    library.fmi3GetVersion.restype = ctypes.c_char_p
    assert library.fmi3GetVersion().startswith(b"3.0")


def test_the_declared_capabilities_are_those_that_are_tested() -> None:
    declared = CAPABILITIES | CO_SIMULATION | MODEL_EXCHANGE
    offered = {name for name, value in declared.items() if value == "true"} | set(EVENTS)
    assert offered == {
        "canGetAndSetFMUState",
        "canSerializeFMUState",
        "canHandleVariableCommunicationStepSize",
        "mightReturnEarlyFromDoStep",
        "providesIntermediateUpdate",
        "canReturnEarlyAfterIntermediateUpdate",
        "hasEventMode",
        "needsCompletedIntegratorStep",
    }


# the same plant


def test_steps_give_what_fmi_2_gives_bit_for_bit(plant3: Plant3, plant: Plant) -> None:
    assert plant.set_reals({"initial.position[3]": DROP, "torso.push_force[1]": PUSH}) == OK
    plant.initialize()
    dropped(plant3)
    for k in range(40):
        assert plant.step(k * H, H) == OK
        assert plant3.step(k * H, H).status == OK
    assert plant3.everything().tolist() == plant.everything()


@pytest.mark.parametrize("method", ["rosw3", "dp54"])
@pytest.mark.parametrize("step", [0.0, 2e-4])
@pytest.mark.parametrize(("events", "early"), [(True, False), (False, True), (True, True)])
def test_events_and_early_returns_do_not_change_the_motion(
    plant_library: Path, events: bool, early: bool, step: float, method: str
) -> None:
    settings = {"solver.method": [ATHENA.enumerations["Method"].number(method)]}
    end = 0.1
    with (
        Plant3(plant_library) as whole,
        Plant3(plant_library, events=events, early=early) as broken,
    ):
        for plant in (whole, broken):
            assert plant.set(settings) == OK
            assert plant.set({"solver.step": [step]}) == OK
            dropped(plant)
        if events:
            assert broken.call("fmi3EnterStepMode") == OK
        assert to_end(whole, end) == []
        times = to_end(broken, end, enter=events)
        assert len(times) >= 3
        assert early == any(not math.isclose(time / H, round(time / H)) for time in times)
        # 1e-12: the end of a step that an importer reaches in pieces may differ in the last bit,
        # and with it the last step
        np.testing.assert_allclose(broken.everything(), whole.everything(), rtol=1e-12, atol=1e-12)
        assert broken.get("solver.steps") == whole.get("solver.steps")


# arrays


def test_an_array_is_its_elements_in_the_order_of_their_references() -> None:
    for name, array in ARRAYS.items():
        assert [element.reference for element in array.elements] == list(
            range(array.reference, array.reference + len(array.elements))
        )
        assert {
            plain_name(re.sub(r"\[\d\]", "[i]", element.name)) for element in array.elements[:1]
        } >= {name} or array.shape
        assert (
            len(
                {
                    (e.type, e.unit, e.minimum, e.maximum, e.nominal, e.variability, e.enumeration)
                    for e in array.elements
                }
            )
            == 1
        )


def test_elements_are_stored_in_the_order_of_fmi_2(plant3: Plant3, plant: Plant) -> None:
    ref = np.arange(18.0).reshape(6, 3) / 20.0
    assert plant3.set({"angle_ref": ref, "torso.push_force": [1.0, 2.0, 3.0]}) == OK
    state = plant3.save()
    loaded = plant.deserialize(plant3.serialize(state))[1]
    assert plant.call("fmi2SetFMUstate", loaded) == OK
    assert plant.reals(["LF.femur.angle_ref", "RR.coxa.angle_ref", "torso.push_force[2]"]) == [
        ref[0, 1],
        ref[5, 0],
        2.0,
    ]
    plant3.free(state)
    plant.free(loaded)


def test_enumerations_are_int64_and_booleans_bool(running3: Plant3) -> None:
    assert running3.get("contact.law")[0].dtype == np.int64
    assert running3.get("foot.contact")[0].tolist() == [True] * 6


@pytest.mark.parametrize("item", [0, 7, -1, 2**40, -(2**40), 2**32 + 1])
def test_a_number_that_is_no_item_is_refused(plant3: Plant3, item: int) -> None:
    before = plant3.get("contact.law")[0]
    assert plant3.set({"contact.law": [item]}) == ERROR
    assert "contact.law" in plant3.last_message
    assert plant3.get("contact.law")[0] == before


@pytest.mark.parametrize("bad", [NAN, INF, -INF, 7.0])
@pytest.mark.parametrize("place", [0, 17])
def test_one_bad_element_leaves_the_whole_batch_unset(
    running3: Plant3, bad: float, place: int
) -> None:
    before = [value.copy() for value in running3.get("torso.push_force", "angle_ref")]
    ref = np.zeros(18)
    ref[place] = bad
    assert running3.set({"torso.push_force": [1.0, 2.0, 3.0], "angle_ref": ref}) == ERROR
    assert ("LF.coxa.angle_ref" if place == 0 else "RR.tibia.angle_ref") in running3.last_message
    for value, old in zip(running3.get("torso.push_force", "angle_ref"), before, strict=True):
        assert (value == old).all()


@pytest.mark.parametrize(
    ("references", "count"),
    [([0], 17), ([0], 19), ([1], 17), ([0, 54], 18), ([999999], 1), ([4323], 1), ([1258], 6)],
)
def test_a_wrong_count_reference_or_type_is_refused(
    running3: Plant3, references: list[int], count: int
) -> None:
    assert running3.get_raw("Float64", references, count)[0] == ERROR
    assert "got" in running3.last_message
    assert "expected" in running3.last_message
    assert running3.set_raw("Float64", references, [0.0] * count) == ERROR


@pytest.mark.parametrize("name", ["angle", "der(speed)"])
def test_outputs_and_derivatives_cannot_be_set(running3: Plant3, name: str) -> None:
    assert running3.set({name: np.zeros(18)}) == ERROR


@pytest.mark.parametrize(
    "kind", ["Float32", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "UInt64", "String"]
)
@pytest.mark.parametrize("verb", ["Get", "Set"])
def test_functions_for_other_types_accept_no_variables(
    running3: Plant3, verb: str, kind: str
) -> None:
    one = (ctypes.c_uint * 1)(0)
    assert running3.call(f"fmi3{verb}{kind}", None, 0, None, 0) == OK
    assert running3.call(f"fmi3{verb}{kind}", one, 1, ctypes.create_string_buffer(8), 1) == ERROR


# stepping


@pytest.mark.parametrize(
    ("time", "size"),
    [(0.0, NAN), (NAN, H), (0.0, INF), (0.0, -H), (0.0, 0.0), (0.0, 1e6), (1.0, H), (INF, H)],
)
def test_an_invalid_step_is_refused_and_changes_nothing(
    plant_library: Path, time: float, size: float
) -> None:
    with Plant3(plant_library, early=True) as plant:
        before = plant.initialize().everything()
        assert plant.step(time, size) == (ERROR, False, False, False, 0.0)
        assert plant.everything().tolist() == before.tolist()
        assert plant.step(0.0, H).status == OK


def test_a_step_that_cannot_be_taken_is_discarded_and_changes_nothing(plant3: Plant3) -> None:
    assert plant3.set({"solver.step": [1e-9]}) == OK
    before = plant3.initialize().everything()
    assert plant3.step(0.0, 10.0) == (DISCARD, False, False, False, 0.0)
    assert plant3.everything().tolist() == before.tolist()


def test_an_event_is_where_a_foot_touches_down(plant_library: Path) -> None:
    touch = 1e-6  # m; penetration that the integrator counts as touching
    with Plant3(plant_library, events=True, early=True) as plant:
        dropped(plant)
        assert plant.get("foot.contact")[0].tolist() == [False] * 6
        assert plant.call("fmi3EnterStepMode") == OK
        step = plant.step(0.0, 0.2)
        assert (step.status, step.event, step.early) == (OK, True, True)
        contact, depth = plant.get("foot.contact")[0], plant.get("foot.penetration")[0]
        assert 0 < contact.sum() < 6 or contact.all()
        assert (abs(depth[contact]) < touch).all()
        assert (depth[~contact] < 0.0).all()
        assert plant.get("foot.impact_speed")[0][contact].min() > 0.0


# saved states


def test_a_restored_state_continues_bit_for_bit_also_after_an_early_return(
    plant_library: Path,
) -> None:
    with Plant3(plant_library, early=True) as plant, Plant3(plant_library, early=True) as other:
        dropped(plant)
        time = plant.step(0.0, 0.2).time
        state = plant.save()
        data = plant.serialize(state)
        assert plant.step(time, 0.2 - time).status == OK
        after = plant.everything()
        assert plant.call("fmi3SetFMUState", state) == OK
        status, foreign = other.deserialize(data)
        assert status == OK
        assert other.call("fmi3SetFMUState", foreign) == OK
        for instance in (plant, other):
            assert instance.step(time, 0.2 - time).status == OK
            assert instance.everything().tolist() == after.tolist()
        plant.free(state)
        other.free(foreign)


def test_damaged_bytes_are_refused(running3: Plant3) -> None:
    state = running3.save()
    data = bytearray(running3.serialize(state))
    for place in (0, 20, len(data) // 2, len(data) - 1):
        damaged = data.copy()
        damaged[place] ^= 1
        assert running3.deserialize(bytes(damaged))[0] == ERROR
    assert running3.deserialize(bytes(data[:-1]))[0] == ERROR
    running3.free(state)


def test_a_state_of_the_other_interface_is_refused(running3: Plant3, plant_library: Path) -> None:
    state = running3.save()
    with Plant3(plant_library, kind="ModelExchange") as other:
        assert other.call("fmi3SetFMUState", state) == ERROR
    running3.free(state)
