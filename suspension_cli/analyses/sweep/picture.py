"""Figure of a sweep: results as lines over one parameter, or as maps over two."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure

from suspension_cli.analyses.sweep.file import SweepResult
from suspension_cli.conventions import DOFS
from suspension_cli.drawing.style import (
    DOF_COLOUR,
    INK,
    NOTE,
    PALE,
    PALETTE,
    house_style,
    new_figure,
    single_line,
)

MAX_MAPS = 6
"""Maps in one figure at most: the results that change most."""
LOG_RATIO = 8.0
"""Ratio of largest to smallest value above which a scale is logarithmic."""
DASHES = ("-", "--", "-.", ":")
"""Line styles of the stages, from the last one up."""


def draw(swept: SweepResult, title: str) -> Figure:
    """Draw the figure of `pendsus sweep`.

    Parameters
    ----------
    swept : Swept
        Parameters after the second are kept at the grid point nearest to the nominal design.
    title : str
    """
    with house_style():
        value = (
            swept.value[(slice(None), slice(None), *swept.start[2:])[: len(swept.axes)]]
            if len(swept.axes) > 2
            else swept.value
        )
        figure = _draw_maps(swept, value) if value.ndim == 3 else _draw_lines(swept, value)
        figure.suptitle(single_line(title, 90), x=0.01, ha="left", fontsize=9)
        figure.tight_layout(rect=(0, 0, 1, 0.99))
        return figure


def _is_geometric(values: Any) -> bool:
    """Whether values are spaced geometrically over a wide range."""
    x = np.asarray(values)
    if len(x) < 3 or x.min() <= 0 or x.max() < LOG_RATIO * x.min():
        return False
    ratio = np.diff(np.log(x))
    return bool(np.allclose(ratio, ratio[0], rtol=1e-6))


def _is_wide(values: Any) -> bool:
    """Whether the largest and smallest positive values differ by more than `LOG_RATIO`."""
    positive = values[np.isfinite(values) & (values > 0)]
    return bool(positive.size and positive.max() > LOG_RATIO * positive.min())


def _draw_lines(swept: SweepResult, value: Any) -> Figure:
    units = list(dict.fromkeys(swept.unit))
    figure = new_figure(6.8, 0.5 + 3.6 * len(units))
    first = swept.axes[0]
    for axes, unit in zip(
        figure.subplots(len(units), 1, sharex=True, squeeze=False)[:, 0], units, strict=True
    ):
        chosen = [n for n, own in enumerate(swept.unit) if own == unit]
        for n in chosen:
            colour, dashes = _style(swept, n, chosen.index(n))
            marker = "o" if len(first.values) == 1 else None
            axes.plot(
                first.values,
                value[:, n],
                color=colour,
                linestyle=dashes,
                marker=marker,
                markersize=3,
                label=single_line(swept.result[n], 60),
            )
        if _is_geometric(first.values):
            axes.set_xscale("log")
        if _is_wide(value[:, chosen]) and not (value[:, chosen] == 0).all(0).any():
            axes.set_yscale("log", nonpositive="mask")  # lines end where they reach 0
        axes.set_ylabel(_axis_label(unit))
        axes.margins(x=0)
        _mark_nominal(axes, swept)
        axes.grid(visible=True, color=PALE, linewidth=0.4)
        order = sorted(chosen, key=lambda n: -np.nan_to_num(swept.nominal[n], posinf=0.0))
        handles = axes.get_legend_handles_labels()[0]
        axes.legend(
            [handles[chosen.index(n)] for n in order],
            [single_line(swept.result[n], 60) for n in order],
            loc="center left",
            bbox_to_anchor=(1.01, 0.5),
            fontsize=6.5,
        )
    figure.axes[-1].set_xlabel(single_line(first.name, 84) + " (SI)")
    return figure


def _style(swept: SweepResult, n: int, place: int) -> tuple[str, str]:
    """Colour and dashes of result n: of its degree of freedom and stage, or from the palette."""
    body, _, dof = swept.degree[n].rpartition(".")
    if sum(bool(home) for home in swept.degree) < 2 or dof not in DOFS:
        return PALETTE[place % len(PALETTE)], "-"
    bodies = list(dict.fromkeys(home.rpartition(".")[0] for home in swept.degree if home))
    return DOF_COLOUR[dof], DASHES[(len(bodies) - 1 - bodies.index(body)) % len(DASHES)]


def _mark_nominal(axes: Axes, swept: SweepResult) -> None:
    at = swept.drawn[0]
    if min(swept.axes[0].values) <= at <= max(swept.axes[0].values):
        axes.axvline(at, color=NOTE, linewidth=0.6, linestyle=(0, (1, 2)))
        axes.annotate(
            "nominal",
            (at, 1),
            xycoords=("data", "axes fraction"),
            xytext=(2, -2),
            textcoords="offset points",
            va="top",
            color=NOTE,
            fontsize=6.5,
        )


def _axis_label(unit: str) -> str:
    return "frequency (Hz)" if unit == "Hz" else f"magnitude ({unit})" if unit != "1" else "ratio"


def _draw_maps(swept: SweepResult, value: Any) -> Figure:
    order = np.argsort(-swept.change, kind="stable")[:MAX_MAPS]
    shown = (
        sorted(order.tolist()) if len(swept.result) > MAX_MAPS else list(range(len(swept.result)))
    )
    columns = min(3, len(shown))
    rows = -(-len(shown) // columns)
    figure = new_figure(0.6 + 3.1 * columns, 0.4 + 2.6 * rows)
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes in panels[len(shown) :]:
        axes.set_visible(False)
    for axes, n in zip(panels, shown, strict=False):
        _draw_map(axes, swept, value[:, :, n], n)
    return figure


def _draw_map(axes: Axes, swept: SweepResult, value: Any, n: int) -> None:
    first, second = swept.axes[:2]
    finite = np.ma.masked_invalid(value.T)
    low, high = (float(finite.min()), float(finite.max())) if finite.count() else (0.0, 1.0)
    norm = LogNorm(low, high) if _is_wide(value) and low > 0 else Normalize(low, high)
    axes.set_facecolor("#eeeeee")
    drawn = axes.pcolormesh(
        first.values,
        second.values,
        finite,
        norm=norm,
        cmap="viridis",
        shading="nearest",
        rasterized=True,
    )
    bar = axes.figure.colorbar(drawn, ax=axes, pad=0.02)
    bar.set_label(_axis_label(swept.unit[n]), fontsize=6.5)
    bar.ax.tick_params(labelsize=6)
    if _is_geometric(first.values):
        axes.set_xscale("log")
    if _is_geometric(second.values):
        axes.set_yscale("log")
    if all(
        min(axis.values) <= at <= max(axis.values)
        for axis, at in zip(swept.axes[:2], swept.drawn[:2], strict=True)
    ):
        axes.plot(*swept.drawn[:2], "+", color="white", markersize=9, markeredgewidth=2.2)
        axes.plot(*swept.drawn[:2], "+", color=INK, markersize=8, markeredgewidth=0.9)
    axes.set_title(single_line(swept.result[n], 44), loc="left", fontsize=7.5)
    axes.set_xlabel(single_line(first.name, 38) + " (SI)", fontsize=7)
    axes.set_ylabel(single_line(second.name, 38) + " (SI)", fontsize=7)
