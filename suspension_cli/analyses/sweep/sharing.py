"""Where modes asked for by labels share a motion with another mode; where results have no value."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.sweep.followed_modes import has_modes
from suspension_cli.analyses.sweep.solve import Sweep
from suspension_cli.files.mapped_arrays import blocks
from suspension_cli.linear import mode_content
from suspension_cli.linear.mode_content import Content
from suspension_cli.studies import builds

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int

MOST = 4
"""Places listed of each mode at most."""


@dataclass(frozen=True)
class Labelled:
    """A result that is a mode asked for by its label, at all points of a grid.

    Shapes, which are most of a large file, are read in blocks.

    Attributes
    ----------
    value
        Frequency of the mode, Hz; or NaN.
    shapes, rank, squared
        Of all modes of each point, see `Sweep`.
    """

    name: str
    content: Content
    value: Float[np.ndarray, "*axes"]
    shapes: Float[np.ndarray, "*axes mode coordinate"]
    rank: Int[np.ndarray, "*axes nominal"]
    squared: Float[np.ndarray, "*axes mode"]

    @cached_property
    def other(self) -> Float[np.ndarray, "*axes"]:
        """Frequency of the mode with most of the motion beside it, Hz; or NaN."""
        found = np.empty(self.value.shape)
        for part in blocks(self.squared):
            place = self.content.other[part].astype(np.intp)
            found[part] = mode_content.frequencies(self.squared[part], place)
        return found

    @property
    def shared(self) -> Bool[np.ndarray, "*axes"]:
        """Whether two modes with frequencies share the motion at each point."""
        return self.content.shared & np.isfinite(self.value) & np.isfinite(self.other)

    def exchanges(self, axis: int) -> Bool[np.ndarray, "*axes"]:
        """Whether it passes to another mode between each point and the next along an axis.

        The shapes of both are then more different than equal. One element less along this axis.
        """
        lengths = list(self.value.shape)
        lengths[axis] -= 1
        found = np.zeros(lengths, dtype=bool)
        beyond = int(axis == 0)  # a block needs the first point of the next one
        for part in blocks(self.shapes):
            wider = slice(part.start, part.stop + beyond)
            shape = np.moveaxis(self._shape(wider), axis, 0)
            known = np.moveaxis(np.isfinite(self.value[wider]), axis, 0)
            overlap = (shape[:-1] * shape[1:]).sum(-1) ** 2
            passes = known[:-1] & known[1:] & (overlap < 0.5)
            found[part] = np.moveaxis(passes, 0, axis)
        return found

    def _shape(self, part: slice) -> Float[np.ndarray, "*axes coordinate"]:
        """Shape of the mode at some points, as in `batch_modes.Spectrum`."""
        own = np.maximum(self.content.mode[part].astype(np.intp), 0)[..., None, None]
        return np.take_along_axis(self.shapes[part], own, -2)[..., 0, :].astype(float)

    @property
    def curves(self) -> list[int]:
        """Nominal modes that share the motion somewhere, followed by shape; none if one alone."""
        touched = self.touched
        rank = self.rank[touched]
        content = self.content
        every = [_curve(rank, place[touched]) for place in (content.mode, content.other)]
        numbers = np.concatenate(every)
        return np.unique(numbers[numbers >= 0]).tolist()

    @cached_property
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


def labelled(swept: Sweep) -> dict[int, Labelled]:
    """Results that are modes asked for by their labels, by their number."""
    found: dict[int, Labelled] = {}
    rank = swept.rank
    squared = swept.omega_squared
    for number, name in enumerate(swept.result):
        content = swept.content(name)
        if content is None or rank is None or squared is None or swept.shape is None:
            continue
        value = swept.value[..., number]
        found[number] = Labelled(name, content, value, swept.shape, rank, squared)
    return found


def _curve(
    rank: Int[np.ndarray, "point nominal"], mode: Int[np.ndarray, " point"]
) -> Int[np.ndarray, " point"]:
    """Number of the nominal mode that has become a mode of each point; -1 if none."""
    same = rank == mode[..., None]
    return np.where((mode >= 0) & same.any(-1), same.argmax(-1), -1)


def remarks(swept: Sweep) -> Iterator[str]:
    """Say where each mode shares its motion, passes to another mode, or has no frequency.

    And at how many points that hang other results have no value.
    """
    for one in labelled(swept).values():
        yield from _shares(swept, one)
        solved = has_modes(swept.status)
        without = solved & (one.content.mode < 0)
        grows = solved & (one.content.mode >= 0) & np.isnan(one.value)
        for places, why in ((grows, "its mode grows"), (without, "no mode is mostly this motion")):
            if places.any():
                yield f"{one.name} has no frequency {_where(swept, places)}: {why}"
    yield from _lacking(swept)


def _lacking(swept: Sweep) -> Iterator[str]:
    """Say where quantities other than modes have no value, though the design is in a steady state.

    Modes that are followed have none where they grow, which the status of a point says.
    """
    for n, name in enumerate(swept.result):
        if swept.missing is None or swept.degree[n]:
            continue
        places = (swept.status == builds.GOOD) & np.isnan(swept.value[..., n])
        infinite = np.isinf(swept.value[..., n])
        if places.any():
            yield f"{name} has no value {_where(swept, places)}: the design {swept.missing[n]}"
        if infinite.any():
            yield f"{name} is infinite {_where(swept, infinite)}"


def _shares(swept: Sweep, one: Labelled) -> Iterator[str]:
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
    pairs = itertools.pairwise(numbers.tolist())
    starts = [n for n, (k, m) in enumerate(pairs, 1) if m != k + 1 or not joined[k]]
    return [(int(run[0]), int(run[-1])) for run in np.split(numbers, starts)]


def _both(swept: Sweep, one: Labelled, at: tuple[int | np.intp, ...]) -> str:
    """Frequencies and fractions of both modes at a point."""
    first = f"{100 * one.content.fraction[at]:.0f}"
    second = f"{100 * one.content.other_fraction[at]:.0f}"
    place = ", ".join(
        f"{axis.name} = {axis.values[k]:.4g}" for axis, k in zip(swept.axes, at, strict=True)
    )
    return (
        f"at {place} they have {one.value[at]:.5g} and {one.other[at]:.5g} Hz, with {first} and"
        f" {second} % of their kinetic energy in it"
    )


def _range(swept: Sweep, first: int, last: int) -> str:
    axis = swept.axes[0]
    low = axis.values[first]
    high = axis.values[last]
    if first == last:
        return f"at {axis.name} = {low:.4g}"
    return f"between {axis.name} = {low:.4g} and {high:.4g}"


def _where(swept: Sweep, places: Bool[np.ndarray, "*axes"]) -> str:
    """Ranges of the parameters at some points, and the number of these."""
    ranges = []
    for axis, numbers in zip(swept.axes, np.nonzero(places), strict=True):
        own = np.array(axis.values)[numbers]
        low = own.min()
        high = own.max()
        ranges.append(
            f"{axis.name} = {low:.4g}"
            if low == high
            else f"{axis.name} from {low:.4g} to {high:.4g}"
        )
    return f"at {places.sum()} of {places.size} points, {', '.join(ranges)}"
