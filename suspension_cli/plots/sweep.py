"""A design's modes, responses and couplings against its parameters: lines over one, maps over two."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure

from suspension_cli.conventions import DOFS
from suspension_cli.plots.style import DOF_COLOUR, INK, NOTE, PALE, PALETTE, house, new_figure, plain
from suspension_cli.results.sweep import Swept

MAPS = 6
"""Most maps in one figure; of more results, those that change most."""
DECADE = 8.0
"""Ratio of largest to smallest value from which a scale is logarithmic."""
DASHES = ("-", "--", "-.", ":")
"""Of the stages, from the top."""


def draw(swept: Swept, title: str) -> Figure:
    """The figure of `pendsus sweep`.

    Parameters
    ----------
    swept : Swept
        Of three and more parameters those past the second stay next to the design as drawn.
    title : str
    """
    with house():
        value = swept.value[(slice(None), slice(None), *swept.start[2:])[: len(swept.axes)]] if len(swept.axes) > 2 else swept.value
        figure = _maps(swept, value) if value.ndim == 3 else _lines(swept, value)
        figure.suptitle(plain(title, 90), x=0.01, ha="left", fontsize=9)
        figure.tight_layout(rect=(0, 0, 1, 0.99))
        return figure


def _logarithmic(values: Any) -> bool:
    """Whether values that are spaced by a ratio ask for a logarithmic axis."""
    x = np.asarray(values)
    if len(x) < 3 or x.min() <= 0 or x.max() < DECADE * x.min():
        return False
    ratio = np.diff(np.log(x))
    return bool(np.allclose(ratio, ratio[0], rtol=1e-6))


def _wide(values: Any) -> bool:
    """Whether values that differ widely ask for a logarithmic axis."""
    positive = values[np.isfinite(values) & (values > 0)]
    return bool(positive.size and positive.max() > DECADE * positive.min())


def _lines(swept: Swept, value: Any) -> Figure:
    units = list(dict.fromkeys(swept.unit))
    figure = new_figure(6.8, 0.5 + 3.6 * len(units))
    first = swept.axes[0]
    for axes, unit in zip(figure.subplots(len(units), 1, sharex=True, squeeze=False)[:, 0], units, strict=True):
        chosen = [n for n, own in enumerate(swept.unit) if own == unit]
        for n in chosen:
            colour, dashes = _style(swept, n, chosen.index(n))
            marker = "o" if len(first.values) == 1 else None
            axes.plot(first.values, value[:, n], color=colour, linestyle=dashes, marker=marker, markersize=3, label=plain(swept.result[n], 60))
        if _logarithmic(first.values):
            axes.set_xscale("log")
        if _wide(value[:, chosen]) and not (value[:, chosen] == 0).all(0).any():
            axes.set_yscale("log", nonpositive="mask")  # a line ends where it comes to 0
        axes.set_ylabel(_quantity(unit))
        axes.margins(x=0)
        _as_drawn(axes, swept)
        axes.grid(visible=True, color=PALE, linewidth=0.4)
        order = sorted(chosen, key=lambda n: -np.nan_to_num(swept.nominal[n], posinf=0.0))
        handles = axes.get_legend_handles_labels()[0]
        axes.legend(
            [handles[chosen.index(n)] for n in order], [plain(swept.result[n], 60) for n in order], loc="center left", bbox_to_anchor=(1.01, 0.5), fontsize=6.5
        )
    figure.axes[-1].set_xlabel(plain(first.name, 84) + " (SI)")
    return figure


def _style(swept: Swept, n: int, place: int) -> tuple[str, str]:
    """Colour and dashes of a line: a mode's degree of freedom and stage, or the next of the palette."""
    body, _, dof = swept.degree[n].rpartition(".")
    if sum(bool(home) for home in swept.degree) < 2 or dof not in DOFS:
        return PALETTE[place % len(PALETTE)], "-"
    bodies = list(dict.fromkeys(home.rpartition(".")[0] for home in swept.degree if home))
    return DOF_COLOUR[dof], DASHES[(len(bodies) - 1 - bodies.index(body)) % len(DASHES)]


def _as_drawn(axes: Axes, swept: Swept) -> None:
    at = swept.drawn[0]
    if min(swept.axes[0].values) <= at <= max(swept.axes[0].values):
        axes.axvline(at, color=NOTE, linewidth=0.6, linestyle=(0, (1, 2)))
        axes.annotate("as drawn", (at, 1), xycoords=("data", "axes fraction"), xytext=(2, -2), textcoords="offset points", va="top", color=NOTE, fontsize=6.5)


def _quantity(unit: str) -> str:
    return "frequency (Hz)" if unit == "Hz" else f"size ({unit})" if unit != "1" else "ratio"


def _maps(swept: Swept, value: Any) -> Figure:
    order = np.argsort(-swept.change, kind="stable")[:MAPS]
    shown = sorted(order.tolist()) if len(swept.result) > MAPS else list(range(len(swept.result)))
    columns = min(3, len(shown))
    rows = -(-len(shown) // columns)
    figure = new_figure(0.6 + 3.1 * columns, 0.4 + 2.6 * rows)
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes in panels[len(shown) :]:
        axes.set_visible(False)
    for axes, n in zip(panels, shown, strict=False):
        _map(axes, swept, value[:, :, n], n)
    return figure


def _map(axes: Axes, swept: Swept, value: Any, n: int) -> None:
    first, second = swept.axes[:2]
    finite = np.ma.masked_invalid(value.T)
    low, high = (float(finite.min()), float(finite.max())) if finite.count() else (0.0, 1.0)
    norm = LogNorm(low, high) if _wide(value) and low > 0 else Normalize(low, high)
    axes.set_facecolor("#eeeeee")
    drawn = axes.pcolormesh(first.values, second.values, finite, norm=norm, cmap="viridis", shading="nearest", rasterized=True)
    bar = axes.figure.colorbar(drawn, ax=axes, pad=0.02)
    bar.set_label(_quantity(swept.unit[n]), fontsize=6.5)
    bar.ax.tick_params(labelsize=6)
    if _logarithmic(first.values):
        axes.set_xscale("log")
    if _logarithmic(second.values):
        axes.set_yscale("log")
    if all(min(axis.values) <= at <= max(axis.values) for axis, at in zip(swept.axes[:2], swept.drawn[:2], strict=True)):
        axes.plot(*swept.drawn[:2], "+", color="white", markersize=9, markeredgewidth=2.2)
        axes.plot(*swept.drawn[:2], "+", color=INK, markersize=8, markeredgewidth=0.9)
    axes.set_title(plain(swept.result[n], 44), loc="left", fontsize=7.5)
    axes.set_xlabel(plain(first.name, 38) + " (SI)", fontsize=7)
    axes.set_ylabel(plain(second.name, 38) + " (SI)", fontsize=7)
