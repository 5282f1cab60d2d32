"""Figure of Q and dilution of all modes against frequency, violin modes by stage."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from suspension_cli.conventions import WIRE_MODE_NAMES
from suspension_cli.design.schema import Design
from suspension_cli.drawing.style import (
    INK,
    NOTE,
    PALE,
    PALETTE,
    house_style,
    new_figure,
    single_line,
)
from suspension_cli.linear.eigenmodes import Modes

MARKERS = {"violin-x": "o", "violin-y": "s", "stretch": "^", "twist": "v"}
"""Marker of each motion of a wire."""


def draw(modes: Modes, design: Design) -> Figure:
    """Draw Q and dilution of every mode against its frequency.

    Parameters
    ----------
    modes : Modes
        In the violin model.
    design : Design
        For the title.
    """
    with house_style():
        figure = new_figure(6.3, 4.6)
        upper, lower = figure.subplots(2, 1, sharex=True)
        families = _families(modes)
        for axes, values in ((upper, modes.q), (lower, modes.dilution)):
            for label, colour, marker, chosen in families:
                good = chosen & np.isfinite(values) & (modes.omega_squared > 0)
                axes.plot(
                    modes.frequency[good],
                    values[good],
                    marker,
                    color=colour,
                    ms=4.5,
                    mfc="none",
                    mew=0.9,
                    label=label,
                )
            axes.set_xscale("log")
            axes.set_yscale("log")
            axes.grid(visible=True, which="major", color=PALE, linewidth=0.4)
            axes.margins(x=0.03, y=0.12)
        if not np.isfinite(modes.q[modes.omega_squared > 0]).any():
            upper.text(
                0.5, 0.5, "no losses given", transform=upper.transAxes, ha="center", color=NOTE
            )
        upper.set_ylabel("Q")
        lower.set_ylabel("dilution factor")
        lower.set_xlabel("frequency (Hz)")
        upper.set_title(
            single_line(design.design.title or design.design.name), loc="left", color=INK
        )
        figure.legend(
            *upper.get_legend_handles_labels(),
            loc="outside lower center",
            ncols=3,
            fontsize=7.0,
            handletextpad=0.3,
        )
        rows = -(-len(families) // 3)
        figure.tight_layout(rect=(0, 0.02 + 0.04 * rows, 1, 1))
        return figure


def _families(modes: Modes) -> list[tuple[str, str, str, np.ndarray]]:
    """Label, colour, marker and members, bool (m,), of bodies, then of the wires of each stage."""
    home = modes.home
    result = [("bodies", INK, "x", modes.order == 0)]
    stages = list(
        dict.fromkeys(body for (body, _), order in zip(home, modes.order, strict=True) if order)
    )
    for stage in sorted(stages, key=modes.body.index):
        colour = PALETTE[modes.body.index(stage) % len(PALETTE)]
        for dof, marker in MARKERS.items():
            chosen = np.array(
                [
                    bool(order) and place == (stage, dof)
                    for place, order in zip(home, modes.order, strict=True)
                ]
            )
            if chosen.any():
                result.append(
                    (f"{single_line(stage, 16)} {WIRE_MODE_NAMES[dof]}", colour, marker, chosen)
                )
    return result
