"""Related files of an FMU: the manifest of fmi-ls-ref, and what `hexapod validate` says of it."""

from __future__ import annotations

import zipfile
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

import fmpy
import fmpy.util
import numpy as np
import pytest
from fmpy.fmi3 import FMU3Slave
from numpy.typing import NDArray

from hexapod_cosim.cosim.export.export import export_fmu
from hexapod_cosim.cosim.export.reference import FOLDER, MANIFEST, OUTPUTS, manifest
from hexapod_cosim.cosim.validate.related import related_problems
from hexapod_cosim.cosim.validate.validation import find_problems
from hexapod_cosim.models import load_robot

NAMES = {"a", "b"}
TABLE = b'"time","a","b"\n0,1,2\n0.5,1,2\n'
GOOD = {
    MANIFEST: manifest("x"),
    f"{FOLDER}/x_in.csv": TABLE,
    f"{FOLDER}/x_ref.csv": TABLE,
    f"{FOLDER}/x_ref.opt": b"StopTime,1.0\n",
}


def problems(changes: dict[str, bytes]) -> list[str]:
    return list(related_problems(NAMES, GOOD | changes))


def changed(old: str, new: str) -> dict[str, bytes]:
    """Returns the manifest with another text at one place."""
    text = GOOD[MANIFEST].decode()
    assert text.count(old) == 1
    return {MANIFEST: text.replace(old, new).encode()}


def test_an_fmu_lists_its_reference_results_with_their_roles(
    plant_build: Path, tmp_path: Path
) -> None:
    fmu = export_fmu(load_robot("athena"), tmp_path / "athena.fmu")
    with zipfile.ZipFile(fmu) as archive:
        found = {name: archive.read(name) for name in archive.namelist()}
    assert {name for name in found if name.startswith("extra/")} == {
        "extra/org.fmi-standard.fmi-ls-ref/fmi-ls-manifest.xml",
        "extra/org.fmi-standard.fmi-ls-ref/athena_in.csv",
        "extra/org.fmi-standard.fmi-ls-ref/athena_ref.csv",
        "extra/org.fmi-standard.fmi-ls-ref/athena_ref.opt",
    }
    root = ElementTree.fromstring(found[MANIFEST])
    assert {one.get("source"): one.get("role") for one in root.iterfind("Related")} == {
        "athena_in.csv": "testcase",
        "athena_ref.csv": "result",
        "athena_ref.opt": "configuration",
    }
    names = {*OUTPUTS, "torso.push_force[1]", "torso.push_force[2]"}
    names |= {"LF.femur.angle_ref", "RR.coxa.angle_ref"}
    assert list(related_problems(names, found)) == []
    assert list(related_problems(names - {"energy.kinetic"}, found)) == [
        f"{FOLDER}/athena_ref.csv: these columns are no variables: energy.kinetic"
    ]


def test_an_fmu_of_fmi_3_has_whole_arrays_as_columns(plant_build: Path, tmp_path: Path) -> None:
    fmu = export_fmu(load_robot("athena"), tmp_path / "athena.fmu", fmi=3)
    with zipfile.ZipFile(fmu) as archive:
        manifested = archive.read(MANIFEST)
        files = [
            archive.extract(f"{FOLDER}/athena_{part}", tmp_path)
            for part in ("in.csv", "ref.csv", "ref.opt")
        ]
    assert manifested == manifest("athena")
    assert find_problems(fmu) == []
    inputs, reference = (fmpy.util.read_csv(path) for path in files[:2])
    assert inputs.dtype.names == ("time", "angle_ref", "torso.push_force")
    assert set(reference.dtype.names) == {
        "time", "torso.position", "torso.roll", "torso.pitch", "torso.yaw", "angle",
        "foot.normal_force", "energy.kinetic",
    }  # fmt: skip
    assert reference["angle"].shape == (101, 18)
    options = fmpy.util.read_ref_opt_file(files[2])
    found = stepped(
        fmu, tmp_path, inputs, tuple(reference.dtype.names or ())[1:], options["StepSize"]
    )
    for name, values in found.items():
        expected = reference[name].reshape(len(reference), -1)
        np.testing.assert_allclose(values, expected, rtol=1e-10, atol=1e-10, err_msg=name)


def stepped(
    path: Path, folder: Path, inputs: NDArray[np.void], names: Sequence[str], step: float
) -> dict[str, list[list[float]]]:
    """Runs an FMU of FMI 3 under the inputs; returns the elements of each output by rows.

    fmpy's own loop does not take inputs of several shapes.
    """
    description = fmpy.read_model_description(path)
    references = {one.name: one.valueReference for one in description.modelVariables}
    fmu = FMU3Slave(
        guid=description.guid,
        unzipDirectory=fmpy.extract(path, str(folder / "unpacked")),
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="plant",
    )
    fmu.instantiate()
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    found: dict[str, list[list[float]]] = {name: [] for name in names}
    sizes = {"angle": 18, "torso.position": 3, "foot.normal_force": 6}
    for row in inputs:
        for name in names:
            found[name].append(fmu.getFloat64([references[name]], sizes.get(name, 1)))
        for name in (inputs.dtype.names or ())[1:]:
            fmu.setFloat64([references[name]], row[name].tolist())
        if len(found[names[0]]) < len(inputs):
            fmu.doStep(row["time"], step)
    fmu.terminate()
    fmu.freeInstance()
    return found


def test_a_good_manifest_and_none_have_no_problems() -> None:
    assert problems({}) == []
    assert list(related_problems(NAMES, {})) == []
    elsewhere = 'source="https://example.org/x.mo" role="model"'
    assert problems(changed('source="x_ref.opt" role="configuration"', elsewhere)) == []
    inside = 'source="../../model%44escription.xml" role="experiment/validation"'
    described = changed('source="x_ref.opt" role="configuration"', inside)
    assert problems(described | {"modelDescription.xml": b""}) == []


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("</fmiReferences>", "", "is no XML"),
        ("<fmiReferences", "<fmiReference", "is no XML"),
        ("org.fmi-standard.fmi-ls-ref", "org.other", "fmi-ls-name is 'org.other'"),
        ('"1.0.0-alpha.1"', '"new"', "fmi-ls-version is 'new'"),
        ("Layered Standard providing", "About", "fmi-ls-description is 'About"),
        ('role="result"', 'role="results"', "x_ref.csv has the role 'results'"),
        ('role="result"', 'role="result/good"', "x_ref.csv has the role 'result/good'"),
        ('role="result"', 'role="experiment/fast"', "the role 'experiment/fast'"),
        ('source="x_ref.csv"', 'source="gone.csv"', "gone.csv is not in the archive"),
        ('source="x_ref.csv"', "", "has no source"),
        ("</fmiReferences>", "<Other/></fmiReferences>", "Other is none of Related"),
    ],
)
def test_a_manifest_against_the_standard_is_named_with_what_it_should_be(
    old: str, new: str, said: str
) -> None:
    (problem,) = problems(changed(old, new))
    assert problem.startswith(MANIFEST)
    assert said in problem


@pytest.mark.parametrize(
    ("table", "said"),
    [
        (b"t,a\n0,1\n", "its first column is 't', expected 'time'"),
        (b"time,c\n0,1\n", "these columns are no variables: c"),
        (b"time,a\n0,1\n0.5,fast\n", "line 3: got '0.5,fast', expected numbers"),
        (b"time,a\n0,1\n0.5\n", "line 3: expected 2 numbers, time not decreasing"),
        (b"time,a\n1,1\n0.5,1\n", "line 3: expected 2 numbers, time not decreasing"),
        (b"", "its first column is ''"),
        (b"time,a\n0,1 2\n0.5,1\n", "line 3: expected 2 cells of 1, 2 numbers"),
        (b"time,a\n0,\n", "line 2: expected 2 numbers"),
    ],
)
def test_a_table_that_is_none_is_named_with_its_line(table: bytes, said: str) -> None:
    (problem,) = problems({f"{FOLDER}/x_ref.csv": table})
    assert problem.startswith(f"{FOLDER}/x_ref.csv")
    assert said in problem
