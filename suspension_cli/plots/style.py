"""The house style: fonts, colours, sizes, how numbers are written, and how a figure becomes a PNG."""

from __future__ import annotations

import io
import os
import uuid
import warnings
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure

from suspension_cli.conventions import DOFS

DPI = 180
"""Dots per inch of the PNG written."""
MAX_PIXELS = 30_000
"""Longest side of a picture; larger figures get fewer dots per inch."""

INK = "#222222"
"""Text and outlines."""
PALE = "#c4c8cc"
"""What is at rest, and rules."""
NOTE = "#5f6770"
"""Dimensions and remarks."""

PALETTE = ("#0072b2", "#d55e00", "#009e73", "#aa4499", "#e69f00", "#56b4e9", "#882255", "#999933")
"""Colours that stay apart in every common colour blindness (Okabe and Ito 2008, Tol 2021 for those past the fifth)."""

DOF_COLOUR: dict[str, str] = dict(zip(DOFS, ("#0072b2", "#009e73", "#e69f00", "#56b4e9", "#d55e00", "#aa4499"), strict=True))
"""A colour for each degree of freedom."""

RC: dict[str, Any] = {
    "font.family": ["DejaVu Sans"],
    "font.size": 8.0,
    "mathtext.fontset": "dejavusans",
    "text.usetex": False,
    "text.color": INK,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.6,
    "axes.titlesize": 8.5,
    "axes.labelsize": 8.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.major.size": 3.0,
    "ytick.major.size": 3.0,
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


def house() -> AbstractContextManager[None]:
    """The context in which figures are drawn and saved."""
    return matplotlib.rc_context(RC)  # type: ignore[arg-type]


def new_figure(width: float, height: float) -> Figure:
    """An empty figure of a width and height in inches."""
    figure = Figure(figsize=(width, height), dpi=DPI)
    FigureCanvasAgg(figure)
    return figure


def place(figure: Figure, left: float, top: float, width: float, height: float) -> Axes:
    """Axes at a place given in inches from the left and from the top of the figure."""
    across, up = figure.get_size_inches()
    return figure.add_axes((left / across, 1 - (top + height) / up, width / across, height / up))


def write(figure: Figure, left: float, top: float, text: str, size: float = 8.0, colour: str = INK, bold: bool = False) -> None:
    """Text at a place in inches from the left and from the top of the figure; it hangs below that line."""
    across, up = figure.get_size_inches()
    figure.text(left / across, 1 - top / up, text, va="top", ha="left", fontsize=size, color=colour, fontweight="bold" if bold else "normal")


def save(figure: Figure, path: str | os.PathLike[str]) -> None:
    """Write a figure as PNG, whole or not at all.

    Parameters
    ----------
    figure : Figure
    path : path
        Replaced if it is there; the picture is written under another name in the same folder first.

    Raises
    ------
    OSError
        If the folder cannot be written to; nothing is left behind then.
    """
    path, picture = Path(path), image(figure)
    passing = path.parent / f".pendsus-{uuid.uuid4().hex}.png"
    try:
        with passing.open("xb") as stream:
            stream.write(picture)
        os.replace(passing, path)
    except BaseException:
        passing.unlink(missing_ok=True)
        raise


def image(figure: Figure) -> bytes:
    """A figure as the bytes of a PNG."""
    stream = io.BytesIO()
    with house(), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing")
        figure.savefig(stream, format="png", dpi=min(DPI, MAX_PIXELS / max(figure.get_size_inches())), metadata={"Software": "pendsus"})
    return stream.getvalue()


def tint(colour: str, strength: float) -> tuple[float, float, float, float]:
    """A colour with an opacity between 0 and 1."""
    return to_rgba(colour, min(max(strength, 0.0), 1.0))


def plain(text: str, most: int = 200) -> str:
    """A user's text on one line, shortened in its middle, without any meaning to mathtext."""
    return shortened(" ".join(text.split()), most).replace("$", r"\$")


def shortened(text: str, most: int) -> str:
    """Text of at most so many characters, its middle left out where it is longer."""
    if len(text) <= most:
        return text
    tail = (most - 1) // 2
    return f"{text[: most - 1 - tail]}…{text[len(text) - tail :]}"


def significant(value: float, digits: int = 4) -> str:
    """A number with so many significant digits, trailing zeros kept: ``0.6000``, ``12.30``, ``12350``."""
    if abs(value) >= 10**digits:
        return f"{float(f'{value:.{digits}g}'):.0f}" if abs(value) < 1e9 else f"{value:.{digits - 1}e}"
    return f"{value:#.{digits}g}".rstrip(".")


def millimetres(value: float) -> str:
    """A length in m as a number of mm, four significant digits."""
    value = 1e3 * value + 0.0
    return (significant(value) if abs(value) >= 1e4 else f"{value:.4g}").replace("-", "−")


def length(value: float) -> str:
    """A length in m with its unit: mm below 10 m."""
    return f"{value:.4g} m".replace("-", "−") if abs(value) >= 10 else f"{millimetres(value)} mm"


def title(figure: Figure, heading: str, name: str) -> None:
    """Head a figure with a design's title and name."""
    across, _ = figure.get_size_inches()
    most = int(across / 0.105)
    if heading:
        write(figure, 0.2, 0.14, plain(heading, most), 12, bold=True)
    write(figure, 0.2, 0.36 if heading else 0.14, plain(name, most), 9 if heading else 12, NOTE if heading else INK)
