"""Pictures of a comparison: modes by their change, responses and noises with their ratio."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from suspension_cli.analyses.compare.solve import Comparison, Overlay, PairedModes
from suspension_cli.analyses.response.picture import insert_gaps
from suspension_cli.drawing.style import (
    INK,
    NOTE,
    PALE,
    PALETTE,
    format_significant,
    house_style,
    new_figure,
    single_line,
)

LINEAR = 1e-4
"""Change of a frequency, relative, below which the axis of changes is linear."""


def draw_modes(found: Comparison, modes: PairedModes) -> Figure:
    """Draw the change of every mode's frequency from the first item to the others, in %."""
    shown = np.flatnonzero(np.isfinite(modes.frequency).sum(1) > 1)
    labels = [modes.label[n] for n in shown]
    first = np.array([row[np.isfinite(row)][0] for row in modes.frequency[shown]])
    base = [int(np.flatnonzero(np.isfinite(row))[0]) for row in modes.frequency[shown]]
    with house_style():
        figure = new_figure(6.3, 1.3 + 0.2 * max(len(shown), 4))
        axes = figure.subplots()
        change = 100 * (modes.frequency[shown] / first[:, None] - 1)
        rows = np.arange(len(shown))
        for n, name in enumerate(found.name):
            own = np.isfinite(change[:, n]) & (np.array(base) != n)
            if own.any():
                colour = PALETTE[n % len(PALETTE)]
                axes.plot(change[own, n], rows[own], "o", ms=4, color=colour, label=name)
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
        axes.set_xlabel(f"frequency relative to {single_line(found.name[0], 40)} (%)")
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), fontsize=7, ncols=4)
        axes.set_title(_modes_title(found, change, labels), loc="left", color=INK)
        figure.tight_layout()
        return figure


def _modes_title(found: Comparison, change: Any, labels: list[str]) -> str:
    if not np.isfinite(change).any():
        return "No mode in common"
    row, column = np.unravel_index(np.nanargmax(np.abs(change)), change.shape)
    if change[row, column] == 0:
        return "No mode differs"
    return single_line(
        f"{labels[row]} differs most: {change[row, column]:+.3g} % in {found.name[column]}", 90
    )


def draw_overlay(found: Comparison, overlay: Overlay) -> Figure:
    """Draw magnitudes (and phases of responses) over each other, and their ratio below."""
    response = overlay.kind == "response"
    with house_style():
        compared = len(overlay.curves) > 1
        heights = [2.2, *[1] * (response + compared)]
        figure = new_figure(6.3, 2.4 + 0.8 * sum(heights[1:]) + 1.6)
        panels = figure.subplots(
            len(heights), 1, sharex=True, height_ratios=heights, squeeze=False
        )[:, 0]
        for curve in overlay.curves:
            name = single_line(found.name[curve.item], 40)
            measured = found.kind[curve.item] == "measurement"
            how: dict[str, Any] = {"color": PALETTE[curve.item % len(PALETTE)]}
            how |= {"ls": "none", "marker": ".", "ms": 3} if measured else {}
            size = np.where(curve.value == 0, np.nan, np.abs(curve.value))
            panels[0].plot(curve.frequency, size, label=name, **how)
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
                panels[1].plot(curve.frequency, _phase(curve.value), **how)
            if len(curve.ratio):
                panels[-1].plot(curve.ratio_frequency, np.abs(curve.ratio), **how)
        panels[0].set_yscale("log")
        panels[0].set_ylabel(overlay.unit)
        if response:
            panels[1].set_ylabel("phase (degrees)")
            panels[1].set_ylim(-190, 190)
            panels[1].set_yticks([-180, -90, 0, 90, 180])
        if compared:
            _finish_ratios(panels[-1], found, overlay)
        panels[-1].set_xlabel("frequency (Hz)")
        for axes in panels:
            axes.set_xscale("log")
            axes.grid(visible=True, which="major", color=PALE, linewidth=0.4)
            axes.margins(x=0)
        panels[0].legend(fontsize=7)
        kind = "" if response else "thermal "
        panels[0].set_title(kind + overlay.name, loc="left", color=INK)
        figure.text(0.99, 0.005, _model_line(found), ha="right", va="bottom", size=6, color=NOTE)
        figure.tight_layout(rect=(0, 0.015, 1, 1))
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
        if known.max() < 100 * known.min():
            axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axes.yaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_minor_formatter(NullFormatter())
    axes.axhline(1, color=PALE, lw=0.8, zorder=0)


def _phase(value: Any) -> Any:
    """Phase in degrees from -185 to 175, where -180 does not flip, with a gap where it wraps."""
    phase = np.degrees(np.angle(value))
    phase[phase > 175] -= 360
    return insert_gaps(phase)


def _model_line(found: Comparison) -> str:
    models = {model for model in found.model if model}
    return ", ".join(f"{model} model" for model in sorted(models))
