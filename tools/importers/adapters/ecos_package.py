"""Runs a package with Ecos.

usage: ecos_package.py PACKAGE.ssp NAMES.txt OUTPUTS.csv STEPS

NAMES: component.variable, one on each line. Ecos needs the step size.
"""

from __future__ import annotations

import sys
from pathlib import Path

from columns import write_columns
from ecos_walk import EcosLib, EcosSimulation, read

STEP = 0.005  # s


def main() -> None:
    """Runs the walk and writes the outputs."""
    package, wanted, outputs, steps = sys.argv[1:]
    EcosLib.set_log_level("err")
    names = Path(wanted).read_text(encoding="utf-8").split("\n")
    seen = []
    with EcosSimulation(step_size=STEP, ssp_path=package) as simulation:
        simulation.init()
        for _ in range(int(steps)):
            simulation.step()
            seen.append(
                [
                    simulation.get_time(),
                    *(read(simulation, name.replace(".", "::", 1)) for name in names),
                ]
            )
        simulation.terminate()
    write_columns(outputs, ["time", *names], seen)


if __name__ == "__main__":
    main()
