"""Writes the first inputs of the fuzz targets to a folder: a few short ones per target.

usage: python tests/support/fuzz_seeds.py FOLDER

A seed of calls is a list of bytes that fuzz_fmi2.c or fuzz_fmi3.c decodes; the numbers of calls are
indices of the table `call` there. Inputs that mutations find are kept in build/fuzz, not here.
"""

from __future__ import annotations

import sys
from pathlib import Path

GRIDS = Path(__file__).parents[1] / "native" / "grids"
PARTS = ("plant", "controller")
# indices of calls
FMI2 = {"initialize": 3, "get": 10, "set": 12, "save": 16, "restore": 17, "serialize": 19}
FMI2 |= {"step": 20, "directional": 26, "continuous": 8, "set_states": 30, "row": 31, "update": 27}
FMI3 = {"initialize": 2, "get": 10, "set": 12, "save": 17, "restore": 18, "serialize": 20}
FMI3 |= {"step": 21, "directional": 26, "continuous": 8, "set_states": 30, "row": 31, "update": 27}


def walks(call: dict[str, int]) -> dict[str, bytes]:
    """Returns sequences of calls by name: co-simulation with states, model exchange."""
    step = [call["step"], 0, 4]
    read = [call["get"], 3, 1, 0, 0, 1, 40, 0, 0, 5, 0]
    write = [call["set"], 2, 0, 4, 1, 140, 0, 7, 1, 120]
    state = [call["save"], 0, *step, call["serialize"], 0, 0, call["restore"], 0]
    begin = [call["initialize"]]
    rows = [byte for kind in range(4) for byte in (call["row"], kind, 0)]
    change = [call["set_states"], 0, 1, 9, 0, 100, 140]
    tangent = [call["directional"], 1, 1, 1, 9, 0, 0, 3, 0, 1, 130]
    return {
        "steps": bytes([0, *begin, *step, *read, *write, *step, *step]),
        "states": bytes([0, *begin, *step, *state, *step, call["restore"], 0, *step]),
        "events": bytes([6, *begin, *step, call["update"], 0, *step, *state]),
        "exchange": bytes(
            [1, *begin, call["update"], 0, call["continuous"], *rows, *change, *tangent, *rows]
        ),
    }


# inputs that fuzzing found (test_findings.py)
FOUND = {
    "refused_states": "01021b00081f00001f01001f02001f03001e00010800648c1a010101"
    "0900001f012400081f00001f1a010900648c1a",
    "refused_direction": "000000000628150004ec9001000000000098d8041400ff00921b0008"
    "1f00001f01001f021b04001c1c1c1c1c0300",
}


def seeds() -> dict[str, dict[str, bytes]]:
    """Returns the seeds by target and name."""
    found = {}
    for part in PARTS:
        found[f"fuzz_fmi2_{part}"] = walks(FMI2)
        found[f"fuzz_fmi3_{part}"] = walks(FMI3) | {
            name: bytes.fromhex(digits) for name, digits in FOUND.items()
        }
        found[f"fuzz_start_values_{part}"] = {
            "valid": bytes([0, 16]),
            "changed_value": bytes([1, 16, 3, 0, 1, 100, 140]),
            "changed_bytes": bytes([1, 16, 3, 0, 0, 2, 4, 0, 49, 5, 0, 50]),
            "without_checksum": bytes([0, 23]),
        }
        found[f"fuzz_states_{part}"] = {
            "valid": bytes([0, 0]),
            "damaged": bytes([0, 1, 100, 0, 0, 1, 7]),
            "forged": bytes([1, 2, 72, 0, 0, 1, 7, 0, 1, 0, 0, 100, 140]),
        }
    found["fuzz_grid"] = {path.name: path.read_bytes() for path in sorted(GRIDS.iterdir())}
    return found


def write(folder: Path) -> None:
    """Writes all seeds into folders named like the targets."""
    for target, files in seeds().items():
        (folder / target).mkdir(parents=True, exist_ok=True)
        for name, content in files.items():
            (folder / target / name).write_bytes(content)


if __name__ == "__main__":
    write(Path(sys.argv[1]))
