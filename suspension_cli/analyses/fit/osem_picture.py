"""Figure of the couplings of motions with nominal and measured matrices."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from suspension_cli.analyses.fit.osem_matrices import OsemFit
from suspension_cli.analyses.fit.result import Fitted
from suspension_cli.drawing import panels
from suspension_cli.drawing.panels import Across, Line, Panel
from suspension_cli.drawing.style import INK, NOTE, PALETTE, LineLook

SHOWN = 6
"""Most pairs of motions that are drawn."""


def draw(found: Fitted, one: OsemFit, title: str) -> Figure:
    """Draw the couplings that were strongest with the nominal matrices, against frequency."""
    order = np.argsort(-one.median_before, kind="stable")[:SHOWN].tolist()
    shown = [_panel(one, n, last=n == order[-1]) for n in order]
    several = len(one.pair) > SHOWN
    which = f", the {SHOWN} strongest of {len(one.pair)} pairs" if several else ""
    said = f"Couplings at {one.stage}{which}"
    return panels.draw(f"MISFIT: {said}" if found.unlikely else said, title, shown)


def _panel(one: OsemFit, n: int, *, last: bool) -> Panel:
    """Make the panel of one pair of motions."""
    lines = [
        Line(one.frequency, one.noise[:, n], "noise of the data", NOTE, {"linestyle": ":"}),
        Line(one.frequency, one.before[:, n], "nominal matrices", PALETTE[1], {}),
        Line(one.frequency, one.after[:, n], "measured matrices", PALETTE[0], {}),
    ]
    if one.suspension[:, n].any():
        look: LineLook = {"linestyle": "--", "linewidth": 0.9}
        lines.append(Line(one.frequency, one.suspension[:, n], "of the suspension", INK, look))
    label = "coupling"
    across = Across() if last else None
    return Panel(label, lines, 1.3, "log", title=one.pair[n], across=across)
