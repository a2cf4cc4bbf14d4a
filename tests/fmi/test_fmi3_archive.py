"""Tests the FMI 3.0 FMU as a file: validation by fmpy and by the standard's schemas, runs of fmpy
compared with FMI 2.0, sources, terminals, derivatives.
"""

from __future__ import annotations

import ctypes
import zipfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import fmpy
import fmpy.build
import fmpy.validation
import numpy as np
import pytest
from fmi3_plant import ARRAYS, STATE_NAMES, Plant3
from fmi_plant import ATHENA, ERROR, MODEL_EXCHANGE, OK, Plant
from lxml import etree
from numpy.typing import NDArray

from hexapod_cosim.cosim.export.plant import export_fmu
from hexapod_cosim.models.robot import load_robot

SCHEMAS = Path(fmpy.__file__).parent / "schema" / "fmi3"
DROP, PUSH, STOP = 0.15, 3.0, 0.25  # m, N, s
START2 = {"initial.position[3]": DROP, "torso.push_force[1]": PUSH}
START3 = {"initial.position": [0.0, 0.0, DROP], "torso.push_force": [PUSH, 0.0, 0.0]}
SEEN2 = [
    "torso.position[1]",
    "torso.position[3]",
    "RR.tibia.torque",
    "LF.foot.force[3]",
    "solver.steps",
]
SEEN3 = ["torso.position", "torque", "foot.force", "solver.steps"]


@pytest.fixture(scope="module")
def exported3(plant_build: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return export_fmu(
        load_robot("athena"), tmp_path_factory.mktemp("export3") / "athena.fmu", fmi=3
    )


def run2(path: Path, **options: Any) -> NDArray[np.float64]:
    """Returns the last row of an FMI 2.0 run."""
    result = fmpy.simulate_fmu(
        str(path),
        stop_time=STOP,
        output_interval=0.005,
        start_values=START2,
        output=SEEN2,
        **options,
    )
    return np.array([result[name][-1] for name in SEEN2])


def run3(path: Path, **options: Any) -> NDArray[np.float64]:
    """Returns the last row of an FMI 3.0 run, with the elements that SEEN2 names."""
    result = fmpy.simulate_fmu(
        str(path),
        stop_time=STOP,
        output_interval=0.005,
        start_values=START3,
        output=SEEN3,
        **options,
    )
    position, torque, force, steps = (result[name][-1] for name in SEEN3)
    return np.array([position[0], position[2], torque[5][2], force[0][2], steps])


def test_the_file_passes_fmpy_validation(exported3: Path) -> None:
    assert fmpy.validation.validate_fmu(str(exported3)) == []


@pytest.mark.parametrize(
    ("member", "schema"),
    [
        ("modelDescription.xml", "fmi3ModelDescription"),
        ("sources/buildDescription.xml", "fmi3BuildDescription"),
        ("terminalsAndIcons/terminalsAndIcons.xml", "fmi3TerminalsAndIcons"),
    ],
)
def test_documents_follow_the_standard_s_schemas(exported3: Path, member: str, schema: str) -> None:
    with zipfile.ZipFile(exported3) as archive:
        document = etree.fromstring(archive.read(member))
    rules = etree.XMLSchema(etree.parse(str(SCHEMAS / f"{schema}.xsd")))
    assert rules.validate(document), rules.error_log


def test_the_archive_has_the_folders_of_fmi_3(exported3: Path) -> None:
    with zipfile.ZipFile(exported3) as archive:
        names = set(archive.namelist())
    library = f"binaries/{fmpy.platform_tuple}/hexapod{fmpy.sharedLibraryExtension}"
    pictures = {"documentation/diagram.png", "terminalsAndIcons/icon.png"}
    assert {
        library,
        "documentation/index.html",
        "resources/start_values.txt",
        "sources/fmi/fmi3.c",
    } | pictures <= names
    assert not names & {"sources/fmi/fmi2.c", "model.png"}  # files of FMI 2


def test_the_fmu_stands_still_in_fmpy(exported3: Path) -> None:
    settled = 1e-5  # m
    height = fmpy.simulate_fmu(str(exported3), output=["torso.position"], stop_time=0.5)[
        "torso.position"
    ][:, 2]
    assert abs(height - height[0]).max() < settled


def test_co_simulation_gives_what_fmi_2_gives_bit_for_bit(
    exported3: Path, athena_fmu: Path
) -> None:
    expected = run2(athena_fmu, fmi_type="CoSimulation")
    assert run3(exported3, fmi_type="CoSimulation").tolist() == expected.tolist()
    assert (
        run3(exported3, fmi_type="CoSimulation", use_event_mode=True).tolist() == expected.tolist()
    )


def test_fmpy_builds_the_sources_into_an_equal_binary(exported3: Path, tmp_path: Path) -> None:
    unzipped = Path(fmpy.extract(str(exported3), str(tmp_path / "fmu")))
    for binary in (unzipped / "binaries").rglob("*.*"):
        binary.unlink()
    fmpy.build.build_platform_binary(
        unzipped, cmake_options={"CMAKE_C_FLAGS_RELEASE:STRING": "-O0"}
    )
    options = {"fmi_type": "CoSimulation", "use_event_mode": True}
    assert run3(unzipped, **options).tolist() == run3(exported3, **options).tolist()


def test_terminals_hold_known_variables(exported3: Path) -> None:
    with zipfile.ZipFile(exported3) as archive:
        root = ElementTree.fromstring(archive.read("terminalsAndIcons/terminalsAndIcons.xml"))
    members = [str(member.get("variableName")) for member in root.iter("TerminalMemberVariable")]
    assert len(members) == len(set(members)) >= 20
    assert set(members) <= set(ARRAYS)


# structure


def test_states_and_derivatives_are_arrays_in_fmi_2_s_order(
    exported3: Path, plant_library: Path
) -> None:
    description = fmpy.read_model_description(str(exported3))
    by_name = {variable.name: variable for variable in description.modelVariables}
    flat: list[str] = []
    for unknown in description.derivatives:
        state = unknown.variable.derivative
        assert by_name[state.name].valueReference == ARRAYS[state.name].reference
        flat += [element.name for element in ARRAYS[state.name].elements]
    assert flat == STATE_NAMES
    indicators = [indicator.variable.name for indicator in description.eventIndicators]
    assert indicators == [
        "foot.event_indicator",
        "knee.event_indicator",
        "shank.event_indicator",
        "torso.event_indicator",
        "neighbour_event_indicator",
    ]
    with (
        Plant3(plant_library, kind="ModelExchange") as plant,
        Plant(plant_library, kind=MODEL_EXCHANGE) as other,
    ):
        plant.initialize()
        other.initialize()
        assert plant.row("fmi3GetContinuousStates", 70).tolist() == other.reals(STATE_NAMES)
        assert (
            plant.row("fmi3GetEventIndicators", 50).tolist()
            == np.concatenate([np.ravel(plant.get(name)[0]) for name in indicators]).tolist()
        )
        rates = [state.derivative for state in ATHENA.states]
        assert plant.row("fmi3GetContinuousStateDerivatives", 70).tolist() == other.reals(rates)
        assert plant.row("fmi3GetNominalsOfContinuousStates", 70).min() > 0.0


def test_dependencies_are_those_of_the_elements(exported3: Path) -> None:
    description = fmpy.read_model_description(str(exported3))
    stated = {unknown.variable.name: unknown.dependencies for unknown in description.derivatives}
    assert {variable.name for variable in stated["der(torso.quaternion)"]} == {
        "torso.quaternion",
        "torso.angular_velocity",
    }
    everything = {variable.name for variable in stated["der(speed)"]}  # written out
    assert {"torso.position", "angle", "torque_ref", "weakness"} < everything


def test_directional_derivatives_of_arrays_are_fmi_2_s_of_elements(
    running3: Plant3, running: Plant
) -> None:
    known, unknown = ARRAYS["torque_ref"], ARRAYS["der(speed)"]
    seed, result = (ctypes.c_double * 18)(*np.linspace(-1.0, 1.0, 18)), (ctypes.c_double * 18)()
    references = [(ctypes.c_uint * 1)(array.reference) for array in (unknown, known)]
    assert (
        running3.call(
            "fmi3GetDirectionalDerivative", references[0], 1, references[1], 1, seed, 18, result, 18
        )
        == OK
    )
    numbers = [
        (ctypes.c_uint * 18)(*(element.reference for element in array.elements))
        for array in (unknown, known)
    ]
    expected = (ctypes.c_double * 18)()
    sizes = ctypes.c_size_t(18)
    assert (
        running.call(
            "fmi2GetDirectionalDerivative", numbers[0], sizes, numbers[1], sizes, seed, expected
        )
        == OK
    )
    assert list(result) == list(expected)
    assert np.abs(result).max() > 1.0
    assert (
        running3.call(
            "fmi3GetDirectionalDerivative", references[0], 1, references[1], 1, seed, 17, result, 18
        )
        == ERROR
    )
    assert (
        running3.call(
            "fmi3GetDirectionalDerivative", references[0], 1, references[1], 1, seed, 18, result, 6
        )
        == ERROR
    )
