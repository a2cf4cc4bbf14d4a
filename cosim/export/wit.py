"""The interface of a WebAssembly FMU: functions of the draft layered standard fmi-ls-wasm.

The draft (modelica/fmi-ls-wasm, package fmi:fmi3@3.0.0) describes FMI 3.0's functions for the
WebAssembly component model. This module states the part that a co-simulation FMU has, in the
component model's text format: named types, the imported log callback, and for each function its
parameters, its result and the function of wasm/fmu.c that it calls.
"""

from __future__ import annotations

from dataclasses import dataclass

PACKAGE, VERSION = "fmi:fmi3", "3.0.0"
INSTANCE = "co-simulation-instance"
TYPES, CALLBACKS = f"{PACKAGE}/types@{VERSION}", f"{PACKAGE}/callbacks@{VERSION}"
COMMON, CO_SIMULATION = f"{PACKAGE}/common@{VERSION}", f"{PACKAGE}/co-simulation@{VERSION}"
LOG_MESSAGE = "log-message"

# types of the interface `types`, in the order of definition; "$" before the name of another one
SHARED_TYPES = {
    "value-reference": "u32",
    "status": '(enum "ok" "warning" "discard" "error" "fatal")',
    "fmu-state": "(list u8)",
    "interval-qualifier": '(enum "interval-not-yet-known" "interval-unchanged" "interval-changed")',
    "interval-fraction": '(record (field "counter" u64) (field "resolution" u64))',
    "dependency-kind": '(enum "dependent" "constant" "fixed" "tunable" "discrete")',
    "variable-dependency": (
        '(record (field "dependent-value-reference" $value-reference)'
        ' (field "element-index-of-dependent" u32)'
        ' (field "independent-value-reference" $value-reference)'
        ' (field "element-index-of-independent" u32) (field "kind" $dependency-kind))'
    ),
    "discrete-states-info": (
        '(record (field "new-discrete-states-needed" bool) (field "terminate-simulation" bool)'
        ' (field "nominals-of-continuous-states-changed" bool)'
        ' (field "values-of-continuous-states-changed" bool)'
        ' (field "next-event-time-defined" bool) (field "next-event-time" f64))'
    ),
}
# types of the interface `co-simulation`
OWN_TYPES = {
    "do-step-result": (
        '(record (field "last-successful-time" f64) (field "event-handling-needed" bool)'
        ' (field "terminate-simulation" bool) (field "early-return" bool))'
    )
}
LOG_PARAMETERS = {
    "instance-name": "string",
    "status": "$status",
    "category": "string",
    "message": "string",
}

Fields = dict[str, str]  # types of parameters by name


@dataclass(frozen=True, kw_only=True)
class Function:
    """A function of the instance: parameters without the instance, result, function in C.

    allocates: the result has a list, which `cabi_post` frees.
    """

    name: str
    calls: str
    parameters: Fields
    result: str
    allocates: bool = False

    @property
    def is_static(self) -> bool:
        """Whether it makes the instance."""
        return self.name == "instantiate-co-simulation"

    @property
    def exported(self) -> str:
        """The name under which the interface exports it."""
        return f"[{'static' if self.is_static else 'method'}]{INSTANCE}.{self.name}"

    def text(self, prefix: str = "") -> str:
        """Returns parameters and result with named types whose names have a prefix."""
        own = {} if self.is_static else {"self": f"(borrow ${INSTANCE})"}
        fields = [f'(param "{name}" {kind})' for name, kind in (own | self.parameters).items()]
        return " ".join([*fields, f"(result {self.result})"]).replace("$", f"${prefix}")


REFERENCES = {"value-references": "(list $value-reference)"}
STATUS = "$status"
INSTANTIATE = Function(
    name="instantiate-co-simulation",
    calls="instantiate",
    parameters={
        "instance-name": "string",
        "instantiation-token": "string",
        "resource-path": "string",
        "visible": "bool",
        "logging-on": "bool",
        "event-mode-used": "bool",
        "early-return-allowed": "bool",
        "required-intermediate-variables": "(list $value-reference)",
    },
    result=f"(option (own ${INSTANCE}))",
)


def _or_status(kind: str) -> str:
    """Returns the type of a value of this type, or the status of a failure."""
    return f"(result {kind} (error {STATUS}))"


def _does(name: str, calls: str = "", **parameters: str) -> Function:
    """Returns a function whose result is a status; `_` in names of parameters stands for `-`."""
    fields = {key.replace("_", "-"): kind for key, kind in parameters.items()}
    return Function(name=name, calls=calls or name, parameters=fields, result=STATUS)


def _get(name: str, element: str, calls: str = "", parameters: Fields = REFERENCES) -> Function:
    """Returns a function whose result is a list."""
    return Function(
        name=f"get-{name}",
        calls=calls or f"get-{name}",
        parameters=parameters,
        result=_or_status(element if element.startswith("$") else f"(list {element})"),
        allocates=True,
    )


def _set(name: str, element: str, calls: str = "", values: str = "values") -> Function:
    """Returns a function that sets variables and whose result is a status."""
    fields = REFERENCES | {values: f"(list {element})"}
    return Function(
        name=f"set-{name}", calls=calls or f"set-{name}", parameters=fields, result=STATUS
    )


# element types of variables by the names in functions; the FMUs have variables of the first three
_PRESENT = {"float64": "f64", "int64": "s64", "boolean": "bool"}
_ABSENT = {
    "float32": "f32", "int8": "s8", "int16": "s16", "int32": "s32",
    "uint8": "u8", "uint16": "u16", "uint32": "u32", "uint64": "u64",
}  # fmt: skip
_TEXTS = {"string": "string", "binary": "(list u8)"}
_DERIVATIVE = {
    "unknowns": "(list $value-reference)",
    "knowns": "(list $value-reference)",
    "seed": "(list f64)",
}
_REQUESTS = "(list (tuple $value-reference u32))"

FUNCTIONS = (
    INSTANTIATE,
    _does("set-debug-logging", logging_on="bool", categories="(list string)"),
    _does(
        "enter-initialization-mode",
        tolerance="(option f64)",
        start_time="f64",
        stop_time="(option f64)",
    ),
    *map(_does, ("exit-initialization-mode", "enter-event-mode", "terminate", "reset")),
    *map(_does, ("enter-configuration-mode", "exit-configuration-mode")),
    *map(_does, ("evaluate-discrete-states", "enter-step-mode")),
    Function(
        name="update-discrete-states",
        calls="update-discrete-states",
        parameters={},
        result=_or_status("$discrete-states-info"),
    ),
    *(_get(name, kind) for name, kind in _PRESENT.items()),
    *(_set(name, kind) for name, kind in _PRESENT.items()),
    *(_get(name, kind, "get-other") for name, kind in (_ABSENT | _TEXTS).items()),
    *(_set(name, kind, "set-other") for name, kind in _ABSENT.items()),
    *(_set(name, kind, "set-texts") for name, kind in _TEXTS.items()),
    _get("clock", "bool"),
    _set("clock", "bool"),
    _get("interval-decimal", "(tuple f64 $interval-qualifier)", "get-clock"),
    _get("interval-fraction", "(tuple $interval-fraction $interval-qualifier)", "get-clock"),
    _get("shift-decimal", "f64", "get-clock"),
    Function(
        name="get-shift-fraction",
        calls="get-clock",
        parameters=REFERENCES,
        result=_or_status("(list $interval-fraction)"),
        allocates=True,
    ),
    _set("interval-decimal", "f64", "set-clock", "intervals"),
    _set("interval-fraction", "$interval-fraction", "set-clock", "intervals"),
    _set("shift-decimal", "f64", "set-clock", "shifts"),
    _set("shift-fraction", "$interval-fraction", "set-clock", "shifts"),
    Function(
        name="get-number-of-variable-dependencies",
        calls="get-number-of-variable-dependencies",
        parameters={"vr": "$value-reference"},
        result=_or_status("u64"),
    ),
    Function(
        name="get-variable-dependencies",
        calls="get-variable-dependencies",
        parameters={"dependent": "$value-reference"},
        result=_or_status("(list $variable-dependency)"),
        allocates=True,
    ),
    _get("fmu-state", "$fmu-state", parameters={}),
    _does("set-fmu-state", state="$fmu-state"),
    _get("directional-derivative", "f64", parameters=_DERIVATIVE),
    _get("adjoint-derivative", "f64", parameters=_DERIVATIVE),
    _does("set-input-derivatives", requests=_REQUESTS, values="(list f64)"),
    _get("output-derivatives", "f64", parameters={"requests": _REQUESTS}),
    Function(
        name="do-step",
        calls="do-step",
        parameters={
            "current-communication-point": "f64",
            "communication-step-size": "f64",
            "no-set-fmu-state-prior-to-current-point": "bool",
        },
        result=_or_status("$do-step-result"),
    ),
)
