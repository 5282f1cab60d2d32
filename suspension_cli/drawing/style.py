"""House style of pictures: fonts, colours, sizes, numbers as text, and figures as PNG."""

from __future__ import annotations

import io
import os
import re
import warnings
from collections.abc import Iterable
from contextlib import AbstractContextManager
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypedDict

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg, RendererAgg
from matplotlib.colors import to_hex, to_rgb
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties

from suspension_cli.conventions import DOFS
from suspension_cli.files.whole_files import replace_file

if TYPE_CHECKING:
    from matplotlib.typing import LineStyleType

    from suspension_cli.models.registry import Choice

DPI = 180
PAGE_WIDTH = 17.8 / 2.54
"""Largest width of a picture that is shown on a page of its own, in."""
PAGE_HEIGHT = 25 / 2.54
"""Largest height of such a picture, in."""
MAX_PIXELS = 30_000
"""Longest side of a picture, pixels; larger figures get a lower resolution."""
SMALL = 7.5
"""Font size of labels, points."""
INK = "#222222"
"""Colour of text and outlines."""
PALE = "#c4c8cc"
"""Colour of parts at rest and of rules."""
LEAST_OF_WORD = 3
"""Least number of letters of a shortened word."""
NOTE = "#5f6770"
"""Colour of dimensions and remarks."""
RED = "#cc0000"
"""Colour of limits, and of what is unstable or not met."""
PALETTE = ("#0072b2", "#d55e00", "#009e73", "#aa4499", "#e69f00", "#56b4e9", "#882255", "#999933")
"""Colours that can be told apart with every common colour blindness (Okabe and Ito 2008; Tol 2021
beyond the fifth)."""
DOF_COLOUR: dict[str, str] = dict(
    zip(DOFS, ("#0072b2", "#009e73", "#e69f00", "#56b4e9", "#d55e00", "#aa4499"), strict=True)
)

RC: dict[str, Any] = {
    "font.family": ["DejaVu Sans"],
    "font.size": 8.0,
    "mathtext.fontset": "dejavusans",
    "text.usetex": False,
    "text.hinting": "no_hinting",  # a third of the time of drawing text, and even spacing
    "text.color": INK,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.6,
    "axes.formatter.use_mathtext": True,
    "axes.formatter.useoffset": False,
    "axes.formatter.limits": (-3, 5),
    "axes.titlesize": 8.5,
    "axes.labelsize": 8.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    **{f"{axis}tick.labelsize": SMALL for axis in "xy"},
    **{f"{axis}tick.major.width": 0.6 for axis in "xy"},
    **{f"{axis}tick.major.size": 3.0 for axis in "xy"},
    "lines.linewidth": 1.0,
    "lines.solid_capstyle": "round",
    "patch.linewidth": 0.8,
    "hatch.linewidth": 0.5,
    "legend.frameon": False,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
    "savefig.bbox": None,
    "path.simplify": True,
}
METADATA = {
    "png": {"Software": "pendsus"},
    "pdf": {"Creator": "pendsus", "Producer": "pendsus", "CreationDate": None},
    "svg": {"Creator": "pendsus", "Date": None},
}
"""Origin recorded in pictures; no date, so that equal pictures are equal files."""
RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_RENDERER = RendererAgg(1, 1, 72)


class LineLook(TypedDict, total=False):
    """Properties of a line, by Matplotlib's names."""

    linestyle: LineStyleType
    linewidth: float
    marker: str
    markersize: float
    markeredgewidth: float
    markeredgecolor: str
    markerfacecolor: str
    fillstyle: Literal["full", "none"]
    solid_capstyle: Literal["butt", "round"]
    zorder: float


def house_style() -> AbstractContextManager[None]:
    """Context manager of the style in which figures are drawn and saved."""
    return matplotlib.rc_context(RC)  # type: ignore[arg-type]


def new_figure(width: float, height: float) -> Figure:
    """Make an empty figure of a width and height in inches."""
    figure = Figure(figsize=(width, height), dpi=DPI)
    FigureCanvasAgg(figure)
    return figure


def figure_of(axes: Axes) -> Figure:
    """Look up the figure in which axes are."""
    figure = axes.get_figure()
    assert isinstance(figure, Figure)
    return figure


def add_axes(
    figure: Figure,
    left: float,
    top: float,
    width: float,
    height: float,
    sharex: Axes | None = None,
) -> Axes:
    """Add axes at a place in inches from the left and from the top of the figure."""
    across, up = figure.get_size_inches()
    box = (left / across, 1 - (top + height) / up, width / across, height / up)
    return figure.add_axes(box, sharex=sharex)


def write_text(
    figure: Figure,
    left: float,
    top: float,
    text: str,
    size: float = 8.0,
    colour: str = INK,
    bold: bool = False,
    side: str = "left",
) -> None:
    """Write text with an upper corner (left or right) in inches from the left and top."""
    across, up = figure.get_size_inches()
    look = {"fontsize": size, "color": colour, "fontweight": "bold" if bold else "normal"}
    figure.text(left / across, 1 - top / up, text, va="top", ha=side, **look)


def write_heading(figure: Figure, quantity: str, design: str) -> None:
    """Write the quantity at the top of a figure; below it, smaller, the design and model."""
    across = figure.get_figwidth()
    write_text(figure, 0.1, 0.08, single_line(quantity, int(across / 0.084)), 9.5, bold=True)
    write_text(figure, 0.1, 0.27, single_line(design, int(across / 0.058)), 7.5, NOTE)


@cache
def text_width(text: str, size: float = SMALL) -> float:
    """Width of a line of text, in."""
    font = FontProperties(family=RC["font.family"], size=size)
    return _RENDERER.get_text_width_height_descent(text, font, ismath="$" in text)[0] / 72


def name_neglected(figure: Figure, choice: Choice) -> None:
    """Write what the model neglects at the bottom of a figure, shortened to fit."""
    text = single_line(choice.neglected.partition(" (tolerance")[0])
    across, up = map(float, figure.get_size_inches())
    if text_width(text) > across - 0.1:
        text = re.sub(r" in .*?(?=, |$)| \(.*\)", "", text)
    with house_style():
        write_text(figure, across - 0.05, up - 0.15, text, SMALL, NOTE, side="right")


def save(figure: Figure, path: str | os.PathLike[str]) -> None:
    """Write a figure as .png, .pdf or .svg, whole or not at all; raises `OSError`."""
    replace_file(Path(path), encode(figure, Path(path).suffix.removeprefix(".")))


def encode(figure: Figure, form: str = "png") -> bytes:
    """Encode a figure as PNG, PDF or SVG."""
    stream = io.BytesIO()
    settings: Any = {"svg.hashsalt": "pendsus", "pdf.fonttype": 42}
    dpi = min(DPI, MAX_PIXELS / max(figure.get_size_inches()))
    # more compression saves a tenth of the size and doubles the time
    how: dict[str, Any] = {"pil_kwargs": {"compress_level": 3}} if form == "png" else {}
    with house_style(), matplotlib.rc_context(settings), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing")
        figure.savefig(stream, format=form, dpi=dpi, metadata=METADATA[form], **how)
    return stream.getvalue()


def single_line(text: str, most: int = 200) -> str:
    """Put a user's text on one line, shortened and escaped for mathtext."""
    return shorten(" ".join(text.split()), most).replace("$", r"\$")


def shorten(text: str, most: int) -> str:
    """Shorten text to at most `most` characters: the end of its longest word, or middle words.

    >>> shorten("test.blades.uncoupled_frequency", 28)
    'test.blades.uncou…_frequency'
    >>> shorten("the first of many short words in a text", 24)
    'the first of… in a text'
    """
    excess = len(text) - most
    if excess <= 0:
        return text
    pieces = re.split(r"([\s._/#]+)", text)  # words at even places, what is between at odd ones
    longest = max(range(0, len(pieces), 2), key=lambda n: len(pieces[n]))
    kept = len(pieces[longest]) - excess - 1
    if kept >= LEAST_OF_WORD:
        pieces[longest] = pieces[longest][:kept] + "…"
        return "".join(pieces)
    head = _whole_words(pieces, (most - 1) // 2 + 1)
    tail = _whole_words(pieces[::-1], most - 1 - len("".join(head)))[::-1]
    if not head and not tail:
        return text[: most - 1] + "…"
    return "".join([*head, "…", *tail])


def _whole_words(pieces: list[str], most: int) -> list[str]:
    """Take pieces of a text from its start that have at most some characters together."""
    lengths = np.cumsum([len(piece) for piece in pieces])
    count = int((lengths <= most).sum())
    return pieces[:count]


def shorten_to(text: str, width: float, size: float = SMALL) -> str:
    """Shorten text to a width, in."""
    most = len(text)
    while most > 1 and text_width(shorten(text, most), size) > width:
        most -= 1
    return shorten(text, most)


def format_significant(value: float, digits: int = 4) -> str:
    """Write a number with significant digits, including zeros: ``0.6000``, ``12.30``, ``12350``."""
    if abs(value) >= 1e9:
        return f"{value:.{digits - 1}e}"
    if abs(value) >= 10**digits:
        return f"{float(f'{value:.{digits}g}'):.0f}"
    return f"{value:#.{digits}g}".rstrip(".")


def format_raised(value: float, digits: int = 2) -> str:
    """Write a number with few digits, with a power of ten only where it is very small or large.

    >>> format_raised(-2312.0, 3), format_raised(0.000594), format_raised(1e-6)
    ('−2310', '5.9·10⁻⁴', '10⁻⁶')
    """
    if not value or not np.isfinite(value) or 1e-3 <= abs(value) < 1e5:
        return f"{float(f'{value:.{digits}g}'):g}".replace("-", "−")
    mantissa, power = f"{value:.{digits - 1}e}".split("e")
    factor = {1.0: "", -1.0: "-"}.get(float(mantissa), f"{float(mantissa):g}·")
    return f"{factor}10{str(int(power)).translate(RAISED)}".replace("-", "−")


def lighten(colour: str, part: float) -> str:
    """Mix a colour with a part of white.

    >>> lighten("#000000", 0.2)
    '#333333'
    """
    red, green, blue = (part + (1 - part) * one for one in to_rgb(colour))
    return to_hex((red, green, blue))


def write_unit(unit: str) -> str:
    """Write an SI unit as pictures have it, "" for a number.

    >>> write_unit("m/Hz^0.5"), write_unit("1")
    ('m/√Hz', '')
    """
    return "" if unit == "1" else unit.replace("Hz^0.5", "√Hz")


def format_signed(value: float, digits: int = 3) -> str:
    """Write a change with its sign and few digits: ``+1010``, ``−0.5``."""
    return "+" * int(value > 0) + format_raised(value, digits)


def millimetres(value: float) -> str:
    """Write a length in m as a number of mm, with four significant digits."""
    value = 1e3 * value + 0.0
    return (format_significant(value) if abs(value) >= 1e4 else f"{value:.4g}").replace("-", "−")


def length(value: float) -> str:
    """Write a length in m with its unit, mm below 10 m."""
    return f"{value:.4g} m".replace("-", "−") if abs(value) >= 10 else f"{millimetres(value)} mm"


def stage_colours(stages: Iterable[str]) -> dict[str, str]:
    """Choose the colour of each stage of a design (top to bottom), the same in every picture.

    From the ninth on they are dark shades.

    >>> stage_colours(["upper", "test"])
    {'upper': '#0072b2', 'test': '#d55e00'}
    """
    dark = [to_hex((0.5 * r, 0.5 * g, 0.5 * b)) for r, g, b in map(to_rgb, PALETTE)]
    colours = [*PALETTE, *dark]
    return {name: colours[n % len(colours)] for n, name in enumerate(dict.fromkeys(stages))}
