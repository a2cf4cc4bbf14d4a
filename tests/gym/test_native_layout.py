"""The structures that Python reads from the headers of the co-simulation library are those of the
compiler; a library with others is refused.
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from hexapod_cosim.cosim.common.plant_files import fmi_headers
from hexapod_cosim.cosim.master import loop_library
from hexapod_cosim.cosim.master.loop_library import HEADERS, ORDER
from hexapod_cosim.extensions.gym import batch, native
from hexapod_cosim.extensions.gym.settings import BLOCKS, REASONS, TERMS
from hexapod_cosim.models import FmuError

ROOT = Path(__file__).parents[2]
HEADER = native.HEADER
STRUCTURES = {
    name: kind for name, kind in HEADER.types.items() if kind and issubclass(kind, ctypes.Structure)
}


def compile_c(text: str, *options: str | Path, folder: Path) -> None:
    """Compiles a source. Skips the test without a compiler."""
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler")
    source = folder / "source.c"
    source.write_text(text)
    subprocess.run([compiler, *options, source], check=True)


def test_python_reads_the_sizes_and_places_of_the_compiler(tmp_path: Path) -> None:
    lines = [f'#include "hexapod/{name}"' for name in (*ORDER, native.PATH.name)]
    for name, structure in STRUCTURES.items():
        lines.append(f'_Static_assert(sizeof({name}) == {ctypes.sizeof(structure)}, "{name}");')
        lines += [
            f"_Static_assert(offsetof({name}, {member}) == {getattr(structure, member).offset} && "
            f"sizeof((({name} *)0)->{member}) == {getattr(structure, member).size}, "
            f'"{name}.{member}");'
            for member, _ in structure._fields_
        ]
    lines += [
        f'_Static_assert({name} == {number}, "{name}");'
        for name, number in HEADER.constants.items()
    ]
    folders = [
        HEADERS.parent,
        native.PATH.parents[1],
        ROOT / "plant_fmu" / "include",
        fmi_headers(),
    ]
    options = [f"-I{folder}" for folder in folders]
    compile_c("\n".join(lines), "-std=c11", "-fsyntax-only", *options, folder=tmp_path)


def test_python_lists_the_names_of_the_header_in_their_order() -> None:
    names = {
        "HX_SEE_": tuple(BLOCKS),
        "HX_TERM_": TERMS,
        "HX_END_": ("none", *REASONS[1:]),
        "HX_AUTORESET_": batch.AUTORESET,
    }
    for prefix, expected in names.items():
        found = [name for name in HEADER.constants if name.startswith(prefix)]
        assert tuple(name.removeprefix(prefix).lower() for name in found) == expected


@pytest.mark.parametrize(
    ("part", "size", "structure", "load"),
    [
        ("master", "hx_master_size", "hxMaster", loop_library.master_library.__wrapped__),
        (
            "environments",
            "hx_environments_settings_size",
            "hxEnvSettings",
            native.environments_library.__wrapped__,
        ),
    ],
)
def test_a_library_with_another_layout_is_refused(
    part: str,
    size: str,
    structure: str,
    load: Callable[[], ctypes.CDLL],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bytes_ = ctypes.sizeof(STRUCTURES[structure])
    number = HEADER.constants[f"HX_{part.upper()}_LAYOUT"]
    sized = "unsigned long {}(void) {{ return {}; }} int hx_{}_layout(void) {{ return {}; }}"
    cases = {
        "layout 0 of 0 bytes": "int other;",
        f"layout 77 of {bytes_} bytes": sized.format(size, bytes_, part, 77),
        f"layout {number} of 8 bytes": sized.format(size, 8, part, number),
    }
    for place, (said, text) in enumerate(cases.items()):
        library = tmp_path / f"stale{place}.so"
        compile_c(text, "-shared", "-fPIC", "-o", library, folder=tmp_path)
        monkeypatch.setattr(loop_library, "shared_library", lambda _, found=library: found)
        with pytest.raises(FmuError, match="another version's") as caught:
            load()
        assert f"got {said!r}, expected layout {number} of {bytes_} bytes" in str(caught.value)
        assert "pip install" in str(caught.value)
