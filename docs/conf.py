"""The site's settings. `make docs` puts the pages together first (tools/docs) and then calls
Sphinx with this file.
"""

import sys
from importlib.metadata import version as version_of
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from docutils import nodes

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

# MathJax in one file, fonts included: pages show formulas without a network, also from a disk
SPEC = find_spec("sphinx-mathjax-offline")
assert SPEC is not None
assert SPEC.origin is not None
MATHJAX = Path(SPEC.origin).parent / "static" / "mathjax" / "tex-svg.js"

project = "hexapod-cosim"
author = "The hexapod-cosim developers"
copyright = author  # noqa: A001  Sphinx's name
version = release = version_of("hexapod-cosim")

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx_copybutton",
    "sphinx_design",
    "sphinx.ext.mathjax",
    "tools.docs.docstrings",
]

# Markdown as GitHub shows it: ```math fences, $...$, anchors of headings
myst_enable_extensions = ["dollarmath", "colon_fence", "attrs_inline", "substitution"]
myst_fence_as_directive = ["math"]
myst_heading_anchors = 3
myst_dmath_double_inline = True
nb_execution_mode = "off"  # tools/docs runs the notebooks

autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 100
toc_object_entries_show_parents = "hide"

# every reference leads somewhere, but for those to other projects, whose inventories are not here
nitpicky = True
nitpick_ignore_regex = [
    ("py:.*", r"(?!hexapod_cosim\.).*"),
    ("c:identifier", ".*"),
    ("py:class", r".*\._\w+"),
]
suppress_warnings = ["misc.highlighting_failure"]  # lines of other languages in a block

html_theme = "furo"
html_title = "hexapod-cosim"
html_static_path = ["_static", str(MATHJAX)]
html_css_files = ["site.css"]
mathjax_path = MATHJAX.name
mathjax3_config = {"svg": {"scale": 0.9}}
html_copy_source = False
html_show_sphinx = False
html_favicon = "_static/favicon.svg"
pygments_style = "friendly"
pygments_dark_style = "github-dark"
copybutton_exclude = ".linenos, .gp, .go"
html_theme_options = {
    "light_css_variables": {"color-brand-primary": "#00568f", "color-brand-content": "#0072b2"},
    "dark_css_variables": {"color-brand-primary": "#7cc4f2", "color-brand-content": "#8ccbf5"},
}


def keep_formulas(_app: Any, page: nodes.document) -> None:
    r"""Leaves displayed formulas to MathJax as they are. Sphinx would put those with several lines
    into an environment in which \tag is not allowed.
    """
    for formula in page.findall(nodes.math_block):
        formula["no-wrap"] = True
        formula[:] = [nodes.Text(rf"\[{formula.astext()}\]")]


def setup(app: Any) -> None:
    """Connects the function above with Sphinx."""
    app.connect("doctree-read", keep_formulas)
