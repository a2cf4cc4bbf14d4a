"""Tests values through the standard's C interface: which ones are refused, that a refusal changes
nothing, and that a read of some outputs gives the bits of a read of all.
"""

from __future__ import annotations

import math
import struct
from collections import defaultdict
from pathlib import Path

import pytest
from fmi_plant import ATHENA, ERROR, OK, Plant

NAN, INF = math.nan, math.inf


@pytest.mark.parametrize(
    "name",
    [
        variable.name
        for variable in ATHENA.of_causality("input", "parameter")[::37]
        if variable.type == "Real"
    ],
)
@pytest.mark.parametrize("value", [NAN, INF, -INF])
def test_a_value_that_is_no_number_is_refused_by_every_kind_of_variable(
    plant: Plant, name: str, value: float
) -> None:
    assert plant.set_reals({name: value}) == ERROR
    assert name in plant.last_message
    assert plant.real(name) == ATHENA.variable(name).start


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("contact.restitution", 1.01),
        ("contact.restitution", -0.01),
        ("torso.mass", -1.0),
        ("LF.coxa.angle_ref", 45.0),
    ],
)
def test_a_value_out_of_range_is_refused_with_the_range(
    plant: Plant, name: str, value: float
) -> None:
    assert plant.set_reals({name: value}) == ERROR
    assert f"got {value:.17g}" in plant.last_message
    variable = ATHENA.variable(name)
    unit = f" {variable.unit}" if variable.unit else ""
    assert f"in [{variable.minimum:g}, {variable.maximum:g}]{unit}; nothing" in plant.last_message


LIMITED = [
    variable for variable in ATHENA.of_causality("input", "parameter") if variable.type == "Real"
]
# values within their own limits that are invalid together: an impossible inertia, a law that
# divides by the restitution, static friction below the kinetic one, stops in the wrong order
RELATED = [
    *(variable.name for variable in LIMITED if ".inertia_" in variable.name),
    *(
        variable.name
        for variable in LIMITED
        if variable.name.endswith((".angle_min", ".angle_max"))
    ),
    "contact.restitution",
    "friction.mu_static",
    "servo.winding_capacity",
    "servo.housing_capacity",
    "servo.air_temperature",
    "servo.derate_temperature",
    "servo.temperature_max",
    "servo.gear_ratio",
]
DEEP = "deep in the ground"  # a start with its feet below the ground is refused


def started(plant: Plant) -> int:
    """Returns the status of the calls up to step mode."""
    assert plant.call("fmi2SetupExperiment", 0, 0.0, 0.0, 0, 0.0) == OK
    assert plant.call("fmi2EnterInitializationMode") == OK
    return plant.call("fmi2ExitInitializationMode")


@pytest.mark.parametrize("side", ["minimum", "maximum"])
def test_every_limit_is_accepted_to_the_end_of_initialization_and_nothing_beyond(
    plant: Plant, side: str
) -> None:
    for variable in LIMITED:
        limit = getattr(variable, side)
        assert limit is not None, variable.name
        assert plant.call("fmi2Reset") == OK
        assert (
            plant.set_reals(
                {variable.name: math.nextafter(limit, INF if side == "maximum" else -INF)}
            )
            == ERROR
        )
        assert plant.set_reals({variable.name: limit}) == OK
        if variable.name not in RELATED:
            if started(plant) != OK:
                assert DEEP in plant.last_message, variable.name
                continue
            assert all(map(math.isfinite, plant.everything())), variable.name


@pytest.mark.parametrize("bad", [{"torso.push_force[2]": NAN}, {"torso.roll": 0.0}])
def test_a_batch_is_set_whole_or_not_at_all(running: Plant, bad: dict[str, float]) -> None:
    before = running.everything()
    assert (
        running.set_reals({"torso.push_force[1]": 5.0} | bad | {"LF.coxa.angle_ref": 0.3}) == ERROR
    )
    assert running.everything() == before


def test_unknown_references_and_wrong_types_are_refused(running: Plant) -> None:
    mass, law, contact = ATHENA.references(["torso.mass", "contact.law", "LF.foot.contact"])
    for unknown in (999, 3999, 100000, 2**32 - 1):
        assert running.get_references("fmi2GetReal", [mass, unknown])[0] == ERROR
        assert str(unknown) in running.last_message
    assert running.get_references("fmi2GetReal", [law])[0] == ERROR
    assert running.get_references("fmi2GetInteger", [contact])[0] == ERROR
    assert running.get_references("fmi2GetBoolean", [mass])[0] == ERROR
    assert running.get_references("fmi2GetInteger", [law]) == (OK, [1])
    assert running.get_references("fmi2GetBoolean", [contact]) == (OK, [1])


def test_parameters_are_fixed_after_initialization(running: Plant) -> None:
    assert running.set_reals({"foot.radius": 0.02}) == ERROR
    assert "fixed" in running.last_message


def test_an_invalid_model_is_refused_at_the_end_of_initialization_and_can_be_corrected(
    plant: Plant,
) -> None:
    assert plant.set_reals({"torso.inertia_zz": 1.0}) == OK
    assert plant.call("fmi2SetupExperiment", 0, 0.0, 0.0, 0, 0.0) == OK
    assert plant.call("fmi2EnterInitializationMode") == OK
    assert plant.call("fmi2ExitInitializationMode") == ERROR
    assert "inertia" in plant.last_message
    assert (
        plant.set_reals({"torso.inertia_zz": ATHENA.variable("torso.inertia_zz").start or 0.0})
        == OK
    )
    assert plant.call("fmi2ExitInitializationMode") == OK


def test_outputs_in_initialization_mode_are_those_of_the_values_set_so_far(plant: Plant) -> None:
    assert plant.call("fmi2SetupExperiment", 0, 0.0, 0.0, 0, 0.0) == OK
    assert plant.call("fmi2EnterInitializationMode") == OK
    assert plant.set_reals({"initial.position[3]": 0.5}) == OK
    assert plant.real("torso.position[3]") == 0.5
    assert plant.set_reals({"initial.position[3]": 0.6, "initial.velocity[1]": 0.25}) == OK
    assert plant.reals(["torso.position[3]", "torso.velocity[1]"]) == [0.6, 0.25]


# Tests that a read of some outputs, which computes their groups alone, gives the bits of a read of
# all.

GROUPS = {"motion", "forces", "servos", "reactions", "distances", "audit"}
CASES: dict[str, tuple[dict[str, float], dict[str, int]]] = {
    "default": ({}, {}),
    "turning rotors": ({"servo.gear_ratio": 200.0}, {}),
    "measured friction": (
        {"servo.motor_load_friction": 0.1, "servo.viscous_friction": 0.1},
        {"servo.mode": 1},
    ),
    "static friction": ({"friction.mu_static": 0.95, "friction.viscous": 0.1}, {}),
    "kinematic drives": ({}, {"servo.mode": 3}),
    "bodies touch": ({}, {"body.contact": 2, "body.self_contact": 3}),
    "bristles": ({"friction.presliding": 1e-4}, {"friction.law": 3}),
    "explicit method": ({"servo.stop_stiffness": 100.0}, {"solver.method": 3}),
    "soil": ({"foot.pad_radius": 0.02}, {"soil.law": 2}),
}


def bits(values: list[float]) -> bytes:
    return struct.pack(f"{len(values)}d", *values)


def walking(library: Path, reals: dict[str, float], kinds: dict[str, int]) -> Plant:
    """Returns a plant that stands unevenly after a third of a second."""
    plant = Plant(library)
    numbers = ATHENA.references(kinds)
    assert plant.set_references("fmi2SetInteger", numbers, list(kinds.values())) == OK
    assert plant.set_reals(reals) == OK
    plant.initialize()
    push(plant)
    for step in range(16):
        assert plant.step(0.02 * step, 0.02) == OK, plant.last_message
    return plant


def push(plant: Plant) -> None:
    """Sets inputs, after which all outputs are computed anew."""
    assert plant.set_reals({"torso.push_force[1]": 9.0, "LM.femur.angle_ref": 0.4}) == OK


def names_by_group() -> dict[str, list[str]]:
    found = defaultdict(list)
    for output in ATHENA.of_causality("output"):
        if output.type == "Real":
            found[output.group or ""].append(output.name)
    return found


def test_every_output_has_one_of_the_groups() -> None:
    assert set(names_by_group()) == GROUPS


@pytest.mark.parametrize("case", CASES)
def test_a_group_that_is_read_alone_has_the_bits_of_all_outputs(
    plant_library: Path, case: str
) -> None:
    with walking(plant_library, *CASES[case]) as plant:
        groups = names_by_group()
        everything = [name for names in groups.values() for name in names]
        push(plant)
        expected = dict(zip(everything, plant.reals(everything), strict=True))
        for group, names in groups.items():
            plant.reals(everything)
            push(plant)
            alone = plant.reals(names)
            assert bits(alone) == bits([expected[name] for name in names]), group


def test_reads_in_any_number_of_calls_have_the_bits_of_one_call(plant_library: Path) -> None:
    with walking(plant_library, {}, {}) as plant:
        names = [name for names in names_by_group().values() for name in names]
        push(plant)
        expected = plant.reals(names)
        push(plant)
        assert bits([plant.real(name) for name in names]) == bits(expected)
        push(plant)
        assert bits([plant.real(name) for name in reversed(names)][::-1]) == bits(expected)


def test_a_group_that_was_not_read_is_computed_after_the_next_step(plant_library: Path) -> None:
    with walking(plant_library, {}, {}) as plant, walking(plant_library, {}, {}) as other:
        energy = ["energy.kinetic", "LF.clearance", "imu.specific_force[3]"]
        before = plant.reals(energy)
        for each in (plant, other):
            assert each.step(0.32, 0.02) == OK
        assert plant.real("torso.position[3]") == other.real("torso.position[3]")
        assert plant.reals(energy) == other.reals(energy)
        assert plant.reals(energy) != before
