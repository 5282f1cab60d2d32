"""Iterative refinement of single responses, with residuals of some 32 digits.

A solution x of D x = b has lost digits near a pole, and where what is asked for is small against what it is the difference of.
With the residual r = b - D x in twofold arithmetic, x + D^-1 r has them again, although D^-1 is as inexact as it was for x; the next
step starts from the digits so gained (Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., chapter 12).
Here every system is one input at one frequency, so that only those that need it are worked on.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from suspension_cli.design.scene import Array
from suspension_cli.mechanics.condensed import Block
from suspension_cli.mechanics.elimination import Factors
from suspension_cli.mechanics.packed import Packed
from suspension_cli.mechanics.twofold import Halved, Twofold, two_sum

STEPS = 5
"""At most; beside a lossless pole to the last bit no number of steps helps."""
ENOUGH = 1e-7
"""Relative change of every coordinate that is the last one needed: the next is smaller by the same factor again."""
TINY = np.finfo(float).tiny
SYSTEMS = 512
"""Worked on at once, so that they stay in the cache."""


@dataclass(frozen=True)
class Equations:
    """D as real rows that each hold only what is not 0, against everything it may multiply.

    The columns stand for v = (s, x), then omega^2 v where there is mass, then omega v where there is damping; x as its real and imaginary
    parts if `split`.

    Attributes
    ----------
    column : (w, r) int array
    factor : Halved of (w, r, 1) arrays
    heavy, damped : slices or (h,), (d,) int arrays
        Which of v have mass and damping.
    split : bool
    """

    column: Any
    factor: Halved
    heavy: Any
    damped: Any
    split: bool

    def residual(self, omega: Array, moves: Any, pushed: Any, x: Twofold) -> Any:
        """b - D x, rounded (r, P), for support motions (6, P) and forces (c, P)."""
        v, whole = Twofold(np.concatenate([moves, x.high]), np.concatenate([np.zeros_like(moves), x.low])), Halved.of(Twofold.of(omega))
        powers = [v, Halved.of(v[self.heavy]) * Halved.of(whole * whole)]
        if self.split:
            powers.append(Halved.of(v[self.damped]) * whole)
        moved = (self.factor * Halved.of(Twofold.stacked(powers)).take(self.column)).summed()
        force = np.concatenate([pushed.real, pushed.imag]) if self.split else pushed
        return (force - moved.high) - moved.low


def equations(block: Block) -> Equations:
    """The equations of a block, worked out once."""
    if Equations not in block.kept:
        block.kept[Equations] = _equations(block)
    return block.kept[Equations]


def _equations(block: Block) -> Equations:
    nothing = np.zeros_like(block.mass)
    split = bool(block.damping.any()) or np.iscomplexobj(block.stiffness)
    parts = [
        (_rows(block.stiffness.real, block.stiffness.imag, split=split), _rows(block.stiffness_low.real, block.stiffness_low.imag, split=split)),
        (_rows(-block.mass, nothing, split=split), _rows(-block.mass_low, nothing, split=split)),
        (_rows(nothing, block.damping, split=split), _rows(nothing, block.damping_low, split=split)),
    ]
    used = [np.arange(parts[0][0].shape[1]), *(np.flatnonzero(high.any(0)) for high, _ in parts[1:])]
    high, low = (np.concatenate([part[n][:, columns] for part, columns in zip(parts, used, strict=True)], axis=1) for n in (0, 1))
    width = 1 << int(np.ceil(np.log2(max((high != 0).sum(1).max(initial=0), 1))))  # sums are taken in pairs
    width = min(width, high.shape[1])
    column = np.argsort(high == 0, axis=1, kind="stable")[:, :width]  # what is not 0 first
    factor = Twofold(*(np.ascontiguousarray(np.take_along_axis(part, column, 1).T)[..., None] for part in (high, low)))
    return Equations(np.ascontiguousarray(column.T), Halved.of(factor), _sliced(used[1]), _sliced(used[2]), split)


def _sliced(which: Any) -> Any:
    """Numbers as a slice if they follow each other."""
    return slice(which[0], which[-1] + 1) if len(which) and which[-1] - which[0] + 1 == len(which) else which


def _rows(real: Any, imag: Any, *, split: bool) -> Any:
    """A complex matrix (c, 6 + c) on (s, x) as real rows, s being real."""
    return np.block([[real, -imag[:, 6:]], [imag, real[:, 6:]]]) if split else real


def refined(block: Block, factors: Factors | Packed, which: Any, omega: Array, moves: Any, pushed: Any, x: Any) -> tuple[Twofold, Twofold | None]:
    """Coordinates of single systems, each one input at one frequency.

    Parameters
    ----------
    block : Block
    factors : Factors
        Of the block at frequencies among which are these.
    which : (P,) int array
        Which of those these are.
    omega : (P,) array
        rad/s.
    moves, pushed : (6, P), (c, P) arrays
        Motions of the support, and forces on the coordinates.
    x : (c, P) array
        As found so far.

    Returns
    -------
    real, imag : Twofold of (c, P) arrays
        The imaginary part None if all is real.
    """
    given, count = equations(block), len(x)
    parts = []
    for start in range(0, len(omega), SYSTEMS):
        now = slice(start, start + SYSTEMS)
        parts.append(_refined(block, given, factors.some(which[now]), omega[now], moves[:, now], pushed[:, now], x[:, now]))
    found = parts[0]
    if len(parts) > 1:
        found = Twofold(*(np.concatenate([getattr(part, name) for part in parts], axis=1) for name in ("high", "low")))
    return (found[:count], found[count:]) if given.split else (found, None)


def _refined(block: Block, given: Equations, factors: Factors | Packed, omega: Array, moves: Any, pushed: Any, x: Any) -> Twofold:
    count = len(x)
    found = Twofold.of(np.concatenate([x.real, x.imag]) if given.split else x)
    left, size = slice(None), np.inf
    for _ in range(STEPS):
        rest = given.residual(omega, moves, pushed, found[:, left])
        step: Any = block.corrected(factors, rest[:count] + 1j * rest[count:] if given.split else rest)
        change = (np.abs(step) / np.maximum(_size(found.high[:, left], count), TINY)).max(0)
        better = change < size
        if not better.all():  # a step that grows, or is no number, leads nowhere
            step = np.where(better, step, 0.0)
        high, low = two_sum(found.high[:, left], np.concatenate([step.real, step.imag]) if given.split else step)
        found.high[:, left], found.low[:, left] = high, found.low[:, left] + low
        again = (better & (change > ENOUGH)).nonzero()[0]
        if not len(again):
            break
        left = again if isinstance(left, slice) else left[again]
        size, factors = change[again], factors.some(again)
        omega, moves, pushed = omega[again], moves[:, again], pushed[:, again]
    return found


def _size(x: Any, count: int) -> Any:
    """Magnitudes of coordinates (c, P) that may be split."""
    return np.abs(x) if len(x) == count else np.hypot(x[:count], x[count:])
