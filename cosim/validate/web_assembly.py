"""Checks the WebAssembly component of an FMU, after the draft layered standard fmi-ls-wasm."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from hexapod_cosim.cosim.export import wit
from hexapod_cosim.cosim.export.platforms import FMI_OF_WASM, WASM_FOLDER
from hexapod_cosim.cosim.export.wasm_component import HEADER, MANIFEST
from hexapod_cosim.cosim.validate.description import schema_problems

SCHEMA = "fmi3/fmi3LayeredStandardManifest.xsd"


def component_problems(
    identifiers: Iterable[str], found: Mapping[str, bytes], fmi: int
) -> Iterator[str]:
    """Yields missing files, an invalid manifest, and components that lack the draft's interface.

    The component is not run.
    """
    if fmi != FMI_OF_WASM:
        yield f"binaries/{WASM_FOLDER} is for FMUs of FMI {FMI_OF_WASM}"
        return
    if MANIFEST in found:
        yield from schema_problems(MANIFEST, found[MANIFEST], SCHEMA)
    else:
        yield f"{MANIFEST} is missing: importers look there for a WebAssembly component"
    for identifier in sorted(identifiers):
        name = f"binaries/{WASM_FOLDER}/{identifier}.wasm"
        data = found.get(name)
        if data is None:
            yield f"{name} is missing: importers look for the modelIdentifier"
        elif not data.startswith(HEADER):
            yield f"{name} is no WebAssembly component"
        else:
            lacking = [one for one in (wit.COMMON, wit.CO_SIMULATION) if one.encode() not in data]
            yield from (f"{name} does not export {one}" for one in lacking)
