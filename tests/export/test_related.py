"""Related files of an FMU: the manifest of fmi-ls-ref and the reference results it lists."""

from __future__ import annotations

import zipfile
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

import fmpy
import fmpy.util
import numpy as np
from fmpy.fmi3 import FMU3Slave
from numpy.typing import NDArray

from hexapod_cosim.cosim.export.plant_export import export_fmu
from hexapod_cosim.cosim.export.reference import FOLDER, MANIFEST, OUTPUTS, manifest
from hexapod_cosim.cosim.validate.validation import find_problems
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
