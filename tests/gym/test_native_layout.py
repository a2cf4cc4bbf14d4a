"""The Python package and the co-simulation library agree on their structures, or the library is
refused.
"""

from __future__ import annotations

import ctypes
import hashlib
import re
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from hexapod_cosim.cosim.master import loop_library, native_loop
from hexapod_cosim.extensions.gym import batch, native
from hexapod_cosim.extensions.gym.settings import BLOCKS, REASONS, TERMS
from hexapod_cosim.models import FmuError

STRUCTURE = re.compile(r"typedef struct (\w+) \{(.*?)\} \1;", re.DOTALL)
LIST = re.compile(r"enum \w* ?\{(.*?)\}", re.DOTALL)


@dataclass(frozen=True)
class Interface:
    """A header of the library and what Python declares of it."""

    name: str
    constant: str  # the number of the layout in C
    layout: int  # and in Python
    size: str  # function that returns the size of the largest structure
    digests: dict[int, str]  # of structures and lists of names under each number of the layout
    structures: dict[str, type[ctypes.Structure]]
    load: Callable[[], ctypes.CDLL]

    def code(self) -> str:
        """Returns the header without its comments."""
        root = Path(__file__).parents[2] / "cosim" / "master" / "include" / "hexapod"
        text = (root / f"{self.name}.h").read_text(encoding="utf-8")
        return re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)

    def lists(self) -> list[str]:
        """Returns the names of each enumeration, with their values where these are given."""
        return [" ".join(body.split()) for body in LIST.findall(self.code())]

    def members(self) -> dict[str, list[str]]:
        """Returns the structures of the header and the names of their members."""
        found = {}
        for name, body in STRUCTURE.findall(self.code()):
            words = [word for line in body.split(";") for word in line.split(",")]
            names = [re.search(r"(\w+)(?:\[\w+\])*$", word.strip()) for word in words]
            found[name] = [name[1] for name in names if name]
        return found

    def digest(self) -> str:
        """Returns the digest of structures and lists."""
        bodies = [" ".join(body.split()) for _, body in STRUCTURE.findall(self.code())]
        return hashlib.sha256("\n".join(bodies + self.lists()).encode()).hexdigest()[:16]


MASTER = Interface(
    name="master",
    constant="HX_MASTER_LAYOUT",
    layout=native_loop.LAYOUT,
    size="hx_master_size",
    digests={1: "0a73ce69c526a2a0", 2: "aa70e431f9fe618e"},
    structures={
        "hxMasterFmu": native_loop._Fmu,
        "hxMasterBlock": native_loop._Block,
        "hxMasterSensor": native_loop._Sensor,
        "hxMasterTable": native_loop._Table,
        "hxMasterPeaks": native_loop._Peaks,
        "hxMaster": native_loop._Master,
    },
    load=native_loop._library.__wrapped__,
)
ENVIRONMENTS = Interface(
    name="environments",
    constant="HX_ENVIRONMENTS_LAYOUT",
    layout=native.LAYOUT,
    size="hx_environments_settings_size",
    digests={1: "787e21bea40beaa2"},
    structures={
        "hxEnvFmu": native.NativeFmu,
        "hxEnvDraws": native.NativeDraws,
        "hxEnvGround": native.NativeGround,
        "hxEnvSettings": native.NativeSettings,
        "hxEnvArrays": native.NativeArrays,
    },
    load=native.environments_library.__wrapped__,
)
INTERFACES = pytest.mark.parametrize(
    "interface", [MASTER, ENVIRONMENTS], ids=lambda interface: interface.name
)
# members that have the name of their type in Python, and another one in C
RENAMED = {
    **dict(zip(
        ("instantiate", "free_instance", "reset", "setup", "enter", "leave", "get_real",
         "set_real", "do_step"),
        native.CALLS, strict=True,
    )),
    "work_size": native.WORK[0],
    "work_use": native.WORK[1],
}  # fmt: skip


@INTERFACES
def test_a_changed_structure_has_a_new_number_of_the_layout(interface: Interface) -> None:
    number = re.search(rf"#define {interface.constant} (\d+)", interface.code())
    assert number
    said = f"increase {interface.constant} and LAYOUT in Python, and add the digest here"
    assert interface.digest() == interface.digests[int(number[1])], said
    assert int(number[1]) == max(interface.digests) == interface.layout


@INTERFACES
def test_python_declares_the_members_of_the_header_in_their_order(interface: Interface) -> None:
    found = interface.members()
    assert found.keys() == interface.structures.keys()
    for name, members in found.items():
        declared = [field[0] for field in interface.structures[name]._fields_]
        renamed = RENAMED if name == "hxEnvFmu" else {}
        assert declared == [renamed.get(member, member) for member in members], name


def test_functions_of_an_environments_fmu_have_the_types_of_their_names() -> None:
    assert tuple(re.findall(r"fmi2(\w+)TYPE \*", ENVIRONMENTS.code())) == native.CALLS


def test_python_allocates_as_many_rows_as_c_writes_together() -> None:
    assert re.findall(r"HX_MASTER_BLOCK = (\d+)", MASTER.code()) == [str(native_loop.BLOCK_ROWS)]


def test_python_lists_the_names_of_the_header_in_their_order() -> None:
    names = {
        "HX_SEE_": tuple(BLOCKS),
        "HX_TERM_": TERMS,
        "HX_END_": ("none", *REASONS[1:]),
        "HX_AUTORESET_": batch.AUTORESET,
    }
    for prefix, expected in names.items():
        found = re.findall(rf"\b{prefix}(\w+)", " ".join(ENVIRONMENTS.lists()))
        assert tuple(name.lower() for name in found) == expected


@INTERFACES
def test_a_library_with_another_layout_is_refused(
    interface: Interface, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler")
    size = max(ctypes.sizeof(structure) for structure in interface.structures.values())
    layout = interface.constant.lower()
    sized = f"unsigned long {interface.size}(void) {{ return {size}; }}"
    cases = {
        "layout 0 of 0 bytes": sized,  # as before the layout had a number
        f"layout 7 of {size} bytes": f"{sized} int {layout}(void) {{ return 7; }}",
        f"layout {interface.layout} of 8 bytes": (
            f"unsigned long {interface.size}(void) {{ return 8; }}"
            f"int {layout}(void) {{ return {interface.layout}; }}"
        ),
    }
    for place, (said, text) in enumerate(cases.items()):
        source, library = tmp_path / "stale.c", tmp_path / f"stale{place}.so"
        source.write_text(text)
        subprocess.run([compiler, "-shared", "-fPIC", "-o", library, source], check=True)
        monkeypatch.setattr(loop_library, "shared_library", lambda _, found=library: found)
        with pytest.raises(FmuError, match="another version's") as caught:
            interface.load()
        expected = f"layout {interface.layout} of {size} bytes"
        assert f"got {said!r}, expected {expected}" in str(caught.value)
        assert "pip install" in str(caught.value)
