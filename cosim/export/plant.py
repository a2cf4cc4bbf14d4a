"""Writes FMUs of plants and controllers.

The binary is the same for every robot; the model description and the start values are the robot's.
"""

from __future__ import annotations

import zipfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from zipfile import ZIP_DEFLATED, ZIP_STORED

from hexapod_cosim.cosim.common.components import CONTROLLER, PLANT, Component
from hexapod_cosim.cosim.common.files import atomic_path, writing_into
from hexapod_cosim.cosim.common.plant_files import (
    FMI2_SOURCES,
    FMI3_SOURCES,
    binary,
    fmi2_platform,
    fmi3_platform,
    licence_file,
    source_files,
)
from hexapod_cosim.cosim.common.temporary import TemporaryFolder
from hexapod_cosim.cosim.export.platforms import build_binaries, choose_platforms, component_library
from hexapod_cosim.cosim.export.reference import reference_members
from hexapod_cosim.cosim.export.start_values import start_values, with_starts
from hexapod_cosim.cosim.interface.arrays import arrays
from hexapod_cosim.cosim.interface.controller import ControllerSetup, load_controller_interface
from hexapod_cosim.cosim.interface.model_description import render_fmi2
from hexapod_cosim.cosim.interface.model_description3 import render_build_description, render_fmi3
from hexapod_cosim.cosim.interface.plant import load_interface
from hexapod_cosim.cosim.interface.records import Interface
from hexapod_cosim.cosim.interface.terminals import FOLDER, ICON, render_terminals
from hexapod_cosim.models.errors import FmuError, check_type
from hexapod_cosim.models.ground.faces import surface_of
from hexapod_cosim.models.ground.grid_file import grid_bytes
from hexapod_cosim.models.ground.surface import Surface
from hexapod_cosim.models.records import Robot
from hexapod_cosim.models.validation.bodies import check_settings
from hexapod_cosim.models.validation.laws import check_contact_surface

FMI_VERSIONS = (2, 3)
NOTHING: Mapping[str, bytes] = MappingProxyType({})
TIMESTAMP = (1980, 1, 1, 0, 0, 0)  # of every member, so that archives are reproducible

# in a binary that a compiler without complex numbers built (plant_fmu/src/plant/continuous.c)
NO_DERIVATIVES = b"derivatives: got a call in a binary without complex numbers"

# path of the model's picture by version of the standard
PICTURES = {2: "model.png", 3: "documentation/diagram.png"}
LICENCE = "documentation/licenses/license.txt"
PICTURE_SIZE, ICON_SIZE = (480, 360), (160, 160)  # pixels


def export_fmu(
    robot: Robot,
    path: str | Path,
    *,
    fmi: int = 2,
    platforms: Iterable[str] | None = None,
    terrains: Sequence[Surface] = (),
    starts: Mapping[str, float] = MappingProxyType({}),
    bare: bool = False,
) -> Path:
    """Writes the plant's FMU of a robot and returns its path.

    Args:
        robot: the robot whose values the FMU starts with.
        path: the file to write, atomically. Its folder is created if need be.
        fmi: version of the standard.
        platforms: names such as linux64 or "all", to cross-compile binaries; "sources" for no
            binary. By default the installed binary of this machine.
        terrains: surfaces to pack as grid files, numbered from 1; after the robot's own, if it
            stands on one. If it does not, the FMU starts on the first of them.
        starts: of inputs and parameters by name, instead of the robot's.
        bare: write only what a simulation reads: model description, start values, binary and
            grids, without compression. Such a file is made in a tenth of the time, for use by this
            process alone: documentation, pictures, sources and the licence are missing.

    Raises FmuError without a binary or cross compiler, for an unknown version or platform and for
    invalid start values; HexapodError when the path cannot be written.
    """
    check_type(robot, Robot, "a Robot, as of load_robot()", where="robot", error=FmuError)
    own = surface_of(robot.terrain)
    grids = list(dict.fromkeys([*([] if own is None else [own]), *terrains]))
    if grids and own is None:
        robot = replace(robot, terrain=replace(robot.terrain, kind="grid", surface=grids[0]))
        check_settings(robot)
    for number, surface in enumerate(grids, start=1):
        check_contact_surface(robot, surface, f"terrain {number}, {surface.name}")
    return export_interface(
        with_starts(load_interface(robot), starts),
        path,
        fmi=fmi,
        platforms=platforms,
        grids=grid_members(grids),
        bare=bare,
    )


def export_controller(
    setup: ControllerSetup,
    path: str | Path,
    *,
    fmi: int = 2,
    platforms: Iterable[str] | None = None,
    starts: Mapping[str, float] = MappingProxyType({}),
    bare: bool = False,
) -> Path:
    """Writes a controller's FMU and returns its path.

    Arguments and errors are those of `export_fmu`; also raises the errors of `Controller`.
    """
    check_type(setup, ControllerSetup, "a ControllerSetup", where="setup", error=FmuError)
    interface = with_starts(load_controller_interface(setup), starts)
    return export_interface(interface, path, fmi=fmi, platforms=platforms, bare=bare)


def grid_members(surfaces: Iterable[Surface]) -> dict[str, bytes]:
    """Returns grid files by their path in the FMU, numbered from 1."""
    return {
        f"resources/terrain/{number}.terrain": grid_bytes(surface)
        for number, surface in enumerate(surfaces, start=1)
    }


def export_interface(
    interface: Interface,
    path: str | Path,
    *,
    fmi: int = 2,
    platforms: Iterable[str] | None = None,
    grids: Mapping[str, bytes] = NOTHING,
    packed: Mapping[str, bytes] = NOTHING,
    bare: bool = False,
) -> Path:
    """Writes the FMU of a component with this interface; arguments and errors as `export_fmu`.

    grids, packed: grid files, and binaries instead of `platforms`, by their path in the FMU.
    """
    check_type(path, (str, Path), "the path of the file to write", where="path", error=FmuError)
    if fmi not in FMI_VERSIONS:
        offered = ", ".join(map(str, FMI_VERSIONS))
        raise FmuError(
            "no such FMI version", got=fmi, expected=offered, fix="export with one of these"
        )
    component = interface.component
    chosen = None if platforms is None else choose_platforms(platforms, fmi=fmi)
    if packed:
        binaries = dict(packed)
    elif chosen is None:
        binaries = installed_binary(component, fmi=fmi)
    else:
        binaries = build_binaries(component_library(component), chosen, fmi=fmi)
    complete = for_binaries(interface, binaries)
    if bare:
        description = _description(complete, fmi)[1]
        return write_archive(Path(path), description | dict(binaries) | dict(grids), ZIP_STORED)
    return write_archive(Path(path), _members(complete, dict(binaries) | dict(grids), fmi))


def installed_binary(component: Component = PLANT, *, fmi: int = 2) -> dict[str, bytes]:
    """Returns the binary that was installed with this package, by its path in the FMU."""
    library = binary(fmi2_platform(), component)
    folder = fmi2_platform() if fmi == 2 else fmi3_platform()
    return {f"binaries/{folder}/{component.identifier}{library.suffix}": library.read_bytes()}


def _description(interface: Interface, fmi: int) -> tuple[str, dict[str, bytes]]:
    """Returns the text of modelDescription.xml, and it and the start values by path."""
    description = (render_fmi2 if fmi == 2 else render_fmi3)(interface)
    return description.xml, {
        "modelDescription.xml": description.xml.encode(),
        "resources/start_values.txt": start_values(interface, description.guid).encode(),
    }


def _members(interface: Interface, binaries: Mapping[str, bytes], fmi: int) -> dict[str, bytes]:
    """Returns the contents of the archive by path."""
    xml, members = _description(interface, fmi)
    members |= dict(binaries) | _sources(interface.component, fmi)
    reference = _reference(interface, members, fmi)
    return members | extra_members(interface, xml, fmi=fmi, reference=bool(reference)) | reference


def _sources(component: Component, fmi: int) -> dict[str, bytes]:
    """Returns the binary's sources without the files for the other version of the standard, whose
    headers an importer may not have.
    """
    other = FMI3_SOURCES if fmi == 2 else FMI2_SOURCES
    files = {
        name: path for name, path in source_files(component).items() if not name.startswith(other)
    }
    members = {f"sources/{name}": path.read_bytes() for name, path in files.items()}
    if fmi == 3:
        description = render_build_description(
            component, (name for name in files if name.endswith(".c"))
        )
        members["sources/buildDescription.xml"] = description.encode()
    return members


def _reference(interface: Interface, members: dict[str, bytes], fmi: int) -> dict[str, bytes]:
    """Returns reference results of a plant or controller of FMI 2.0 that has a binary for this
    machine.
    """
    own, known = f"binaries/{fmi2_platform()}/", (PLANT, CONTROLLER)
    if fmi != 2 or interface.component not in known or not any(own in name for name in members):
        return {}
    with TemporaryFolder("export") as folder:
        trial = write_archive(folder / "trial.fmu", members, ZIP_STORED)
        return reference_members(interface, trial)


def write_archive(
    path: Path, members: Mapping[str, bytes], compression: int = ZIP_DEFLATED
) -> Path:
    """Writes a ZIP archive atomically; equal members give equal bytes.

    Raises HexapodError when it cannot be written.
    """
    with (
        writing_into(path.parent),
        atomic_path(path) as part,
        zipfile.ZipFile(part, "w") as archive,
    ):
        for name, content in members.items():
            archive.writestr(_member(name, compression), content)
    return path


def _member(name: str, compression: int) -> zipfile.ZipInfo:
    """Returns the ZIP entry of a path."""
    info = zipfile.ZipInfo(name, TIMESTAMP)
    info.compress_type = compression
    info.create_system = 3  # Unix, wherever it is packed
    info.external_attr = (0o755 if name.startswith("binaries/") else 0o644) << 16
    return info


def for_binaries(interface: Interface, binaries: Mapping[str, bytes]) -> Interface:
    """Returns the interface that all of these binaries have: without directional derivatives if
    one was built by a compiler without complex numbers, such as Microsoft's.
    """
    lacking = any(NO_DERIVATIVES in data for data in binaries.values())
    return replace(interface, directional_derivatives=False) if lacking else interface


def extra_members(
    interface: Interface, description: str, *, fmi: int = 2, reference: bool = False
) -> dict[str, bytes]:
    """Returns the files by path in the archive.

    Args:
        interface: of the FMU.
        description: the FMU's modelDescription.xml.
        fmi: version of the standard.
        reference: whether the archive contains reference results.
    """
    # imported here: runs need neither pages nor pictures
    from hexapod_cosim.cosim.export.documentation import render_html  # noqa: PLC0415

    ports = list(interface.by_name)
    if fmi == 3:
        seen = ("input", "output")
        ports = [one.name for one in arrays(interface) if one.first.causality in seen]
    return {
        "documentation/index.html": render_html(
            interface, description, picture=PICTURES[fmi], reference=reference
        ).encode(),
        LICENCE: licence_file().read_bytes(),
        f"{FOLDER}/terminalsAndIcons.xml": render_terminals(ports).encode(),
        **pictures(interface, fmi=fmi),
    }


def pictures(interface: Interface, *, fmi: int = 2) -> dict[str, bytes]:
    """Returns the robot's picture and icon by path in the archive."""
    from hexapod_cosim.cosim.export.documentation import draw_robot  # noqa: PLC0415

    sizes = {PICTURES[fmi]: PICTURE_SIZE, f"{FOLDER}/{ICON}": ICON_SIZE}
    return {
        path: draw_robot(interface.robot, width=width, height=height)
        for path, (width, height) in sizes.items()
    }
