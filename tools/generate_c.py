"""Renders the C of an FMU's variables: structures, tables and defaults (tools/generate.py)."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from hexapod_cosim.cosim.common.components import PLANT, Component
from hexapod_cosim.cosim.interface.arrays import arrays
from hexapod_cosim.cosim.interface.records import CAUSALITIES, Interface, Variable

# constants of C that are sizes of arrays of outputs, by component
SIZES = {"plant": {"HX_CONE_BINS": "output.cone_time"}}
# structures of C with names, inner ones first, by component; their fields are variables
STRUCTURES: dict[str, dict[str, str]] = {
    "controller": {
        **{"definition.leg.link": "hxKnownLink", "definition.leg": "hxKnownLeg"},
        **{"definition.gait": "hxGait", "definition.gains": "hxGains"},
        **{"definition.parts": "hxParts", "definition": "hxControllerDefinition"},
        **{"input": "hxControllerInput", "output": "hxControllerOutput"},
    },
    "plant": {
        **{"definition.leg.link": "hxLink", "definition.leg": "hxLeg"},
        **{"definition.soil": "hxSoilDefinition", "definition": "hxDefinition"},
        "input": "hxInput",
    },
}
TYPES = {"Real": "HX_REAL", "Enumeration": "HX_INTEGER", "Boolean": "HX_BOOLEAN"}


def render_settings(interface: Interface) -> str:
    """Returns NAME_settings.h: the enumerations, and the structures of grouped parameters."""
    guard = f"HEXAPOD_{interface.component.name.upper()}_SETTINGS_H"
    lines = [
        _head(f"{interface.component.name}_settings.h - choices and settings of a definition."),
        *(f"#ifndef {guard}", f"#define {guard}", "", '#include "hexapod/legs.h"', ""),
    ]
    for enumeration in interface.enumerations.values():
        lines += [f"typedef enum hx{enumeration.name} {{"]
        for number, (_, description) in enumerate(enumeration.items, start=1):
            value = " = 1" if number == 1 else ""
            lines += [*_comment(description), f"  {enumeration.constant(number)}{value},"]
        lines += [f"}} hx{enumeration.name};", ""]
    for constant, array in SIZES.get(interface.component.name, {}).items():
        size = sum(item.field.startswith(f"{array}[") for item in interface.of_causality("output"))
        lines += [f"enum {{ {constant} = {size} }};", ""]
    names = STRUCTURES.get(interface.component.name, {})
    fields = _field_tree(interface)
    for path, name in names.items():
        lines += [f"typedef struct {name} {{", *_render_fields(fields, path, names)]
        lines += [f"}} {name};", ""]
    return "\n".join([*lines, "#endif", ""])


@dataclass
class Field:
    """A field of a structure in C: a variable, or a structure with the fields `inside`."""

    variable: Variable
    sizes: list[int]  # of an array, empty: a single one
    inside: list[str]  # paths


def _field_tree(interface: Interface) -> dict[str, Field]:
    """Returns the fields of definition, input and output by their paths without indices."""
    found: dict[str, Field] = {}
    for variable in interface.of_causality("parameter", "input", "output"):
        path = ""
        for part in variable.field.split("."):
            name, *indices = re.findall(r"\w+", part)
            above, path = path, f"{path}.{name}" if path else name
            field = found.setdefault(path, Field(variable, [0] * len(indices), []))
            field.sizes = [max(n, int(k) + 1) for n, k in zip(field.sizes, indices, strict=True)]
            if above and path not in found[above].inside:
                found[above].inside.append(path)
    return found


def _render_fields(
    fields: Mapping[str, Field], path: str, names: Mapping[str, str], indent: str = "  "
) -> Iterable[str]:
    """Yields the C fields of a structure."""
    for inner in fields[path].inside:
        field = fields[inner]
        name = inner.rpartition(".")[2] + "".join(f"[{size}]" for size in field.sizes)
        if inner in names:
            yield f"{indent}{names[inner]} {name};"
        elif field.inside:
            yield f"{indent}struct {{"
            yield from _render_fields(fields, inner, names, indent + "  ")
            yield f"{indent}}} {name};"
        else:
            item = field.variable
            unit = f"hx{item.enumeration}" if item.enumeration else item.unit or "0 or 1"
            yield from _comment(f"{unit}  {item.description}", indent)
            yield f"{indent}{'double' if item.type == 'Real' else 'int'} {name};"


def _comment(text: str, indent: str = "  ") -> list[str]:
    """Returns a text as a C comment of lines of at most 100 columns."""
    lines = textwrap.wrap(f"/* {text} */", 100 - len(indent), subsequent_indent=" * ")
    return [indent + line for line in lines]


def render_structure(component: Component) -> str:
    """Returns variables.h: the C structure that holds the values of the variables."""
    kind = component.structure
    lines = [
        _head("variables.h - what the FMU's variables are fields of."),
        "#ifndef HEXAPOD_GENERATED_VARIABLES_H",
    ]
    lines += ["#define HEXAPOD_GENERATED_VARIABLES_H", "", f'#include "{component.header}"', ""]
    if kind:
        lines += [f"typedef hx{kind}Input hxInput; /* what the FMI layer calls it */", ""]
    lines += [
        "struct hxVariables {",
        f"  hx{kind}Definition definition; /* parameters */",
        "  hxInput input;",
    ]
    if component is PLANT:
        lines += ["  hxCoordinates state; /* of model exchange */"]
    lines += [f"  hx{kind}Output output; /* this and what follows is calculated from the above */"]
    if component is PLANT:
        lines += ["  hxCoordinates rate;     /* of the continuous states */"]
        lines += ["  hxIndicators indicator; /* events are their changes of sign */"]
    return "\n".join([*lines, "};", "", "#endif", ""])


def render_variables(interface: Interface, guid: str) -> str:
    """Returns variables.c: the table of variables."""
    head = _head("variables.c - every variable of the FMU: where it is and what it may be.")
    lines = [head, "#include <float.h>", "", '#include "fmi/variables.h"', ""]
    array_rows = {array.reference: len(array.elements) for array in arrays(interface)}
    for causality in CAUSALITIES:
        if rows := [
            _row(variable, array_rows.get(variable.reference, 0))
            for variable in interface.of_causality(causality)
        ]:
            lines += [f"static const hxVariable {causality}s[] = {{", *rows, "};", ""]
    lines += ["const hxSection hx_sections[HX_CAUSALITIES] = {"]
    for causality in CAUSALITIES:
        first, rows = interface.first_reference[causality], f"{causality}s"
        table = f"sizeof {rows} / sizeof {rows}[0], {rows}"
        row = f"{first}, {table if interface.of_causality(causality) else '0, 0'}"
        lines += [f"    [HX_{causality.upper()}] = {{{row}}},"]
    lines += ["};", "", "const unsigned char hx_output_groups[] = {"]
    lines += [f"    {_groups(output)}," for output in interface.of_causality("output")]
    time = interface.first_reference["independent"]
    lines += ["};", "", f"const unsigned hx_time_reference = {time};"]
    lines += ["", "const char *const hx_log_category_names[] = {"]
    lines += [f'    "{name}",' for name in interface.log_categories]
    lines += ["};", "", *_states(interface)]
    lines += [f"const uint64_t hx_table_digest = {interface.table_digest:#018x}u;", ""]
    lines += [f'const char hx_default_guid[] = "{guid}";', "", *_enumeration_checks(interface), ""]
    return "\n".join(lines)


def _states(interface: Interface) -> list[str]:
    """Returns the C table of continuous states, in the order of the state in struct hxVariables."""
    if not interface.states:
        return ["const hxStateRow *const hx_states = 0;", "const size_t hx_state_count = 0;", ""]
    variables = [interface.variable(state.name) for state in interface.states]
    rows = [f"    {{{variable.reference}, {variable.nominal!r}}}," for variable in variables]
    lines = ["static const hxStateRow states[] = {", *rows, "};"]
    lines += ["const hxStateRow *const hx_states = states;"]
    lines += ["const size_t hx_state_count = sizeof states / sizeof states[0];", ""]
    lines.append(
        "_Static_assert(sizeof states / sizeof states[0] == sizeof(hxCoordinates) / "
        'sizeof(double), "each state has its row");'
    )
    return [*lines, ""]


def _row(variable: Variable, array_rows: int) -> str:
    """Returns the C row of a variable."""
    place = f"offsetof(struct hxVariables, {variable.field})"
    return (
        f'    {{"{variable.name}", "{variable.unit or ""}", {_limits(variable)}, {place}, '
        f"{TYPES[variable.type]}, {int(variable.variability == 'tunable')}, {array_rows}}},"
    )


def _groups(output: Variable) -> str:
    """Returns the groups of outputs that an output belongs to, in C."""
    return f"HX_OUTPUT_{output.group.upper()}" if output.group else "HX_ALL_GROUPS"


def _limits(variable: Variable) -> str:
    """Returns a variable's limits in C."""
    low = "-DBL_MAX" if variable.minimum is None else repr(variable.minimum)
    high = "DBL_MAX" if variable.maximum is None else repr(variable.maximum)
    return f"{low}, {high}"


def _enumeration_checks(interface: Interface) -> Iterable[str]:
    """Yields C assertions that enumeration items have the same numbers in C and in the FMU."""
    for enumeration in interface.enumerations.values():
        for number in range(1, len(enumeration.items) + 1):
            yield (
                f'_Static_assert({enumeration.constant(number)} == {number}, "{enumeration.name}");'
            )


def render_defaults(interface: Interface) -> str:
    """Returns defaults.c: the default robot's values, the ranges of variables, the version."""
    component = interface.component
    lines = [
        _head(f"defaults.c - the robot {interface.robot.name} and the version."),
        "#include <float.h>",
        "",
        f'#include "{component.header}"',
        "",
    ]
    for member in ("definition", "input"):
        lines += _default(interface, member)
    lines += ["const char *hx_version(void) {", f'  return "{interface.version}";', "}", ""]
    for member in ("definition", "input"):
        structure = f"hx{component.structure}{member.capitalize()}"
        ranges = _ranges(interface, member, structure)
        lines += [f"static const hxRange {member}_ranges[] = {{", *ranges, "};", ""]
        lines += [f"size_t hx_{component.prefix}{member}_ranges(const hxRange **range) {{"]
        lines += [f"  *range = {member}_ranges;"]
        lines += [f"  return sizeof {member}_ranges / sizeof {member}_ranges[0];", "}", ""]
    return "\n".join(lines)


def _default(interface: Interface, member: str) -> Iterable[str]:
    """Yields a structure's default values and the function that copies them."""
    structure = f"hx{interface.component.structure}{member.capitalize()}"
    function = f"hx_{interface.component.prefix}{member}_default"
    yield f"static const {structure} default_{member} = {{"
    yield from _initialisers(interface, member)
    yield from ("};", "")
    yield f"void {function}({structure} *{member}) {{"
    yield from (f"  *{member} = default_{member};", "}", "")


def _ranges(interface: Interface, member: str, structure: str) -> Iterable[str]:
    """Yields the C rows of ranges for one structure."""
    for variable in interface.of_causality("input", "parameter"):
        root, _, field = variable.field.partition(".")
        if root == member:
            place = f"offsetof({structure}, {field})"
            unit = "" if variable.unit in (None, "1") else variable.unit
            yield (
                f'    {{"{variable.name}", "{unit}", {_limits(variable)}, {place}, '
                f"{int(variable.type != 'Real')}}},"
            )


def _initialisers(interface: Interface, member: str) -> Iterable[str]:
    """Yields the C initialisers of one structure."""
    for variable in interface.of_causality("input", "parameter"):
        root, _, field = variable.field.partition(".")
        if root == member and variable.start is not None:
            yield f"    .{field} = {_constant(interface, variable)},"


def _constant(interface: Interface, variable: Variable) -> str:
    """Returns a start value in C."""
    if variable.enumeration is not None:
        return interface.enumerations[variable.enumeration].constant(int(variable.start or 0))
    return str(int(variable.start)) if isinstance(variable.start, bool) else repr(variable.start)


def _head(purpose: str) -> str:
    """Returns the comment at the beginning of a generated file."""
    return (
        f"/* {purpose}\n * Generated by tools/generate.py: change interface.toml or the robot's "
        "file, not this. */"
    )
