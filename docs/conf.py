"""Sphinx configuration of the site: strict, with equations that need no script and no network.

The source folder is the checkout (`make docs`), so that relative links between pages, results and
designs are valid both on the site and in the repository.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.util.logging import getLogger

if TYPE_CHECKING:
    from sphinx.application import Sphinx

sys.path.insert(0, str(Path(__file__).parents[1]))
from tools import reference

logger = getLogger(__name__)

project = "pendsus"
html_title = "pendsus"
root_doc = "docs/index"
include_patterns = [
    "docs/*.md",
    "docs/examples/*.md",
    "results/*.md",
    "CONTRIBUTING.md",
    "CHANGELOG.md",
]
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
napoleon_google_docstring = False
autodoc_typehints = "none"
html_math_renderer = "mathml"
html_theme = "furo"
html_copy_source = False
html_show_sourcelink = False
html_show_copyright = False
html_static_path = ["site.css"]
html_css_files = ["site.css"]

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4  # anchors as forges make them, so that #section links mean the same there
nitpicky = True
nitpick_ignore_regex = [("py:.*", ".*")]  # types in docstrings are words


def setup(app: Sphinx) -> None:
    """Render equations at build time, and redirect the top of the site to the first page."""
    app.add_html_math_renderer("mathml", (in_line, None), (displayed, None))
    app.connect("build-finished", redirect)
    app.connect("source-read", expand_pages)
    app.connect("autodoc-process-docstring", escape_dimensions, priority=600)  # after napoleon


def expand_pages(_app: Sphinx, page: str, source: list[str]) -> None:
    """Add the meaning of every option to the page on commands, and docstrings to that on Python."""
    if page == "docs/commands":
        source[0] = reference.expand(source[0])
    if page == "docs/api":
        source[0] += reference.documented_names()


def escape_dimensions(
    _app: Sphinx, _what: str, _name: str, _object: object, _options: object, lines: list[str]
) -> None:
    """Escape the star of dimensions such as "*axes" in types, which is no emphasis."""
    lines[:] = [re.sub(r"""(["'])\*(\w)""", r"\1\*\2", line) for line in lines]


def in_line(writer: Any, node: nodes.math) -> None:
    """Write an equation within a line, in MathML."""
    writer.body.append(mathml(node, as_block=False))
    raise nodes.SkipNode


def displayed(writer: Any, node: nodes.math_block) -> None:
    """Write an equation on a line of its own, in MathML."""
    writer.body.append(f'<div class="math">{mathml(node, as_block=True)}</div>\n')
    raise nodes.SkipNode


def mathml(node: nodes.Element, *, as_block: bool) -> str:
    """Convert LaTeX to MathML; LaTeX that docutils does not know is a warning, and so an error."""
    text = node.astext()
    try:
        if re.search(r"frac(?!\{)", text):
            raise MathError("docutils reads \\frac12 otherwise than LaTeX does: write \\frac{1}{2}")
        return tex2mathml(text, as_block=as_block)
    except MathError as error:
        logger.warning("%s: %s", error, text, location=node)
        return ""


def redirect(app: Sphinx, error: Exception | None) -> None:
    """Write the page at the top of the site, which redirects to the first one."""
    if error is None and app.builder.name == "html":
        Path(app.outdir, "index.html").write_text(
            "<!doctype html><title>pendsus</title>"
            '<meta http-equiv="refresh" content="0; url=docs/index.html">\n'
        )
