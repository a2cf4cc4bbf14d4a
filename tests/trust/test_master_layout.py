"""The Python package and the co-simulation library agree on hxMaster, or the library is refused."""

from __future__ import annotations

import ctypes
import hashlib
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from hexapod_cosim.cosim.master import native_loop
from hexapod_cosim.models import FmuError

HEADER = Path(__file__).parents[2] / "master" / "include" / "hexapod" / "master.h"
# what the header's structures were under each number of the layout
DIGESTS = {1: "ea97c6a35bdb3694"}
STRUCTURES = {
    "hxMasterFmu": native_loop._Fmu,
    "hxMasterBlock": native_loop._Block,
    "hxMasterSensor": native_loop._Sensor,
    "hxMasterTable": native_loop._Table,
    "hxMasterPeaks": native_loop._Peaks,
    "hxMaster": native_loop._Master,
}
STRUCTURE = re.compile(r"typedef struct (\w+) \{(.*?)\} \1;", re.DOTALL)


def code() -> str:
    """Returns the header without its comments."""
    return re.sub(r"/\*.*?\*/", "", HEADER.read_text(encoding="utf-8"), flags=re.DOTALL)


def structures() -> dict[str, list[str]]:
    """Returns the structures of the header and the names of their members."""
    found = {}
    for name, body in STRUCTURE.findall(code()):
        members = [word for line in body.split(";") for word in line.split(",")]
        found[name] = [re.findall(r"\w+", word)[-1] for word in members if word.strip()]
    return found


def test_a_changed_structure_has_a_new_number_of_the_layout() -> None:
    number = re.search(r"#define HX_MASTER_LAYOUT (\d+)", code())
    assert number
    text = " ".join(" ".join(body.split()) for _, body in STRUCTURE.findall(code()))
    said = "increase HX_MASTER_LAYOUT and LAYOUT of native_loop.py, and add the digest here"
    assert hashlib.sha256(text.encode()).hexdigest()[:16] == DIGESTS[int(number[1])], said
    assert int(number[1]) == max(DIGESTS)


def test_python_declares_the_members_of_the_header_in_their_order() -> None:
    assert structures().keys() == STRUCTURES.keys()
    for name, members in structures().items():
        assert [field[0] for field in STRUCTURES[name]._fields_] == members, name


def test_a_library_with_another_layout_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler")
    size = ctypes.sizeof(native_loop._Master)
    sized = f"unsigned long hx_master_size(void) {{ return {size}; }}"
    cases = {
        "layout 0 of 0 bytes": sized,  # as before the layout had a number
        f"layout 7 of {size} bytes": f"{sized} int hx_master_layout(void) {{ return 7; }}",
    }
    for place, (said, text) in enumerate(cases.items()):
        source, library = tmp_path / "stale.c", tmp_path / f"stale{place}.so"
        source.write_text(text)
        subprocess.run([compiler, "-shared", "-fPIC", "-o", library, source], check=True)
        monkeypatch.setattr(native_loop, "shared_library", lambda _, found=library: found)
        with pytest.raises(FmuError, match="another version's") as caught:
            native_loop._library.__wrapped__()
        assert f"got {said!r}, expected layout 1 of {size} bytes" in str(caught.value)
        assert "pip install" in str(caught.value)
