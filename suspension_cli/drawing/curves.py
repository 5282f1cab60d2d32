"""Curves and their axes: ordinates, limits, peaks; plain numbers on logarithmic axes, heat maps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm, Normalize
from matplotlib.ticker import Formatter, LogLocator, MaxNLocator, NullFormatter

from suspension_cli.drawing.style import PALE, RAISED, SMALL, figure_of, format_raised, text_width

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Int
    from numpy.typing import ArrayLike

    from suspension_cli.scene.arrays import Array

PROMINENT = 2.0
"""Factor by which a peak must exceed the valleys on both sides to be labelled."""
NEAR = 3e-4
"""Relative distance from an infinite peak within which points do not set the limits of the axis."""
ENDLESS = 3e6
"""Ratio of the highest point of a peak to the curve at the distance `NEAR`, from which the peak is
infinite."""
SPECTRUM = 30.0, 3.0, 1e20
"""Factors of room below and above a spectral density, and largest ratio on its axis."""
PLAIN = 0.9e-3, 1.1e4
"""Range in which a logarithmic axis has plain numbers, however long it is."""
LONG = 3.0
"""Decades from which an axis beyond this range has powers of ten alone."""
SHORT = ((0.6, (1, 1.5, 2, 3, 5, 7)), (2.0, (1, 2, 5)), (np.inf, (1,)))
"""Digits of the ticks of axes up to a length, decades."""
SIGNED = 8.0
"""Size of a value of either sign above which its axis is logarithmic."""
TICKS_APART = 0.08
"""Least distance between the labels of its ticks, in."""
NARROW = 1.5
"""Width of such an axis that has room for powers of ten alone, in."""
LOWEST_PHASE = -200.0
"""Lower end of axes of phases, degrees, so that a phase scattered about -180 stays together."""


def wrap(phase: Float[np.ndarray, "*shape"], low: float = LOWEST_PHASE) -> Array:
    """Shift phases by turns to between `low` and a turn above, degrees."""
    return np.round((phase - low) % 360.0 + low, 9)


def phase_line(
    x: Float[np.ndarray, " frequency"],
    value: Complex[np.ndarray, " frequency"],
    low: float = LOWEST_PHASE,
) -> tuple[Float[np.ndarray, " point"], Float[np.ndarray, " point"]]:
    """Abscissas and wrapped phase (degrees) of a response, with NaN where it jumps by a turn.

    >>> phase_line(np.arange(3.0), np.exp(1j * np.radians([100.0, 150.0, 200.0])))[1].tolist()
    [100.0, 150.0, nan, -160.0]
    """
    known = np.isfinite(value) & (value != 0)
    x = np.asarray(x)[known]
    phase = wrap(np.degrees(np.angle(np.asarray(value)[known])), low)
    jumps = 1 + np.flatnonzero(np.abs(np.diff(phase)) > 270.0)
    return np.insert(x, jumps, np.nan), np.insert(phase, jumps, np.nan)


def continuous_phase(value: Complex[np.ndarray, " frequency"]) -> Float[np.ndarray, " frequency"]:
    """Phase in degrees along a curve without jumps by a turn; it begins as `wrap` has it.

    >>> continuous_phase(np.exp(1j * np.radians([100.0, 150.0, 200.0, 250.0]))).round(6).tolist()
    [100.0, 150.0, 200.0, 250.0]
    """
    known = np.isfinite(value) & (value != 0)
    phase = np.full(len(value), np.nan)
    phase[known] = np.degrees(np.unwrap(np.angle(value[known])))
    first = phase[known][:1]
    return phase + (wrap(first) - first if len(first) else 0.0)


def limit_phases(phases: Sequence[ArrayLike]) -> tuple[float, float] | None:
    """Limits of an axis of continuous phases (degrees), with a little room around them."""
    every = np.concatenate([np.zeros(0), *(np.ravel(one) for one in phases)])
    every = every[np.isfinite(every)]
    return (float(every.min()) - 20.0, float(every.max()) + 20.0) if len(every) else None


def ordinates(values: Array, scale: str) -> Array:
    """Values on an axis of `panels.Scale`; NaN where a logarithm does not exist."""
    if scale == "phase":
        complexes = np.iscomplexobj(values)
        return wrap(np.degrees(np.angle(values))) if complexes else values
    if scale == "linear":
        return values.astype(float)
    size = np.abs(values) if np.iscomplexobj(values) else values.astype(float)
    size = np.where(size > 0, size, np.nan)
    return 20 * np.log10(size) if scale == "db" else size


def limit_sizes(size: Array, scale: str) -> tuple[float, float] | None:
    """Limits of an axis of magnitudes, "db" or "log", a little beyond them."""
    size = size[np.isfinite(size) & (size > 0)]
    if not len(size):
        return None
    low = 20 * np.log10(size.min())
    high = 20 * np.log10(size.max())
    room = 0.04 * max(high - low, 6.0)
    low = float(low - room)
    high = float(high + room)
    return (low, high) if scale == "db" else (10 ** (low / 20), 10 ** (high / 20))


def limit_spectrum(total: Array) -> tuple[float, float] | None:
    """Limits of an axis of spectral densities: those of the sum, with room for its parts."""
    total = total[np.isfinite(total) & (total > 0)]
    if not len(total):
        return None
    top = SPECTRUM[1] * float(total.max())
    return max(float(total.min()) / SPECTRUM[0], top / SPECTRUM[2]), top


def find_peaks(size: Float[np.ndarray, " frequency"]) -> Int[np.ndarray, " peak"]:
    """Indices of local maxima that exceed both valleys beside them, the most prominent last.

    >>> find_peaks(np.array([1.0, 9.0, 8.0, 8.5, 1.0, 4.0, 4.0, 4.0, 0.0])).tolist()
    [6, 1]
    """
    level = np.log(np.where(np.isfinite(size) & (size > 0), size, np.nan))
    level = np.nan_to_num(level, nan=np.nanmin(level, initial=0.0))
    starts = np.flatnonzero(np.diff(level, prepend=np.nan))
    middle = (starts + np.append(starts[1:], len(level)) - 1) // 2  # of equal neighbours
    level = level[starts]
    tops = 1 + np.flatnonzero((level[1:-1] > level[:-2]) & (level[1:-1] > level[2:]))
    left = _lowest_before(level, tops)
    right = _lowest_before(level[::-1], len(level) - 1 - tops[::-1])[::-1]
    prominence = level[tops] - np.maximum(left, right)
    order = np.argsort(prominence, kind="stable")
    return middle[tops[order[prominence[order] >= np.log(PROMINENT)]]]


def _lowest_before(
    level: Float[np.ndarray, " point"], tops: Int[np.ndarray, " peak"]
) -> Float[np.ndarray, " peak"]:
    """Lowest level between each of the local maxima and the last higher one before it.

    scipy.signal.find_peaks has the same, but its import takes as long as a whole response.
    """
    if not len(tops):
        return np.zeros(0)
    valleys = np.minimum.reduceat(level[: tops[-1]], np.append(0, tops[:-1]))
    lowest = []
    higher: list[tuple[float, float]] = []  # maxima that none exceeds yet, and their lowest
    for height, low in zip(level[tops].tolist(), valleys.tolist(), strict=True):
        while higher and higher[-1][0] <= height:
            low = min(low, higher.pop()[1])
        higher.append((height, low))
        lowest.append(low)
    return np.array(lowest)


def find_tops(
    frequency: Float[np.ndarray, " frequency"], size: Float[np.ndarray, " frequency"]
) -> tuple[list[tuple[int, str]], Bool[np.ndarray, " frequency"]]:
    """Find the peaks of a magnitude, and which points are not beside an infinite one.

    Each peak has its index and a remark: " ∞" if it is infinite.
    """
    tops = []
    around = np.isfinite(size)
    for top in find_peaks(size).tolist():
        beyond = np.abs(frequency / frequency[top] - 1) > NEAR
        beside = np.interp(frequency[top] * (1 + NEAR), frequency, size)
        endless = bool(beyond.any() and size[top] > ENDLESS * beside)
        around &= beyond | (not endless)
        tops.append((top, " ∞" if endless else ""))
    return tops, around


def unit_of_ratio(ratio: str) -> str:
    """Unit of a ratio of two motions.

    >>> unit_of_ratio("test.pitch/test.x@0,0,0.001")
    'rad/m'
    """
    names = [end.strip().split("@")[0].rpartition(".")[2] for end in ratio.split("/")[:2]]
    return "/".join("rad" if name in ("roll", "pitch", "yaw") else "m" for name in names)


class _Digits(LogLocator):
    """Ticks at 1, 10, 100; of a short axis also between."""

    def tick_values(self, vmin: float, vmax: float) -> Any:
        low, high = sorted((max(vmin, 1e-300), max(vmax, 1e-300)))
        if high < 2 * low:
            return MaxNLocator(5).tick_values(low, high)
        digits = next(digits for most, digits in SHORT if np.log10(high / low) <= most)
        self.set_params(subs=digits, numticks=9)
        return super().tick_values(vmin, vmax)


class _Plainly(Formatter):
    """Labels 0.1, 1, 10, or powers of ten where an axis is long."""

    def __call__(self, x: float, pos: int | None = None) -> str:
        low, high = sorted(np.abs(self.axis.get_view_interval()))  # type: ignore[union-attr]
        plain = low >= PLAIN[0] and high <= PLAIN[1]
        if plain or not low or np.log10(high / low) <= LONG or not x:
            return format_raised(x, 6)
        return f"10{str(round(np.log10(x))).translate(RAISED)}"


def label_plainly(axis: Axis) -> None:
    """Make an axis logarithmic with 0.1, 1, 10 as labels, or powers of ten if it is long."""
    (axis.axes.set_xscale if axis is axis.axes.xaxis else axis.axes.set_yscale)(
        "log", nonpositive="mask"
    )
    axis.set_major_locator(_Digits())
    axis.set_major_formatter(_Plainly())
    axis.set_minor_formatter(NullFormatter())


def label_signed(axes: Axes) -> None:
    """Make a long horizontal axis logarithmic on both sides of 0: 0, 1, 2, 10, more powers."""
    low, high = axes.get_xlim()
    largest = max(-low, high)
    if largest > SIGNED:
        decades = np.log10(largest)
        axes.set_xscale("symlog", linthresh=2.0, linscale=0.5 + 0.3 * decades)
        powers = 10.0 ** np.arange(np.floor(decades), 0, -np.ceil(decades / 3))
        narrow = axes.bbox.width / axes.figure.dpi < NARROW
        digits = powers[:1] if narrow else np.append([1.0, 2.0], powers)
        below = _with_end(axes, -digits, low) if low < 0 else np.zeros(0)
        above = _with_end(axes, digits, high) if high > 0 else np.zeros(0)
        axes.set_xticks([*below, 0.0, *above])
        fine = np.outer(10.0 ** np.arange(np.ceil(decades)), np.arange(2.0, 10.0)).ravel()
        axes.set_xticks([*-fine[fine <= -low], *fine[fine <= high]], minor=True)
    axes.xaxis.set_major_formatter(lambda x, _: format_raised(x, 6))


def _with_end(axes: Axes, ticks: Float[np.ndarray, " tick"], end: float) -> Array:
    """Add a round number near the end of a signed axis, if its label has room beyond the others.

    The ticks are on the side of the end, which has their sign.
    """
    inside = ticks[np.abs(ticks) <= abs(end)]
    last = inside[np.argmax(np.abs(inside))] if len(inside) else 0.0
    sizes = np.outer(10.0 ** np.arange(8), [1.0, 2.0, 5.0]).ravel()
    rounds = np.sign(end) * sizes[(sizes <= abs(end)) & (sizes > abs(last))]
    for candidate in rounds[::-1][:1]:
        left, right = (axes.transData.transform((at, 1.0))[0] for at in sorted((last, candidate)))
        texts = (format_raised(at, 6) for at in (last, candidate))
        if right - left > axes.figure.dpi * (max(map(text_width, texts)) + TICKS_APART):
            return np.append(inside, candidate)
    return inside


def rule(axes: Axes) -> None:
    """Draw a faint grid, and tick labels that are legible in a column of 8.5 cm."""
    axes.grid(visible=True, which="major", color=PALE, linewidth=0.4)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=SMALL)


def raise_power(axis: Axis) -> None:
    """Put the power of ten of small or large values into the unit of their axis: (10⁻³ m/m)."""
    top = float(np.abs(axis.get_view_interval()).max())
    if top and not 0.01 <= top < 1e4:
        power = int(np.floor(np.log10(top)))
        raised = f"(10{str(power).translate(RAISED)} "
        axis.set_label_text(axis.get_label_text().replace("(", raised))
        axis.set_major_formatter(lambda value, _: f"{value / 10.0**power:.6g}".replace("-", "−"))


def label_phases(axes: Axes, limits: tuple[float, float] | None = None) -> None:
    """Label a vertical axis of phases, by default of a turn, at multiples of 90 degrees or more."""
    low, high = limits or (LOWEST_PHASE, LOWEST_PHASE + 360.0)
    axes.set_ylim(low, high)
    step = 90 * max(1, round((high - low) / 450))
    ticks = np.arange(step * np.ceil(low / step), high, step)
    axes.set_yticks(ticks, [format_raised(tick, 6) for tick in ticks])


@dataclass(frozen=True)
class Tints:
    """Scale of colours: map, range, quantity with unit, labelled values (by default decades)."""

    map: str
    norm: Normalize
    label: str
    ticks: Sequence[float] = ()


def draw_table(axes: Axes, value: Float[np.ndarray, "row column"], tints: Tints) -> None:
    """Draw a coloured cell per value; NaN is empty. The axes have rows from the top down."""
    rows, columns = value.shape
    edges = (-0.5, columns - 0.5, rows - 0.5, -0.5)
    axes.imshow(value, norm=tints.norm, cmap=tints.map, aspect="auto", extent=edges)
    axes.tick_params(length=0)
    axes.grid(visible=False)
    axes.spines[:].set_visible(False)


def draw_bar(axes: Axes, tints: Tints) -> None:
    """Draw a horizontal colour bar that fills axes."""
    mappable = ScalarMappable(tints.norm, tints.map)
    bar = figure_of(axes).colorbar(mappable, cax=axes, orientation="horizontal")
    ticks = [*tints.ticks]
    if not ticks and isinstance(tints.norm, LogNorm):
        low = float(tints.norm.vmin or 0.0)
        high = float(tints.norm.vmax or 1.0)
        powers = np.arange(round(np.log10(low)), round(np.log10(high)) + 1)
        ticks = (10.0 ** powers[:: -max(1, -(-len(powers) // 5))]).tolist()
    bar.set_ticks(ticks, labels=[format_raised(tick) for tick in ticks])
    bar.minorticks_off()
    bar.ax.tick_params(length=2, pad=1.5)
    bar.outline.set_visible(False)
