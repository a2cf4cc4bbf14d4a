"""Tests that a read of some outputs, which computes their groups alone, gives the bits of a read of
all.
"""

from __future__ import annotations

import struct
from collections import defaultdict
from pathlib import Path

import pytest
from fmi_plant import ATHENA, OK, Plant

GROUPS = {"motion", "forces", "servos", "reactions", "distances", "audit"}
CASES: dict[str, tuple[dict[str, float], dict[str, int]]] = {
    "default": ({}, {}),
    "elastic gears": ({"servo.gear_stiffness": 60.0, "servo.gear_damping": 0.1}, {}),
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
