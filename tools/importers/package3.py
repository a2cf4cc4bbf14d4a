"""Runs a package of FMI 3.0 FMUs (SSP 2.0) with a minimal master: whole arrays are transferred, in
the order of the components, and nothing is set but what is connected.
"""

from __future__ import annotations

import zipfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from xml.etree import ElementTree

import fmpy
import numpy as np
from fmpy.fmi3 import FMU3Slave
from numpy.typing import NDArray

SSD = "{http://ssp-standard.org/SSP1/SystemStructureDescription}"
SSC = "{http://ssp-standard.org/SSP1/SystemStructureCommon}"
ENDS = ("startElement", "startConnector", "endElement", "endConnector")


@dataclass(frozen=True)
class Array:
    """A variable of a component: its reference and number of elements."""

    reference: int
    count: int


class Running:
    """An initialized package."""

    def __init__(self, folder: Path, end: float, stack: ExitStack) -> None:
        root = ElementTree.parse(folder / "SystemStructure.ssd").getroot()
        self.components: dict[str, FMU3Slave] = {}
        self.arrays: dict[tuple[str, str], Array] = {}
        for one in root.iterfind(f"{SSD}System/{SSD}Elements/{SSD}Component"):
            name, source = one.get("name", ""), folder / one.get("source", "")
            fmu, variables = started(source, stack)
            self.components[name] = fmu
            for connector in one.iterfind(f"{SSD}Connectors/{SSD}Connector"):
                sizes = [
                    int(each.get("size", "")) for each in connector.iterfind(f"{SSC}Dimension")
                ]
                known = variables[connector.get("name", "")]
                self.arrays[name, known.name] = Array(
                    known.valueReference, int(np.prod(sizes, dtype=int))
                )
        self.connections = [
            tuple(one.get(key, "") for key in ENDS)
            for one in root.iterfind(f"{SSD}System/{SSD}Connections/{SSD}Connection")
        ]
        for fmu in self.components.values():
            fmu.enterInitializationMode(startTime=0.0, stopTime=end)
            fmu.exitInitializationMode()

    def get(self, component: str, name: str) -> NDArray[np.float64]:
        """Returns the elements of a variable."""
        array = self.arrays[component, name]
        found = self.components[component].getFloat64([array.reference], nValues=array.count)
        return np.array(found)

    def transfer(self, order: Sequence[str]) -> None:
        """Sets inputs to the present outputs of one component after the other."""
        for component in order:
            for start, output, end, entry in self.connections:
                if start != component:
                    continue
                values = list(self.get(start, output))
                self.components[end].setFloat64([self.arrays[end, entry].reference], values)


def started(path: Path, stack: ExitStack) -> tuple[FMU3Slave, dict[str, Any]]:
    """Instantiates an FMU; returns it and its variables by name."""
    description = fmpy.read_model_description(str(path))
    folder = fmpy.extract(str(path), str(path.with_suffix("")))
    fmu = FMU3Slave(
        guid=description.guid,
        unzipDirectory=folder,
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName=path.stem,
    )
    fmu.instantiate()
    stack.callback(fmu.freeInstance)
    return fmu, {one.name: one for one in description.modelVariables}


@contextmanager
def opened(package: Path, *, end: float) -> Iterator[Running]:
    """Yields a package, initialized at time 0 for a run until `end` [s]."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(TemporaryDirectory()))
        with zipfile.ZipFile(package) as archive:
            archive.extractall(folder)
        yield Running(folder, end, stack)


def run(
    package: Path, names: Sequence[str], *, step: float, steps: int, order: Sequence[str]
) -> NDArray[np.float64]:
    """Returns a row of the elements of `names` (component.variable) after each step."""
    rows = []
    with opened(package, end=step * steps) as running:
        running.transfer(order)
        for k in range(steps):
            for component in running.components.values():
                component.doStep(k * step, step)
            seen = [running.get(*name.split(".", 1)) for name in names]
            rows.append(np.concatenate(seen))
            running.transfer(order)
    return np.array(rows)
