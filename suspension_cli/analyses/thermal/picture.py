"""Figure of thermal noise: amplitude spectral densities of the sum, by stage and by cause."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from suspension_cli.drawing import curves, panels
from suspension_cli.drawing.panels import Line, Panel
from suspension_cli.drawing.style import INK, NOTE, LineLook, single_line, stage_colours
from suspension_cli.physics.thermal_noise import MotionNoise

if TYPE_CHECKING:
    from jaxtyping import Float

LINES = 7
"""Largest number of lines in a panel: the sum, the largest parts, and the others together."""
OTHER = "other"
SUPPORT = "whole suspension"
"""Names of the sum of small parts, and of sources that belong to no stage."""
SHADES = ("#332288", "#cc6677", "#117733", "#88ccee", "#999933", "#aa4499", "#44aa99", "#ddaa33")
"""Colours of causes, in their order, which are not those of stages (Tol 2021, muted)."""


def draw(noises: Sequence[MotionNoise], title: str, stages: Sequence[str] = ()) -> Figure:
    """Draw two panels per motion: the sum with its parts by stage, and by cause."""
    groups = [(_by_stage, "by stage"), (_by_cause, "by cause")]
    every = [*dict.fromkeys(source for noise in noises for source in noise.source)]
    colours = stage_colours([*stages, *map(_by_stage, every)])
    causes = sorted({*map(_by_cause, every)})
    colours |= {cause: SHADES[n % len(SHADES)] for n, cause in enumerate(causes)}
    colours |= {OTHER: NOTE, SUPPORT: NOTE}
    shown = [
        _panel(noise, sum_groups(noise, group, stages), colours, what)
        for noise in noises
        for group, what in groups
    ]
    notes = [
        f"{noise.output}: along a beam that rises by {1e6 * noise.tilt:.3g} µrad"
        for noise in noises
        if noise.tilt
    ]
    outputs = ", ".join(noise.output for noise in noises)
    return panels.draw(f"Thermal noise of {outputs}", title, shown, notes=notes)


def _by_stage(source: str) -> str:
    return source.rpartition(".")[0] or SUPPORT


def _by_cause(source: str) -> str:
    return source.rpartition(".")[2].replace("-", ", ")


def sum_groups(
    noise: MotionNoise, group: Callable[[str], str], order: Sequence[str] = ()
) -> dict[str, Float[np.ndarray, " frequency"]]:
    """Sum amplitudes (f,) of sources by group; beyond `LINES`, the smallest groups become one."""
    square: dict[str, Float[np.ndarray, " frequency"]] = {}
    for source, density in zip(noise.source, noise.density, strict=True):
        if density.any():
            square[group(source)] = square.get(group(source), 0.0) + density
    place = [*order, *sorted(square), OTHER]
    if len(square) > LINES - 1:
        total = noise.density.sum(0)
        total = np.where(total > 0, total, 1.0)
        largest = sorted(square, key=lambda name: -float((square[name] / total).max()))
        square[OTHER] = sum((square.pop(name) for name in largest[LINES - 2 :]), np.zeros(()))
    return {name: np.sqrt(square[name]) for name in sorted(square, key=place.index)}


def _panel(
    noise: MotionNoise,
    parts: dict[str, Float[np.ndarray, " frequency"]],
    colours: dict[str, str],
    what: str,
) -> Panel:
    """Make the panel of a sum and its parts."""
    total = noise.amplitude
    lines = [Line(noise.frequency, total, "sum", INK, {"linewidth": 2.2, "zorder": 2})]
    for n, (name, amplitude) in enumerate(parts.items()):
        look: LineLook = {"linestyle": panels.DASHES[n % len(panels.DASHES)]}
        lines.append(Line(noise.frequency, amplitude, name, colours[name], look))
    label = f"{single_line(noise.output, 30)} ({noise.unit}/√Hz)"
    return Panel(label, lines, scale="log", limits=curves.limit_spectrum(total), title=what)
