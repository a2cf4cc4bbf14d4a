"""Loads a module of the copy with the change of a mutant.

The copy's environment imports this file when Python starts, in commands that tests run too. The
environment variable HEXAPOD_MUTANT names the changed file, line, column, old and new text as JSON.
No file changes, so that mutants can be judged at the same time.
"""

from __future__ import annotations

import json
import os
from importlib.machinery import SourceFileLoader
from types import CodeType

_get_code = SourceFileLoader.get_code


def _changed_code(loader: SourceFileLoader, fullname: str) -> CodeType | None:
    """Compiles the changed text of the mutant's file; other files are loaded as always."""
    given = os.environ.get("HEXAPOD_MUTANT")
    mutant = json.loads(given) if given else None
    if not mutant or os.path.realpath(loader.path) != mutant["path"]:
        return _get_code(loader, fullname)
    with open(loader.path, encoding="utf-8") as file:
        lines = file.readlines()
    line, column = lines[mutant["line"] - 1], mutant["column"]
    rest = line[column + len(mutant["old"]) :]
    lines[mutant["line"] - 1] = line[:column] + mutant["new"] + rest
    return compile("".join(lines), loader.path, "exec", dont_inherit=True)


setattr(SourceFileLoader, "get_code", _changed_code)  # noqa: B010 (its declared type is another)
