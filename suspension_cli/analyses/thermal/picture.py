"""Figure of thermal noise: amplitude spectral densities of the sum and of its sources."""

from __future__ import annotations

import textwrap
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullFormatter

from suspension_cli.analyses.thermal.solve import Thermal
from suspension_cli.design.losses.registry import MECHANISMS
from suspension_cli.drawing.style import (
    DPI,
    INK,
    NOTE,
    PALE,
    PALETTE,
    house_style,
    new_figure,
    shorten,
    single_line,
)

WIDTH, HEIGHT = 7.0, 4.0
"""Width of the figure and least height of its panels, in; a long legend makes a panel taller."""
ROW, MARGIN = 0.125, 0.8
"""Height of a line of the legend, and of the margins above and below it, in."""
FAINT = 1e-3
"""Fraction of the sum that a source must reach somewhere to be drawn."""
ROOM = (30.0, 3.0)
"""Factors of room below the lowest sum and above the highest."""
SMALL, HANDLE, GAP = 6.5, 3.0, 0.8
"""Legend: font size (points), length of its lines and space after them (font sizes)."""
DECADES = 14
"""Largest number of decades in a panel."""

KINDS: dict[str, tuple[str, Any]] = {
    "bending-upper": ("bending, upper ends", "-"),
    "bending-lower": ("bending, lower ends", (0, (4, 1.6))),
    "stretching": ("stretching", (0, (1, 1.4))),
    "torsion": ("torsion", (0, (5, 1.4, 1, 1.4))),
    "blades": ("blades", (0, (8, 2))),
    "springs": ("springs", (0, (3, 1.2, 1, 1.2, 1, 1.2))),
    "link": ("link", (0, (3, 1, 1, 1))),
    "gas": ("gas", (0, (1, 3))),
    "damping": ("dampers", (0, (6, 1.5, 2, 1.5))),
    "support": ("support", (0, (2, 2))),
} | {own.cause: (own.cause, (0, (1, 1, 5, 1))) for own in MECHANISMS if own.cause}
"""Label and line style of each kind of source."""


def draw(noises: list[Thermal], title: str) -> Figure:
    """Draw one panel per motion: the sum, and the sources that come near it.

    Sources of one stage share a colour, those of one kind a line style.

    Parameters
    ----------
    noises : list of Thermal
    title : str
    """
    with house_style():
        heights = [max(HEIGHT, ROW * _count_rows(noise) + MARGIN) for noise in noises]
        figure = new_figure(WIDTH, sum(heights))
        panels = figure.subplots(len(noises), 1, squeeze=False, height_ratios=heights)[:, 0]
        colours = _stage_colours(noises)
        for axes, noise in zip(panels, noises, strict=True):
            _panel(axes, noise, colours)
        panels[0].set_title(single_line(title, 80), loc="left", color=INK)
        figure.tight_layout()
        return figure


def split_source(source: str) -> tuple[str, str]:
    """Split a source into its stage ("" if it belongs to none) and its kind."""
    stage, _, kind = source.rpartition(".")
    return stage, kind


def split_by_size(noise: Thermal) -> tuple[list[str], list[str]]:
    """Split sources into those drawn and those too far below the sum (`FAINT`)."""
    total = noise.amplitude
    near = {name: bool((part >= FAINT * total).any()) for name, part in noise.parts.items()}
    drawn = [name for name in noise.source if near[name]]
    return drawn, [name for name in noise.source if not near[name]]


def _stage_colours(noises: list[Thermal]) -> dict[str, str]:
    """Choose a colour for each stage, the same in all panels."""
    stages = dict.fromkeys(
        split_source(name)[0] for noise in noises for name in split_by_size(noise)[0]
    )
    return {
        stage: NOTE if stage == "" else PALETTE[n % len(PALETTE)] for n, stage in enumerate(stages)
    }


def _count_rows(noise: Thermal) -> int:
    """Count the lines of the legend: the sum, the sources, a heading per stage."""
    drawn, _ = split_by_size(noise)
    return 1 + len(drawn) + len({split_source(name)[0] for name in drawn})


def _panel(axes: Axes, noise: Thermal, colours: dict[str, str]) -> None:
    mark = "" if len(noise.frequency) > 1 else "o"
    drawn, faint = split_by_size(noise)
    axes.loglog(noise.frequency, noise.amplitude, color=INK, linewidth=2.0, marker=mark, zorder=2)
    for name in drawn:
        stage, kind = split_source(name)
        part = np.where(noise.parts[name] > 0, noise.parts[name], np.nan)
        axes.plot(
            noise.frequency,
            part,
            color=colours[stage],
            linestyle=KINDS[kind][1],
            linewidth=0.9,
            marker=mark,
            markersize=3,
            zorder=3,
        )
    axes.set_ylim(*_limits(noise.amplitude))
    axes.margins(x=0)
    axes.set_xlabel("frequency (Hz)")
    axes.set_ylabel(f"{single_line(noise.output, 40)} ({noise.unit}/√Hz)")
    axes.yaxis.set_major_locator(LogLocator(numticks=9))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.grid(visible=True, which="major", color=PALE, linewidth=0.4)
    _draw_legend(axes, drawn, colours)
    remarks = _remarks(noise, faint)
    if remarks:
        axes.annotate(
            remarks,
            (0, 0),
            (0, -34),
            xycoords="axes fraction",
            textcoords="offset points",
            ha="left",
            va="top",
            fontsize=SMALL,
            color=NOTE,
        )


def _limits(total: Any) -> tuple[float, float]:
    """Limits of the y axis: the range of the sum, with room for its parts."""
    top = total.max() * ROOM[1]
    return max(total[total > 0].min() / ROOM[0], top / 10**DECADES), top


def _draw_legend(axes: Axes, drawn: list[str], colours: dict[str, str]) -> None:
    """Draw the legend beside the panel, with a heading per stage."""
    handles, texts, heads = [Line2D([], [], color=INK, linewidth=2.0)], ["sum"], {}
    order = list(KINDS)
    for stage in dict.fromkeys(split_source(name)[0] for name in drawn):
        if stage:
            heads[len(texts)] = colours[stage]
            handles.append(Line2D([], [], linestyle=""))
            texts.append(single_line(stage, 20))
        for kind in sorted(
            (split_source(name)[1] for name in drawn if split_source(name)[0] == stage),
            key=order.index,
        ):
            handles.append(
                Line2D([], [], color=colours[stage], linestyle=KINDS[kind][1], linewidth=1.1)
            )
            texts.append(KINDS[kind][0])
    place: dict[str, Any] = {
        "loc": "upper left",
        "bbox_to_anchor": (1.01, 1.02),
        "borderaxespad": 0.0,
    }
    legend = axes.legend(
        handles,
        texts,
        fontsize=SMALL,
        handlelength=HANDLE,
        handletextpad=GAP,
        labelspacing=0.35,
        **place,
    )
    for n, colour in heads.items():
        legend.get_texts()[n].set(color=colour, fontweight="bold")
        legend.get_texts()[n].set_x(-(HANDLE + GAP) * SMALL * DPI / 72)


def _remarks(noise: Thermal, faint: list[str]) -> str:
    """Remarks below a panel: the tilt of the beam, and sources that are not drawn."""
    lines = []
    if noise.tilt:
        lines.append(f"along a beam that rises by {1e6 * noise.tilt:.3g} µrad")
    if faint:
        lines.append(
            f"not drawn, below {FAINT:g} of the sum everywhere: {shorten(', '.join(faint), 240)}"
        )
    return "\n".join(
        row for line in lines for row in textwrap.wrap(line, 120, break_on_hyphens=False)
    )
