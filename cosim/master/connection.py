"""Connects the variables of a controller FMU with the plant by name.

The FMU's inputs are measurements and body commands under the names of the plant's FMU; its outputs
are joint commands. A variable of another name is connected by a table: `[control.map]` of the
scenario, or `[map]` of a TOML file beside the FMU with the FMU's name. Keys are our names, values
the FMU's:

    [map]
    "{leg}.{joint}.angle_ref" = "q_{leg}_{joint}"   # 18 names at once
    "command.vx" = "v"
    "angle_ref" = "q"                               # an array (6, 3) of FMI 3
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

from hexapod_cosim.cosim.interface.names import vector_names
from hexapod_cosim.cosim.master.fmu_block import FmuVariable
from hexapod_cosim.cosim.master.sensors import CONTACT, MEASURED, READINGS
from hexapod_cosim.cosim.master.signals import ACCELERATION, COMMANDED, COMMANDS, JOINT_COMMANDS
from hexapod_cosim.models import JOINT_NAMES, LEG_NAMES, FmuError, suggestion
from hexapod_cosim.models.files import decoding_toml, parse_toml, read_text

MOST_SHOWN = 12  # names in a message
# sources of inputs, in the order of the vector that source_row() fills
SOURCES = [*COMMANDS, *READINGS]
SINKS = [*JOINT_COMMANDS, *ACCELERATION]  # of outputs: the plant's inputs
FAULTY = [f"{joint}.faulty" for joint in JOINT_NAMES]
FLAGS = ("swinging", "unreachable", "fallback", "absent", "outrun", "doubted", *FAULTY)
SHIFT = [name for leg in LEG_NAMES for name in vector_names(f"{leg}.shift", 2)]
LIFT = [f"{leg}.lift" for leg in LEG_NAMES]
PLANNED = [name for leg in LEG_NAMES for name in vector_names(f"{leg}.planned")]
DIAGNOSED = [*SHIFT, *LIFT, *PLANNED]
DIAGNOSED_FLAGS = [f"{leg}.{flag}" for flag in FLAGS for leg in LEG_NAMES]
# arrays of FMI 3: the plant's names without leg, joint and index
GROUPS: dict[str, list[str]] = {
    "angle": MEASURED["angle"],
    "speed": MEASURED["speed"],
    "foot.force": MEASURED["foot_force"],
    "foot.contact": CONTACT,
    "torso.quaternion": MEASURED["quaternion"],
    "torso.angular_velocity": MEASURED["angular_velocity"],
    **COMMANDED,
    "acceleration_ref": ACCELERATION,
    "shift": SHIFT,
    "lift": LIFT,
    "planned": PLANNED,
    **{flag: [f"{leg}.{flag}" for leg in LEG_NAMES] for flag in FLAGS},
    "faulty": [f"{leg}.{flag}" for leg in LEG_NAMES for flag in FAULTY],
    "command": COMMANDS,
}
OURS = {*SOURCES, *SINKS, *DIAGNOSED, *DIAGNOSED_FLAGS}


Pairs = list[tuple[str, list[str]]]  # the FMU's variable and our names of its elements


@dataclass(frozen=True)
class Connection:
    """The connected variables of a controller FMU."""

    inputs: Pairs  # of floating-point type
    flag_inputs: Pairs  # of Boolean type
    outputs: Pairs  # to the plant
    diagnostics: Pairs  # complete, or empty
    flags: Pairs  # complete, or empty
    unconnected: tuple[str, ...]  # inputs of the FMU without a source

    @property
    def is_scalar(self) -> bool:
        """Whether the loop in C can drive the FMU: it writes floating-point scalars alone."""
        pairs = chain(self.inputs, self.outputs, self.diagnostics, self.flags)
        return not self.flag_inputs and all(len(names) == 1 for _, names in pairs)


def connect(
    variables: Sequence[FmuVariable], table: Mapping[str, str], *, torque: bool, where: str
) -> Connection:
    """Returns the connection of a controller FMU by equal names and by a table.

    Args:
        variables: those of the FMU.
        table: the FMU's names by ours, as `names_of_map` returns them.
        torque: whether the servos follow `torque_ref` alone.
        where: the FMU's file, for messages.

    Raises:
        FmuError: a name of the table is not the FMU's, or joint commands are missing.
    """
    present = {item.name: item for item in variables}
    for own, theirs in table.items():
        if theirs not in present:
            raise _not_in_fmu(own, theirs, present, where)
    taken = {theirs: own for own, theirs in table.items()}
    found: dict[str, Pairs] = {key: [] for key in ("real", "flag", "out", "info", "mark")}
    unconnected = []
    for item in variables:
        ours = elements_of(taken.get(item.name, item.name), item.size)
        if item.causality == "input":
            if ours and set(ours) <= set(SOURCES) and (item.real or item.flag):
                found["real" if item.real else "flag"].append((item.name, ours))
            else:
                unconnected.append(item.name)
        elif item.causality == "output" and ours:
            kind = _kind_of_output(ours, item)
            if kind:
                found[kind].append((item.name, ours))
    needed = COMMANDED["torque_ref" if torque else "angle_ref"]
    _check_outputs(found["out"], needed, variables, where)
    complete = _covers(found["info"], DIAGNOSED) and _covers(found["mark"], DIAGNOSED_FLAGS)
    return Connection(
        found["real"], found["flag"], found["out"],
        found["info"] if complete else [], found["mark"] if complete else [], tuple(unconnected),
    )  # fmt: skip


def elements_of(name: str, size: int) -> list[str]:
    """Returns our names of a variable's elements; [] where the name or the size is not ours."""
    if size == 1 and name in OURS:
        return [name]
    group = GROUPS.get(name, [])
    return group if len(group) == size else []


def _kind_of_output(ours: Sequence[str], item: FmuVariable) -> str:
    """Returns which list of the connection an output belongs to; "" for none."""
    if item.real and set(ours) <= set(SINKS):
        return "out"
    if item.real and set(ours) <= set(DIAGNOSED):
        return "info"
    return "mark" if item.flag and set(ours) <= set(DIAGNOSED_FLAGS) else ""


def _covers(pairs: Pairs, names: Sequence[str]) -> bool:
    return {name for _, ours in pairs for name in ours} >= set(names)


def _check_outputs(
    pairs: Pairs, needed: Sequence[str], variables: Sequence[FmuVariable], where: str
) -> None:
    """Raises FmuError when the FMU does not command every joint."""
    have = {name for _, ours in pairs for name in ours}
    missing = [name for name in needed if name not in have]
    if missing:
        more = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
        names = [item.name for item in variables if item.causality == "output"]
        raise FmuError(
            "the controller FMU does not command every joint",
            got=f"no {missing[0]}{more}; its outputs are {_listed(names)}",
            expected=f"outputs {needed[0]} to {needed[-1]}",
            fix=f'map its names: [control.map] "{missing[0]}" = "its name"',
            where=where,
        )


def _listed(names: Sequence[str]) -> str:
    """Returns names for a message, the first ones of many."""
    shown = ", ".join(names[:MOST_SHOWN]) or "none"
    return f"{shown} and {len(names) - MOST_SHOWN} more" if len(names) > MOST_SHOWN else shown


def _not_in_fmu(ours: str, theirs: str, present: Mapping[str, Any], where: str) -> FmuError:
    return FmuError(
        f"the map names a variable that the FMU lacks, for {ours}",
        got=theirs,
        expected=f"one of its variables: {_listed(list(present))}",
        fix=suggestion(theirs, present, otherwise="name one of these"),
        where=where,
    )


def read_map(path: Path) -> dict[str, Any]:
    """Returns the table [map] of the TOML file beside an FMU; {} where there is no such file.

    Raises FmuError for a damaged file.
    """
    place = path.with_suffix(".toml")
    if not place.is_file():
        return {}
    with decoding_toml(place, kind="TOML", error=FmuError):
        table = parse_toml(read_text(place))
    found = table.get("map", {})
    return dict(found) if isinstance(found, Mapping) else {"map": found}


def names_of_map(table: Mapping[str, Any], *, where: str) -> dict[str, str]:
    """Returns the FMU's names by ours, with {leg} and {joint} replaced. Raises FmuError."""
    found: dict[str, str] = {}
    for ours, theirs in table.items():
        if not isinstance(theirs, str):
            raise FmuError(
                "wrong type",
                got=theirs,
                expected='a name in quotes: "LF.coxa.angle_ref" = "q1"',
                where=f"{where}: {ours}",
            )
        found |= _expanded(ours, theirs)
    for name in found:
        if name not in OURS and name not in GROUPS:
            raise FmuError(
                "not a name of a measurement, command or joint command",
                got=name,
                expected="a name as in the plant's FMU, or command.vx, ...",
                fix=suggestion(name, [*OURS, *GROUPS], otherwise="see docs/howto/my-controller.md"),
                where=where,
            )
    return found


def _expanded(ours: str, theirs: str) -> dict[str, str]:
    """Returns the entries that one entry with {leg} and {joint} stands for."""
    legs = LEG_NAMES if "{leg}" in ours else ("",)
    joints = JOINT_NAMES if "{joint}" in ours else ("",)
    return {
        ours.replace("{leg}", leg).replace("{joint}", joint): theirs.replace("{leg}", leg).replace(
            "{joint}", joint
        )
        for leg in legs
        for joint in joints
    }
