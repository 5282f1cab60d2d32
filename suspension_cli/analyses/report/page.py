"""The page of a report: paragraphs, tables and pictures, and their HTML by the template page.html.

The page is one file: pictures are `data:` addresses, the style sheet is inline, there is no script.
"""

from __future__ import annotations

import base64
import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from suspension_cli.analyses import tables
from suspension_cli.analyses.tables import Table
from suspension_cli.drawing.style import RAISED
from suspension_cli.errors import escape_unprintable

if TYPE_CHECKING:
    from jinja2 import Environment
    from matplotlib.figure import Figure

ADDRESS = {"svg": "data:image/svg+xml;base64,", "png": "data:image/png;base64,"}
"""Start of the address of a picture of each kind."""
LARGEST = 1_500_000
"""Size in bytes above which a picture is embedded as PNG instead of SVG."""
WIDTH, ACROSS = 6.4, 880
"""Width of pictures of curves, in, and of the page, in pixels, over which they are shown."""
FIGURE_SPACE, NO_BREAK = "\u2007", "\u00a0"
"""Space as wide as a digit, and space at which lines do not break."""
NUMBER = re.compile(r"([-+]?)([\d,]+\.?\d*)(?:e([-+]\d+))?( *)")
"""A formatted number: sign, digits with the point, exponent, spaces."""


class Paragraph(NamedTuple):
    """Lines of text, of a class of the style sheet."""

    lines: Sequence[str]
    kind: str = ""


class Grid(NamedTuple):
    """Table: the class of each column ("n" numbers, "t" text), its heading and unit; cells."""

    heads: Sequence[tuple[str, str, str]]
    rows: Iterable[Iterable[tuple[str, str]]]
    caption: str = ""


class Picture(NamedTuple):
    """Picture as `data:` address, its size on the page in pixels, and its caption."""

    address: str
    width: int
    height: int
    caption: str


Block = Paragraph | Grid | Picture


def prose(answer: str, found: Sequence[Table], model: str = "") -> Iterator[Block]:
    """Divide the printed text of a command, made within `tables.collecting`, into blocks.

    `found` are the collected tables; the line of the model has a style of its own. Lines that end
    with a semicolon are joined.
    """
    for part in re.split(r"\n\s*\n", answer):
        lines: list[str] = []
        for line in filter(None, map(str.strip, part.split("\n"))):
            place = tables.PLACE.fullmatch(line)
            if place is None and line != model:
                joined = lines and lines[-1].endswith(";")
                lines.append(f"{lines.pop()} {line}" if joined else line)
                continue
            if lines:
                yield Paragraph(lines)
            lines = []
            yield table(found[int(place[1])]) if place else Paragraph([line], "model")
        if lines:
            yield Paragraph(lines)


def table(content: Table, caption: str = "") -> Grid:
    """Make a table: numbers aligned on the point as in the terminal, text on the left."""
    heads = []
    columns = []
    for (head, form), cells in zip(content.columns.items(), content.cells, strict=True):
        side = "n" if form else "t"
        name, _, unit = head.partition("\n")
        heads.append((side, name, unit.strip()))
        _, *aligned = tables.align([""], cells) if form else ("", *cells)
        columns.append([(side, _cell(cell)) for cell in aligned])
    return Grid(heads, [*zip(*columns, strict=True)], caption)


def _cell(cell: str) -> str:
    """Write a number with typographic signs, and the spaces after it as wide as a digit."""
    part = NUMBER.fullmatch(cell.lstrip())
    if part is None:
        return cell.strip().replace(tables.GLUE, NO_BREAK)
    sign, digits, power, spaces = part.groups()
    exponent = f"×10{str(int(power)).translate(RAISED)}" if power else ""
    return f"{sign.replace('-', '−')}{digits}{exponent}{FIGURE_SPACE * len(spaces)}"


def number(value: float, digits: int = 3) -> str:
    """Write a number for readers: ``0.59``, ``1.2×10⁻¹¹``."""
    return _cell(f"{value:.{digits}g}")


def pictures(figures: Iterable[Figure], caption: str) -> Iterator[Picture]:
    """Embed the pictures of one result: from the first one on that is too large as SVG, as PNG."""
    kind = "svg"
    for figure in figures:
        found = picture(figure, caption, kind)
        if found.address.startswith(ADDRESS["png"]):
            kind = "png"
        yield found


def picture(figure: Figure, caption: str, kind: str = "svg") -> Picture:
    """Embed a picture as SVG, or as PNG if that is asked for or SVG is too large."""
    from suspension_cli.drawing.style import encode

    data = encode(figure, kind)
    if kind == "svg" and len(data) > LARGEST:
        kind = "png"
        data = encode(figure, kind)
    across, up = (round(ACROSS / WIDTH * float(size)) for size in figure.get_size_inches())
    return Picture(ADDRESS[kind] + encode_text(data), across, up, caption)


def encode_text(data: bytes) -> str:
    """Encode bytes for a `data:` address."""
    return base64.b64encode(data).decode()


def printable(text: str) -> str:
    """Escape characters that a page cannot show."""
    if text.isprintable():  # so are pictures, which are long
        return text
    kept = ("\n", FIGURE_SPACE, NO_BREAK)
    return "".join(one if one in kept else escape_unprintable(one) for one in text)


def environment() -> Environment:
    """Templates, which escape all text, with the signs √ and ± in place of their ASCII forms."""
    from jinja2 import Environment, FileSystemLoader
    from markupsafe import Markup

    def clean(value: object) -> object:
        if not isinstance(value, str) or isinstance(value, Markup):
            return value
        value = printable(value).replace("sqrt(Hz)", "√Hz").replace("/Hz^0.5", "/√Hz")
        return value.replace("+-", "±")

    made = Environment(
        loader=FileSystemLoader(Path(__file__).parent), autoescape=True, finalize=clean,
        trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True,
    )  # fmt: skip
    made.globals["br"] = Markup("<br>")
    return made
