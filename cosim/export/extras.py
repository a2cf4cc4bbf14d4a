"""Further files of an FMU: documentation, pictures, terminals, licence."""

from __future__ import annotations

from hexapod_cosim.cosim.common.plant_files import licence_file
from hexapod_cosim.cosim.export.documentation import render_html
from hexapod_cosim.cosim.export.picture import draw_robot
from hexapod_cosim.cosim.interface.arrays import arrays
from hexapod_cosim.cosim.interface.plant import Interface
from hexapod_cosim.cosim.interface.terminals import (
    FOLDER,
    ICON,
    render_terminals,
    render_terminals3,
)

# path of the model's picture by version of the standard
PICTURES = {2: "model.png", 3: "documentation/diagram.png"}
LICENCE = "documentation/licenses/license.txt"
PICTURE_SIZE, ICON_SIZE = (480, 360), (160, 160)  # pixels


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
    ports = [
        array.name for array in arrays(interface) if array.first.causality in ("input", "output")
    ]
    terminals = render_terminals(list(interface.by_name)) if fmi == 2 else render_terminals3(ports)
    return {
        "documentation/index.html": render_html(
            interface, description, picture=PICTURES[fmi], reference=reference
        ).encode(),
        LICENCE: licence_file().read_bytes(),
        f"{FOLDER}/terminalsAndIcons.xml": terminals.encode(),
        **pictures(interface, fmi=fmi),
    }


def pictures(interface: Interface, *, fmi: int = 2) -> dict[str, bytes]:
    """Returns the robot's picture and icon by path in the archive."""
    sizes = {PICTURES[fmi]: PICTURE_SIZE, f"{FOLDER}/{ICON}": ICON_SIZE}
    return {
        path: draw_robot(interface.robot, width=width, height=height)
        for path, (width, height) in sizes.items()
    }
