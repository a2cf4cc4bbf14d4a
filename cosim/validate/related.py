"""Checks the related files of an FMU, after the layered standard fmi-ls-ref (1.0.0-alpha.1)."""

from __future__ import annotations

import posixpath
import re
from collections.abc import Collection, Iterator, Mapping
from urllib.parse import unquote, urlsplit
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from hexapod_cosim.cosim.export.reference import (
    ABOUT_STANDARD,
    FOLDER,
    MANIFEST,
    MANIFEST_NAMESPACE,
    STANDARD,
)

ROOT, RELATED, LABEL, ANNOTATIONS = "fmiReferences", "Related", "Label", "Annotations"
ROLES = {
    "document", "requirement", "specification", "model", "parameter", "system", "testcase",
    "experiment", "result", "method", "rationale", "report", "request", "delivery",
    "configuration", "signature", "serialized-state", "meta-data", "other",
}  # fmt: skip
# sub-roles by role; None: any
SUB_ROLES: Mapping[str, Collection[str] | None] = {
    "experiment": {"smoke-test", "validation", "uncertainty-analysis"},
    "serialized-state": None,
}
VERSION = re.compile(r"\d+\.\d+\.\d+([-+][0-9A-Za-z.+-]+)?")  # semantic
TABLE = "text/csv"
TIME = "time"


def related_problems(names: Collection[str], found: Mapping[str, bytes]) -> Iterator[str]:
    """Yields the problems of the manifest and of the tables that it names.

    names: of the FMU's variables, which the columns of inputs and results must have. An FMU without
    the manifest has none.
    """
    if MANIFEST not in found:
        return
    try:
        root = ElementTree.fromstring(found[MANIFEST])
    except ElementTree.ParseError as error:
        yield f"{MANIFEST} is no XML: {error}"
        return
    yield from _root_problems(root)
    for related in root.iterfind(RELATED):
        yield from _related_problems(related, names, found)


def _root_problems(root: Element) -> Iterator[str]:
    """Yields problems of the root, its attributes and its children."""
    if root.tag != ROOT:
        yield f"{MANIFEST}: its root is {root.tag}, expected {ROOT}"
    name, version, about = (
        root.get(f"{{{MANIFEST_NAMESPACE}}}fmi-ls-{key}", "")
        for key in ("name", "version", "description")
    )
    if name != STANDARD:
        yield f"{MANIFEST}: fmi-ls-name is {name!r}, expected {STANDARD!r}"
    if not VERSION.fullmatch(version):
        yield f"{MANIFEST}: fmi-ls-version is {version!r}, expected a version such as 1.0.0"
    if about != ABOUT_STANDARD:
        yield f"{MANIFEST}: fmi-ls-description is {about!r}, expected {ABOUT_STANDARD!r}"
    for child in root:
        if child.tag not in (RELATED, ANNOTATIONS):
            yield f"{MANIFEST}: {child.tag} is none of {RELATED}, {ANNOTATIONS}"


def _related_problems(
    related: Element, names: Collection[str], found: Mapping[str, bytes]
) -> Iterator[str]:
    """Yields problems of one related file."""
    source, role = related.get("source", ""), related.get("role", "")
    main, slash, part = role.partition("/")
    allowed = SUB_ROLES.get(main, ())
    if main not in ROLES or (slash and allowed is not None and part not in allowed):
        yield f"{MANIFEST}: {source or RELATED} has the role {role!r}, which the standard lacks"
    for label in related.iterfind(LABEL):
        if not label.get("name"):
            yield f"{MANIFEST}: a label of {source} has no name"
    if not source:
        yield f"{MANIFEST}: a {RELATED} has no source"
        return
    parts = urlsplit(source)
    if parts.scheme or parts.netloc:
        return  # of elsewhere: left to the importer
    path = posixpath.normpath(posixpath.join(FOLDER, unquote(parts.path)))
    if path not in found:
        yield f"{MANIFEST}: {source} is not in the archive"
    elif related.get("type") == TABLE and main in ("testcase", "result"):
        yield from _table_problems(path, found[path], names)


def _table_problems(path: str, data: bytes, names: Collection[str]) -> Iterator[str]:
    """Yields problems of a table of inputs or results over time."""
    header, *rows = data.decode(errors="replace").splitlines() or [""]
    columns = [name.strip().strip('"') for name in header.split(",")]
    if columns[0] != TIME:
        yield f"{path}: its first column is {columns[0]!r}, expected {TIME!r}"
    unknown = [name for name in columns[1:] if name not in names]
    if unknown:
        yield f"{path}: these columns are no variables: {', '.join(unknown)}"
    last, sizes = float("-inf"), [1] * len(columns)
    for number, row in enumerate(rows, start=2):
        try:
            cells = [[float(value) for value in cell.split()] for cell in row.split(",")]
        except ValueError:
            yield f"{path} line {number}: got {row!r}, expected numbers"
            return
        found = [len(cell) for cell in cells]
        if number == 2 and len(found) == len(sizes) and min(found) > 0 and found[0] == 1:
            sizes = found  # of arrays, as the first row has them
        if found != sizes or not cells[0][0] >= last:
            yield f"{path} line {number}: expected {_expected(sizes)}, time not decreasing"
            return
        last = cells[0][0]


def _expected(sizes: list[int]) -> str:
    """Returns what a row must have; sizes: numbers in each cell."""
    if max(sizes) == 1:
        return f"{len(sizes)} numbers"
    return f"{len(sizes)} cells of {', '.join(map(str, sizes))} numbers"
