"""Which responses of a block rounding may have spoilt, told from a few frequencies for all.

Solving (K + i omega C - omega^2 M) x = b in doubles leaves an error of some roundings of

    n = |D^-1| (|K| + omega |C| + omega^2 |M|) |x|

(Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., section 7.2), a size that has no zeros and changes slowly but
near the poles.  So it is worked out on a grid that closes in on each pole, and between two of its frequencies taken as the larger of
both; a response that is found to be small against it is to be refined, and so is whatever lies closer to a pole than the grid.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from suspension_cli.design.scene import Array
from suspension_cli.mechanics.condensed import Block
from suspension_cli.mechanics.stacks import inverse

DOUBT = 3000.0
"""n against a response above which that is refined, where elimination by itself loses nothing.

Three roundings of n are then within 1e-12; mostly less than half of one is lost, and at most 1.7 were seen (on a processor without fused
multiply-add).
"""
DECADE = 24
"""Frequencies a decade."""
NEAR = np.geomspace(3e-5, 0.3, 9)
"""Relative distances from a pole at which the grid has frequencies."""
HOPELESS = 1e100
"""Stands for n between the two frequencies that enclose a pole."""


@dataclass(frozen=True)
class Table:
    """Sizes of what is rounded, on a grid.

    Attributes
    ----------
    edge : (e,) array
        rad/s, ascending.
    size : (c, s, 6 + c) array
        n of each coordinate, between a frequency and another, for unit motions of the support and unit forces on the coordinates.
    place : (e - 1,) int array
        Which of these s holds between each frequency and the next.
    growth : (e - 1,) array
        By how much elimination makes more of that (`elimination.Factors`).
    """

    edge: Array
    size: Any
    place: Any
    growth: Any

    def limit(self, rows: Any, moves: Any, pushed: Any, *, grown: bool) -> Any:
        """Below what (o, i, e - 1) linear forms (o, c) are in doubt, for inputs told by motions (6, i) and forces (c, i).

        Growth is counted if `grown`; else it is left to be measured.
        """
        inputs, used = np.abs(np.concatenate([moves, pushed])), np.flatnonzero(rows.any(0))
        size = self.size[used[0] : used[0] + 1] if len(used) == 1 else self.size[used]
        felt = (np.abs(rows[:, used]) / DOUBT) @ (size @ inputs).reshape(len(used), -1)
        felt = felt.reshape(len(rows), -1, inputs.shape[1]).swapaxes(1, 2)[..., self.place]
        return felt * self.growth if grown else felt

    def cell(self, omega: Array) -> Any:
        """Between which of the grid's frequencies and the next some ascending ones lie."""
        place = omega.searchsorted(self.edge)
        place[0], place[-1] = 0, len(omega)
        return np.arange(len(self.edge) - 1).repeat(place[1:] - place[:-1])


def table(block: Block, low: float, high: float, *, carried: bool) -> Table:
    """The table of a block between two frequencies (rad/s)."""
    key, span = (Table, carried), (low, high)
    if key not in block.kept or block.kept[key][0] != span:  # the last is kept, for calls that repeat
        # n has its peaks at the resonances alone; what elimination makes of it has more, and is quicker to work out
        coarse = _edges(block.resonances, low, high)
        edge = coarse if low == high else np.union1d(coarse, _edges(np.concatenate([block.parts, _crossings(block)]), low, high))
        size = _sizes(block, coarse, carried=carried)
        size = np.maximum(size[:-1], size[1:])
        size[_enclosing(coarse, block.resonances)] = HOPELESS
        place = np.minimum(np.searchsorted(coarse, edge[:-1], side="right") - 1, len(size) - 1)
        growth = block.measured(edge, np.inf).growth
        growth = np.nan_to_num(np.maximum(growth[:-1], growth[1:]), nan=HOPELESS, posinf=HOPELESS)
        growth[_enclosing(edge, block.parts)] = HOPELESS
        block.kept[key] = span, Table(edge, np.ascontiguousarray(np.swapaxes(size, 0, 1)), place, growth)
    return block.kept[key][1]


def _edges(poles: Array, low: float, high: float) -> Array:
    """Evenly in the logarithm, and closing in on each pole; at least two, both ends among them."""
    start = max(low, high * 1e-9)
    if start == high:
        return np.array([low, high])
    base = np.geomspace(start, high, int(DECADE * np.log10(high / start)) + 2)
    near = (poles[:, None] * np.concatenate([1 - NEAR, 1 + NEAR])).ravel()
    return np.unique(np.concatenate([[low], base[1:-1], near[(near > low) & (near < high)], [high]]))


def _crossings(block: Block) -> Array:
    """Zeros of D's diagonal, rad/s."""
    return np.array([np.sqrt(k / m) for piece in block.own for k, m in zip(np.diag(piece.stiffness.real), np.diag(piece.mass), strict=True) if k > 0 and m > 0])


def _enclosing(edge: Array, poles: Array) -> Any:
    """Between which frequencies of the grid and the next there are poles."""
    inside = poles[(poles >= edge[0]) & (poles <= edge[-1])]
    return np.clip(np.searchsorted(edge, inside) - 1, 0, len(edge) - 2)


def _sizes(block: Block, edge: Array, *, carried: bool) -> Any:
    """n at the grid's frequencies, (e, c, 6 + c)."""
    omega = edge[:, None, None]
    count = len(block.keep)
    dynamic = block.stiffness - omega**2 * block.mass
    rounded = np.abs(block.stiffness) + omega**2 * np.abs(block.mass)
    if block.damping.any():
        dynamic, rounded = dynamic + 1j * omega * block.damping, rounded + omega * np.abs(block.damping)
    with np.errstate(divide="ignore", invalid="ignore"):  # a grid point on a pole to the last bit
        inverted = np.nan_to_num(np.moveaxis(inverse(np.moveaxis(dynamic[..., 6:], 0, -1)), -1, 0), nan=HOPELESS, posinf=HOPELESS, neginf=-HOPELESS)
    push, drag = np.broadcast_to(np.eye(count), (len(edge), count, count)), -dynamic[..., :6]
    size = np.abs(push), rounded[..., :6]
    if carried:
        drag = drag - dynamic[..., 6:] @ block.settled
        size = size[0], np.abs(drag)
    found = np.abs(inverted @ np.concatenate([drag, push], axis=-1))
    result = np.abs(inverted) @ (rounded[..., 6:] @ found + np.concatenate([size[1], size[0]], axis=-1))
    if carried:
        result[..., :6] += np.abs(block.settled)
    return np.nan_to_num(result, nan=HOPELESS, posinf=HOPELESS)
