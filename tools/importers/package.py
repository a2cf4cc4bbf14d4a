"""Runs a package of plant and controller with a minimal master, in both orders of data exchange
that tools use.
"""

from __future__ import annotations

import zipfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from fmpy.ssp.ssd import read_ssd

from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.master.fmu_block import FmuBlock
from hexapod_cosim.cosim.master.recorder import Recording


@dataclass(frozen=True)
class Connections:
    """All connections of one type from one component to another."""

    start: str
    source: FmuBlock
    target: FmuBlock

    def transfer(self) -> None:
        """Sets the inputs to the present outputs."""
        self.source.get()
        self.target.values[:] = self.source.values
        self.target.set()


@dataclass(frozen=True)
class InitialisedPackage:
    """The components and connections of an initialized package."""

    components: dict[str, Fmu]
    connections: list[Connections]

    def transfer_in_order(self, order: Sequence[str]) -> None:
        """Transfers outputs of one component after the other, so that later components use the
        present outputs of earlier ones.
        """
        for name in order:
            for connection in self.connections:
                if connection.start == name:
                    connection.transfer()

    def transfer_at_once(self) -> None:
        """Reads all outputs, then sets all inputs, so that every component uses the outputs of the
        step before.
        """
        for connection in self.connections:
            connection.source.get()
        for connection in self.connections:
            connection.target.values[:] = connection.source.values
            connection.target.set()


def run(
    package: Path,
    names: Sequence[str],
    *,
    step: float,
    steps: int,
    order: Sequence[str],
    in_order: bool,
) -> Recording:
    """Runs a package; returns rows of `names` (component.variable) after each step.

    With `in_order`, inputs are set in the order of the components to outputs of the same
    communication point; else to those of the point before, except at the first.
    """
    rows = []
    with opened(package, end=step * steps) as running:
        seen = [
            running.components[name.partition(".")[0]].block([name.partition(".")[2]])
            for name in names
        ]
        running.transfer_in_order(order)
        for k in range(steps):
            for component in running.components.values():
                component.step(k * step, step)
            for block in seen:
                block.get()
            rows.append([(k + 1) * step, *(float(block.values[0]) for block in seen)])
            if in_order:
                running.transfer_in_order(order)
            else:
                running.transfer_at_once()
    return Recording(("time", *names), np.array(rows))


@contextmanager
def opened(package: Path, *, end: float) -> Iterator[InitialisedPackage]:
    """Yields a package's components, initialized at time 0 for a run until `end` [s]."""
    described = read_ssd(str(package))
    with ExitStack() as stack:
        folder = Path(stack.enter_context(TemporaryDirectory()))
        with zipfile.ZipFile(package) as archive:
            archive.extractall(folder)
        components = {}
        for element in described.system.elements:
            components[element.name] = stack.enter_context(
                Fmu(folder / element.source, name=element.name)
            )
        ends = [
            (one.startElement, one.startConnector, one.endElement, one.endConnector)
            for one in described.system.connections
        ]
        connections = list(grouped_connections(components, ends))
        for fmu in components.values():
            fmu.initialise(0.0, end)
        yield InitialisedPackage(components, connections)


def grouped_connections(
    components: dict[str, Fmu], ends: Sequence[tuple[str, str, str, str]]
) -> Iterator[Connections]:
    """Yields the connections, grouped by pair of components and type."""
    groups: dict[tuple[str, str, str], list[tuple[str, str]]] = {}
    for start, output, end, entry in ends:
        groups.setdefault((start, end, components[start].variables[output].type), []).append(
            (output, entry)
        )
    for (start, end, _), names in groups.items():
        yield Connections(
            start,
            components[start].block([name for name, _ in names]),
            components[end].block([name for _, name in names]),
        )
