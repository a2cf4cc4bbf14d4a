"""Cross-compiled libraries: the cache and the errors."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from command import Call

from hexapod_cosim.cosim.export import cross_build
from hexapod_cosim.cosim.export.cross_build import Library, build_library, find_compiler, user_cache
from hexapod_cosim.models.errors import FmuError


def test_each_input_of_the_build_changes_the_key_of_the_cache(tmp_path: Path) -> None:
    source = tmp_path / "a.c"
    source.write_text("int a;", encoding="utf-8")
    first = Library("a", {"a.c": source})
    digests = [
        first.digest(),
        Library("b", {"a.c": source}).digest(),
        Library("a", {"b.c": source}).digest(),
        Library("a", {"a.c": source}, flags=("-DX",)).digest(),
    ]
    source.write_text("int b;", encoding="utf-8")
    assert len({*digests, first.digest()}) == 5


def test_an_unwritable_cache_is_ignored(tmp_path: Path) -> None:
    source = tmp_path / "tiny.c"
    source.write_text(
        '__attribute__((visibility("default"))) int fmi2Tiny(void) { return 7; }\n',
        encoding="utf-8",
    )
    library, cache = Library("tiny", {"tiny.c": source}), tmp_path / "cache"
    cache.mkdir()
    (cache / "zig").symlink_to(user_cache() / "zig")
    data = build_library(library, "x86_64-linux", cache_folder=cache)
    shutil.rmtree(cache / "binaries")
    (cache / "binaries").write_text("in the way", encoding="utf-8")
    assert build_library(library, "x86_64-linux", cache_folder=cache) == data


def test_sources_that_do_not_compile_are_one_error_with_the_compiler_s_message(
    tmp_path: Path,
) -> None:
    source = tmp_path / "bad.c"
    source.write_text("int f(void) { return unknown_thing; }\n", encoding="utf-8")
    kept = set((user_cache() / "binaries").glob("*"))
    with pytest.raises(FmuError, match=r"(?s)cannot build for aarch64-linux.*unknown_thing"):
        build_library(Library("bad", {"bad.c": source}), "aarch64-linux")
    assert set((user_cache() / "binaries").glob("bad-*")) <= kept


def test_without_the_compiler_the_error_says_how_to_get_it(
    call: Call, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(cross_build, "PACKAGE", "no_such_compiler")
    find_compiler.cache_clear()
    code, _, err = call("export", "--platforms", "all", "-o", tmp_path / "a.fmu")
    find_compiler.cache_clear()
    assert code != 0
    assert ".venv/bin/python -m pip install -e '.[platforms]'" in err
    assert "Traceback" not in err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("amiga64", "linux64, win64, darwin64, aarch64-linux"),
        ("", "linux64"),
        ("x86_64-amiga", "linux64"),
    ],
)
def test_unknown_platforms_are_refused_with_the_list_of_platforms(
    call: Call, tmp_path: Path, name: str, expected: str
) -> None:
    code, _, err = call("export", "--platforms", name, "-o", tmp_path / "a.fmu")
    assert code != 0
    assert expected in err
    assert list(tmp_path.iterdir()) == []
