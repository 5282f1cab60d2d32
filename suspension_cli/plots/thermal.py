"""Amplitude spectral densities of thermal noise: the sum, and what it is made of."""

from __future__ import annotations

import textwrap
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullFormatter

from suspension_cli.analysis.thermal import Thermal
from suspension_cli.plots.style import DPI, INK, NOTE, PALE, PALETTE, house, new_figure, plain, shortened

WIDTH, HEIGHT = 7.0, 4.0
"""Of the figure, and of each of its panels, in; a panel whose legend is longer is as high as that."""
ROW, MARGIN = 0.125, 0.8
"""Height of a line of the legend, and of what a panel has above and below it, in."""
FAINT = 1e-3
"""A source whose part is nowhere this share of the sum is left out."""
ROOM = (30.0, 3.0)
"""Factors of room below the lowest sum and above the highest."""
SMALL, HANDLE, GAP = 6.5, 3.0, 0.8
"""Of the legend: font size (points), length of its lines and space after them (font sizes)."""
DECADES = 14
"""Most that a panel shows; what lies lower is cut off."""

KINDS: dict[str, tuple[str, Any]] = {
    "bending-upper": ("bending, upper ends", "-"),
    "bending-lower": ("bending, lower ends", (0, (4, 1.6))),
    "stretching": ("stretching", (0, (1, 1.4))),
    "torsion": ("torsion", (0, (5, 1.4, 1, 1.4))),
    "blades": ("blades", (0, (8, 2))),
    "springs": ("springs", (0, (3, 1.2, 1, 1.2, 1, 1.2))),
    "gas": ("gas", (0, (1, 3))),
    "damping": ("dampers", (0, (6, 1.5, 2, 1.5))),
    "support": ("support", (0, (2, 2))),
}
"""What dissipates: its words and its line style."""


def draw(noises: list[Thermal], title: str) -> Figure:
    """One panel for each motion: the sum, and every part that comes near it.

    The parts of a stage share a colour, those of a kind a line style.

    Parameters
    ----------
    noises : list of Thermal
    title : str
    """
    with house():
        heights = [max(HEIGHT, ROW * _rows(noise) + MARGIN) for noise in noises]
        figure = new_figure(WIDTH, sum(heights))
        panels = figure.subplots(len(noises), 1, squeeze=False, height_ratios=heights)[:, 0]
        colours = _colours(noises)
        for axes, noise in zip(panels, noises, strict=True):
            _panel(axes, noise, colours)
        panels[0].set_title(plain(title, 80), loc="left", color=INK)
        figure.tight_layout()
        return figure


def stage_of(source: str) -> tuple[str, str]:
    """Stage ("" for what belongs to none) and kind of a source."""
    stage, _, kind = source.rpartition(".")
    return stage, kind


def split(noise: Thermal) -> tuple[list[str], list[str]]:
    """Sources that are drawn, and those left out because they come nowhere near the sum."""
    total = noise.amplitude
    near = {name: bool((part >= FAINT * total).any()) for name, part in noise.parts.items()}
    return [name for name in noise.source if near[name]], [name for name in noise.source if not near[name]]


def _colours(noises: list[Thermal]) -> dict[str, str]:
    """A colour for each stage, the same in all panels."""
    stages = dict.fromkeys(stage_of(name)[0] for noise in noises for name in split(noise)[0])
    return {stage: NOTE if stage == "" else PALETTE[n % len(PALETTE)] for n, stage in enumerate(stages)}


def _rows(noise: Thermal) -> int:
    """Lines of the legend: the sum, the sources, a heading for each stage."""
    drawn, _ = split(noise)
    return 1 + len(drawn) + len({stage_of(name)[0] for name in drawn})


def _panel(axes: Axes, noise: Thermal, colours: dict[str, str]) -> None:
    mark = "" if len(noise.frequency) > 1 else "o"
    drawn, faint = split(noise)
    axes.loglog(noise.frequency, noise.amplitude, color=INK, linewidth=2.0, marker=mark, zorder=2)
    for name in drawn:
        stage, kind = stage_of(name)
        part = np.where(noise.parts[name] > 0, noise.parts[name], np.nan)
        axes.plot(noise.frequency, part, color=colours[stage], linestyle=KINDS[kind][1], linewidth=0.9, marker=mark, markersize=3, zorder=3)
    axes.set_ylim(*_limits(noise.amplitude))
    axes.margins(x=0)
    axes.set_xlabel("frequency (Hz)")
    axes.set_ylabel(f"{plain(noise.output, 40)} ({noise.unit}/√Hz)")
    axes.yaxis.set_major_locator(LogLocator(numticks=9))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.grid(visible=True, which="major", color=PALE, linewidth=0.4)
    _legend(axes, drawn, colours)
    remarks = _remarks(noise, faint)
    if remarks:
        axes.annotate(remarks, (0, 0), (0, -34), xycoords="axes fraction", textcoords="offset points", ha="left", va="top", fontsize=SMALL, color=NOTE)


def _limits(total: Any) -> tuple[float, float]:
    """The range that holds the sum, with some room for its parts."""
    top = total.max() * ROOM[1]
    return max(total[total > 0].min() / ROOM[0], top / 10**DECADES), top


def _legend(axes: Axes, drawn: list[str], colours: dict[str, str]) -> None:
    """A list beside the panel, a heading for each stage."""
    handles, texts, heads = [Line2D([], [], color=INK, linewidth=2.0)], ["sum"], {}
    order = list(KINDS)
    for stage in dict.fromkeys(stage_of(name)[0] for name in drawn):
        if stage:
            heads[len(texts)] = colours[stage]
            handles.append(Line2D([], [], linestyle=""))
            texts.append(plain(stage, 20))
        for kind in sorted((stage_of(name)[1] for name in drawn if stage_of(name)[0] == stage), key=order.index):
            handles.append(Line2D([], [], color=colours[stage], linestyle=KINDS[kind][1], linewidth=1.1))
            texts.append(KINDS[kind][0])
    place: dict[str, Any] = {"loc": "upper left", "bbox_to_anchor": (1.01, 1.02), "borderaxespad": 0.0}
    legend = axes.legend(handles, texts, fontsize=SMALL, handlelength=HANDLE, handletextpad=GAP, labelspacing=0.35, **place)
    for n, colour in heads.items():
        legend.get_texts()[n].set(color=colour, fontweight="bold")
        legend.get_texts()[n].set_x(-(HANDLE + GAP) * SMALL * DPI / 72)


def _remarks(noise: Thermal, faint: list[str]) -> str:
    """What the panel does not show by itself."""
    lines = []
    if noise.tilt:
        lines.append(f"along a beam that rises by {1e6 * noise.tilt:.3g} µrad")
    if faint:
        lines.append(f"left out, below {FAINT:g} of the sum everywhere: {shortened(', '.join(faint), 240)}")
    return "\n".join(row for line in lines for row in textwrap.wrap(line, 120, break_on_hyphens=False))
