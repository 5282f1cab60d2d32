"""Figure of a budget: spectra by cause, their sum, cumulative RMS and the requirement."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from suspension_cli.analyses.budget.cause_groups import Grouped
from suspension_cli.drawing import curves, panels
from suspension_cli.drawing.panels import Line, Panel
from suspension_cli.drawing.style import (
    INK,
    NOTE,
    PALETTE,
    RED,
    LineLook,
    format_raised,
    single_line,
)
from suspension_cli.physics.noise_budget import MotionBudget

FAINT = 1e-3
"""Fraction of the sum below which a cause is not drawn."""
MOST = 99.0
"""Part of the mean square, per cent, from which a cause makes "nearly all" of it."""


def draw(grouped: Sequence[Grouped], title: str) -> Figure:
    """Draw a panel per output, below a sentence on it."""
    budgets = [one.budget for one in grouped]
    drawn = [*dict.fromkeys(name for one in budgets for name in _drawn(one))]
    colours = [PALETTE[n % len(PALETTE)] for n in range(len(drawn))]
    looks: dict[str, tuple[str, LineLook]] = {
        name: (colour, {"linestyle": dashes, "linewidth": 0.9})
        for name, colour, dashes in zip(drawn, colours, panels.dashes_of(colours), strict=True)
    }
    shown = [_panel(one, looks) for one in grouped]
    outputs = ", ".join(one.output for one in budgets)
    return panels.draw(f"Noise budget of {outputs}", title, shown)


def _panel(grouped: Grouped, looks: dict[str, tuple[str, LineLook]]) -> Panel:
    one = grouped.budget
    at = one.frequency
    drawn = _drawn(one)
    lines = [Line(at, one.amplitude, "all", INK, {"linewidth": 2.0})]
    lines += [Line(at, one.parts[name], name, *looks[name]) for name in drawn]
    known = [one.amplitude]
    if np.isfinite(one.rms).all():
        lines.append(Line(at, one.rms, f"RMS above f ({one.unit})", NOTE, {"linewidth": 0.7}))
        known.append(one.rms[:1])
    if one.requirement is not None:
        given = one.requirement
        look = LineLook(linestyle="--", linewidth=1.1)
        lines.append(Line(given.frequency, given.density, Path(given.name).stem, RED, look))
        known.append(given.density)
    faint = ", ".join(name for name in one.cause if name not in drawn)
    remarks = [f"not drawn, below {FAINT:g} of the sum everywhere: {faint}"] if faint else []
    return Panel(
        f"{single_line(one.output, 40)} ({one.unit}/√Hz)",
        lines,
        2.4,
        "log",
        curves.limit_spectrum(np.concatenate(known)),
        title=write_message(one),
        remarks=[*remarks, *grouped.remarks],
    )


def write_message(one: MotionBudget) -> str:
    """Describe a panel in one sentence: RMS, its main cause, requirement."""
    square = one.mean_square[0]
    rms = one.total_rms
    if np.isfinite(rms) and rms > 0:
        by = int(square.argmax())
        part = 100 * square[by] / square.sum()
        most = "nearly all" if part >= MOST else f"{part:.0f} % of its square"
        size = f"{format_raised(rms)} {one.unit}"
        text = f"{one.output} moves by {size} RMS, {most} due to {one.cause[by]}"
    elif np.isinf(rms):
        text = f"{one.output} has an infinite RMS: a resonance without loss is driven"
    else:
        text = f"{one.output}"
    return f"{text}; the requirement is {one.requirement.outcome}" if one.requirement else text


def _drawn(one: MotionBudget) -> list[str]:
    total = one.amplitude
    return [name for name, part in one.parts.items() if (part > FAINT * total).any()]
