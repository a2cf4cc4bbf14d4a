"""Expands entries of interface.toml that stand for a record of the controller's settings."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, get_type_hints

from hexapod_cosim.controller.gains import LEAST, SECTIONS, USUAL, Parts, Row
from hexapod_cosim.models.schema import Number

RECORDS: dict[str, dict[str, type[Any]]] = {  # of the settings, by their names in the variables
    "gains": {f"gains.{name}": kind for name, kind in SECTIONS.items()},
    "parts": {"parts": Parts},
}


def rows_of_records(entries: Iterable[Mapping[str, Any]]) -> Iterator[Mapping[str, Any]]:
    """Yields entries, with one for each field of the records in the place of their entry."""
    for entry in entries:
        if "record" in entry:
            for name, kind in RECORDS[entry["record"]].items():
                yield from _rows(name, kind)
        else:
            yield entry


def _rows(name: str, kind: type[Any]) -> Iterator[dict[str, Any]]:
    """Yields the entries of the fields of a record."""
    for field, hint in get_type_hints(kind, include_extras=True).items():
        facts = getattr(hint, "__metadata__", ())
        for row in (fact for fact in facts if isinstance(fact, Row)):
            entry: dict[str, Any] = {"name": f"{name}.{field}", "description": row.text}
            if not row.unit:
                law = "the paper's" if field.startswith("paper_") else "the compliant"
                text = f"Part of {law} control: {row.text}"
                yield entry | {"type": "Boolean", "description": text}
                continue
            positive = any(isinstance(fact, Number) and fact.above == 0.0 for fact in facts)
            low = LEAST if positive else 0.0
            nominal, most = USUAL[row.unit]
            yield entry | {
                "unit": row.unit,
                "min": low if row.low is None else row.low,
                "max": most if row.most is None else row.most,
                "nominal": nominal if row.nominal is None else row.nominal,
            }
