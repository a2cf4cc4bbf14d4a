"""Tests that messages and results do not depend on the locale that a process has set."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the locale's file is glibc's")

MAGIC = 0x20031115  # of glibc's files of most categories of a locale
NUMERIC = 1  # number of the category LC_NUMERIC

# sets the locale and prints the messages of refused calls to the plant and to its core
REFUSED = """
import ctypes, locale, sys
locale.setlocale(locale.LC_NUMERIC, "comma")
libc = ctypes.CDLL(None)
text = ctypes.create_string_buffer(32)
libc.snprintf(text, ctypes.c_size_t(32), b"%g", ctypes.c_double(1.5))
print(text.value.decode())
from pathlib import Path
from fmi_plant import Plant
with Plant(Path(sys.argv[1])) as plant:
    plant.set_reals({"foot.radius": -1.5})
    print(plant.last_message)
    plant.initialize(start=0.5)
    plant.step(0.25, 0.125)
    print(plant.last_message)
    plant.step(0.5, 0.125)
    print(plant.real("torso.position[3]").hex())
"""


def numeric_category(point: bytes) -> bytes:
    """Returns the file LC_NUMERIC of a locale with this sign for the decimal point.

    Its fields are the sign, the separator and the grouping of thousands, both signs as numbers, and
    the encoding.
    """
    code = ord(point.decode()).to_bytes(4, "little")
    fields = [point + b"\0", b"\0", b"\0", code, bytes(4), b"UTF-8\0"]
    head = 8 + 4 * len(fields)
    places, body = [], b""
    for field in fields:
        if len(field) == 4 and field in (code, bytes(4)):
            body += bytes(-(head + len(body)) % 4)
        places.append(head + len(body))
        body += field
    numbers = [MAGIC ^ NUMERIC, len(fields), *places]
    return b"".join(number.to_bytes(4, "little") for number in numbers) + body


def said(folder: Path, library: Path, point: str) -> list[str]:
    """Returns what the program prints in a locale with this sign for the decimal point."""
    (folder / "comma").mkdir()
    (folder / "comma" / "LC_NUMERIC").write_bytes(numeric_category(point.encode()))
    support = Path(__file__).resolve().parents[1] / "support"
    environment = os.environ | {"LOCPATH": str(folder), "PYTHONPATH": str(support)}
    done = subprocess.run(
        [sys.executable, "-c", REFUSED, str(library)],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.splitlines()


@pytest.mark.parametrize("point", [",", "\N{ARABIC DECIMAL SEPARATOR}"])
def test_messages_and_results_are_those_of_a_decimal_point(
    tmp_path: Path, plant_library: Path, point: str
) -> None:
    (tmp_path / "other").mkdir()
    (tmp_path / "plain").mkdir()
    number, *lines = said(tmp_path / "other", plant_library, point)
    assert number == f"1{point}5"  # the locale is in force
    assert ": got -1.5, expected a finite number in [" in lines[0]
    assert lines[1].startswith("communication point: got 0.25 s, expected 0.5, ")
    assert lines == said(tmp_path / "plain", plant_library, ".")[1:]
