"""Repeats a recorded walk with libcosim, which uses FMI Library.

usage: libcosim_walk.py FMU INPUTS.csv NAMES.txt OUTPUTS.csv

Inputs are set by an override manipulator before each step and constant over it; outputs are read by
an observer after the step.
"""

from __future__ import annotations

import sys
from pathlib import Path

from columns import read_columns, write_columns
from libcosimpy.CosimEnums import CosimVariableType
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
from libcosimpy.CosimManipulator import CosimManipulator
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave

NANOSECONDS = 1e9


def main() -> None:
    """Runs the walk and writes the outputs."""
    fmu, inputs, wanted, outputs = sys.argv[1:]
    log_output_level(CosimLogLevel.ERROR)
    (_, *driven), rows = read_columns(inputs)
    names = Path(wanted).read_text(encoding="utf-8").split("\n")
    execution = CosimExecution.from_step_size(round((rows[1][0] - rows[0][0]) * NANOSECONDS))
    plant = execution.add_local_slave(CosimLocalSlave(fmu_path=fmu, instance_name="plant"))
    observer, manipulator = CosimObserver.create_last_value(), CosimManipulator.create_override()
    execution.add_observer(observer)
    execution.add_manipulator(manipulator)
    known = {variable.name.decode(): variable for variable in execution.slave_variables(plant)}
    flags = [name for name in names if known[name].type == CosimVariableType.BOOLEAN.value]
    reals = [name for name in names if name not in set(flags)]
    references = {
        kind: [known[name].reference for name in group]
        for kind, group in (("in", driven), ("real", reals), ("flag", flags))
    }
    seen = []
    for _, *values in rows[:-1]:
        manipulator.slave_real_values(plant, references["in"], values)
        if not execution.step():
            raise SystemExit("libcosim: the step failed")
        time = execution.status().current_time / NANOSECONDS
        found = observer.last_boolean_values(plant, references["flag"])
        seen.append(
            [time, *observer.last_real_values(plant, references["real"]), *map(float, found)]
        )
    write_columns(outputs, ["time", *reals, *flags], seen)


if __name__ == "__main__":
    main()
