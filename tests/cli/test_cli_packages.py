"""`hexapod simulate` runs packages as they say, and refuses in one sentence what it cannot."""

from __future__ import annotations

import re
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest
from command import QUICK, Call, assert_refused

from hexapod_cosim.controller import make_gait
from hexapod_cosim.cosim.export.robot_package import export_package
from hexapod_cosim.cosim.interface.controller import ControllerSetup
from hexapod_cosim.models import load_robot

STRUCTURE = "SystemStructure.ssd"
SAME = 1e-9  # relative: last bits of the commands, which stiff servos and the ground amplify
SEEN = (
    "time", "torso.position[1]", "torso.position[3]", "torso.yaw", "LF.coxa.angle",
    "RM.femur.speed", "RR.tibia.angle_ref", "LF.foot.normal_force", "RM.foot.force[3]",
)  # fmt: skip
FAST = {"controller": {"command.vx": 0.1}, "plant": {"friction.law": 3.0, "torso.com[1]": 0.01}}


def setup_of(robot: str) -> ControllerSetup:
    own = load_robot(robot)
    return ControllerSetup(robot=own, gait=make_gait(own), period=0.004)


@pytest.fixture(scope="module")
def package(plant_build: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return export_package(setup_of("athena"), tmp_path_factory.mktemp("package") / "walk.ssp")


def changed(path: Path, folder: Path, members: Mapping[str, Callable[[str], str]]) -> Path:
    """Returns a copy of a package, or an FMU, with the texts of members changed."""
    copy = folder / path.name
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(copy, "w") as new:
        for name in old.namelist():
            data = old.read(name)
            new.writestr(name, members[name](data.decode()).encode() if name in members else data)
    return copy


def walked(call: Call, folder: Path, *words: str | Path) -> np.ndarray:
    code, _, err = call("simulate", *words, *QUICK, "-o", folder)
    assert code == 0, err
    file = folder / "results.csv"
    names = [
        one.partition(" [")[0].strip('"')
        for one in file.read_text("utf-8").partition("\n")[0].split(",")
    ]
    every = np.genfromtxt(file, delimiter=",", skip_header=1)
    return every[:, [names.index(name) for name in SEEN]]


def assert_close(found: np.ndarray, expected: np.ndarray) -> None:
    scale = np.maximum(np.abs(expected).max(axis=0), 1e-3)
    assert np.abs(found - expected).max(axis=0) / scale == pytest.approx(0.0, abs=SAME)


@pytest.mark.parametrize("robot", ["athena", "phantomx_mk4", "sts3215_hexapod"])
def test_a_package_of_each_robot_walks_as_the_scenario_in_both_standards(
    call: Call, tmp_path: Path, robot: str
) -> None:
    found = [
        walked(call, tmp_path / f"of{fmi}", export_package(
            setup_of(robot), tmp_path / f"{fmi}.ssp", fmi=fmi))
        for fmi in (2, 3)
    ]  # fmt: skip
    words = ("--set", f"robot={robot}", "--set", "macro_step=0.004")
    expected = walked(call, tmp_path / "own", "walk_flat", *words)
    assert np.array_equal(found[0], found[1])
    assert expected.shape == found[0].shape
    assert_close(found[0], expected)


def test_values_of_a_package_are_those_of_the_run(call: Call, tmp_path: Path) -> None:
    """Of settings and of enumerations; a body that differs needs the robot's file."""
    path = export_package(
        setup_of("athena"), tmp_path / "fast.ssp",
        values={**FAST, "plant": {"friction.law": 3.0, "friction.mu": 0.5}}, fmi=3,
    )  # fmt: skip
    words = ("friction.law=bristle", "friction.mu=0.5", "command.vx=0.1", "macro_step=0.004")
    given = [word for one in words for word in ("--set", one)]
    expected = walked(call, tmp_path / "own", "walk_flat", *given)
    assert_close(walked(call, tmp_path / "package", path), expected)
    other = export_package(setup_of("athena"), tmp_path / "other.ssp", values=FAST)
    outcome = call("simulate", other, "-o", tmp_path / "no")
    assert_refused(outcome, "1 numbers of its body that differ from those of athena, as torso.com")


def test_connections_name_the_variables_of_a_foreign_controller(
    call: Call, package: Path, tmp_path: Path
) -> None:
    with zipfile.ZipFile(package) as archive:
        archive.extract("resources/controller.fmu", tmp_path)
    names = {'"LF.coxa.angle"': '"q.1"', '"RR.tibia.angle_ref"': '"u.18"'}

    def renamed(text: str) -> str:
        for ours, own in names.items():
            text = text.replace(f"name={ours}", f"name={own}")
        return text

    def rewired(text: str) -> str:
        text = text.replace(
            'endElement="controller" endConnector="LF.coxa.angle"',
            'endElement="controller" endConnector="q.1"',
        ).replace(
            'startElement="controller" startConnector="RR.tibia.angle_ref"',
            'startElement="controller" startConnector="u.18"',
        )
        return text.replace("resources/controller.fmu", "resources/my%20law.fmu")

    fmu = changed(
        tmp_path / "resources/controller.fmu", tmp_path, {"modelDescription.xml": renamed}
    )
    foreign = changed(package, tmp_path, {STRUCTURE: rewired})
    with zipfile.ZipFile(foreign, "a") as archive:
        archive.write(fmu, "resources/my law.fmu")
    found = walked(call, tmp_path / "foreign", foreign)
    assert np.array_equal(found, walked(call, tmp_path / "own", package))


LINE = re.compile(r'<ssd:Connection startElement="plant" startConnector="LF.coxa.angle" [^>]*/>')


@pytest.mark.parametrize(
    ("change", "parts"),
    [
        (lambda text: LINE.sub("", text), ["got 'none of LF.coxa.angle', expected a connection"]),
        (
            lambda text: LINE.sub(
                lambda found: found[0].replace(
                    "/>", "><ssc:LinearTransformation/></ssd:Connection>"
                ),
                text,
            ),
            ["plant.LF.coxa.angle to controller.LF.coxa.angle with a transformation"],
        ),
        (
            lambda text: LINE.sub(
                lambda found: found[0].replace("LF.coxa.angle", "torso.yaw"), text
            ),
            ["not a name of a measurement", "'torso.yaw'"],
        ),
        (
            lambda text: LINE.sub(lambda found: found[0].replace('"controller"', '"plant"'), text),
            ["got 'plant.LF.coxa.angle to plant.LF.coxa.angle', expected each output of one FMU"],
        ),
        (
            lambda text: text.replace("resources/controller.fmu", "resources/plant.fmu"),
            ["plant, controller, of which 2 take joint commands"],
        ),
        (
            lambda text: text.replace("resources/controller.fmu", "../controller.fmu"),
            ["got '../controller.fmu', expected the path of an FMU in the package"],
        ),
        (
            lambda text: text.replace("<ssd:Elements>", "<ssd:ParameterBinding/><ssd:Elements>"),
            ["got 'parameter sets', expected values that are start values"],
        ),
        (lambda text: text.replace('"10.0"', '"later"'), ["'later'", "times and a step in s"]),
        (lambda text: f"<!DOCTYPE x>{text}", ["cannot be read: got '<!DOCTYPE'"]),
        (lambda text: text[:-20], ["SystemStructure.ssd cannot be read"]),
    ],
)
def test_what_the_loop_does_not_connect_is_refused(
    call: Call, package: Path, tmp_path: Path, change: Callable[[str], str], parts: list[str]
) -> None:
    path = changed(package, tmp_path, {STRUCTURE: change})
    assert_refused(call("simulate", path, "-o", tmp_path / "no"), *parts)
    assert not (tmp_path / "no").exists()


def test_a_file_that_is_no_package_is_refused_as_such(call: Call, tmp_path: Path) -> None:
    said = "no such package: got "
    assert_refused(call("simulate", "missing.ssp"), said, "missing.ssp", "hexapod export --ssp")
    (tmp_path / "text.ssp").write_text("no archive", encoding="utf-8")
    assert_refused(call("simulate", tmp_path / "text.ssp"), said, "a ZIP file with a System")
