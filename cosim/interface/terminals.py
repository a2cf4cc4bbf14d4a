"""Writes terminalsAndIcons.xml: groups of variables that users connect together, and the icon.

The file is defined by FMI 3.0 (section 2.4.9) and used since FMI 2.0.4. Each leg has the terminals
command (from a controller), state (measured by joint sensors) and foot (the contact); the torso has
push, motion and imu. Terminals connect by their members' names (rule "plug"), so that a
controller's terminal with the same members is connected as a whole.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from xml.etree.ElementTree import Element, SubElement

from hexapod_cosim.cosim.interface.model_description import document_text
from hexapod_cosim.models.records import JOINT_NAMES, LEG_NAMES

FOLDER = "terminalsAndIcons"
ICON = "icon.png"
COMMANDS = ("angle_ref", "speed_ref", "torque_ref", "acceleration_ref")
STATES = ("angle", "speed", "torque")
BODY = ("vx", "vy", "yaw_rate", "height", "roll", "pitch")  # inputs of a controller
Group = tuple[str, str, tuple[str, ...]]  # name, meaning, members
LEGS: tuple[Group, ...] = (
    ("command", "joint commands", COMMANDS),
    ("state", "joint states", STATES),
    ("servo", "faults of the servos", ("weakness", "lock")),
)
FOOT = "contact of the foot with the ground"
TORSO: tuple[Group, ...] = (
    ("push", "disturbing force and torque", ("torso.push_force", "torso.push_torque")),
    (
        "motion",
        "position, attitude and their rates",
        ("torso.position", "torso.quaternion", "torso.velocity", "torso.angular_velocity"),
    ),
    (
        "command",
        "commanded velocity and posture of the torso",
        tuple(f"command.{name}" for name in BODY),
    ),
    ("imu", "an ideal inertial sensor", ("imu.specific_force", "imu.angular_velocity")),
)
HALF_SIZE = 100.0  # the icon's coordinates run from -100 to 100
MILLIMETRES = 0.1  # per unit of these coordinates


def render_terminals(names: Sequence[str]) -> str:
    """Returns the document for an FMU with inputs and outputs of these names.

    Each leg has terminals of its scalars in FMI 2.0. In FMI 3.0 variables are arrays over legs and
    joints, so there is one set of terminals for all legs.
    """
    root, terminals = _document()
    legs = [
        (leg, f"leg {leg}", f"{leg}.", [f"{joint}." for joint in JOINT_NAMES]) for leg in LEG_NAMES
    ]
    if not any(name.startswith(f"{LEG_NAMES[0]}.") for name in names):
        legs = [("legs", "all legs: arrays over legs and joints", "", [""])]
    for leg, about, start, joints in legs:
        terminal, foot = _add(terminals, leg, about), f"{start}foot."
        for name, text, quantities in LEGS:
            members = [f"{joint}{quantity}" for joint in joints for quantity in quantities]
            present = [(f"{start}{one}", one) for one in members if f"{start}{one}" in names]
            if present:
                _add(terminal, name, text, present)
        points = [(one, one.removeprefix(foot)) for one in names if one.startswith(foot)]
        _add(terminal, "foot", FOOT, points)
    torso = _add(terminals, "torso", "what happens to the torso")
    for name, text, starts in TORSO:
        found = [(one, one.partition(".")[2]) for one in names if one.partition("[")[0] in starts]
        if found:
            _add(torso, name, text, found)
    return document_text(root)


def _document() -> tuple[Element, Element]:
    """Returns a document with the icon, and its element for terminals."""
    root = Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    corners = {
        "x1": repr(-HALF_SIZE),
        "y1": repr(-HALF_SIZE),
        "x2": repr(HALF_SIZE),
        "y2": repr(HALF_SIZE),
    }
    picture = SubElement(root, "GraphicalRepresentation")
    SubElement(
        picture, "CoordinateSystem", corners | {"suggestedScalingFactorTo_mm": repr(MILLIMETRES)}
    )
    SubElement(picture, "Icon", corners)
    return root, SubElement(root, "Terminals")


def _add(parent: Element, name: str, text: str, members: Iterable[tuple[str, str]] = ()) -> Element:
    """Adds a terminal of (variable, member) pairs."""
    terminal = SubElement(parent, "Terminal", name=name, matchingRule="plug", description=text)
    for variable, member in members:
        SubElement(
            terminal,
            "TerminalMemberVariable",
            variableName=variable,
            memberName=member,
            variableKind="signal",
        )
    return terminal
