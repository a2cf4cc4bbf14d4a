"""Repeats a recorded walk with fmi-sim, a program in Rust.

usage: fmi_sim_walk.py FMU INPUTS.csv NAMES.txt OUTPUTS.csv

fmi-sim reads the commands, interpolates between rows and sets them at communication points, which
are the times of the rows. It reads outputs before it sets the next inputs.
"""

from __future__ import annotations

import csv
import subprocess
import sys
from pathlib import Path

from columns import read_columns, write_columns

PROGRAM = Path(sys.prefix).parent / "cargo" / "bin" / "fmi-sim"
FLAGS = {"true": 1.0, "false": 0.0}


def main() -> None:
    """Runs the walk and writes the outputs."""
    fmu, inputs, wanted, outputs = sys.argv[1:]
    times = [row[0] for row in read_columns(inputs)[1]]
    step = repr(times[1] - times[0])
    found = Path(outputs).with_suffix(".raw.csv")
    plan = [
        "co-simulation",
        "-s",
        repr(times[0]),
        "-f",
        repr(times[-1]),
        "--step",
        step,
        "--output-interval",
        step,
    ]
    command = [str(PROGRAM), "--model", fmu, "-i", inputs, "-o", str(found), *plan]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(done.stderr or done.stdout)
    names = ["time", *Path(wanted).read_text(encoding="utf-8").split("\n")]
    with found.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    write_columns(outputs, names, ([number(row[name]) for name in names] for row in rows[1:]))


def number(text: str) -> float:
    """Parses a number or Boolean."""
    return FLAGS[text] if text in FLAGS else float(text)


if __name__ == "__main__":
    main()
