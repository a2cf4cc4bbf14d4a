"""Tests that the dependencies in the model description are those of the derivatives, and that the
description offers what its binary has.
"""

from __future__ import annotations

import ctypes
import itertools
import shutil
import subprocess
import zipfile
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from exchange_calls import INPUTS, ROUNDING, STATES, UNKNOWNS, directional
from fmi_plant import ATHENA, ERROR, OK, Plant
from fmi_plant import ATHENA as INTERFACE

from hexapod_cosim.cosim.common.plant_files import fmi_headers, source_files
from hexapod_cosim.cosim.export import plant
from hexapod_cosim.cosim.export.plant import export_fmu
from hexapod_cosim.models import load_robot

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


def test_initial_dependencies_of_unknowns_are_those_of_the_description(plant_library: Path) -> None:
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


# Tests that a model description offers what its binary has: derivatives with complex numbers.

ROBOT = load_robot("athena")
TF = ("true", "false")
BINARY = "binaries/linux64/hexapod.so"


@pytest.fixture(scope="module")
def without_complex(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The plant's library as a compiler without complex numbers builds it."""
    compiler = shutil.which("gcc") or shutil.which("clang")
    assert compiler is not None
    folder = tmp_path_factory.mktemp("without_complex")
    for name, source in source_files().items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(source.read_bytes())
    sources = [name for name in source_files() if name.endswith(".c")]
    command = [compiler, "-std=c11", "-O0", "-shared", "-fPIC", "-fvisibility=hidden"]
    command += ["-DHX_NO_COMPLEX", "-DHX_BASELINE_ONLY", "-I.", "-I", str(fmi_headers())]
    subprocess.run([*command, *sources, "-o", "hexapod.so", "-lm"], cwd=folder, check=True)
    return folder / "hexapod.so"


def promised(fmu: Path) -> Counter[str]:
    """Returns how many interfaces promise directional derivatives, and how many do not."""
    with zipfile.ZipFile(fmu) as archive:
        text = archive.read("modelDescription.xml").decode()
    found = (text.count(f'providesDirectionalDerivative{s}="{v}"') for s in ("", "s") for v in TF)
    yes2, no2, yes3, no3 = found
    return Counter(yes=yes2 + yes3, no=no2 + no3)


@pytest.mark.parametrize("fmi", [2, 3])
def test_derivatives_are_promised_where_the_binary_has_them(
    plant_library: Path,
    without_complex: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    fmi: int,
) -> None:
    assert promised(export_fmu(ROBOT, tmp_path / "with.fmu", fmi=fmi)) == {"yes": 2, "no": 0}

    def other(*_: Any, **__: Any) -> dict[str, bytes]:
        return {BINARY: without_complex.read_bytes()}

    monkeypatch.setattr(plant, "installed_binary", other)
    assert promised(export_fmu(ROBOT, tmp_path / "less.fmu", fmi=fmi)) == {"yes": 0, "no": 2}


def test_a_binary_without_complex_numbers_refuses_derivatives(without_complex: Path) -> None:
    with Plant(without_complex) as plant:
        plant.initialize()
        reference = (ctypes.c_uint * 1)(0)
        number = (ctypes.c_double * 1)(1.0)
        one = ctypes.c_size_t(1)
        unknown = (ctypes.c_uint * 1)(*INTERFACE.references(["torso.position[3]"]))
        status = plant.call(
            "fmi2GetDirectionalDerivative", unknown, one, reference, one, number, number
        )
        assert status == ERROR
        assert "without complex numbers" in plant.last_message
