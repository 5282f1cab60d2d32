"""Figure of Q and dilution of all modes against frequency, by stage and motion."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from suspension_cli.conventions import WIRE_MODE_NAMES
from suspension_cli.design.schema import Design
from suspension_cli.drawing import curves
from suspension_cli.drawing.curves import write_heading
from suspension_cli.drawing.style import (
    NOTE,
    house_style,
    new_figure,
    single_line,
    stage_colours,
)
from suspension_cli.linear.eigenmodes import Modes

BODIES = "bodies"
MARKERS = {BODIES: "x", "violin-x": "<", "violin-y": ">", "stretch": "^", "twist": "v"}
"""Marker of the modes of bodies, and of each motion of a wire; two at one point differ from one."""
ROW = 0.14
"""Height of a row of the legend, in."""


def draw(modes: Modes, design: Design, subtitle: str) -> Figure:
    """Draw Q and dilution of every mode against its frequency."""
    colours = stage_colours(stage.name for stage in design.stage)
    stages = np.array([body.partition(".")[0] for body, _ in modes.home])
    wired = modes.order > 0
    motions = np.array([dof for _, dof in modes.home], dtype=object)
    motions[~wired] = BODIES
    with house_style():
        shown = [one for one in MARKERS if one in motions]
        below = -(-len(shown) // 3)
        rows = -(-len(colours) // 4) + below
        figure = new_figure(curves.COLUMN, 4.4 + rows * ROW)
        upper, lower = figure.subplots(2, 1, sharex=True)
        for axes, values, name in ((upper, modes.q, "Q"), (lower, modes.dilution, "dilution")):
            good = np.isfinite(values) & (modes.omega_squared > 0)
            for stage, motion in dict.fromkeys(zip(stages.tolist(), motions, strict=True)):
                chosen = good & (stages == stage) & (motions == motion)
                axes.plot(
                    modes.frequency[chosen],
                    values[chosen],
                    MARKERS[motion],
                    color=colours.get(stage, NOTE),
                    ms=4.0,
                    mfc="none",
                    mew=0.9,
                )
            axes.set(xscale="log", yscale="log", ylabel=f"{name} (ratio)")
            axes.margins(x=0.03, y=0.12)
            curves.rule(axes)
        if not np.isfinite(modes.q[modes.omega_squared > 0]).any():
            upper.text(
                0.5, 0.5, "no losses given", transform=upper.transAxes, ha="center", color=NOTE
            )
        lower.set_xlabel("frequency (Hz)")
        write_heading(figure, "Q and dilution factor of all modes", subtitle)
        curves.set_margins(figure, bottom=0.5 + rows * ROW, hspace=0.1)
        _write_key(figure, colours, shown, below)
        return figure


def _write_key(figure: Figure, colours: dict[str, str], motions: list[str], below: int) -> None:
    """Write the colours of the stages and, in rows below, the markers of the motions."""
    names = {BODIES: BODIES} | WIRE_MODE_NAMES
    shown = [
        Line2D([], [], ls="", marker="o", c=colour, label=single_line(name, 14))
        for name, colour in colours.items()
    ]
    markers = [
        Line2D([], [], ls="", marker=MARKERS[one], c=NOTE, mfc="none", label=names[one])
        for one in motions
    ]
    for handles, place, columns in ((shown, below, 4), (markers, 0, 3)):
        figure.legend(
            handles=handles,
            loc="lower left",
            bbox_to_anchor=(0.02, place * ROW / figure.get_size_inches()[1]),
            ncols=columns,
            fontsize=7.5,
            markerscale=0.7,
            handletextpad=0.1,
            columnspacing=1.0,
            labelspacing=0.25,
            borderpad=0.1,
        )
