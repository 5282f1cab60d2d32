"""What a block answers to inputs at many frequencies, each response to nearly all the digits of a double.

The bulk is solved in doubles, all frequencies at once; of that, what rounding may have spoilt (`doubt`) is solved again (`refinement`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from suspension_cli.design.scene import Array
from suspension_cli.mechanics.condensed import Block
from suspension_cli.mechanics.doubt import Table, table
from suspension_cli.mechanics.elimination import LIGHT
from suspension_cli.mechanics.refinement import refined
from suspension_cli.mechanics.twofold import Twofold

MANY = 4
"""Inputs for which it is quicker to measure at each frequency what elimination loses, and solve densely where that is much, than to refine."""
CHUNK = 1 << 18
"""Numbers (coordinates times inputs times frequencies) worked on at once: few enough to stay in the cache."""


@dataclass(frozen=True)
class Asked:
    """What is asked of a block.

    Attributes
    ----------
    seen : (o, c) array
        Outputs as linear forms of the coordinates.
    moves, pushed : (6, i), (c, i) arrays
        Inputs as motions of the support and forces on the coordinates.
    """

    seen: Any
    moves: Any
    pushed: Any


def answers(block: Block, omega: Array, wanted: Asked) -> Iterator[tuple[slice, list[Any], Any]]:
    """Responses, range by range of ascending frequencies.

    Yields
    ------
    now : slice
        Of the frequencies.
    values : list of (i, f) arrays
        Of each output; they may share memory.
    finite : (f,) bool array
        Where there is a response.
    """
    slow = int(omega.searchsorted(block.resonances[0] if len(block.resonances) else np.inf)) if _left_behind(block, wanted) else 0
    step = min(max(CHUNK // max(len(block.keep) * wanted.moves.shape[1], 1), 256), 4096)
    for first, last, carried in ((0, slow, True), (slow, len(omega), False)):
        if first == last:
            continue
        bounds = table(block, omega[first], omega[last - 1], carried=carried)
        limit = bounds.limit(wanted.seen, wanted.moves, wanted.pushed, grown=wanted.moves.shape[1] < MANY)
        for start in range(first, last, step):
            now = slice(start, min(start + step, last))
            yield now, *_answers(block, omega[now], wanted, bounds, limit, carried=carried)


def _left_behind(block: Block, wanted: Asked) -> bool:
    """Whether some output does not just follow a slow support one to one, so that it is a small part of what moves."""
    moved = wanted.moves.any(0)
    if not moved.any():
        return False
    moves = wanted.moves[:, moved]
    if moves[3:5].any() or ((moves != 0).sum(0) > 1).any():
        return True
    return bool((np.abs(wanted.seen @ (block.settled @ moves)) < 0.5).any())


def _answers(block: Block, omega: Array, wanted: Asked, bounds: Table, limit: Any, *, carried: bool) -> tuple[list[Any], Any]:
    if wanted.moves.shape[1] < MANY:
        factors, growth = block.factored(omega), None
    else:
        factors = block.measured(omega, LIGHT)
        growth = factors.growth
    x = block.solve(factors, omega, wanted.moves, wanted.pushed, carried=carried)
    values = [_combined(form, x) for form in wanted.seen]
    bad = _doubtful(values, limit, bounds.cell(omega), growth)
    where = bad.nonzero()
    if len(where[0]):
        better = refined(block, factors, where[1], omega[where[1]], wanted.moves[:, where[0]], wanted.pushed[:, where[0]], x[:, *where])
        for n, form in enumerate(wanted.seen):
            values[n] = _with(values[n], where, form, better)
    finite = np.isfinite(values[0]).all(0)
    for value in values[1:]:
        finite &= np.isfinite(value).all(0)
    return values, finite


def _doubtful(values: list[Any], limit: Any, cell: Any, growth: Any) -> Any:
    """Which responses (i, f) are small against what was rounded for them, for any output."""
    bad = np.zeros((limit.shape[1], len(cell)), dtype=bool)
    bound, size, found = np.empty(bad.shape), np.empty(bad.shape), np.empty(bad.shape, dtype=bool)
    for value, one in zip(values, limit, strict=True):
        np.take(one, cell, axis=1, out=bound, mode="clip")
        if growth is not None:
            bound *= growth
        np.less(np.abs(value, out=size), bound, out=found)
        bad |= found
    return bad


def _combined(form: Array, x: Any) -> Any:
    """A linear form (c,) of coordinates (c, i, f); just the coordinate where it is one."""
    chosen = form.nonzero()[0]
    if len(chosen) == 1 and form[chosen[0]] == 1.0:
        return x[chosen[0]]
    return sum(form[c] * x[c] for c in chosen)


def _with(value: Any, where: Any, form: Any, better: tuple[Twofold, Twofold | None]) -> Any:
    """Responses (i, f) with those of single systems put in their places, combined in twofold."""
    real, imag = better
    found = _form(form, real)
    if imag is not None:
        found = found + 1j * _form(form, imag)
    value[where] = found
    return value


def _form(form: Any, x: Twofold) -> Any:
    """A linear form (c,) of coordinates (c, P)."""
    chosen = form.nonzero()[0]
    if len(chosen) == 1 and form[chosen[0]] == 1.0:
        return x.high[chosen[0]] + x.low[chosen[0]]
    return (Twofold.of(form[None, chosen, None]) * x[None, chosen]).total().value[0]
