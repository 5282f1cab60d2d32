"""How Sphinx builds the site: pages of docs/ and results/, strict, with equations that need no script and no network.

The source folder is the checkout (`make docs`), so that a page links to another, to a result or to a design by the same relative path here and on the web.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.util.logging import getLogger

if TYPE_CHECKING:
    from sphinx.application import Sphinx

logger = getLogger(__name__)

project = "pendsus"
html_title = "pendsus"
root_doc = "docs/index"
include_patterns = ["docs/*.md", "results/*.md", "CHANGELOG.md"]
extensions = ["myst_parser"]
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


def setup(app: Sphinx) -> None:
    """Set equations at build time, and leave a page at the top of the site that leads to the first one."""
    app.add_html_math_renderer("mathml", (in_line, None), (displayed, None))
    app.connect("build-finished", redirect)


def in_line(writer: Any, node: nodes.math) -> None:
    """Write an equation within a line, in MathML."""
    writer.body.append(mathml(node, as_block=False))
    raise nodes.SkipNode


def displayed(writer: Any, node: nodes.math_block) -> None:
    """Write an equation on a line of its own, in MathML."""
    writer.body.append(f'<div class="math">{mathml(node, as_block=True)}</div>\n')
    raise nodes.SkipNode


def mathml(node: nodes.Element, *, as_block: bool) -> str:
    """LaTeX as MathML, which browsers show by themselves; what docutils does not know is a warning, and so an error."""
    text = node.astext()
    try:
        if re.search(r"frac(?!\{)", text):
            raise MathError("docutils reads \\frac12 otherwise than LaTeX does: write \\frac{1}{2}")
        return tex2mathml(text, as_block=as_block)
    except MathError as error:
        logger.warning("%s: %s", error, text, location=node)
        return ""


def redirect(app: Sphinx, error: Exception | None) -> None:
    """The page at the top."""
    if error is None and app.builder.name == "html":
        Path(app.outdir, "index.html").write_text('<!doctype html><title>pendsus</title><meta http-equiv="refresh" content="0; url=docs/index.html">\n')
