"""Figure of cross-coupling against frequency or imperfections (Figure 6 of Husman et al.)."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from suspension_cli.analyses.xcouple.file import Coupling
from suspension_cli.drawing.style import NOTE, PALE, PALETTE, house_style, new_figure
from suspension_cli.studies.axes import Axis

LABELS = {
    "k": "$k/k_0$",
    "offset": "offset of the wire's upper end along x (mm)",
    "offset_y": "offset of the wire's upper end along y (mm)",
    "offset_z": "offset of the wire's upper end along z (mm)",
    "lower_offset": "offset of the wire's lower end along x (mm)",
    "lower_offset_y": "offset of the wire's lower end along y (mm)",
    "lower_offset_z": "offset of the wire's lower end along z (mm)",
    "length": "change of the wire's length (mm)",
    "mass": "$m/m_0$",
    "inertia": "$I/I_0$",
    "com": "offset of the COM along x (mm)",
    "com_y": "offset of the COM along y (mm)",
    "com_z": "offset of the COM along z (mm)",
}
MOST_CURVES = 9
"""Curves at most; more values of the second axis are thinned out evenly."""


def draw(coupling: Coupling, title: str) -> Figure:
    """Draw the figure of `pendsus xcouple`: a curve per value of the second axis.

    With several frequencies: ratio against frequency, of the build with the largest ratio and as
    the median of all builds.
    """
    with house_style():
        figure = new_figure(5.6, 4.2)
        axes = figure.subplots()
        if len(coupling.frequency) > 1:
            _draw_over_frequency(axes, coupling)
        else:
            _draw_over_axes(axes, coupling)
        axes.set_ylabel(f"|{coupling.over} / {coupling.under}|")
        axes.set_title(title, loc="left")
        axes.grid(visible=True, color=PALE, linewidth=0.4)
        figure.tight_layout()
        return figure


def _draw_over_frequency(axes: Axes, coupling: Coupling) -> None:
    size = np.abs(coupling.ratio).reshape(-1, len(coupling.frequency))
    good = np.isfinite(size).all(1)
    if not good.any():
        axes.text(0.5, 0.5, "no build has an equilibrium", ha="center", transform=axes.transAxes)
        return
    worst = size[good][int(size[good][:, -1].argmax())]
    axes.loglog(
        coupling.frequency,
        np.where(worst > 0, worst, np.nan),
        color=PALETTE[1],
        label="largest at the highest frequency",
    )
    if good.sum() > 1:
        middle = np.median(size[good], axis=0)
        axes.loglog(
            coupling.frequency,
            np.where(middle > 0, middle, np.nan),
            color=PALETTE[0],
            label="median of all builds",
        )
        axes.legend()
    axes.set_xlabel("frequency (Hz)")
    axes.margins(x=0)


def _draw_over_axes(axes: Axes, coupling: Coupling) -> None:
    size = np.abs(coupling.ratio[..., 0])
    while size.ndim > 2:  # worst case over further axes
        size = np.nanmax(size, axis=-1)
    first = coupling.axes[0]
    if size.ndim == 1:
        _draw_curve(axes, first, size, PALETTE[0], "")
    else:
        second = coupling.axes[1]
        shown = np.unique(
            np.linspace(0, len(second.values) - 1, min(MOST_CURVES, len(second.values)))
            .round()
            .astype(int)
        )
        for n, column in enumerate(shown):
            _draw_curve(
                axes,
                first,
                size[:, column],
                PALETTE[n % len(PALETTE)],
                _format_value(second, column),
            )
        axes.legend(title=LABELS.get(second.name, second.name), title_fontsize=7)
    axes.set_xlabel(LABELS.get(first.name, first.name))
    axes.set_ylim(bottom=0)
    remark = (
        f"{coupling.hold.replace('-', ' ')} held, {coupling.frequency[0]:g} Hz, wire"
        f" {coupling.wire}"
    )
    axes.text(
        0.99,
        1.01,
        remark,
        transform=axes.transAxes,
        ha="right",
        va="bottom",
        color=NOTE,
        fontsize=6.5,
    )


def _draw_curve(axes: Axes, along: Axis, size: np.ndarray, colour: str, label: str) -> None:
    """Draw one curve, or a marker where it has a single point."""
    x = np.array(along.values) * _scale(along.name)
    axes.plot(x, size, color=colour, label=label, marker="o" if len(x) == 1 else None)


def _scale(name: str) -> float:
    return 1e3 if "(mm)" in LABELS.get(name, "") else 1.0


def _format_value(axis: Axis, n: int) -> str:
    return f"{axis.values[n] * _scale(axis.name):.4g}"
