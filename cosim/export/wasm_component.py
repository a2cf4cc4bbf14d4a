"""Builds an FMU's binary as a WebAssembly component, after the draft layered standard fmi-ls-wasm.

The cross compiler makes a core module of the component's sources and wasm/fmu.c. A shell around it,
written here in the component model's text format, gives its functions the types of the draft. The
FMU's resources are in the component as a second core module, which copies them into the memory of
the first one: the draft leaves files to WASI, and an importer need not offer it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from importlib import util
from pathlib import Path

from hexapod_cosim.cosim.common.components import Component
from hexapod_cosim.cosim.common.installation import install_extra
from hexapod_cosim.cosim.common.plant_files import fmi_headers, released_binary, source_files
from hexapod_cosim.cosim.export import wit
from hexapod_cosim.cosim.export.cross_build import COMPONENT, Library, build_library
from hexapod_cosim.cosim.export.platforms import WASM_FOLDER
from hexapod_cosim.cosim.export.reference import MANIFEST_NAMESPACE
from hexapod_cosim.models.errors import FmuError

STANDARD, STANDARD_VERSION = "org.modelica.fmi-ls-wasm", "0.1.0"
MANIFEST = f"extra/{STANDARD}/manifest.xml"
_TREE = Path(__file__).resolve().parents[2]
# functions of stdio.h that the sources call, and what reads from memory instead
_FILES = {"fopen": "open", "fclose": "close", "fgetc": "getc", "fread": "read"}
_PLACES = {"fseek": "seek", "ftell": "tell"}
HEADER = b"\0asm\x0d\0\x01\0"  # of a component
RESOURCES = "resources/"
_CORE_MODULE = 1  # section of a component


def component_members(component: Component, members: Mapping[str, bytes]) -> dict[str, bytes]:
    """Returns the component and the draft's manifest by their path in an FMU with these members."""
    resources = {
        name.removeprefix(RESOURCES): data
        for name, data in members.items()
        if name.startswith(RESOURCES)
    }
    return {
        f"binaries/{WASM_FOLDER}/{component.identifier}.wasm": component_binary(
            component, resources
        ),
        MANIFEST: manifest(),
    }


def component_binary(component: Component, resources: Mapping[str, bytes]) -> bytes:
    """Returns a component of an FMU with its resources, by their path in the FMU's resources.

    It comes from a released wheel, or is built. Raises FmuError without a cross compiler.
    """
    made = released_binary(WASM_FOLDER, component.identifier) or build_component(component)
    return _with_modules(made, {1: resource_module(resources)})


def build_component(component: Component) -> bytes:
    """Builds a component without resources. Raises FmuError without compiler or wasmtime."""
    if util.find_spec("wasmtime") is None:
        raise FmuError(
            "no assembler of WebAssembly components",
            got="no package wasmtime",
            expected="wasmtime",
            fix=install_extra("platforms"),
        )
    import wasmtime  # noqa: PLC0415  of an extra

    core = build_library(component_module(component), COMPONENT)
    shell = bytes(wasmtime.wat2wasm(shell_text()))
    return _with_modules(shell, {0: core, 1: resource_module({})})


def component_module(component: Component) -> Library:
    """Returns the sources of the core module, by their path in an FMU's sources folder."""
    own = {f"wasm/{name}": _TREE / "wasm" / name for name in _OWN_FILES}
    flags = tuple(f"-D{name}=hx_memory_{own}" for name, own in (_FILES | _PLACES).items())
    return Library(
        component.identifier,
        dict(sorted((source_files(component) | own).items())),
        (fmi_headers(),),
        flags=flags,
    )


_OWN_FILES = ("fmu.c", "memory_files.c", "memory_files.h")


def manifest() -> bytes:
    """Returns the draft's manifest, which tells importers that the FMU has such a binary."""
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        f'<fmi-ls:fmiLayeredStandardManifest xmlns:fmi-ls="{MANIFEST_NAMESPACE}"\n'
        f'  fmi-ls:fmi-ls-name="{STANDARD}"\n'
        f'  fmi-ls:fmi-ls-version="{STANDARD_VERSION}"\n'
        '  fmi-ls:fmi-ls-description="FMI Layered Standard for WebAssembly"/>\n'
    ).encode()


# ------------------------------------------------------------------------------------------ text


def shell_text() -> str:
    """Returns the component around the two core modules, which are empty here, as text."""
    return "\n".join(["(component", *_imports(), *_core(), *_lifted(), *_exports(), ")"])


def _imports() -> Iterator[str]:
    """Yields the types of the draft, and the log callback that the importer offers."""
    yield f'(import "{wit.TYPES}" (instance $types'
    for name, kind in wit.SHARED_TYPES.items():
        yield f"  (type $own-{name} {kind})"
        yield f'  (export "{name}" (type ${name} (eq $own-{name})))'
    yield "))"
    for name in wit.SHARED_TYPES:
        yield f'(alias export $types "{name}" (type ${name}))'
    for name, kind in wit.OWN_TYPES.items():
        yield f"(type ${name} {kind})"
    log = " ".join(f'(param "{name}" {kind})' for name, kind in wit.LOG_PARAMETERS.items())
    yield f'(import "{wit.CALLBACKS}" (instance $callbacks'
    yield "  (alias outer 1 $status (type $outer-status))"
    yield '  (export "status" (type $status (eq $outer-status)))'
    yield f'  (export "{wit.LOG_MESSAGE}" (func {log}))'
    yield "))"


def _core() -> Iterator[str]:
    """Yields the core modules and how they are connected.

    The log callback needs the memory of the first module, which imports it; and the resource type
    needs that module's destructor, and the module the type. So both go through a table, which is
    filled when the module exists.
    """
    yield "(core module $main)"
    yield "(core module $resources)"
    texts = "i32 i32 i32 i32 i32 i32 i32"
    yield f"""(core module $table
  (type $log (func (param {texts})))
  (type $free (func (param i32)))
  (table (export "table") 2 2 funcref)
  (func (export "log") (type $log)
    {" ".join(f"local.get {k}" for k in range(7))} i32.const 0 call_indirect (type $log))
  (func (export "free") (type $free) local.get 0 i32.const 1 call_indirect (type $free)))
(core module $fill
  (import "" "table" (table 2 2 funcref))
  (import "" "log" (func $log (param {texts})))
  (import "" "free" (func $free (param i32)))
  (elem (i32.const 0) func $log $free))
(core instance $table (instantiate $table))
(alias core export $table "free" (core func $free))
(type ${wit.INSTANCE} (resource (rep i32) (dtor (core func $free))))
(core func $new (canon resource.new ${wit.INSTANCE}))
(alias core export $table "log" (core func $log))
(core instance $host (export "log" (func $log)) (export "new" (func $new)))
(core instance $main (instantiate $main (with "host" (instance $host))))
(core instance $resources (instantiate $resources (with "main" (instance $main))))
(alias core export $main "memory" (core memory $memory))
(alias core export $main "cabi_realloc" (core func $realloc))
(alias core export $main "cabi_post" (core func $post))
(alias core export $main "free-instance" (core func $main-free))
(alias core export $table "table" (core table $functions))
(alias export $callbacks "{wit.LOG_MESSAGE}" (func $log-message))
(core func $host-log (canon lower (func $log-message) (memory $memory) string-encoding=utf8))
(core instance $filling (export "table" (table $functions)) (export "log" (func $host-log))
  (export "free" (func $main-free)))
(core instance (instantiate $fill (with "" (instance $filling))))"""


def _lifted() -> Iterator[str]:
    """Yields the functions of the core module with the types of the draft."""
    memory = "(memory $memory) (realloc $realloc) string-encoding=utf8"
    yield '(alias core export $main "get-version" (core func $core-version))'
    yield f"(func $get-version (result string) (canon lift (core func $core-version) {memory}))"
    for one in wit.FUNCTIONS:
        post = " (post-return $post)" if one.allocates else ""
        yield f'(alias core export $main "{one.calls}" (core func $core-{one.name}))'
        yield f"(func ${one.name} {one.text()}"
        yield f"  (canon lift (core func $core-{one.name}) {memory}{post}))"


def _exports() -> Iterator[str]:
    """Yields the exported interfaces.

    The types of exported functions must be exported with them, under new identities, which takes a
    component around the functions.
    """
    yield f"""(component $common
  (import "import-get-version" (func $get-version (result string)))
  (export "get-version" (func $get-version)))
(instance $common-made (instantiate $common
  (with "import-get-version" (func $get-version))))
(export "{wit.COMMON}" (instance $common-made))"""
    types = wit.SHARED_TYPES | wit.OWN_TYPES
    yield "(component $interface"
    for name, kind in types.items():
        yield f"  (type $own-{name} {kind})"
        yield f'  (import "import-{name}" (type ${name} (eq $own-{name})))'
    yield f'  (import "import-{wit.INSTANCE}" (type ${wit.INSTANCE} (sub resource)))'
    for one in wit.FUNCTIONS:
        yield f'  (import "import-function-{one.name}" (func ${one.name} {one.text()}))'
    for name in (*types, wit.INSTANCE):
        yield f'  (export $out-{name} "{name}" (type ${name}))'
    for one in wit.FUNCTIONS:
        yield f'  (export "{one.exported}" (func ${one.name}) (func {one.text("out-")}))'
    yield ")"
    yield "(instance $co-simulation (instantiate $interface"
    for name in (*types, wit.INSTANCE):
        yield f'  (with "import-{name}" (type ${name}))'
    for one in wit.FUNCTIONS:
        yield f'  (with "import-function-{one.name}" (func ${one.name}))'
    yield "))"
    yield f'(export "{wit.CO_SIMULATION}" (instance $co-simulation))'


# ---------------------------------------------------------------------------------------- binary


def resource_module(resources: Mapping[str, bytes]) -> bytes:
    """Returns a core module that initialises the main one and copies files into its memory.

    Its only function asks the main module for a block (wasm/memory_files.h) and fills it.
    """
    block = b"".join(
        name.encode() + b"\0" + len(data).to_bytes(4, "little") + data
        for name, data in sorted(resources.items())
    )
    size = _signed(len(block))
    plain, allocate = b"\x60\0\0", b"\x60\x01\x7f\x01\x7f"  # () -> (), (i32) -> (i32)
    imports = [
        _name("main") + _name("memory") + b"\x02\0\0",
        _name("main") + _name("_initialize") + b"\0\0",
        _name("main") + _name("resources") + b"\0\x01",
    ]
    # call _initialize; memory.init 0 (resources(size), 0, size)
    body = b"\0\x10\0\x41" + size + b"\x10\x01\x41\0\x41" + size + b"\xfc\x08\0\0\x0b"
    sections = {
        1: _vector([plain, allocate]),
        2: _vector(imports),
        3: _vector([b"\0"]),
        8: b"\x02",  # start: function 2
        12: b"\x01",  # number of data segments
        10: _vector([_number(len(body)) + body]),
        11: _vector([b"\x01" + _number(len(block)) + block]),
    }
    return b"\0asm\x01\0\0\0" + b"".join(map(_section, sections, sections.values()))


def _with_modules(component: bytes, modules: Mapping[int, bytes]) -> bytes:
    """Returns the component with other core modules, by their number in it."""
    place, count, parts = len(HEADER), 0, [HEADER]
    while place < len(component):
        kind = component[place]
        size, begin = _read_number(component, place + 1)
        place = begin + size
        content = component[begin:place]
        if kind == _CORE_MODULE:
            content = modules.get(count, content)
            count += 1
        parts.append(_section(kind, content))
    return b"".join(parts)


def _section(kind: int, content: bytes) -> bytes:
    return bytes([kind]) + _number(len(content)) + content


def _vector(items: list[bytes]) -> bytes:
    return _number(len(items)) + b"".join(items)


def _name(text: str) -> bytes:
    return _number(len(text)) + text.encode()


def _number(value: int) -> bytes:
    """Returns an unsigned number as LEB128."""
    found = bytearray()
    while value > 0x7F:
        found.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*found, value])


def _signed(value: int) -> bytes:
    """Returns a number that is not negative as signed LEB128."""
    found = bytearray()
    while value > 0x3F:
        found.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*found, value])


def _read_number(data: bytes, place: int) -> tuple[int, int]:
    """Returns an unsigned LEB128 number and the place behind it."""
    value = shift = 0
    while data[place] & 0x80:
        value |= (data[place] & 0x7F) << shift
        place, shift = place + 1, shift + 7
    return value | data[place] << shift, place + 1
