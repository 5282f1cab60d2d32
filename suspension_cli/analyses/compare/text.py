"""Text of a comparison."""

from __future__ import annotations

import numpy as np

from suspension_cli.analyses import tables
from suspension_cli.analyses.compare.solve import Comparison, Overlay, PairedModes

MIXED = 0.9
"""Overlap of two shapes below which the table notes a difference."""
MANY = 20
"""Most printed changes of a design."""
ROUNDED = 1e-9
"""Change of a frequency, %, below which it is a rounding error."""


def describe(found: Comparison, neglected: str = "") -> str:
    """Return the models and what they neglect, changed numbers, paired modes and ratios."""
    kinds = zip(found.name, found.kind, found.model, strict=True)
    items = [f"{n}: {k}" + (f", {m} model" if m else "") for n, k, m in kinds]
    lines = ["; ".join([*items, neglected] if neglected else items), *_changes(found)]
    if found.modes is not None:
        lines += ["", *_table(found, found.modes)]
    for overlay in found.overlay:
        kind = "thermal " if overlay.kind == "noise" else ""
        lines += ["", f"{kind}{overlay.name} ({overlay.unit})", *_ratios(found, overlay)]
    return "\n".join(lines)


def _changes(found: Comparison) -> list[str]:
    designs = [n for n, kind in enumerate(found.kind) if kind != "measurement"]
    lines = []
    for n in designs[1:]:
        changes = found.change[n]
        lines += ["", f"numbers that differ between {found.name[designs[0]]} and {found.name[n]}"]
        if not changes:
            lines[-1] += ": none"
            continue
        rows = [(c.words, c.before, c.after) for c in changes[:MANY]]
        heads = ["", found.name[designs[0]], found.name[n]]
        lines.append(tables.render(dict.fromkeys(heads, ""), rows))
        if len(changes) > MANY:
            lines.append(f"  and {len(changes) - MANY} more, which --json lists")
    return lines


def _table(found: Comparison, modes: PairedModes) -> list[str]:
    rows = []
    shown = [n for n in range(len(found.name)) if np.isfinite(modes.frequency[:, n]).any()]
    first = shown[0]
    few = (modes.overlap < MIXED).sum() <= len(modes.label) / 2
    for m, label in enumerate(modes.label):
        row: list[object] = []
        for n in shown:
            row.append(modes.frequency[m, n])
            if n != first:
                change = 100 * (modes.frequency[m, n] / modes.frequency[m, first] - 1)
                row.append("0" if abs(change) < ROUNDED else change)
        poor = [found.name[n] for n in shown if modes.overlap[m, n] < MIXED]
        note = f"; shape differs in {', '.join(poor)}" if poor and few else ""
        rows.append((*row, label + note))
    columns: dict[str, str] = {}
    for n in shown:
        columns |= {f"{found.name[n]}\nHz": "#.5g"}
        columns |= {f"{found.name[n]}\nchange %": "+.3g"} if n != first else {}
    more = "" if few else " as far as possible: most shapes differ"
    return [f"modes, paired by shape{more}", tables.render(columns | {"mode": ""}, rows)]


def _ratios(found: Comparison, overlay: Overlay) -> list[str]:
    reference = found.name[overlay.curves[0].item]
    lines = []
    zero = [found.name[curve.item] for curve in overlay.curves if not curve.value.any()]
    if zero:
        return [f"  0 by symmetry: {', '.join(zero)}"]
    for curve in overlay.curves[1:]:
        size = np.abs(curve.ratio)
        known = np.isfinite(size) & (size > 0)
        head = f"  {found.name[curve.item]} / {reference}: "
        if not known.any():
            lines.append(head + "no frequency in common")
            continue
        f, size = curve.ratio_frequency[known], size[known]
        worst = int(np.argmax(np.abs(np.log(size))))
        lines.append(
            f"{head}median {np.median(size):.4g}, {size[0]:.4g} at {f[0]:.4g} Hz,"
            f" {size[-1]:.4g} at {f[-1]:.4g} Hz, farthest from 1: {size[worst]:.4g} at"
            f" {f[worst]:.5g} Hz"
        )
    return lines or [f"  only {reference} has it: nothing to compare with"]
