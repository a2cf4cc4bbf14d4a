"""Which variables of a controller FMU are connected, by pairs of our name and the FMU's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from hexapod_cosim.cosim.interface.names import vector_names
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.master.fmu_controller import COMMANDS, FLAGS, SENSED
from hexapod_cosim.cosim.master.signals import ACCELERATION, COMMANDED, MEASURED
from hexapod_cosim.models import LEG_NAMES

JOINT_COMMANDS = [name for names in COMMANDED.values() for name in names]
SHIFT = [name for leg in LEG_NAMES for name in vector_names(f"{leg}.shift", 2)]
PLANNED = [name for leg in LEG_NAMES for name in vector_names(f"{leg}.planned")]
DIAGNOSTICS = [*SHIFT, *(f"{leg}.lift" for leg in LEG_NAMES), *PLANNED]
CONTROLLER_FLAGS = [f"{leg}.{flag}" for flag in FLAGS for leg in LEG_NAMES]

Names = tuple[tuple[str, str], ...]  # pairs: our name, the FMU's name


@dataclass(frozen=True)
class Wiring:
    """The connected variables of a controller FMU, all floating-point but the flags."""

    commands: Names  # body command
    measured: Names
    outputs: Names  # to the plant's inputs
    diagnostics: Names
    flags: Names


def own_wiring(plant: Fmu, controller: Fmu) -> Wiring:
    """Returns the wiring of an FMU of `hexapod export --controller`, which has all our names."""
    both = set(plant.names("input")) & set(controller.names("output"))
    acceleration = ACCELERATION if set(ACCELERATION) <= both else []
    return Wiring(
        commands=_same(COMMANDS),
        measured=_same([name for key in SENSED for name in MEASURED[key]]),
        outputs=_same([*JOINT_COMMANDS, *acceleration]),
        diagnostics=_same(DIAGNOSTICS),
        flags=_same(CONTROLLER_FLAGS),
    )


def _same(names: Sequence[str]) -> Names:
    return tuple((name, name) for name in names)


def ours(pairs: Names) -> list[str]:
    """Returns our names of the pairs."""
    return [name for name, _ in pairs]


def theirs(pairs: Names) -> list[str]:
    """Returns the FMU's names of the pairs."""
    return [name for _, name in pairs]
