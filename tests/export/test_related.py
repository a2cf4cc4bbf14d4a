"""Related files of an FMU: the manifest of fmi-ls-ref, and what `hexapod validate` says of it."""

from __future__ import annotations

import zipfile
from pathlib import Path
from xml.etree import ElementTree

import pytest

from hexapod_cosim.cosim.export.export import export_fmu
from hexapod_cosim.cosim.export.reference import FOLDER, MANIFEST, OUTPUTS, manifest
from hexapod_cosim.cosim.validate.related import related_problems
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
    ],
)
def test_a_table_that_is_none_is_named_with_its_line(table: bytes, said: str) -> None:
    (problem,) = problems({f"{FOLDER}/x_ref.csv": table})
    assert problem.startswith(f"{FOLDER}/x_ref.csv")
    assert said in problem
