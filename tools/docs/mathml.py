"""Converts formulas to MathML, which browsers show without scripts or downloads.

The font for brackets and accents is embedded in a style sheet, because browsers do not load font
files for pages that are opened from a disk.
"""

from __future__ import annotations

import base64
import io
import re
from html import escape
from pathlib import Path
from typing import Any

import ziamath
from docutils import nodes
from fontTools import subset
from fontTools.ttLib import TTFont
from latex2mathml.converter import convert

STYLE = "mathfont.css"
# letters and signs, accents, Greek, punctuation and primes, arrows, operators, brackets and their
# parts, italic letters
SHOWN = (
    (0x20, 0x7E),
    (0xA0, 0xFF),
    (0x300, 0x338),
    (0x370, 0x3FF),
    (0x2010, 0x2064),
    (0x2190, 0x21FF),
    (0x2200, 0x22FF),
    (0x2308, 0x230B),
    (0x239B, 0x23B1),
    (0x1D434, 0x1D467),
    (0x1D6E2, 0x1D71B),
)
BAR = re.compile(r"<mo([^>]*)>(?=&#x0007C;)")  # a bar of a norm, which is not an operator
TAG = re.compile(r"\s*\\tag\{(\w+)\}\s*$")


def mathml(latex: str, *, display: str) -> str:
    """Converts a formula to MathML; its LaTeX source is the alternative text."""
    text = BAR.sub(r'<mo\1 lspace="0" rspace="0">', str(convert(latex, display=display)))
    return text.replace("<math ", f'<math alttext="{escape(latex, quote=True)}" ', 1)


def split_tag(latex: str) -> tuple[str, str]:
    r"""Splits a displayed formula into formula and number of its \tag, "" without one."""
    found = TAG.search(latex.strip())
    return (latex.strip()[: found.start()], found[1]) if found else (latex.strip(), "")


def visit_math(translator: Any, node: nodes.math) -> None:
    """Writes a formula in a line of text."""
    translator.body.append(
        f'<span class="formula">{mathml(node.astext(), display="inline")}</span>'
    )
    raise nodes.SkipNode


def visit_math_block(translator: Any, node: nodes.math_block) -> None:
    """Writes a displayed formula with its number as an anchor: equations.html#eq-4."""
    latex, number = split_tag(node.astext())
    anchor = f' id="eq-{number}"' if number else ""
    label = f'<a class="formula-number" href="#eq-{number}">({number})</a>' if number else ""
    formula = mathml(latex, display="block")
    translator.body.append(
        f'<div class="formula-block"{anchor}><div>{formula}</div>{label}</div>\n'
    )
    raise nodes.SkipNode


def font_style() -> str:
    """Returns the style sheet with the font.

    The font is STIX Two Math (SIL Open Font Licence) from ziamath, reduced to the characters of
    SHOWN.
    """
    path = Path(ziamath.__file__).parent / "fonts" / "STIXTwoMath-Regular.ttf"
    font, bytes_out = TTFont(path), io.BytesIO()
    chosen = subset.Subsetter(
        subset.Options(layout_features=["ssty", "dtls", "flac"], notdef_outline=True)
    )
    chosen.populate(unicodes=[code for start, end in SHOWN for code in range(start, end + 1)])
    chosen.subset(font)
    font.save(bytes_out)
    data = base64.b64encode(bytes_out.getvalue()).decode()
    return (
        '@font-face { font-family: "Site Math"; '
        f'src: url("data:font/ttf;base64,{data}") format("truetype"); }}\n'
    )


def write_font(app: Any, _error: Any) -> None:
    """Writes the style sheet into the site."""
    (Path(app.outdir) / "_static" / STYLE).write_text(font_style(), encoding="utf-8")


def setup(app: Any) -> dict[str, bool]:
    """Registers the extension with Sphinx."""
    app.add_css_file(STYLE)
    app.connect("build-finished", write_font)
    app.add_html_math_renderer(
        "mathml", inline_renderers=(visit_math, None), block_renderers=(visit_math_block, None)
    )
    return {"parallel_read_safe": True, "parallel_write_safe": True}
