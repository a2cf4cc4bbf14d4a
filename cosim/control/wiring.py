"""Tells whether a controller FMU can run on the loop in C, and how it is wired there."""

from __future__ import annotations

from hexapod_cosim.cosim.control.connection import SINKS, Connection, Pairs
from hexapod_cosim.cosim.master.fmu_controller import COMMANDS
from hexapod_cosim.cosim.master.signals import CONTACT
from hexapod_cosim.cosim.master.wiring import Names, Wiring


def compiled_wiring(connection: Connection) -> Wiring | None:
    """Returns the wiring of a controller FMU in the loop in C.

    None where the loop cannot drive it: it writes floating-point scalars, and it does not pass on
    contacts, which a fault of a force sensor changes.
    """
    pairs = [*connection.inputs, *connection.outputs, *connection.diagnostics, *connection.flags]
    if connection.flag_inputs or any(len(names) != 1 for _, names in pairs):
        return None
    inputs = _names(connection.inputs)
    if any(ours in CONTACT for ours, _ in inputs):
        return None
    order = {name: k for k, name in enumerate(SINKS)}
    return Wiring(
        commands=tuple(pair for pair in inputs if pair[0] in COMMANDS),
        measured=tuple(pair for pair in inputs if pair[0] not in COMMANDS),
        outputs=tuple(sorted(_names(connection.outputs), key=lambda pair: order[pair[0]])),
        diagnostics=_names(connection.diagnostics),
        flags=_names(connection.flags),
    )


def _names(pairs: Pairs) -> Names:
    """Returns pairs of our name and the FMU's, of scalars."""
    return tuple((names[0], theirs) for theirs, names in pairs)
