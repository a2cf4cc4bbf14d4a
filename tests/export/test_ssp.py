"""Packages of plant and controller: validity, content, and results with a minimal master."""

from __future__ import annotations

import math
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from feed_through import FOOT, JOINT, make_feed_through
from fmpy.ssp.ssd import read_ssd

from hexapod_cosim.cosim.common.plant_files import fmi2_platform
from hexapod_cosim.cosim.export.ssp import (
    KINDS,
    PREFIXES,
    export_ssp,
)
from hexapod_cosim.cosim.interface.descriptions import read_description
from hexapod_cosim.models.errors import FmuError
from tools.importers.package import run

STEP, STEPS = 0.005, 60  # s
SWING = 0.05  # rad    start value of the controller
STOP = 0.3  # s
ORDER = ("plant", "controller")
SEEN = (f"plant.{JOINT}.angle", f"controller.{JOINT}.angle_ref", "plant.torso.position[3]")


@pytest.fixture(scope="module")
def controller(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_feed_through(tmp_path_factory.mktemp("feed_through"), fmi2_platform())


@pytest.fixture(scope="module")
def fmus(athena_fmu: Path, controller: Path) -> dict[str, Path]:
    return {"plant": athena_fmu, "controller": controller}


def pack(folder: Path, fmus: dict[str, Path]) -> Path:
    return export_ssp(folder / "athena.ssp", fmus, title="athena", step=STEP, stop=STOP)


@pytest.fixture(scope="module")
def package(fmus: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    return pack(tmp_path_factory.mktemp("package"), fmus)


def test_a_package_is_valid_by_the_standards_schemas(package: Path) -> None:
    assert read_ssd(str(package), validate=True).system.elements


def test_the_package_contains_the_fmus_unchanged(package: Path, fmus: dict[str, Path]) -> None:
    with zipfile.ZipFile(package) as archive:
        assert {name: archive.read(f"resources/{name}.fmu") for name in fmus} == {
            name: fmu.read_bytes() for name, fmu in fmus.items()
        }


def test_outputs_drive_the_inputs_of_their_names(package: Path) -> None:
    connections = read_ssd(str(package)).system.connections
    found = {
        (one.startElement, one.startConnector, one.endElement, one.endConnector)
        for one in connections
    }
    assert found == {
        ("plant", f"{JOINT}.angle", "controller", f"{JOINT}.angle"),
        ("plant", f"{FOOT}.contact", "controller", f"{FOOT}.contact"),
        ("controller", f"{JOINT}.angle_ref", "plant", f"{JOINT}.angle_ref"),
    }


def test_connectors_are_the_fmus_variables_with_their_units(
    package: Path, fmus: dict[str, Path]
) -> None:
    with zipfile.ZipFile(package) as archive:
        root = ElementTree.fromstring(archive.read("SystemStructure.ssd"))
    defined = {unit.get("name") for unit in root.findall("ssd:Units/ssc:Unit", PREFIXES)}
    for component in root.findall("ssd:System/ssd:Elements/ssd:Component", PREFIXES):
        known = {
            one.name: one
            for one in read_description(fmus[component.get("name", "")]).modelVariables
        }
        connectors = {
            one.get("name", ""): one
            for one in component.findall("ssd:Connectors/ssd:Connector", PREFIXES)
        }
        expected = {
            name
            for name, one in known.items()
            if one.type in {"Real", "Boolean"} and one.causality in KINDS
        }
        # masters set the connectors of inputs, so only driven ones have some
        assert {
            name for name in expected - set(connectors) if known[name].causality != "input"
        } == (set())
        assert {name for name in connectors if known[name].causality == "input"} == (
            {f"{JOINT}.angle_ref"}
            if component.get("name") == "plant"
            else {f"{JOINT}.angle", f"{FOOT}.contact"}
        )
        for name, connector in connectors.items():
            assert connector.get("kind") == known[name].causality
            assert connector[0].tag == f"{{{PREFIXES['ssc']}}}{known[name].type}"
            assert connector[0].get("unit") in (
                {known[name].unit} if known[name].unit in defined else {None}
            )


def test_a_controller_with_feed_through_holds_its_law_at_every_point(package: Path) -> None:
    found = run(package, SEEN, step=STEP, steps=STEPS, order=ORDER, in_order=True)
    angle, reference = found.column(SEEN[0]), found.column(SEEN[1])
    late = np.concatenate(
        [[math.nan], angle[:-1]]
    )  # after its step it still has the angle from before
    swing = SWING * np.sin(2.0 * math.pi * found.time)
    law = 0.4 + 0.5 * (late - 0.4) + swing + 1e-6 * np.arange(1, STEPS + 1)
    assert reference[1:] == pytest.approx(law[1:], abs=1e-14)


def test_components_that_share_no_names_are_refused(controller: Path, tmp_path: Path) -> None:
    with pytest.raises(FmuError, match="nothing to connect"):
        export_ssp(
            tmp_path / "no.ssp",
            {"one": controller, "other": controller},
            title="no",
            step=STEP,
            stop=STOP,
        )
    assert not list(tmp_path.iterdir())
