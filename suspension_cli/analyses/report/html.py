"""HTML of a report: text, tables, pictures and the page around them.

The page is one file: pictures are `data:` addresses, the style sheet is inline, there is no script.
"""

from __future__ import annotations

import base64
import re
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from suspension_cli.analyses import tables
from suspension_cli.analyses.tables import Table
from suspension_cli.drawing.style import RAISED
from suspension_cli.errors import escape_unprintable

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LARGEST = 1_500_000
"""Size in bytes above which a picture is embedded as PNG instead of SVG."""
WIDTH, ACROSS = 6.4, 880
"""Width of pictures of curves, in, and of the page, in pixels, over which they are shown."""
FIGURE_SPACE = "\u2007"
"""Space as wide as a digit."""
NUMBER = re.compile(r"([-+]?)([\d,]+\.?\d*)(?:e([-+]\d+))?( *)")
"""A formatted number: sign, digits with the point, exponent, spaces."""


def text(value: object) -> str:
    """Escape text for HTML, with the signs √ and ± in place of their ASCII forms."""
    plain = escape_unprintable(str(value))
    return escape(plain.replace("sqrt(Hz)", "√Hz").replace("+-", "±"))


def lines(value: str) -> str:
    """Escape text of several lines for HTML."""
    return "\n".join(escape(escape_unprintable(line)) for line in value.split("\n"))


def paragraph(content: str, kind: str = "") -> str:
    """Return a paragraph of HTML, of a class of the style sheet."""
    kind = f' class="{kind}"' if kind else ""
    return f"<p{kind}>{content}</p>\n"


def prose(answer: str, found: Sequence[Table], model: str = "") -> str:
    """Convert the printed text of a command, made within `tables.collecting`, to HTML.

    `found` are the collected tables; the line of the model has a style of its own.
    """
    parts: list[str] = []
    for block in re.split(r"\n\s*\n", answer):
        lines: list[str] = []
        for line in map(str.strip, block.split("\n")):
            place = tables.PLACE.fullmatch(line)
            if place:
                parts += [_lines(lines), table(found[int(place[1])])]
                lines = []
            elif line and line == model:
                parts.append(paragraph(text(line), "model"))
            elif line:
                lines.append(line)
        parts.append(_lines(lines))
    return "".join(parts)


def _lines(lines: Sequence[str]) -> str:
    """Return lines of text as one paragraph; lines that end with a semicolon are joined."""
    joined = "".join(text(line) + (" " if line[-1] == ";" else "<br>") for line in lines)
    return paragraph(joined.removesuffix("<br>")) if joined else ""


def table(content: Table, caption: str = "") -> str:
    """Return a table: numbers aligned on the point as in the terminal, text on the left."""
    heads, columns = [], []
    for (head, form), cells in zip(content.columns.items(), content.cells, strict=True):
        side = "n" if form else "t"
        name, _, unit = head.partition("\n")
        below = f"<br><small>{text(unit.strip())}</small>" if unit else ""
        heads.append((side, text(name) + below))
        _, *aligned = tables.align([""], cells) if form else ("", *cells)
        columns.append([(side, _cell(cell)) for cell in aligned])
    return grid(heads, zip(*columns, strict=True), caption)


def grid(
    heads: Iterable[tuple[str, str]], rows: Iterable[Iterable[tuple[str, str]]], caption: str = ""
) -> str:
    """Return a table of cells: a class of the style sheet, "n" or "t", and HTML."""
    top = "".join(f'<th scope="col" class="{side}">{head}</th>' for side, head in heads)
    cells = ("".join(f'<td class="{side}">{cell}</td>' for side, cell in row) for row in rows)
    body = "".join(f"<tr>{row}</tr>\n" for row in cells)
    title = f"<caption>{caption}</caption>" if caption else ""
    return (
        f'<div class="wide"><table>{title}\n<thead><tr>{top}</tr></thead>\n'
        f"<tbody>\n{body}</tbody></table></div>\n"
    )


def _cell(cell: str) -> str:
    """Return text, or a number with the spaces after it as wide as a digit, as HTML."""
    part = NUMBER.fullmatch(cell.lstrip())
    if part is None:
        return "\u00a0".join(map(text, cell.strip().split(tables.GLUE)))
    sign, digits, power, spaces = part.groups()
    exponent = f"×10{str(int(power)).translate(RAISED)}" if power else ""
    return f"{sign.replace('-', '−')}{digits}{exponent}{FIGURE_SPACE * len(spaces)}"


def number(value: float, digits: int = 3) -> str:
    """Write a number for readers: ``0.59``, ``1.2×10⁻¹¹``."""
    return _cell(f"{value:.{digits}g}")


def picture(figure: Figure, caption: str, alternative: str) -> str:
    """Return a picture with its caption (HTML), as SVG, or as PNG if that is too large.

    `alternative` is plain text for readers who cannot see the picture.
    """
    from suspension_cli.drawing.style import encode

    kind, data = "svg+xml", encode(figure, "svg")
    if len(data) > LARGEST:
        kind, data = "png", encode(figure, "png")
    across, up = (round(ACROSS / WIDTH * float(size)) for size in figure.get_size_inches())
    return (
        f'<figure><img width="{across}" height="{up}" alt="{text(alternative)}"'
        f' src="data:image/{kind};base64,{base64.b64encode(data).decode()}">\n'
        f"<figcaption>{caption}</figcaption></figure>\n"
    )


def section(name: str, title: str, content: str) -> str:
    """Return a section under its heading."""
    return f'<section id="{text(name)}">\n<h2>{text(title)}</h2>\n{content}</section>\n'


def contents(sections: Iterable[tuple[str, str]]) -> str:
    """Return the table of contents of sections (name, title)."""
    items = "".join(
        f'<li><a href="#{text(name)}">{text(title)}</a></li>\n' for name, title in sections
    )
    return f'<nav aria-label="Contents">\n<ol>\n{items}</ol>\n</nav>\n'


def page(title: str, header: str, body: str) -> str:
    """Return the whole document."""
    style = Path(__file__).with_name("style.css").read_text(encoding="utf-8")
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="generator" content="pendsus">\n<link rel="icon" href="data:,">\n'
        f"<title>{text(title)}</title>\n<style>\n{style}</style>\n</head>\n<body>\n<main>\n"
        f"<header>\n{header}</header>\n{body}</main>\n</body>\n</html>\n"
    )
