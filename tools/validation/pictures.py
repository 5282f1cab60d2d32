"""Panels of signed deviations, which the pictures of validation share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from suspension_cli.drawing.panels import Across, Line, Panel, Rule
from suspension_cli.drawing.style import PALE, LineLook

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

DOT: LineLook = {"linestyle": "none", "marker": "o", "markersize": 3}
RING: LineLook = {**DOT, "fillstyle": "none"}
CROSS: LineLook = {"linestyle": "none", "marker": "x", "markersize": 3.5}
DECADES = 4
"""Number of decades of an axis from which on every other one has a tick."""


def with_room(values: ArrayLike) -> tuple[float, float]:
    """Limits of a logarithmic axis a little beyond some values."""
    found = np.ravel(values)
    return float(found.min()) / 1.15, float(found.max()) * 1.15


def deviation_panel(
    lines: Sequence[Line],
    limits: tuple[float, float],
    smallest: float,
    across: Across,
    close: float | None = None,
    remarks: Sequence[str] = (),
) -> Panel:
    """Make a panel of relative deviations in percent with their sign, logarithmic either side of 0.

    Below `smallest`, %, it is linear; within `close`, %, it is grey.
    """

    def paint(axes: Axes) -> None:
        axes.set_yscale("symlog", linthresh=smallest)
        low, high = axes.get_ylim()
        step = 2 if np.log10(high / smallest) > DECADES else 1
        sizes = smallest * 10.0 ** np.arange(step, 12, step)
        ticks = [*-sizes[-low >= sizes][::-1], 0.0, *sizes[sizes <= high]]
        axes.set_yticks(ticks, [f"{tick:+g}".replace("-", "−") if tick else "0" for tick in ticks])
        axes.minorticks_off()

    band = [] if close is None else [Rule(-close, to=close, colour=PALE)]
    return Panel(
        "deviation (%)",
        lines,
        1.3,
        limits=limits,
        rules=band,
        across=across,
        paint=paint,
        remarks=remarks,
    )
