"""Where modes asked for by their labels share a motion with another mode, or have no frequency."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.sweep.solve import SweepResult, has_modes
from suspension_cli.linear import mode_content
from suspension_cli.linear.mode_content import Content

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int

MOST = 4
"""Places listed of each mode at most."""


@dataclass(frozen=True)
class Labelled:
    """A result that is a mode asked for by its label, at all points of a grid.

    Attributes
    ----------
    curve
        Number of the nominal mode that has become this one, followed by shape; -1 if none.
    value, other
        Frequencies of the mode and of the one with most of the motion beside it, Hz; or NaN.
    """

    name: str
    content: Content
    curve: Int[np.ndarray, "*axes"]
    value: Float[np.ndarray, "*axes"]
    other: Float[np.ndarray, "*axes"]
    other_curve: Int[np.ndarray, "*axes"]

    @property
    def shared(self) -> Bool[np.ndarray, "*axes"]:
        """Whether two modes with frequencies share the motion at each point."""
        return self.content.shared & np.isfinite(self.value) & np.isfinite(self.other)

    def exchanges(self, axis: int) -> Bool[np.ndarray, "*axes"]:
        """Whether it passes to another mode between each point and the next along an axis.

        One element less along this axis.
        """
        known = np.where(np.isfinite(self.value), self.curve, -1)
        here, there = (np.moveaxis(known, axis, 0)[part] for part in (slice(-1), slice(1, None)))
        return np.moveaxis((here >= 0) & (there >= 0) & (here != there), 0, axis)

    @property
    def curves(self) -> list[int]:
        """Nominal modes that it is at some point, or shares the motion with; none if one alone."""
        every = np.concatenate([self.curve.ravel(), self.other_curve[self.shared]])
        found = np.unique(every[every >= 0]).tolist()
        return found if len(found) > 1 else []

    @property
    def touched(self) -> Bool[np.ndarray, "*axes"]:
        """Points at which the motion is shared, or beside which it passes to another mode."""
        result = self.shared
        for axis in range(result.ndim):
            passes = self.exchanges(axis)
            none = [(0, 0)] * result.ndim
            before = [*none[:axis], (0, 1), *none[axis + 1 :]]
            after = [*none[:axis], (1, 0), *none[axis + 1 :]]
            result = result | np.pad(passes, before) | np.pad(passes, after)
        return result


def labelled(swept: SweepResult) -> dict[int, Labelled]:
    """Results that are modes asked for by their labels, by their number."""
    found = {}
    for number, name in enumerate(swept.result):
        content = swept.content(name)
        if content is None or swept.rank is None or swept.omega_squared is None:
            continue
        curves = [_curve(swept.rank, mode) for mode in (content.mode, content.other)]
        other = mode_content.frequencies(swept.omega_squared, content.other.astype(np.intp))
        value = swept.value[..., number]
        found[number] = Labelled(name, content, curves[0], value, other, curves[1])
    return found


def _curve(
    rank: Int[np.ndarray, "*axes mode"], mode: Int[np.ndarray, "*axes"]
) -> Int[np.ndarray, "*axes"]:
    """Nominal mode that has become a mode of each point."""
    same = rank == mode[..., None]
    return np.where((mode >= 0) & same.any(-1), same.argmax(-1), -1)


def remarks(swept: SweepResult) -> Iterator[str]:
    """Say where each mode shares its motion, passes to another mode, or has no frequency."""
    for one in labelled(swept).values():
        yield from _shares(swept, one)
        solved = has_modes(swept.status)
        without = solved & (one.content.mode < 0)
        grows = solved & (one.content.mode >= 0) & np.isnan(one.value)
        for places, why in ((grows, "its mode grows"), (without, "no mode is mostly this motion")):
            if places.any():
                yield f"{one.name} has no frequency {_where(swept, places)}: {why}"


def _shares(swept: SweepResult, one: Labelled) -> Iterator[str]:
    touched = one.touched
    if not touched.any():
        return
    if touched.ndim > 1:
        most = np.where(touched, one.content.ratio, -1.0)
        at = np.unravel_index(int(most.argmax()), most.shape)
        yield f"two modes share {one.name} {_where(swept, touched)}; {_both(swept, one, at)}"
        return
    runs = _runs(touched, one)
    for first, last in runs[:MOST]:
        ratio = one.content.ratio[first : last + 1]
        at = (first + int(np.nanargmax(ratio)),)
        passes = one.exchanges(0)[first:last].any()
        how = "share this motion and exchange character" if passes else "share this motion"
        yield f"{one.name}: two modes {how} {_range(swept, first, last)}; {_both(swept, one, at)}"
    if len(runs) > MOST:
        yield f"{one.name}: shared in {len(runs) - MOST} further places"


def _runs(touched: Bool[np.ndarray, " point"], one: Labelled) -> list[tuple[int, int]]:
    """First and last points of places at which modes share the motion, or exchange it."""
    joined = (one.shared[:-1] & one.shared[1:]) | one.exchanges(0)
    numbers = np.flatnonzero(touched)
    apart = [n for n, (k, m) in enumerate(zip(numbers, numbers[1:], strict=False), 1)
             if m != k + 1 or not joined[k]]  # fmt: skip
    return [(int(run[0]), int(run[-1])) for run in np.split(numbers, apart)]


def _both(swept: SweepResult, one: Labelled, at: tuple[int | np.intp, ...]) -> str:
    """Frequencies and fractions of both modes at a point."""
    fractions = one.content.fraction[at], one.content.other_fraction[at]
    first, second = (f"{100 * fraction:.0f}" for fraction in fractions)
    place = ", ".join(
        f"{axis.name} = {axis.values[k]:.4g}" for axis, k in zip(swept.axes, at, strict=True)
    )
    return (
        f"at {place} they have {one.value[at]:.5g} and {one.other[at]:.5g} Hz, with {first} and"
        f" {second} % of their kinetic energy in it"
    )


def _range(swept: SweepResult, first: int, last: int) -> str:
    axis = swept.axes[0]
    low, high = axis.values[first], axis.values[last]
    if first == last:
        return f"at {axis.name} = {low:.4g}"
    return f"between {axis.name} = {low:.4g} and {high:.4g}"


def _where(swept: SweepResult, places: Bool[np.ndarray, "*axes"]) -> str:
    """Ranges of the parameters at some points, and the number of these."""
    ranges = []
    for axis, numbers in zip(swept.axes, np.nonzero(places), strict=True):
        own = np.array(axis.values)[numbers]
        low, high = own.min(), own.max()
        ranges.append(
            f"{axis.name} = {low:.4g}"
            if low == high
            else f"{axis.name} from {low:.4g} to {high:.4g}"
        )
    return f"at {places.sum()} of {places.size} points, {', '.join(ranges)}"
