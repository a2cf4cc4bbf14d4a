"""Repeats a recorded walk with Ecos, which uses fmi4c.

usage: ecos_walk.py FMU INPUTS.csv NAMES.txt OUTPUTS.csv

Inputs are set before each step and constant over it; outputs are read after the step.
"""

from __future__ import annotations

import ctypes
import sys
from pathlib import Path

from columns import read_columns, write_columns

# Ecos requires oneTBB, which PyPI's package `tbb` installs where the loader does not look
ctypes.CDLL(str(Path(sys.prefix) / "lib" / "libtbb.so.12"), mode=ctypes.RTLD_GLOBAL)

# requires oneTBB
from ecospy import EcosLib, EcosSimulation, EcosSimulationStructure  # noqa: E402


def main() -> None:
    """Runs the walk and writes the outputs."""
    fmu, inputs, wanted, outputs = sys.argv[1:]
    EcosLib.set_log_level("err")
    (_, *driven), rows = read_columns(inputs)
    names = Path(wanted).read_text(encoding="utf-8").split("\n")
    seen = []
    with EcosSimulationStructure() as structure:
        structure.add_model("plant", fmu)
        with EcosSimulation(structure=structure, step_size=rows[1][0] - rows[0][0]) as simulation:
            simulation.init()
            for _, *values in rows[:-1]:
                for name, value in zip(driven, values, strict=True):
                    simulation.set_real(f"plant::{name}", value)
                simulation.step()
                seen.append(
                    [simulation.get_time(), *(read(simulation, f"plant::{name}") for name in names)]
                )
            simulation.terminate()
    write_columns(outputs, ["time", *names], seen)


def read(simulation: EcosSimulation, name: str) -> float:
    """Returns a Real or Boolean as a float."""
    try:
        return float(simulation.get_real(name))
    except Exception:  # the binding's only error type
        return float(simulation.get_bool(name))


if __name__ == "__main__":
    main()
