"""Figure of cross-coupling against frequency or imperfections (Figure 6 of Husman et al.)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from suspension_cli.analyses.xcouple.result import Coupling
from suspension_cli.drawing import curves
from suspension_cli.drawing.style import (
    NOTE,
    PALETTE,
    RED,
    format_raised,
    house_style,
    new_figure,
    single_line,
)
from suspension_cli.studies.axes import Axis

if TYPE_CHECKING:
    from jaxtyping import Complex, Float, Inexact, Int

RATIOS = {"k": "$k/k_0$ (ratio)", "mass": "$m/m_0$ (ratio)", "inertia": "$I/I_0$ (ratio)"}
"""Labels of imperfections that are ratios to the design, 1 without imperfection."""
LENGTHS = {
    f"{name}{end}": f"offset of the {part} along {axis} (mm)"
    for name, part in (
        ("offset", "wire's upper end"),
        ("lower_offset", "wire's lower end"),
        ("com", "COM"),
    )
    for end, axis in (("", "x"), ("_y", "y"), ("_z", "z"))
} | {"length": "change of the wire's length (mm)"}
"""Labels of imperfections that are lengths, 0 without imperfection."""
LABELS = RATIOS | LENGTHS
MOST_CURVES = 9
"""Curves at most; more values of the second axis are thinned out evenly."""
FINE = 16
"""Points per interval of the first axis, interpolated, so that zeros are sharp."""
COLOURS = "viridis"
"""Colour map of the second axis."""


def draw(coupling: Coupling, title: str, limit: float | None = None) -> Figure:
    """Draw the figure of `pendsus xcouple`: a curve per value of the second axis.

    With several frequencies: largest and median ratio of all builds against frequency. `title`
    names the design and the model; `limit` is the largest ratio allowed.
    """
    with house_style():
        names = _curve_names(coupling)
        right = curves.room_for(names) if names else 0.2
        figure = new_figure(curves.COLUMN, 3.85)
        axes = figure.subplots()
        curves.set_margins(figure, left=0.85, right=right, top=curves.HEAD + 0.5, bottom=0.6)
        curves.rule(axes)
        if len(coupling.frequency) > 1:
            _draw_over_frequency(axes, coupling, limit)
            at = ""
        else:
            _draw_over_axes(axes, coupling, limit)
            at = f" at {coupling.frequency[0]:g} Hz"
        ratio = f"{coupling.over} / {coupling.under}"
        axes.set_ylabel(f"{single_line(f'|{ratio}|', 46)} ({curves.unit_of_ratio(ratio)})")
        axes.yaxis.get_offset_text().set_fontsize(curves.SMALL)
        _write_conditions(axes, coupling)
        size = np.abs(coupling.ratio)
        most = float(np.nanmax(size)) if np.isfinite(size).any() else np.nan
        said = f": at most {format_raised(most)}" if np.isfinite(most) else ""
        curves.write_heading(figure, f"Cross-coupling{at}{said}", title)
        return figure


def _write_conditions(axes: Axes, coupling: Coupling) -> None:
    """Write what is driven, imperfect and kept above the axes."""
    parts = [f"for {coupling.input}"]
    if coupling.wire:
        parts.append(f"wire {coupling.wire}, {coupling.hold.replace('-', ' ')} held")
    if coupling.failures:
        parts.append("gaps: " + "; ".join(coupling.failures))
    lines = [single_line("; ".join(parts), 62)]
    if len(coupling.frequency) == 1 and len(coupling.axes) > 1:
        lines.append(f"lines: {_label(coupling.axes[1])}")
    if len(coupling.frequency) > 1 and len(_curve_names(coupling)) > 1:
        lines.append(_name_worst(coupling))
    axes.set_title("\n".join(lines), loc="left", fontsize=7.5, color=NOTE, pad=13)


def _curve_names(coupling: Coupling) -> list[str]:
    """Labels at the ends of curves."""
    if len(coupling.frequency) > 1:
        return ["largest", "median"] if coupling.ratio.shape[0] > 1 else []
    if len(coupling.axes) < 2:
        return []
    second = coupling.axes[1]
    return [_format_value(second, n) for n in _shown(second)]


def _shown(axis: Axis) -> Int[np.ndarray, " curve"]:
    """Numbers of the values of the second axis that have curves."""
    count = len(axis.values)
    return np.unique(np.linspace(0, count - 1, min(MOST_CURVES, count)).round().astype(int))


def _name_worst(coupling: Coupling) -> str:
    """Name the build and the frequency with the largest ratio."""
    size = np.abs(coupling.ratio)
    if not np.isfinite(size).any():
        return ""
    *place, at = np.unravel_index(int(np.nanargmax(size)), size.shape)
    values = (
        f"{axis.name} = {_format_value(axis, int(n)).rpartition(' = ')[2]}"
        for axis, n in zip(coupling.axes, place, strict=True)
    )
    where = f"{coupling.frequency[at]:.3g} Hz"
    return single_line(
        f"{np.prod(size.shape[:-1])} builds; largest at {where}: {', '.join(values)}", 62
    )


def _draw_over_frequency(axes: Axes, coupling: Coupling, limit: float | None) -> None:
    size = np.abs(coupling.ratio).reshape(-1, len(coupling.frequency))
    good = np.isfinite(size).all(1)
    if not good.any():
        axes.text(0.5, 0.5, "no build has an equilibrium", ha="center", transform=axes.transAxes)
        return
    axes.set_xscale("log")
    axes.set_yscale("log")
    ends = []
    several = good.sum() > 1
    for values, colour, name in (
        (size[good].max(axis=0), PALETTE[1], "largest" if several else ""),
        (np.median(size[good], axis=0), PALETTE[0], "median"),
    )[: 1 + several]:
        drawn = np.where(values > 0, values, np.nan)
        axes.plot(coupling.frequency, drawn, color=colour)
        ends.append((coupling.frequency, drawn, name, colour))
    axes.set_xlabel("frequency (Hz)")
    axes.margins(x=0)
    if limit is not None:
        low, high = axes.get_ylim()
        axes.set_ylim(min(low, limit / 1.5), max(high, limit * 1.5))
        _draw_limit(axes, limit)
    curves.label_plainly(axes.yaxis)
    if several:
        curves.label_ends(axes, ends)


def _draw_over_axes(axes: Axes, coupling: Coupling, limit: float | None) -> None:
    ratio = coupling.ratio[..., 0]
    while ratio.ndim > 2:  # worst case over further axes
        ratio = np.nanmax(np.abs(ratio), axis=-1)
    first, ends = coupling.axes[0], []
    x = np.array(first.values) * _scale(first)
    if ratio.ndim == 1:
        _draw_curve(axes, x, ratio, PALETTE[0])
    else:
        second = coupling.axes[1]
        values = np.array(second.values)
        span = float(np.ptp(values)) or 1.0
        for column in _shown(second):
            place = 0.88 * (values[column] - values.min()) / span  # the rest is too pale
            colour = to_hex(matplotlib.colormaps[COLOURS](place))
            fine, drawn = _draw_curve(axes, x, ratio[:, column], colour)
            ends.append((fine, drawn, _format_value(second, int(column)), colour))
    top = float(np.abs(ratio[np.isfinite(ratio)]).max(initial=0.0)) or 1.0
    axes.set_ylim(0, 1.05 * top)
    if limit is not None:
        if limit < 2.5 * top:
            axes.set_ylim(0, 1.08 * max(top, limit))
            _draw_limit(axes, limit)
        else:
            axes.annotate(
                f"↑ limit {limit:g}",
                (1, 1),
                (0, 2),
                xycoords="axes fraction",
                textcoords="offset points",
                ha="right",
                va="bottom",
                fontsize=7.5,
                color=RED,
            )
    if len(x) > 1:
        axes.set_xlim(x.min(), x.max())
    axes.ticklabel_format(axis="y", style="sci", scilimits=(-2, 4), useMathText=True)
    axes.yaxis.get_offset_text().set_fontsize(7)
    axes.set_xlabel(_label(first))
    at = 1.0 if first.name in RATIOS else 0.0 if first.name in LENGTHS else np.nan
    if x.min() < at < x.max():
        curves.mark_design([axes], at)
    if ends:
        curves.label_ends(axes, ends)


def _draw_limit(axes: Axes, limit: float) -> None:
    axes.axhline(limit, color=RED, linewidth=1.0, linestyle=(0, (6, 2)), zorder=1.7)
    axes.annotate(
        f"limit {limit:g}",
        (0.01, limit),
        (0, -2),
        xycoords=("axes fraction", "data"),
        textcoords="offset points",
        va="top",
        fontsize=7.5,
        color=RED,
    )


def _draw_curve(
    axes: Axes, x: Float[np.ndarray, " build"], ratio: Complex[np.ndarray, " build"], colour: str
) -> tuple[Float[np.ndarray, " finer"], Float[np.ndarray, " finer"]]:
    """Draw the size of a smooth complex ratio, interpolated between the builds, or one marker."""
    if len(x) == 1:
        axes.plot(x, np.abs(ratio), color=colour, marker="o")
        return x, np.abs(ratio)
    at, size = interpolate(x, ratio)
    axes.plot(at, size, color=colour, linewidth=1.2)
    if len(x) <= 15:
        axes.plot(x, np.abs(ratio), ".", color=colour, markersize=4)
    return at, size


def interpolate(
    x: Float[np.ndarray, " build"], ratio: Inexact[np.ndarray, " build"]
) -> tuple[Float[np.ndarray, " finer"], Float[np.ndarray, " finer"]]:
    """Interpolate a complex ratio (NaN where unknown); return its magnitude, sharp at zeros.

    >>> at, size = interpolate(np.array([0.0, 1.0, 2.0, 3.0]), np.array([-1.5, -0.5, 0.5, 1.5]))
    >>> bool(size.min() < 1e-12)
    True
    """
    from scipy.interpolate import PchipInterpolator

    if np.iscomplexobj(ratio) and not np.imag(ratio).any():
        ratio = np.real(ratio)
    if len(x) < 3:
        return x, np.abs(ratio)
    order = np.argsort(x, kind="stable")
    x, ratio = np.asarray(x)[order], np.asarray(ratio)[order]
    weights = np.linspace(0, 1, FINE, endpoint=False)
    at = np.append((x[:-1, None] + np.diff(x)[:, None] * weights).ravel(), x[-1])
    found = np.full(len(at), np.nan, dtype=ratio.dtype)
    known = np.isfinite(ratio)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], known, [False]])))
    for start, stop in edges.reshape(-1, 2):
        inside = (at >= x[start]) & (at <= x[stop - 1])
        if stop - start < 2:
            found[inside] = ratio[start]
            continue
        own = slice(start, stop)
        found[inside] = PchipInterpolator(x[own], np.real(ratio[own]))(at[inside])
        if np.iscomplexobj(ratio):
            found[inside] += 1j * PchipInterpolator(x[own], np.imag(ratio[own]))(at[inside])
    # the zero of the real part between two points, where the magnitude is least
    with np.errstate(invalid="ignore"):
        crossed = np.flatnonzero(np.real(found[:-1]) * np.real(found[1:]) < 0)
    part = np.real(found[crossed]) / np.real(found[crossed] - found[crossed + 1])
    zeros = at[crossed] + part * (at[crossed + 1] - at[crossed])
    least = np.abs(np.imag(found[crossed] + part * (found[crossed + 1] - found[crossed])))
    return np.insert(at, crossed + 1, zeros), np.insert(np.abs(found), crossed + 1, least)


def _label(axis: Axis) -> str:
    if axis.name in LABELS:
        return LABELS[axis.name]
    unit = axis.displayed_unit[0]
    return single_line(axis.name, 50) + (f" ({unit})" if unit else "")


def _scale(axis: Axis) -> float:
    if axis.name in LABELS:
        return 1e3 if axis.name in LENGTHS else 1.0
    return axis.displayed_unit[1]


def _format_value(axis: Axis, n: int) -> str:
    """Write a value of the second axis with its unit."""
    value = axis.values[n] * _scale(axis)
    label = _label(axis)
    if label.startswith("$"):
        return f"{label} = {value:.4g}"
    sign = "+" if min(axis.values) < 0 < value else ""
    unit = label.rpartition(" (")[2].rstrip(")") if label.endswith(")") else ""
    return f"{sign}{value:.4g} {unit}".strip().replace("-", "−")
