"""Figure of thermal noise: amplitude spectral densities of the sum, by stage and by cause."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from suspension_cli.analyses.thermal.solve import Thermal
from suspension_cli.design.losses.registry import MECHANISMS
from suspension_cli.drawing import curves
from suspension_cli.drawing.style import (
    INK,
    NOTE,
    LineLook,
    house_style,
    single_line,
    stage_colours,
)

if TYPE_CHECKING:
    from jaxtyping import Float

HEIGHT = 2.3
"""Height of a panel, in."""
LINES = 7
"""Largest number of lines in a panel: the sum, the largest parts, and the others together."""
ROOM = (30.0, 3.0)
"""Factors of room below the lowest sum and above the highest."""
DECADES = 20
"""Largest number of decades in a panel."""
OTHER, SUPPORT = "other", "whole suspension"
"""Names of the sum of small parts, and of sources that belong to no stage."""

CAUSES: dict[str, str] = {
    "bending-upper": "bending, upper ends",
    "bending-lower": "bending, lower ends",
    "stretching": "stretching",
    "torsion": "torsion",
    "blades": "blades",
    "springs": "springs",
    "link": "links",
    "gas": "gas",
    "damping": "dampers",
    "support": "support",
} | {own.cause: own.cause for own in MECHANISMS if own.cause}
"""Label of each cause."""
SHADES = ("#332288", "#cc6677", "#117733", "#88ccee", "#999933", "#aa4499", "#44aa99", "#ddaa33")
"""Colours of causes, in their order, which are not those of stages (Tol 2021, muted)."""


def draw(noises: list[Thermal], title: str, stages: Sequence[str] = ()) -> Figure:
    """Draw two panels per motion: the sum with its parts by stage, and by cause."""
    with house_style():
        parts = [(by_stage(noise, stages), by_cause(noise)) for noise in noises]
        colours = stage_colours([*stages, *(name for one, _ in parts for name in one)])
        colours |= {OTHER: NOTE, SUPPORT: NOTE}
        shades = {
            label: SHADES[n % len(SHADES)] for n, label in enumerate(dict.fromkeys(CAUSES.values()))
        }
        shades[OTHER] = NOTE
        keys = [
            [_look(name, n, found) for n, name in enumerate(["sum", *one], -1)]
            for both in parts
            for one, found in zip(both, (colours, shades), strict=True)
        ]
        rooms = [curves.key_room([name for name, *_ in key]) + 0.3 for key in keys]
        notes = [
            f"{noise.output}: along a beam that rises by {1e6 * noise.tilt:.3g} µrad"
            for noise in noises
            if noise.tilt
        ]
        foot = 0.45 + 0.13 * len(notes)
        figure, panels = curves.stack_panels([HEIGHT] * len(rooms), rooms, bottom=foot)
        for n, (noise, (own, causes)) in enumerate(zip(noises, parts, strict=True)):
            _panel(panels[2 * n], noise, own, keys[2 * n], "by stage")
            _panel(panels[2 * n + 1], noise, causes, keys[2 * n + 1], "by cause")
        panels[-1].set_xlabel("frequency (Hz)")
        figure.align_ylabels(panels)
        outputs = ", ".join(noise.output for noise in noises)
        curves.write_heading(figure, f"Thermal noise of {outputs}", title)
        for n, note in enumerate(notes):
            at = (foot - 0.42 - 0.13 * n) / figure.get_figheight()
            figure.text(0.02, at, textwrap.shorten(note, 78), va="top", fontsize=7.5, color=NOTE)
        return figure


def by_stage(noise: Thermal, stages: Sequence[str]) -> dict[str, Float[np.ndarray, " frequency"]]:
    """Sum amplitudes (f,) by stage, in the order of the stages."""
    order = {name: n for n, name in enumerate(stages)}
    found = _sum_groups(noise, lambda source: source.rpartition(".")[0] or SUPPORT)
    return dict(sorted(found.items(), key=lambda one: order.get(one[0], len(order))))


def by_cause(noise: Thermal) -> dict[str, Float[np.ndarray, " frequency"]]:
    """Sum amplitudes (f,) by cause, in the order of `CAUSES`."""
    order = [*CAUSES.values(), OTHER]
    found = _sum_groups(noise, lambda source: CAUSES[source.rpartition(".")[2]])
    return dict(sorted(found.items(), key=lambda one: order.index(one[0])))


def _sum_groups(
    noise: Thermal, group: Callable[[str], str]
) -> dict[str, Float[np.ndarray, " frequency"]]:
    """Sum sources by group; beyond `LINES` lines, the smallest groups become one."""
    square: dict[str, Float[np.ndarray, " frequency"]] = {}
    for source, density in zip(noise.source, noise.density, strict=True):
        name = group(source)
        square[name] = square.get(name, 0.0) + density
    if len(square) > LINES - 1:
        total = noise.density.sum(0)
        total = np.where(total > 0, total, 1.0)
        largest = sorted(square, key=lambda name: -float((square[name] / total).max()))
        square[OTHER] = sum((square.pop(name) for name in largest[LINES - 2 :]), np.zeros(()))
    return {name: np.sqrt(density) for name, density in square.items()}


def _look(name: str, n: int, colours: dict[str, str]) -> tuple[str, str, LineLook]:
    """Name, colour and look of a line; the sum has number -1."""
    if n < 0:
        return name, INK, {"linewidth": 2.2, "zorder": 2}
    dashes = curves.DASHES[n % len(curves.DASHES)]
    return name, colours[name], {"linestyle": dashes, "linewidth": 1.0}


def _panel(
    axes: Axes,
    noise: Thermal,
    parts: dict[str, Float[np.ndarray, " frequency"]],
    key: Sequence[tuple[str, str, LineLook]],
    what: str,
) -> None:
    mark = "" if len(noise.frequency) > 1 else "o"
    frequency, total = noise.frequency, noise.amplitude
    for amplitude, (_, colour, look) in zip([total, *parts.values()], key, strict=True):
        part = np.where(amplitude > 0, amplitude, np.nan)
        marked: LineLook = {"marker": mark, "markersize": 3, **look}
        axes.loglog(frequency, part, color=colour, **marked)
    top = total.max() * ROOM[1]
    axes.set_ylim(max(total[total > 0].min() / ROOM[0], top / 10**DECADES), top)
    axes.set_ylabel(f"{single_line(noise.output, 30)} ({noise.unit}/√Hz)")
    room = curves.key_room([name for name, *_ in key])
    axes.set_title(what, loc="left", fontsize=8, color=INK, pad=72 * room + 2)
    curves.label_plainly(axes.yaxis)
    curves.write_key(axes, key)
