"""Pictures of a comparison: modes by their change, responses and noises with their ratio."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from suspension_cli.analyses.compare.solve import Comparison, Overlay, PairedModes
from suspension_cli.drawing import curves
from suspension_cli.drawing.style import (
    PALE,
    PALETTE,
    format_significant,
    house_style,
    new_figure,
    single_line,
)

DASHES = ("-", (0, (5, 1.5)), (0, (1.2, 1.2)), (0, (5, 1.4, 1.2, 1.4)))
"""Line styles of the items, so that equal curves do not hide each other."""
MARKERS = ("o", "D", "s", "^", "v")
"""Markers of the items."""


def draw_modes(found: Comparison, modes: PairedModes) -> Figure:
    """Draw the change of every mode's frequency from the first item to the others, in %."""
    shown = np.flatnonzero(np.isfinite(modes.frequency).sum(1) > 1)
    labels = [modes.label[n] for n in shown]
    first = np.array([row[np.isfinite(row)][0] for row in modes.frequency[shown]])
    base = [int(np.flatnonzero(np.isfinite(row))[0]) for row in modes.frequency[shown]]
    with house_style():
        left = 0.3 + 0.058 * max(len(label) + 9 for label in [*labels, ""])
        tall = 0.17 * max(len(shown), 4)
        figure = new_figure(curves.COLUMN, curves.HEAD + 0.3 + tall + 0.55)
        axes = figure.subplots()
        curves.set_margins(figure, left=left, top=curves.HEAD + 0.3, bottom=0.55)
        change: Any = 100 * (modes.frequency[shown] / first[:, None] - 1)
        rows = np.arange(len(shown))
        for n, name in enumerate(found.name):
            own = np.isfinite(change[:, n]) & (np.array(base) != n)
            if own.any():
                colour = PALETTE[n % len(PALETTE)]
                marker = MARKERS[n % len(MARKERS)]
                axes.hlines(rows[own], 0, change[own, n], color=colour, lw=0.6, alpha=0.5)
                axes.plot(change[own, n], rows[own], marker, ms=4, color=colour, label=name)
        largest = float(np.nanmax(np.abs(change), initial=0.0))
        if largest > 5:
            axes.set_xscale("symlog", linthresh=1.0)
            axes.xaxis.set_major_formatter(lambda x, _: f"{x:+g}".replace("-", "−") if x else "0")
        axes.axvline(0, color=PALE, lw=0.8, zorder=0)
        axes.set_yticks(
            rows,
            [
                f"{label}  {format_significant(f)} Hz"
                for label, f in zip(labels, first, strict=True)
            ],
        )
        axes.set_ylim(len(shown) - 0.5, -0.5)
        axes.grid(visible=True, axis="y", color=PALE, linewidth=0.3)
        axes.set_xlabel(f"frequency relative to {single_line(found.name[0], 16)} (%)")
        axes.tick_params(labelsize=7.5)
        if len(found.name) > 2:
            axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), fontsize=7.5, ncols=4)
        models = _model_line(found)
        items = [single_line(name) for name in found.name]
        against = f"{', '.join(items[1:])} against {items[0]}"
        curves.write_heading(
            figure,
            f"Mode frequencies: {_modes_title(found, change, labels)}",
            f"{against}{f' · {models}' if models else ''}",
        )
        return figure


def _modes_title(found: Comparison, change: Any, labels: list[str]) -> str:
    if not np.isfinite(change).any():
        return "none in common"
    row, column = np.unravel_index(np.nanargmax(np.abs(change)), change.shape)
    if change[row, column] == 0:
        return "none differs"
    return single_line(f"{labels[row]} {change[row, column]:+.3g} % in {found.name[column]}", 40)


def draw_overlay(found: Comparison, overlay: Overlay) -> Figure:
    """Draw magnitudes (and phases of responses) over each other, and their ratio below."""
    response = overlay.kind == "response"
    with house_style():
        compared = len(overlay.curves) > 1
        heights = [2.3, *[1.2] * (response + compared)]
        names = [single_line(found.name[curve.item], 40) for curve in overlay.curves]
        right = curves.room_for(names)
        figure = new_figure(curves.COLUMN, curves.HEAD + sum(heights) + 0.15 * len(heights) + 0.6)
        panels = figure.subplots(
            len(heights), 1, sharex=True, height_ratios=heights, squeeze=False
        )[:, 0]
        curves.set_margins(figure, right=right, top=curves.HEAD + 0.08, bottom=0.5, hspace=0.1)
        for axes in panels:
            axes.set_xscale("log")
            curves.rule(axes)
            axes.margins(x=0)
        panels[0].set_yscale("log")
        ends = []
        for curve, name in zip(overlay.curves, names, strict=True):
            measured = found.kind[curve.item] == "measurement"
            how: dict[str, Any] = {"color": PALETTE[curve.item % len(PALETTE)]}
            how |= {"ls": DASHES[curve.item % len(DASHES)]}
            how |= {"ls": "none", "marker": ".", "ms": 3} if measured else {}
            size = np.where(curve.value == 0, np.nan, np.abs(curve.value))
            panels[0].plot(curve.frequency, size, label=name, **how)
            ends.append((curve.frequency, size, name, how["color"]))
            if measured and np.isfinite(curve.uncertainty).any():
                panels[0].errorbar(
                    curve.frequency,
                    size,
                    curve.uncertainty,
                    fmt="none",
                    lw=0.6,
                    ecolor=how["color"],
                )
            if response:
                panels[1].plot(curve.frequency, curves.unwrap_phase(curve.value), **how)
            if len(curve.ratio):
                panels[-1].plot(curve.ratio_frequency, np.abs(curve.ratio), **how)
        panels[0].set_ylabel(overlay.unit)
        curves.label_plainly(panels[0].yaxis)
        if response:
            panels[1].set_ylabel("phase (degrees)")
            curves.label_phases(panels[1])
        if compared:
            _finish_ratios(panels[-1], found, overlay)
        panels[-1].set_xlabel("frequency (Hz)")
        curves.label_ends(panels[0], ends)
        kind = "Transfer function " if response else "Thermal noise of "
        curves.write_heading(figure, kind + overlay.name, _model_line(found))
        figure.align_ylabels(panels)
        return figure


def _finish_ratios(axes: Axes, found: Comparison, overlay: Overlay) -> None:
    """Label the panel of ratios, with a logarithmic axis where they differ much."""
    reference = single_line(found.name[overlay.curves[0].item], 24)
    axes.set_ylabel(f"ratio to\n{reference}")
    sizes = [np.abs(curve.ratio) for curve in overlay.curves if len(curve.ratio)]
    known = np.concatenate([s[np.isfinite(s) & (s > 0)] for s in sizes] or [np.ones(1)])
    if len(known) and known.max() > 3 * known.min():
        axes.set_yscale("log")
        curves.label_plainly(axes.yaxis)
    axes.axhline(1, color=PALE, lw=0.8, zorder=0)


def _model_line(found: Comparison) -> str:
    models = {model for model in found.model if model}
    return ", ".join(f"{model} model" for model in sorted(models))
