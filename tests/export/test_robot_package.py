"""A package of plant and controller FMU walks as the Python master and controller do, with present
measurements or with those of one period before.
"""

from __future__ import annotations

import zipfile
from pathlib import Path
from xml.etree import ElementTree

import fmpy
import numpy as np
import pytest
from command import Call
from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import read_ssd
from gains import PERIOD, make_gains

from hexapod_cosim.controller import make_gait
from hexapod_cosim.cosim.export.robot_package import CONTROLLER, PLANT, export_package, read_values
from hexapod_cosim.cosim.interface.controller import ControllerSetup
from hexapod_cosim.cosim.master.sensors import MEASURED
from hexapod_cosim.cosim.master.signals import ACCELERATION, COMMANDED
from hexapod_cosim.models import FmuError, HexapodError, load_robot
from tools.importers import delayed, package3
from tools.importers.package import run

ORDER = (PLANT, CONTROLLER)
STEPS = 160  # the ramp, lift-offs and touch-downs
# due to the last bits of the commands, which stiff servos and the ground amplify
SAME = 1e-9
KINEMATIC = ("--ssp", "--controller", "kinematic", "--set")
# outputs without direct feed-through
SEEN = (
    "torso.position[1]",
    "torso.position[3]",
    "torso.yaw",
    "LF.coxa.angle",
    "RM.femur.speed",
    "LF.foot.normal_force",
    "RM.foot.force[3]",
)


@pytest.fixture(scope="module")
def setup() -> ControllerSetup:
    robot = load_robot("athena")
    return ControllerSetup(
        robot=robot, gait=make_gait(robot), period=PERIOD, gains=make_gains(robot)
    )


@pytest.fixture(scope="module")
def package(
    setup: ControllerSetup, plant_build: Path, tmp_path_factory: pytest.TempPathFactory
) -> Path:
    return export_package(setup, tmp_path_factory.mktemp("package") / "athena.ssp")


@pytest.fixture(scope="module")
def arrays_package(
    setup: ControllerSetup, plant_build: Path, tmp_path_factory: pytest.TempPathFactory
) -> Path:
    """A package of FMI 3.0 FMUs."""
    return export_package(setup, tmp_path_factory.mktemp("arrays") / "athena.ssp", fmi=3)


@pytest.fixture(scope="module")
def plant(package: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    with zipfile.ZipFile(package) as archive:
        return Path(archive.extract("resources/plant.fmu", tmp_path_factory.mktemp("plant")))


def test_the_inputs_and_outputs_of_the_controller_are_connected(package: Path) -> None:
    connections = read_ssd(str(package), validate=True).system.connections
    joints = {name for names in (*COMMANDED.values(), ACCELERATION) for name in names}
    measured = {*MEASURED["angle"], *MEASURED["foot_force"], *MEASURED["quaternion"]}
    assert {one.startConnector for one in connections if one.startElement == CONTROLLER} == joints
    assert {one.startConnector for one in connections if one.startElement == PLANT} == measured
    assert len(connections) == len(joints) + len(measured)


@pytest.mark.parametrize("is_late", [False, True], ids=["on time", "a period late"])
def test_a_package_walks_as_the_python_master_does(
    setup: ControllerSetup, package: Path, plant: Path, is_late: bool
) -> None:
    names = [f"{PLANT}.{name}" for name in SEEN]
    found = run(package, names, step=PERIOD, steps=STEPS, order=ORDER, in_order=not is_late)
    expected = delayed.walk(setup, plant, duration=STEPS * PERIOD, overrides=[], late=is_late)
    scale = np.maximum(np.abs(expected.columns(SEEN)).max(axis=0), 1e-3)
    assert expected.column("LF.foot.contact").min() == 0.0
    assert np.abs(found.columns(names) - expected.columns(SEEN)).max(
        axis=0
    ) / scale == pytest.approx(0.0, abs=SAME)


def starts(package: Path, component: str, folder: Path) -> dict[str, str]:
    """Returns the start values of an FMU of a package by the names of its variables."""
    with zipfile.ZipFile(package) as archive:
        fmu = archive.extract(f"resources/{component}.fmu", folder)
    return {one.name: one.start for one in fmpy.read_model_description(fmu).modelVariables}


def test_values_are_start_values_of_the_fmus(
    setup: ControllerSetup, plant_build: Path, tmp_path: Path
) -> None:
    texts = ["controller.command.yaw_rate=0.1", "plant.friction.mu=0.5", "plant.friction.law=2"]
    values = read_values([*texts, "controller.command.vx=0"])
    path = export_package(setup, tmp_path / "athena.ssp", values=values)
    controller, plant = (starts(path, name, tmp_path) for name in (CONTROLLER, PLANT))
    assert float(controller["command.yaw_rate"]) == 0.1
    assert float(controller["command.vx"]) == 0.0
    assert float(plant["friction.mu"]) == 0.5
    assert int(plant["friction.law"]) == 2


def test_without_values_the_robot_walks_straight_ahead(package: Path, tmp_path: Path) -> None:
    found = starts(package, CONTROLLER, tmp_path)
    command = {name: float(value) for name, value in found.items() if name.startswith("command.")}
    assert {name: value for name, value in command.items() if value} == {"command.vx": 0.08}


def test_arrays_of_fmi_3_are_connected_as_a_whole(arrays_package: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(arrays_package) as archive:
        names = archive.namelist()
        archive.extractall(tmp_path)
    assert names == ["SystemStructure.ssd", "resources/plant.fmu", "resources/controller.fmu"]
    root = ElementTree.parse(tmp_path / names[0]).getroot()
    assert root.get("version") == "2.0"
    assert [one.get("startConnector") for one in root.iter(f"{package3.SSD}Connection")] == [
        "angle", "foot.force", "torso.quaternion", "angle_ref", "speed_ref", "torque_ref",
        "acceleration_ref",
    ]  # fmt: skip
    for component in root.iter(f"{package3.SSD}Component"):
        fmu = fmpy.read_model_description(str(tmp_path / component.get("source", "")))
        variables = {one.name: one for one in fmu.modelVariables}
        for connector in component.iter(f"{package3.SSD}Connector"):
            variable = variables[connector.get("name")]
            kind, *sizes = connector
            assert kind.tag == f"{package3.SSC}{variable.type}"
            assert connector.get("kind") == variable.causality
            assert [one.get("size") for one in sizes] == [
                str(one.start) for one in variable.dimensions
            ]


def test_a_package_of_fmi_3_walks_as_that_of_fmi_2(package: Path, arrays_package: Path) -> None:
    names = [f"{PLANT}.torso.position", f"{PLANT}.foot.force"]
    found = package3.run(arrays_package, names, step=PERIOD, steps=STEPS, order=ORDER)
    scalars = [f"{PLANT}.torso.position[{i}]" for i in (1, 2, 3)]
    scalars += [
        f"{PLANT}.{leg}.foot.force[{i}]"
        for leg in ("LF", "LM", "LR", "RF", "RM", "RR")
        for i in (1, 2, 3)
    ]
    expected = run(package, scalars, step=PERIOD, steps=STEPS, order=ORDER, in_order=True)
    assert np.array_equal(found, expected.columns(scalars))
    assert found[-1, 0] - found[0, 0] > 0.02


def test_a_value_of_an_input_that_the_controller_sets_is_refused(
    setup: ControllerSetup, tmp_path: Path
) -> None:
    values = {PLANT: {"LF.coxa.angle_ref": 0.1}}
    with pytest.raises(FmuError, match="no such value to set"):
        export_package(setup, tmp_path / "no.ssp", values=values, fmi=3)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("text", "said"),
    [("ctrl.command.vx=1", "component"), ("controller.command.vx=fast", "not a number")],
)
def test_invalid_values_are_refused(text: str, said: str) -> None:
    with pytest.raises(HexapodError, match=said):
        read_values([text])


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--set", "plant.friction.mu=0.5", "-o", "one.fmu"), "without a package"),
        (("--ssp", "-o", "one.fmu"), "not the name of such a file"),
        (("--ssp", "--urdf"), "two formats"),
        (("--ssp", "--controller", "kinematic", "--fmi", "4"), "no such FMI version"),
        (("--ssp", "--platforms", "sources"), "without binaries"),
        ((*KINEMATIC, "plant.friction.nu=1"), "did you mean 'friction.mu'"),
        (
            (*KINEMATIC, "plant.friction.mu=-5"),
            "plant.friction.mu is out of range: got -5.0, expected 0 to 100",
        ),
        ((*KINEMATIC, "plant.friction.mu=nan"), "got nan, expected 0 to 100"),
        ((*KINEMATIC, "plant.friction.mu=1e400"), "got inf, expected 0 to 100"),
        (
            (*KINEMATIC, "controller.command.vx=99"),
            "controller.command.vx is out of range: got 99.0, expected -10 to 10 m/s",
        ),
        ((*KINEMATIC, "plant.friction.law=1.5"), "got 1.5, expected 1 to"),
    ],
)
def test_invalid_packages_are_refused_and_no_file_is_written(
    call: Call,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: tuple[str, ...],
    said: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    code, _, err = call("export", *arguments)
    assert code != 0
    assert said in err
    assert not list(tmp_path.iterdir())


def test_a_package_for_no_platform_is_refused(setup: ControllerSetup, tmp_path: Path) -> None:
    with pytest.raises(FmuError, match="without binaries"):
        export_package(setup, tmp_path / "no.ssp", platforms=[])
    assert not list(tmp_path.iterdir())


def test_the_package_walks_in_fmpy(package: Path) -> None:
    result = simulate_ssp(str(package), stop_time=3.0, step_size=PERIOD)
    x, height = (result[f"plant.torso.position[{axis}]"] for axis in (1, 3))
    assert 0.18 < x[-1] < 0.22  # m    0.08 m/s, after a ramp of a gait period
    assert height.min() > 0.12
