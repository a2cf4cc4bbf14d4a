"""Tests the further files of an FMU: pictures, terminals, licence, documentation, reference
results and their manifest.
"""

from __future__ import annotations

import io
import posixpath
import re
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import fmpy
import fmpy.util
import numpy as np
import pytest
from fmi_plant import ATHENA
from PIL import Image

from hexapod_cosim.cosim.export.plant import (
    ICON_SIZE,
    PICTURE_SIZE,
    export_controller,
    export_fmu,
    pictures,
)
from hexapod_cosim.cosim.export.reference import COMMANDS, FOLDER, MANIFEST, OUTPUTS
from hexapod_cosim.cosim.interface.plant import load_interface
from hexapod_cosim.cosim.interface.terminals import render_terminals
from hexapod_cosim.cosim.run.plan import make_setup
from hexapod_cosim.cosim.scenario.records import CONTROLS
from hexapod_cosim.models import list_robots, load_robot

ROUNDING = (
    1e-9  # of the solver, between two ways to give the same inputs; and of the files' 12 digits
)


@pytest.mark.parametrize("robot", [*list_robots(), *CONTROLS])
def test_an_importer_gets_the_reference_results(
    plant_build: Path, tmp_path: Path, robot: str
) -> None:
    fmu, name, outputs = tmp_path / f"{robot}.fmu", robot, list(OUTPUTS)
    if robot in CONTROLS:
        setup = make_setup(load_robot("athena"), control=robot, period=0.004)
        export_controller(setup, fmu)
        name, outputs = "athena_controller", list(COMMANDS)
    else:
        export_fmu(load_robot(robot), fmu)
    with zipfile.ZipFile(fmu) as archive:
        files = [
            archive.extract(f"{FOLDER}/{name}_{part}", tmp_path)
            for part in ("in.csv", "ref.csv", "ref.opt")
        ]
    options = fmpy.util.read_ref_opt_file(files[2])
    inputs = fmpy.util.read_csv(files[0])
    result = fmpy.simulate_fmu(
        str(fmu),
        input=inputs,
        output=outputs,
        start_time=options["StartTime"],
        stop_time=options["StopTime"],
        output_interval=options["StepSize"],
    )
    assert options["StopTime"] == 1.0
    reference = fmpy.util.read_csv(files[1])
    for name in ("time", *outputs):
        assert result[name] == pytest.approx(
            np.array(reference[name]), rel=ROUNDING, abs=ROUNDING
        ), name


@pytest.mark.parametrize("robot", list_robots())
def test_pictures_show_the_whole_robot(robot: str) -> None:
    drawn = pictures(load_interface(load_robot(robot)))
    assert [Image.open(io.BytesIO(data)).size for data in drawn.values()] == [
        PICTURE_SIZE,
        ICON_SIZE,
    ]
    for data in drawn.values():
        opaque = np.asarray(Image.open(io.BytesIO(data)))[..., 3] > 250
        rows, columns = np.flatnonzero(opaque.any(axis=1)), np.flatnonzero(opaque.any(axis=0))
        height, width = opaque.shape
        assert (
            min(rows[0], columns[0], height - 1 - rows[-1], width - 1 - columns[-1]) >= 1
        )  # the robot is not cut off
        assert (
            max(np.ptp(rows) / height, np.ptp(columns) / width) > 0.85
        )  # the robot fills the picture


def test_every_input_of_a_leg_and_the_torso_is_in_one_terminal() -> None:
    document = ElementTree.fromstring(render_terminals(list(ATHENA.by_name)))
    members = [
        str(member.get("variableName")) for member in document.iter("TerminalMemberVariable")
    ]
    assert len(members) == len(set(members))
    assert {variable.name for variable in ATHENA.of_causality("input")} <= set(members)
    assert {
        variable.name for variable in ATHENA.of_causality("output") if ".foot." in variable.name
    } <= set(members)


def test_types_carry_units_and_angles_are_shown_in_degrees(athena_fmu: Path) -> None:
    description = fmpy.read_model_description(str(athena_fmu))
    variables = {variable.name: variable for variable in description.modelVariables}
    angle, speed = variables["LF.coxa.angle"], variables["LF.coxa.speed"]
    assert (angle.declaredType.name, angle.declaredType.unit, angle.displayUnit) == (
        "Angle",
        "rad",
        "deg",
    )
    assert (speed.declaredType.name, speed.declaredType.unit, speed.displayUnit) == (
        "AngularVelocity",
        "rad/s",
        "deg/s",
    )
    assert variables["contact.law"].declaredType.name == "ContactLaw"


@pytest.mark.parametrize(("fmi", "platforms"), [(2, None), (2, "sources"), (3, None)])
def test_the_page_describes_only_what_the_archive_contains(
    plant_build: Path, tmp_path: Path, fmi: int, platforms: str | None
) -> None:
    with zipfile.ZipFile(
        export_fmu(load_robot("athena"), tmp_path / "athena.fmu", fmi=fmi, platforms=platforms)
    ) as archive:
        page, names = archive.read("documentation/index.html").decode(), archive.namelist()
    assert (
        (FOLDER in page)
        == any(name.startswith(FOLDER) for name in names)
        == (platforms is None and fmi == 2)
    )
    links = re.findall(r'(?:src|href)="([^"#:]+)"', page)
    assert len(links) >= 2  # the picture and the licence
    assert {posixpath.normpath(f"documentation/{link}") for link in links} <= set(names)


# Related files of an FMU: the manifest of fmi-ls-ref and the reference results it lists.


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
