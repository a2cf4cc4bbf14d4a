"""Formulas as MathML, which browsers show by themselves: no script, no font from elsewhere, nothing fetched at reading time."""

from __future__ import annotations

import re
from html import escape
from typing import Any

from docutils import nodes
from latex2mathml.converter import convert

TAG = re.compile(r"\s*\\tag\{(\w+)\}\s*$")


def mathml(latex: str, *, display: str) -> str:
    """A formula as MathML, with what it was written as for readers who copy it."""
    return str(convert(latex, display=display)).replace("<math ", f'<math alttext="{escape(latex, quote=True)}" ', 1)


def split_tag(latex: str) -> tuple[str, str]:
    r"""A displayed formula and the number of its \tag, "" without one."""
    found = TAG.search(latex.strip())
    return (latex.strip()[: found.start()], found[1]) if found else (latex.strip(), "")


def visit_math(translator: Any, node: nodes.math) -> None:
    """A formula in a line of text."""
    translator.body.append(f'<span class="formula">{mathml(node.astext(), display="inline")}</span>')
    raise nodes.SkipNode


def visit_math_block(translator: Any, node: nodes.math_block) -> None:
    """A formula of its own, with its number as an anchor: equations.html#eq-4."""
    latex, number = split_tag(node.astext())
    anchor = f' id="eq-{number}"' if number else ""
    label = f'<a class="formula-number" href="#eq-{number}">({number})</a>' if number else ""
    translator.body.append(f'<div class="formula-block"{anchor}><div>{mathml(latex, display="block")}</div>{label}</div>\n')
    raise nodes.SkipNode


def setup(app: Any) -> dict[str, bool]:
    """Tells Sphinx."""
    app.add_html_math_renderer("mathml", inline_renderers=(visit_math, None), block_renderers=(visit_math_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
