"""Tests that the dependencies in the model description are those of the derivatives."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from exchange_calls import INPUTS, ROUNDING, STATES, UNKNOWNS, directional
from fmi_plant import ATHENA, OK, Plant

VARIANTS: tuple[dict[str, float], ...] = (
    {},
    {"friction.law": 3, "terrain.kind": 2, "terrain.incline": 0.1, "terrain.heading": 0.5},
    {"servo.mode": 3, "terrain.kind": 2, "terrain.incline": 0.1},
    # torso, knees and shanks are in the ground
    {
        "body.torso_box[3]": 0.15,
        "body.corner_radius": 0.35,
        "body.knee_radius": 0.35,
        "body.shank_radius": 0.35,
        "terrain.kind": 2,
        "terrain.incline": 0.1,
        "terrain.heading": 0.5,
    },
    # neighbouring legs overlap
    {"body.self_contact": 3, "body.knee_radius": 0.12, "body.shank_radius": 0.12},
)


def moved(library: Path, variant: dict[str, float], *, initialize: bool = True) -> Plant:
    """Returns a moving instance in an asymmetric posture, with all feet deep in soft ground."""
    plant, rng = Plant(library), np.random.default_rng(5)
    soft = {
        "contact.law": 5,
        "contact.damping_factor": 0.1,
        "contact.stiffness": 1e3,
        "friction.presliding": 1e-5,
        "friction.mu": 0.1,
        "foot.radius": 0.16,
        "terrain.height": -0.07,
    }
    for name, value in (soft | variant).items():
        kind = "fmi2SetReal" if ATHENA.variable(name).type == "Real" else "fmi2SetInteger"
        assert plant.set_references(kind, ATHENA.references([name]), [value]) == OK
    names = [n.name for n in ATHENA.of_causality("parameter") if n.name.startswith("initial.")]
    assert plant.set_reals({name: plant.real(name) + rng.normal(0.0, 0.05) for name in names}) == OK
    assert (
        plant.set_reals(
            {f"torso.push_{kind}[{i}]": 1.0 for kind in ("force", "torque") for i in (1, 2, 3)}
        )
        == OK
    )
    return plant.initialize() if initialize else plant


def test_dependencies_of_unknowns_are_those_of_the_description(plant_library: Path) -> None:
    knowns = [*STATES, *INPUTS]
    seen = np.zeros((len(UNKNOWNS), len(knowns)), dtype=bool)
    for variant in VARIANTS:
        with moved(plant_library, variant) as plant:
            for start, end in itertools.pairwise(
                (0.0, 0.0005, 0.001, 0.002, 0.005, 0.01)
            ):  # some feet slide, some stick
                assert plant.step(start, end - start) == OK, plant.last_message
                jacobian = np.array(
                    [directional(plant, UNKNOWNS, [known], [1.0])[1] for known in knowns]
                ).T
                # smaller values are rounding
                seen |= np.abs(jacobian) > 1e-9 * np.abs(jacobian).max(axis=0)
    for name, row in zip(UNKNOWNS, seen, strict=True):
        found, stated = (
            {known for known, does in zip(knowns, row, strict=True) if does},
            ATHENA.depends(name),
        )
        assert stated is None or found <= set(stated), (
            f"{name} depends on {found - set(stated or ())} too"
        )
        assert stated is None or kinds(stated) == kinds(found), (
            f"{name} depends on {kinds(found)} alone, whatever the index"
        )


def kinds(names: Iterable[str]) -> set[str]:
    """Returns the names without their indices."""
    return {name.partition("[")[0] for name in names}


def test_initial_dependencies_of_unknowns_are_those_of_the_description(
    plant_library: Path,
) -> None:
    """Each parameter is changed separately in both directions, since a kink may hide one."""
    names = [
        *(
            variable.name
            for variable in ATHENA.of_causality("parameter")
            if variable.type == "Real"
        ),
        *INPUTS,
    ]
    seen = {name: set[str]() for name in UNKNOWNS}
    for variant in VARIANTS:
        with moved(plant_library, variant, initialize=False) as plant:
            before, value = (
                np.array(plant.reals(UNKNOWNS)),
                dict(zip(names, plant.reals(names), strict=True)),
            )
            for name, sign in itertools.product(names, (1.0, -1.0)):
                if (
                    plant.set_reals(
                        {
                            name: value[name] * (1.0 + sign * 0.01)
                            + sign * 1e-3 * (value[name] == 0.0)
                        }
                    )
                    != OK
                ):
                    continue
                status, values = plant.get_references("fmi2GetReal", ATHENA.references(UNKNOWNS))
                for unknown in (
                    np.array(UNKNOWNS)[
                        np.abs(np.array(values) - before) > 1e-9 * np.abs(before) + ROUNDING
                    ]
                    if status == OK
                    else ()
                ):
                    seen[unknown].add(name)
                assert plant.set_reals({name: value[name]}) == OK
    for name, found in seen.items():
        stated = ATHENA.depends_initially(name)
        assert stated is None or found <= set(stated), (
            f"{name} depends on {found - set(stated or ())} too"
        )
