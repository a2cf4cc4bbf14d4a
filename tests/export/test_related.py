"""Related files of an FMU: the manifest of fmi-ls-ref and the reference results it lists."""

from __future__ import annotations

import zipfile
from pathlib import Path
from xml.etree import ElementTree

from hexapod_cosim.cosim.export.plant import export_fmu
from hexapod_cosim.cosim.export.reference import FOLDER, MANIFEST, OUTPUTS
from hexapod_cosim.models import load_robot


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
    columns = {
        part: found[f"{FOLDER}/athena_{part}.csv"].decode().splitlines()[0].replace('"', "")
        for part in ("in", "ref")
    }
    assert set(columns["in"].split(",")) == {
        "time", "torso.push_force[1]", "torso.push_force[2]",
        "LF.femur.angle_ref", "RR.coxa.angle_ref",
    }  # fmt: skip
    assert columns["ref"].split(",") == ["time", *OUTPUTS]
