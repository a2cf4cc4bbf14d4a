"""Measures what an importer does before the first step: reading and instantiating.

usage: python -m benchmarks.opening

Prints the median and best processor time of some repetitions beside their limit. Nothing is
asserted, because machines are noisy.
"""

from __future__ import annotations

import ctypes
import statistics
import sys
import time
import zipfile
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from xml.etree import ElementTree

import fmpy
from fmpy.fmi2 import FMU2Slave

from hexapod_cosim.cosim.export.plant_export import export_fmu
from hexapod_cosim.models import load_robot

REPETITIONS = 30


def milliseconds(action: Callable[[], object]) -> tuple[float, float]:
    """Returns the median and the least processor time of an action [ms]."""
    times = []
    for _ in range(REPETITIONS):
        begin = time.process_time()
        action()
        times.append(1e3 * (time.process_time() - begin))
    return statistics.median(times), min(times)


def main() -> int:
    """Measures and prints; returns the exit code."""
    with TemporaryDirectory() as folder:
        fmu = export_fmu(load_robot("phantomx_mk4"), Path(folder) / "robot.fmu")
        root = fmpy.extract(str(fmu), str(Path(folder) / "unpacked"))
        rows = [
            ("model description parsed", 20.0, lambda: ElementTree.fromstring(_description(fmu))),
            (
                "model description read by fmpy",
                20.0,
                lambda: fmpy.read_model_description(root, validate=False),
            ),
            ("instance made from its resources", 50.0, _instantiate(root)),
        ]
        for name, limit, action in rows:
            median, best = milliseconds(action)
            print(f"{name:36} {median:8.2f} ms   best {best:8.2f} ms   limit: {limit:g} ms")
    return 0


def _description(fmu: Path) -> bytes:
    with zipfile.ZipFile(fmu) as archive:
        return archive.read("modelDescription.xml")


def _instantiate(root: str) -> Callable[[], None]:
    """Returns an action that creates and frees an instance of the loaded library."""
    description = fmpy.read_model_description(root)
    slave = FMU2Slave(
        guid=description.guid,
        modelIdentifier=description.coSimulation.modelIdentifier,
        unzipDirectory=root,
        instanceName="plant",
    )
    resources = (Path(root) / "resources").as_uri().encode()
    instantiate, free = slave.dll.fmi2Instantiate, slave.dll.fmi2FreeInstance

    def action() -> None:
        component = instantiate(b"plant", 1, description.guid.encode(), resources, None, 0, 0)
        assert component
        free(ctypes.c_void_p(component))

    return action


if __name__ == "__main__":
    sys.exit(main())
