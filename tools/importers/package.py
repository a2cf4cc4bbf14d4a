"""A package of plant and controller run by the plainest of masters, in both orders that tools
know, to compare them with.
"""

from __future__ import annotations

import zipfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from fmpy.ssp.ssd import read_ssd, read_ssv

from hexapod_cosim.cosim.master.fmu import Fmu, FmuBlock
from hexapod_cosim.cosim.master.recorder import Recording


@dataclass(frozen=True)
class Wire:
    """All connections of one type from one component to another."""

    start: str
    source: FmuBlock
    target: FmuBlock

    def transfer(self) -> None:
        """Outputs as they are now become inputs."""
        self.source.get()
        self.target.values[:] = self.source.values
        self.target.set()


@dataclass(frozen=True)
class Running:
    """An initialised package."""

    components: dict[str, Fmu]
    wires: list[Wire]

    def settle(self, order: Sequence[str]) -> None:
        """Hands outputs on, component after component: the later ones answer what the earlier
        ones put out just now.
        """
        for name in order:
            for wire in self.wires:
                if wire.start == name:
                    wire.transfer()

    def swap(self) -> None:
        """Reads all outputs, then sets all inputs: every component answers what it was told a
        step ago.
        """
        for wire in self.wires:
            wire.source.get()
        for wire in self.wires:
            wire.target.values[:] = wire.source.values
            wire.target.set()


def run(
    package: Path,
    names: Sequence[str],
    *,
    step: float,
    steps: int,
    order: Sequence[str],
    at_once: bool,
) -> Recording:
    """Rows of `names` (component.variable) after each step.

    at_once: controllers answer the outputs of the same communication point, in `order`; else those
    of the point before, but for the first.
    """
    rows = []
    with opened(package, end=step * steps) as running:
        seen = [
            running.components[name.partition(".")[0]].block([name.partition(".")[2]])
            for name in names
        ]
        running.settle(order)
        for k in range(steps):
            for component in running.components.values():
                component.step(k * step, step)
            for block in seen:
                block.get()
            rows.append([(k + 1) * step, *(float(block.values[0]) for block in seen)])
            if at_once:
                running.settle(order)
            else:
                running.swap()
    return Recording(("time", *names), np.array(rows))


@contextmanager
def opened(package: Path, *, end: float) -> Iterator[Running]:
    """A package's components with its parameter sets in place, initialised at time 0, to run
    until `end` [s].
    """
    described = read_ssd(str(package))
    with ExitStack() as stack:
        folder = Path(stack.enter_context(TemporaryDirectory()))
        with zipfile.ZipFile(package) as archive:
            archive.extractall(folder)
        components = {}
        for element in described.system.elements:
            fmu = components[element.name] = stack.enter_context(
                Fmu(folder / element.source, name=element.name)
            )
            for parameter in read_ssv(
                str(folder / element.source.replace(".fmu", ".ssv"))
            ).parameters:
                block = fmu.block([parameter.name])
                block.values[0] = float(
                    parameter.value in {"true", "1"}
                    if parameter.type == "Boolean"
                    else parameter.value
                )
                block.set()
        ends = [
            (one.startElement, one.startConnector, one.endElement, one.endConnector)
            for one in described.system.connections
        ]
        wires = list(wired(components, ends))
        for fmu in components.values():
            fmu.initialise(0.0, end)
        yield Running(components, wires)


def wired(components: dict[str, Fmu], ends: Sequence[tuple[str, str, str, str]]) -> Iterator[Wire]:
    """Connections by pair of components and type."""
    groups: dict[tuple[str, str, str], list[tuple[str, str]]] = {}
    for start, output, end, entry in ends:
        groups.setdefault((start, end, components[start].variables[output].type), []).append(
            (output, entry)
        )
    for (start, end, _), names in groups.items():
        yield Wire(
            start,
            components[start].block([name for name, _ in names]),
            components[end].block([name for _, name in names]),
        )
