"""Pictures of a comparison: changes of modes, responses and noises with ratios."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from suspension_cli.analyses.compare.fine import refine
from suspension_cli.analyses.compare.solve import Comparison, Curve, Overlay, PairedModes
from suspension_cli.analyses.response.picture import (
    find_limits,
    find_tops,
    lowest_and_highest,
    say_zero,
)
from suspension_cli.drawing import curves
from suspension_cli.drawing.style import (
    PALE,
    PALETTE,
    LineLook,
    format_significant,
    house_style,
    new_figure,
    shorten,
    single_line,
)

if TYPE_CHECKING:
    from jaxtyping import Float

MARKERS = ("o", "D", "s", "^", "v")
"""Markers of the items."""


def draw_modes(found: Comparison, modes: PairedModes) -> Figure:
    """Draw changes of mode frequencies from the first item to the others, in %."""
    shown = np.flatnonzero(np.isfinite(modes.frequency).sum(1) > 1)
    labels, frequency = [modes.label[n] for n in shown], modes.frequency[shown]
    base = np.isfinite(frequency).argmax(1)
    first = frequency[np.arange(len(shown)), base]
    with house_style():
        left = 0.3 + 0.058 * max(len(label) + 9 for label in [*labels, ""])
        tall = 0.17 * max(len(shown), 4)
        figure = new_figure(curves.COLUMN, curves.HEAD + 0.3 + tall + 0.55)
        axes = figure.subplots()
        curves.set_margins(figure, left=left, right=0.28, top=curves.HEAD + 0.3, bottom=0.55)
        change = 100 * (frequency / first[:, None] - 1)
        rows = np.arange(len(shown))
        for n, name in enumerate(found.name):
            own = np.isfinite(change[:, n]) & (base != n)
            if own.any():
                colour, marker = PALETTE[n % len(PALETTE)], MARKERS[n % len(MARKERS)]
                axes.hlines(rows[own], 0, change[own, n], color=colour, lw=0.6, alpha=0.5)
                axes.plot(change[own, n], rows[own], marker, ms=4, color=colour, label=name)
        largest = float(np.nanmax(np.abs(change), initial=0.0))
        if largest > 5:
            axes.set_xscale("symlog", linthresh=1.0 if largest < 100 else 10.0)
            axes.xaxis.set_major_formatter(lambda x, _: f"{x:+g}".replace("-", "−") if x else "0")
        axes.axvline(0, color=PALE, lw=0.8, zorder=0)
        named = zip(labels, first, strict=True)
        axes.set_yticks(rows, [f"{label}  {format_significant(f)} Hz" for label, f in named])
        axes.set_ylim(len(shown) - 0.5, -0.5)
        axes.grid(visible=True, axis="y", color=PALE, linewidth=0.3)
        axes.set_xlabel(f"frequency relative to {single_line(found.name[0], 16)} (%)")
        axes.tick_params(labelsize=7.5)
        if len(found.name) > 2:
            axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), fontsize=7.5, ncols=4)
        models = _model_line(found)
        items = [single_line(name) for name in found.name]
        against = f"{', '.join(items[1:])} against {items[0]}{f' · {models}' if models else ''}"
        title = f"Mode frequencies: {_modes_title(found, change, labels)}"
        curves.write_heading(figure, title, against)
        return figure


def _modes_title(
    found: Comparison, change: Float[np.ndarray, "mode design"], labels: list[str]
) -> str:
    if not np.isfinite(change).any():
        return "none in common"
    row, column = np.unravel_index(np.nanargmax(np.abs(change)), change.shape)
    if change[row, column] == 0:
        return "none differs"
    text = f"{labels[row]} {change[row, column]:+.3g} % in ".replace("-", "−")
    return text + shorten(found.name[column], max(54 - len("Mode frequencies: " + text), 6))


def draw_overlay(found: Comparison, overlay: Overlay) -> Figure:
    """Draw magnitudes (of responses also phases), and ratios below."""
    response, compared = overlay.kind == "response", len(overlay.curves) > 1
    drawn = refine(overlay)
    with house_style():
        key = [(_name(found, c), PALETTE[c.item % len(PALETTE)], _look(found, c)) for c in drawn]
        rooms = [curves.key_room([name for name, *_ in key]) + 0.08, *[0.12] * response]
        rooms += [0.22] * compared
        figure, panels = curves.stack_panels([2.3, *[1.2] * (response + compared)], rooms)
        nonzero = any(curve.value.any() for curve in drawn)
        panels[0].set(xscale="log", yscale="log" if nonzero else "linear")
        for curve, (_, colour, how) in zip(drawn, key, strict=True):
            known = np.isfinite(curve.uncertainty)
            size = np.where(curve.value == 0, np.nan, np.abs(curve.value))
            panels[0].plot(curve.frequency, size, color=colour, **how)
            if known.any():
                low, high = size - curve.uncertainty, size + curve.uncertainty
                at = curve.frequency[known]
                panels[0].vlines(at, low[known], high[known], color=colour, linewidth=0.6)
            if response:
                phase = curves.unwrap_phase(curve.value)
                panels[1].plot(curve.frequency, phase, color=colour, **how)
            if len(curve.ratio):
                panels[-1].plot(curve.ratio_frequency, np.abs(curve.ratio), color=colour, **how)
        _limit(panels[0], drawn, [colour for _, colour, _ in key])
        unit = overlay.unit.replace("sqrt(Hz)", "√Hz")
        name = "magnitude" if response else overlay.output
        panels[0].set_ylabel(f"{single_line(name, 30)} ({unit})")
        if response:
            panels[1].set_ylabel("phase (degrees)")
            curves.label_phases(panels[1])
        if nonzero:
            curves.label_plainly(panels[0].yaxis)
        else:
            say_zero(panels[0], drawn[0].frequency)
            for axes in panels[1:]:
                axes.set_yticks([])
        if compared:
            _finish_ratios(panels[-1], found, overlay)
        panels[-1].set_xlabel("frequency (Hz)")
        curves.write_key(panels[0], key)
        kind = "Transfer function " if response else "Thermal noise of "
        what = overlay.name if response else overlay.output
        curves.write_heading(figure, kind + what, _model_line(found))
        figure.align_ylabels(panels)
        return figure


def _limit(axes: Axes, drawn: list[Curve], colours: list[str]) -> None:
    """Limit an axis to the values beside infinite peaks, which get arrows."""
    levels, endless = [], []
    for curve, colour in zip(drawn, colours, strict=True):
        size = np.where(curve.value == 0, np.nan, np.abs(curve.value))
        tops, around = find_tops(curve.frequency, size)
        levels.append(lowest_and_highest(size[around]))
        endless += [(curve.frequency[top], colour) for top, remark in tops if remark]
    low, high = find_limits(levels, decibels=False)
    if 0 < low < high:
        axes.set_ylim(low, high)
        for at, colour in endless:
            axes.plot(at, high, "^", color=colour, markersize=3, clip_on=False)


def _name(found: Comparison, curve: Curve) -> str:
    return found.name[curve.item] + ("" if curve.value.any() else " (0 by symmetry)")


def _look(found: Comparison, curve: Curve) -> LineLook:
    if found.kind[curve.item] == "measurement":
        return {"linestyle": "none", "marker": ".", "markersize": 3}
    return {"linestyle": curves.DASHES[curve.item % len(curves.DASHES)]}


def _finish_ratios(axes: Axes, found: Comparison, overlay: Overlay) -> None:
    """Label the panel of ratios; its axis is logarithmic if they differ much."""
    axes.set_ylabel("ratio")
    axes.set_title(
        f"relative to {single_line(found.name[overlay.curves[0].item], 60)}",
        loc="left",
        fontsize=curves.SMALL,
        pad=3,
    )
    sizes = [np.abs(curve.ratio) for curve in overlay.curves if len(curve.ratio)]
    known = np.concatenate([s[np.isfinite(s) & (s > 0)] for s in sizes] or [np.ones(1)])
    if len(known) and known.max() > 3 * known.min():
        axes.set_yscale("log")
        curves.label_plainly(axes.yaxis)
    axes.axhline(1, color=PALE, lw=0.8, zorder=0)


def _model_line(found: Comparison) -> str:
    models = {model for model in found.model if model}
    return ", ".join(f"{model} model" for model in sorted(models))
