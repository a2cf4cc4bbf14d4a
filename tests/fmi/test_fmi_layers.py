"""Tests that the C files of the FMI layer call each other in one direction only; fmi/instance.h
describes the layers.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

FMI = Path(__file__).resolve().parents[2] / "fmi"
# from the bottom up; files of one layer do not call each other
LAYERS = (
    ("variables",),
    ("resources",),
    ("instance",),
    ("step", "exchange", "state"),
    ("call", "arrays"),
    ("fmi2", "fmi3"),
)
LAYER_OF = {name: index for index, layer in enumerate(LAYERS) for name in layer}
DEFINITION = re.compile(r"^(?!static|extern)[\w *]*\b(hx_\w+)\([^;{]*\) \{", re.MULTILINE)
CALL = re.compile(r"\b(hx_\w+)\b")


def defined_in() -> dict[str, str]:
    """Returns the file that defines each function."""
    return {
        function: name
        for name in LAYER_OF
        for function in DEFINITION.findall((FMI / f"{name}.c").read_text(encoding="utf-8"))
    }


def test_every_c_file_has_a_layer() -> None:
    assert {path.stem for path in FMI.glob("*.c")} == set(LAYER_OF)


@pytest.mark.parametrize("name", LAYER_OF)
def test_a_file_calls_only_the_layers_below_it(name: str) -> None:
    definitions = defined_in()
    assert definitions["hx_log"] == "variables"
    assert definitions["hx_instance_step"] == "step"
    text = (FMI / f"{name}.c").read_text(encoding="utf-8")
    for function in set(CALL.findall(text)):
        other = definitions.get(function, name)
        below = LAYER_OF[other] < LAYER_OF[name]
        assert other == name or below, f"{name}.c calls {function} of {other}.c"
