"""Bode plots of frequency responses."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from suspension_cli.drawing import curves
from suspension_cli.drawing.style import LineLook, house_style, stage_colours
from suspension_cli.linear.response import Response

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Inexact
    from matplotlib.typing import LineStyleType

PANEL, PHASE = 2.3, 1.3
"""Heights of a panel of magnitudes and of that of phases, in."""
ENDLESS = 3e6
"""Ratio of the highest point of a peak to the response around it, from which it is infinite."""
NEAR = 3e-4
"""Relative distance from an infinite peak beyond which points set the limits of the axis."""
MOST = 12
"""Largest number of curves with labels of peaks and slopes."""


def draw(response: Response, title: str, scale: str = "db", stages: Sequence[str] = ()) -> Figure:
    """Draw magnitudes, a panel per unit, and unwrapped phases against frequency.

    Curves have the colours of the stages of their outputs. `scale` is "db" (20 log10 of the SI
    value) or "absolute" (on a log axis).
    """
    pairs = [(o, i) for o in range(len(response.output)) for i in range(len(response.input))]
    units = list(dict.fromkeys(response.unit[o][i] for o, i in pairs))
    own = [[pair for pair in pairs if response.unit[pair[0]][pair[1]] == unit] for unit in units]
    many = len(pairs) > 1
    with house_style():
        keys = [[_name(response, *pair) for pair in part] if many else [] for part in own]
        rooms = [curves.key_room(key) + curves.PEAKS + 0.05 for key in keys]
        figure, panels = curves.stack_panels([PANEL] * len(units) + [PHASE], [*rooms, 0.12])
        looks = _looks(response, pairs, stages)
        logarithmic = response.frequency[0] > 0 and len(response.frequency) > 1
        panels[0].set_xscale("log" if logarithmic else "linear")
        for axes, unit, part, key in zip(panels, units, own, keys, strict=False):
            _draw_magnitudes(axes, response, part, looks, scale)
            axes.set_ylabel(label_magnitude(unit, scale == "db"))
            samples: list[tuple[str, str, LineLook]] = [
                (name, looks[pair][0], {"linestyle": looks[pair][1]})
                for name, pair in zip(key, part, strict=False)
            ]
            curves.write_key(axes, samples, above=curves.PEAKS)
            if not any(response.value[:, o, i].any() for o, i in part):
                say_zero(axes, response.frequency)
        for o, i in pairs:
            phase = curves.unwrap_phase(response.value[:, o, i])
            colour, dashes = looks[o, i]
            panels[-1].plot(response.frequency, phase, color=colour, linestyle=dashes)
        panels[-1].set_ylabel("phase (degrees)")
        panels[-1].set_xlabel("frequency (Hz)")
        curves.label_phases(panels[-1])
        if not response.value.any():
            panels[-1].set_yticks([])
        figure.align_ylabels(panels)
        loops = ", loops closed" if response.closed_loop else ""
        one = f"Transfer function {_name(response, 0, 0)}" if not many else "Transfer functions"
        curves.write_heading(figure, one + loops, title)
        return figure


def say_zero(axes: Axes, frequency: Float[np.ndarray, " frequency"]) -> None:
    """Say that all responses of a panel are 0."""
    axes.set_yticks([])
    if len(frequency) > 1:
        axes.set_xlim(frequency[0], frequency[-1])
    words = "0 by symmetry at all frequencies"
    place = {"transform": axes.transAxes, "ha": "center", "va": "center"}
    axes.text(0.5, 0.5, words, bbox={"color": "white"}, **place)


def _name(response: Response, o: int, i: int) -> str:
    zero = "" if response.value[:, o, i].any() else " = 0 by symmetry"
    return f"{response.output[o]} / {response.input[i]}{zero}"


def _looks(
    response: Response, pairs: Sequence[tuple[int, int]], stages: Sequence[str]
) -> dict[tuple[int, int], tuple[str, LineStyleType]]:
    """Colour of each pair's output stage, and dashes that distinguish pairs of one colour."""
    body = [body_of(output) for output in response.output]
    colours = stage_colours([*stages, *body])
    looks: dict[tuple[int, int], tuple[str, LineStyleType]] = {}
    for o, i in pairs:
        colour = colours[body[o]]
        before = sum(one == colour for one, _ in looks.values())
        looks[o, i] = colour, curves.DASHES[before % len(curves.DASHES)]
    return looks


def body_of(signal: str) -> str:
    """Body of a signal: ``test`` of ``test.x@0,0,0.001``."""
    return signal.partition("@")[0].rpartition(".")[0]


def _draw_magnitudes(
    axes: Axes,
    response: Response,
    pairs: Sequence[tuple[int, int]],
    looks: dict[tuple[int, int], tuple[str, LineStyleType]],
    scale: str,
) -> None:
    frequency, lines, peaks, levels = response.frequency, [], [], []
    for o, i in pairs:
        (colour, dashes), value = looks[o, i], response.value[:, o, i]
        name, size = _name(response, o, i), np.abs(value)
        drawn = draw_magnitude(axes, frequency, value, scale, colour, name, dashes)
        lines.append((size, drawn, colour))
        tops, around = find_tops(frequency, size)
        peaks += [(frequency[top], drawn[top], remark) for top, remark in tops]
        levels.append(lowest_and_highest(drawn[around]))
    low, high = find_limits(levels, scale == "db")
    if low < high:
        axes.set_ylim(low, high)
    peaks = [(at, min(level, high), remark) for at, level, remark in peaks]
    if scale != "db":
        curves.label_plainly(axes.yaxis)
    if len(frequency) > 1 and frequency[0] > 0 and len(pairs) <= MOST:
        curves.label_peaks(axes, peaks)
        for size, drawn, colour in lines:
            curves.label_slopes(axes, frequency, size, drawn, colour)


def find_tops(
    frequency: Float[np.ndarray, " frequency"], size: Float[np.ndarray, " frequency"]
) -> tuple[list[tuple[int, str]], Bool[np.ndarray, " frequency"]]:
    """Find the peaks of a magnitude, and which points are not beside an infinite one.

    Each peak has its index and a remark: " ∞" if it is infinite.
    """
    tops, around = [], np.ones(len(size), dtype=bool)
    for top in curves.find_peaks(size).tolist():
        at = frequency[top]
        beyond = np.abs(frequency / at - 1) > NEAR
        beside = np.interp(at * (1 + NEAR), frequency, size)
        endless = bool(beyond.any() and size[top] > ENDLESS * beside)
        around &= beyond | (not endless)
        tops.append((top, " ∞" if endless else ""))
    return tops, around


def lowest_and_highest(drawn: Float[np.ndarray, " frequency"]) -> tuple[float, float]:
    """Smallest and largest finite value."""
    finite = drawn[np.isfinite(drawn)]
    return (float(finite.min()), float(finite.max())) if len(finite) else (np.nan, np.nan)


def find_limits(levels: Sequence[tuple[float, float]], decibels: bool) -> tuple[float, float]:
    """Limits of the magnitude axis."""
    found = np.array(levels)
    if np.isnan(found).all():
        return 0.0, 0.0
    low, high = np.nanmin(found), np.nanmax(found)
    if not decibels:
        low, high = 20 * np.log10([low, high])
    span = max(high - low, 6.0)
    low, high = low - 0.04 * span, high + 0.04 * span
    return (low, high) if decibels else (10 ** (low / 20), 10 ** (high / 20))


def draw_magnitude(
    axes: Axes,
    frequency: Float[np.ndarray, " frequency"],
    value: Inexact[np.ndarray, " frequency"],
    scale: str,
    colour: str,
    label: str,
    dashes: LineStyleType = "-",
) -> Float[np.ndarray, " frequency"]:
    """Draw the magnitude of one response; exact zeros are left out. Returns the ordinates."""
    size = np.where(value == 0, np.nan, np.abs(value))
    drawn = 20 * np.log10(size) if scale == "db" else size
    if scale != "db":
        axes.set_yscale("log")
    mark = "o" if len(frequency) == 1 else ""
    axes.plot(frequency, drawn, color=colour, label=label, linestyle=dashes, marker=mark)
    return drawn


def label_magnitude(unit: str, decibels: bool) -> str:
    """Label of an axis of magnitudes with its unit."""
    if decibels:
        return "magnitude (dB)" if unit in ("m/m", "") else f"magnitude (dB re 1 {unit})"
    return f"magnitude ({unit})" if unit else "magnitude"
