"""How Sphinx builds the site: pages of docs/ and results/, strict, with equations that the browser sets.

The source folder is the checkout (`make docs`), so that a page links to another, to a result or to a design by the same relative path here and on the web.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sphinx.application import Sphinx

project = "pendsus"
html_title = "pendsus"
root_doc = "docs/index"
include_patterns = ["docs/*.md", "results/*.md", "CHANGELOG.md"]
extensions = ["myst_parser", "sphinx.ext.mathjax"]
html_theme = "furo"
html_copy_source = False
html_show_sourcelink = False
html_static_path = ["site.css"]
html_css_files = ["site.css"]

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4  # anchors as forges make them, so that #section links mean the same there
nitpicky = True


def setup(app: Sphinx) -> None:
    """Leave a page at the top of the site that leads to the first one."""

    def redirect(app: Sphinx, error: Exception | None) -> None:
        if error is None and app.builder.name == "html":
            Path(app.outdir, "index.html").write_text('<!doctype html><title>pendsus</title><meta http-equiv="refresh" content="0; url=docs/index.html">\n')

    app.connect("build-finished", redirect)
