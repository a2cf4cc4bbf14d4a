"""Writes documentation/index.html of an FMU."""

from __future__ import annotations

import posixpath
from xml.etree import ElementTree

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined

from hexapod_cosim.cosim.common.components import PLANT
from hexapod_cosim.cosim.interface.records import Interface

INTERFACES = {"CoSimulation": "co-simulation", "ModelExchange": "model exchange"}


def render_html(interface: Interface, description: str, *, picture: str, reference: bool) -> str:
    """Returns the page of one FMU. The templates are in pages/, one for each component.

    Args:
        interface: of the FMU.
        description: the FMU's modelDescription.xml.
        picture: path of the robot's picture in the archive.
        reference: whether the archive contains reference results.
    """
    root = ElementTree.fromstring(description.encode())
    environment = Environment(
        loader=ChoiceLoader(
            [PackageLoader(one, "pages") for one in (PLANT.package, interface.component.package)]
        ),
        autoescape=True,
        undefined=StrictUndefined,
    )
    robot, arrayed = interface.robot, str(root.get("fmiVersion")).startswith("3")
    return environment.get_template(f"{interface.component.name}.html.jinja").render(
        robot=robot,
        picture=posixpath.relpath(picture, "documentation"),
        reference=reference,
        interface=interface,
        joints=sum(len(leg.links) for leg in robot.legs),
        fmi=root.get("fmiVersion"),
        token=root.get("guid", root.get("instantiationToken")),
        kinds=[name for tag, name in INTERFACES.items() if root.find(tag) is not None],
        arrayed=arrayed,
        weight=robot.total_mass * max(map(abs, robot.gravity)),
    )
