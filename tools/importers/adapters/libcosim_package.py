"""Runs a package with libcosim.

usage: libcosim_package.py PACKAGE.ssp NAMES.txt OUTPUTS.csv STEPS

NAMES: component.variable, one on each line. libcosim reads the step size from the
unpacked package.
"""

from __future__ import annotations

import sys
import zipfile
from pathlib import Path
from tempfile import TemporaryDirectory

from columns import write_columns
from libcosimpy.CosimEnums import CosimVariableType
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
from libcosimpy.CosimObserver import CosimObserver

NANOSECONDS = 1e9


def main() -> None:
    """Runs the walk and writes the outputs."""
    package, wanted, outputs, steps = sys.argv[1:]
    log_output_level(CosimLogLevel.ERROR)
    names = Path(wanted).read_text(encoding="utf-8").split("\n")
    with TemporaryDirectory() as folder:
        with zipfile.ZipFile(package) as archive:
            archive.extractall(folder)
        execution = CosimExecution.from_ssp_file(folder)
        observer = CosimObserver.create_last_value()
        execution.add_observer(observer)
        components = {slave.name.decode(): slave.index for slave in execution.slave_infos()}
        known = {
            name: {one.name.decode(): one for one in execution.slave_variables(index)}
            for name, index in components.items()
        }
        seen = []
        for _ in range(int(steps)):
            if not execution.step():
                raise SystemExit("libcosim: the step failed")
            values = []
            for name in names:
                component, _, variable = name.partition(".")
                one, index = known[component][variable], components[component]
                flag = one.type == CosimVariableType.BOOLEAN.value
                read = observer.last_boolean_values if flag else observer.last_real_values
                values.append(float(read(index, [one.reference])[0]))
            seen.append([execution.status().current_time / NANOSECONDS, *values])
    write_columns(outputs, ["time", *names], seen)


if __name__ == "__main__":
    main()
