"""The exporter, and how the binary reads an FMU's resources."""

from __future__ import annotations

import contextlib
import ctypes
import dataclasses
import os
import zipfile
from pathlib import Path
from urllib.parse import quote

import fmpy
import fmpy.build
import fmpy.validation
import numpy as np
import pytest
from building import TARGETS
from fmi_plant import ATHENA, OK, Plant

from hexapod_cosim.cosim.common import plant_files
from hexapod_cosim.cosim.export.plant import export_fmu
from hexapod_cosim.cosim.export.reference import FOLDER, MANIFEST
from hexapod_cosim.cosim.export.start_values import checksum, start_values
from hexapod_cosim.cosim.interface.model_description import render_fmi2
from hexapod_cosim.cosim.interface.plant import load_interface
from hexapod_cosim.cosim.interface.records import Interface
from hexapod_cosim.models.errors import HexapodError
from hexapod_cosim.models.records import Robot
from hexapod_cosim.models.robot import list_robots, load_robot

ROOT = Path(__file__).parents[2]
LOOPS = ("hexapod_master", "hexapod_gym")


@pytest.fixture
def heavy() -> Robot:
    robot = load_robot("athena")
    return dataclasses.replace(robot, torso=dataclasses.replace(robot.torso, mass=3.1))


def write_resources(folder: Path, robot: Robot) -> str:
    """Writes start values of a robot to a folder; returns the GUID."""
    return write_starts(folder, load_interface(robot))


def write_starts(folder: Path, interface: Interface) -> str:
    guid = render_fmi2(interface).guid
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "start_values.txt").write_text(start_values(interface, guid), encoding="utf-8")
    return guid


def members(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist() if not name.endswith("/")}


def test_an_exported_fmu_passes_fmpy_validation(athena_fmu: Path) -> None:
    assert fmpy.validation.validate_fmu(str(athena_fmu)) == []


def test_the_same_robot_makes_the_same_bytes(athena_fmu: Path, tmp_path: Path) -> None:
    assert (
        export_fmu(load_robot("athena"), tmp_path / "again.fmu").read_bytes()
        == athena_fmu.read_bytes()
    )


def test_a_bare_fmu_has_the_description_starts_and_binary_of_the_whole_one_and_no_more(
    athena_fmu: Path, tmp_path: Path
) -> None:
    whole = members(athena_fmu)
    bare = members(export_fmu(load_robot("athena"), tmp_path / "bare.fmu", bare=True))
    assert {name.partition("/")[0] for name in bare} == {
        "binaries", "modelDescription.xml", "resources",
    }  # fmt: skip
    assert all(whole[name] == content for name, content in bare.items())


def test_the_default_robot_needs_no_resources(athena_fmu: Path, tmp_path: Path) -> None:
    bare = tmp_path / "bare.fmu"
    with zipfile.ZipFile(bare, "w") as archive:
        for name, data in members(athena_fmu).items():
            if not name.startswith("resources/"):
                archive.writestr(name, data)
    names = ["torso.position[1]", "torso.position[3]", "RR.tibia.torque"]
    runs = [
        fmpy.simulate_fmu(str(path), output=names, stop_time=0.1) for path in (athena_fmu, bare)
    ]
    assert np.array_equal(*runs)


def test_robots_differ_in_description_resources_and_pictures_only(
    athena_fmu: Path, tmp_path: Path
) -> None:
    other = members(export_fmu(load_robot("phantomx_mk4"), tmp_path / "phantomx.fmu"))
    other = {
        name.replace(f"{FOLDER}/phantomx_mk4_", f"{FOLDER}/athena_"): data
        for name, data in other.items()
    }
    athena = members(athena_fmu)
    different = {name for name in athena if athena[name] != other[name]}
    assert set(other) == set(athena)
    pictures, results = (
        {"model.png", "terminalsAndIcons/icon.png"},
        {f"{FOLDER}/athena_{part}.csv" for part in ("in", "ref")},
    )
    assert different == {
        "modelDescription.xml",
        "documentation/index.html",
        "resources/start_values.txt",
    } | pictures | results | {MANIFEST}


@pytest.mark.parametrize(
    "form",
    [
        "file://{path}",
        "file:{path}",
        "file:///{path}",
        "file://{path}/",
        "FILE://localhost{path}",
        "file://{quoted}",
        "{path}",
        "{path}/",
    ],
)
def test_every_form_of_the_resources_uri_is_understood(
    plant_library: Path, tmp_path: Path, heavy: Robot, form: str
) -> None:
    folder = tmp_path / "with space" / "ünïcode" / "100%" / "resources"
    guid = write_resources(folder, heavy)
    plain = folder.as_posix()
    with Plant(
        plant_library, guid=guid, resources=form.format(path=plain, quoted=quote(plain))
    ) as plant:
        assert plant.component, plant.messages
        assert plant.real("torso.mass") == heavy.torso.mass


@pytest.mark.parametrize(
    "resources", [None, "", "file:///nowhere/at/all", "http://example.org/resources"]
)
def test_without_resources_only_the_default_robot_is_available(
    plant_library: Path, heavy: Robot, resources: str | None
) -> None:
    with Plant(plant_library, resources=resources) as plant:
        for variable in ATHENA.of_causality("input", "parameter"):
            assert variable.type != "Real" or plant.real(variable.name) == variable.start, (
                variable.name
            )
    with Plant(
        plant_library, resources=resources, guid=render_fmi2(load_interface(heavy)).guid
    ) as plant:
        assert plant.component is None
        assert "start_values.txt" in plant.last_message


def test_start_values_are_read_exactly(plant_library: Path, tmp_path: Path) -> None:
    interface = load_interface(load_robot("phantomx_mk4"))
    guid = write_resources(tmp_path, interface.robot)
    with Plant(plant_library, guid=guid, resources=tmp_path.as_uri()) as plant:
        for variable in interface.of_causality("input", "parameter"):
            if variable.type == "Real":
                assert plant.real(variable.name) == variable.start, variable.name
            else:
                assert plant.get_references("fmi2GetInteger", [variable.reference]) == (
                    OK,
                    [variable.start],
                )


def refusal(library: Path, folder: Path, robot: Robot, old: str, new: str) -> str:
    """Returns the FMU's message about start values in which `old` was replaced by `new`, which it
    must refuse.
    """
    guid = write_resources(folder, robot)
    file = folder / "start_values.txt"
    text = file.read_text(encoding="utf-8")
    assert old in text
    file.write_text(text.replace(old, new, 1), encoding="utf-8")
    with Plant(library, guid=guid, resources=folder.as_uri()) as plant:
        assert plant.component is None
        return str(plant.last_message)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("4000 0x", "4000 0y"),
        ("4000 0x", "4001 0x"),
        (" torso.mass", " torso.weight"),
        ("p+1 torso.mass", "p torso.mass"),
        ("p+1 torso.mass", "p+9999 torso.mass"),
        ("p+1 torso.mass", "p+1"),
        ("0x1.8", "nan 0x1.8"),
        ("\n4001 ", "\n\n4001 "),
        (" contact.law", "0 contact.law"),
        ("1 contact.law", "1.0 contact.law"),
        ("4000 0x", "4000 -0x"),
    ],
)
def test_malformed_start_values_are_refused_with_the_line(
    plant_library: Path, tmp_path: Path, heavy: Robot, old: str, new: str
) -> None:
    assert "start_values.txt: line " in refusal(plant_library, tmp_path, heavy, old, new)


def test_an_impossible_robot_is_refused_at_instantiation(
    plant_library: Path, tmp_path: Path
) -> None:
    robot = load_robot("athena")
    flat = dataclasses.replace(
        robot, torso=dataclasses.replace(robot.torso, inertia=(0.01, 0.01, 1.0, 0.0, 0.0, 0.0))
    )
    guid = write_resources(tmp_path, flat)
    with Plant(plant_library, guid=guid, resources=tmp_path.as_uri()) as plant:
        assert plant.component is None
        assert "torso.inertia_zz" in plant.last_message


def test_a_binary_refuses_start_values_of_another_table_of_outputs(
    plant_library: Path, tmp_path: Path
) -> None:
    """The outputs' names are not in the start values: with another order an angle would be read as
    a speed.
    """
    interface = load_interface(load_robot("athena"))
    angle, speed = (interface.variable(f"LF.femur.{name}") for name in ("angle", "speed"))
    swapped = {
        angle.name: dataclasses.replace(angle, reference=speed.reference),
        speed.name: dataclasses.replace(speed, reference=angle.reference),
    }
    variables = tuple(swapped.get(one.name, one) for one in interface.variables)
    guid = write_starts(tmp_path, dataclasses.replace(interface, variables=variables))
    with Plant(plant_library, guid=guid, resources=tmp_path.as_uri()) as plant:
        assert plant.component is None
        assert "and of the binary's variables" in plant.last_message


@pytest.mark.parametrize("robot", list_robots())
def test_all_robots_have_the_table_of_the_binary(robot: str) -> None:
    ours, default = (load_interface(load_robot(name)) for name in (robot, "athena"))
    assert ours.table_digest == default.table_digest


@pytest.mark.parametrize("data", [b"", b"a", b"12345678", b"123456789", bytes(range(256))])
def test_the_exporter_s_checksum_is_the_plant_s(core: ctypes.CDLL, data: bytes) -> None:
    core.hx_checksum.restype = ctypes.c_uint64
    for seed in (0, 1, 2**64 - 1):
        assert core.hx_checksum(
            ctypes.c_uint64(seed), data, ctypes.c_size_t(len(data))
        ) == checksum(seed, data)


def test_an_unwritable_path_is_one_error_and_leaves_no_file(
    plant_build: Path, tmp_path: Path
) -> None:
    blocker = tmp_path / "file"
    blocker.write_text("", encoding="utf-8")
    for path in (blocker / "athena.fmu", tmp_path):
        with pytest.raises(HexapodError, match="cannot write"):
            export_fmu(load_robot("athena"), path)
    assert list(tmp_path.iterdir()) == [blocker]


@pytest.mark.parametrize(("age", "stale"), [(0, False), (1, True)])
def test_a_binary_is_stale_a_second_before_its_newest_source(
    plant_library: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, age: int, stale: bool
) -> None:
    sources = [*plant_files.source_files().values(), ROOT / "plant_fmu" / "interface.toml"]
    built = int(max(path.stat().st_mtime for path in sources)) - age
    library = tmp_path / "binaries" / plant_files.fmi2_platform() / plant_library.name
    library.parent.mkdir(parents=True)
    library.write_bytes(b"")
    os.utime(library, (built, built))
    monkeypatch.setattr(plant_files, "plant_folders", lambda: [tmp_path])
    with (
        pytest.raises(HexapodError, match="older than its sources")
        if stale
        else contextlib.nullcontext()
    ):
        assert plant_files.binary(plant_files.fmi2_platform()) == library


@pytest.mark.parametrize("name", [name for name in TARGETS if name in LOOPS])
def test_a_loop_s_library_is_stale_a_second_before_its_newest_source(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    sources = [*(ROOT / "cosim" / "master").rglob("*.[ch]")]
    if name == "hexapod_gym":
        sources += (ROOT / "extensions" / "gym" / "loop").rglob("*.[ch]")
    newest = int(max(path.stat().st_mtime for path in sources))
    library = tmp_path / "lib" / f"{name}.so"
    library.parent.mkdir()
    library.write_bytes(b"")
    monkeypatch.setattr(plant_files, "plant_folders", lambda: [tmp_path])
    os.utime(library, (newest, newest))
    assert plant_files.shared_library(name) == library
    os.utime(library, (newest - 1, newest - 1))
    with pytest.raises(HexapodError, match=f"the library {name} is older than its sources"):
        plant_files.shared_library(name)


def test_fmpy_builds_an_fmu_of_sources_alone_into_a_binary_of_the_same_results(
    athena_fmu: Path, tmp_path: Path
) -> None:
    bare = export_fmu(load_robot("athena"), tmp_path / "sources.fmu", platforms="sources")
    unzipped = Path(fmpy.extract(str(bare), str(tmp_path / "fmu")))
    assert not (unzipped / "binaries").exists()
    fmpy.build.build_platform_binary(
        unzipped, cmake_options={"CMAKE_C_FLAGS_RELEASE:STRING": "-O0"}
    )
    names = ["torso.position[1]", "torso.position[3]", "RR.tibia.torque"]
    rebuilt = fmpy.simulate_fmu(str(unzipped), output=names, stop_time=0.2)
    original = fmpy.simulate_fmu(str(athena_fmu), output=names, stop_time=0.2)
    for name in names:
        assert np.array_equal(rebuilt[name], original[name])
