"""Number of modes below a frequency, by the Wittrick-Williams theorem.

With massive wires the determinant of the dynamic stiffness Z(omega) has poles, so a search for its
zeros may miss some. The number of modes below omega, however, is

    J(omega) = J_0(omega) + s(Z(omega)),

with J_0 the number of resonances below omega of all wires clamped at both ends and s the number of
negative eigenvalues of Z (Wittrick and Williams, Q. J. Mech. Appl. Math. 24, 263, 1971). It is an
integer that never decreases, so bisection finds each mode, including near-degenerate pairs and
modes that move no body.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.linear.frequency_terms import WireTerm
from suspension_cli.linear.pencil import Pencil
from suspension_cli.linear.system import LinearSystem

if TYPE_CHECKING:
    from jaxtyping import Float, Int

GRID = 256
"""Frequencies of the initial count."""
CHUNK = 256
"""Frequencies computed at once."""
BALANCED = 3
"""Times that rows and columns are divided by the roots of their largest elements."""

Progress = Callable[[int, int, float], None]
"""Called with (steps done, total steps, steps per second)."""


def silent(_done: int, _all: int, _rate: float) -> None:
    """Report no progress."""


def modes_below(
    model: LinearSystem,
    omega: Float[np.ndarray, " frequency"],
    step: Callable[[int], None] = lambda _: None,
) -> Int[np.ndarray, " frequency"]:
    """Count the modes below frequencies in rad/s, above 0.

    `step` is called with the number of frequencies done since the last call.
    """
    total = np.zeros(len(omega), dtype=int)
    for start in range(0, len(omega), CHUNK):
        span = slice(start, start + CHUNK)
        total[span] = _count_below(model, omega[span])
        step(len(omega[span]))
    return total


def _count_below(
    model: LinearSystem, omega: Float[np.ndarray, " frequency"]
) -> Int[np.ndarray, " frequency"]:
    total = np.zeros(len(omega), dtype=int)
    for term in model.terms:
        if isinstance(term, WireTerm):
            total += len(term.forms["twist"]) * term.strand.resonances_below(omega)
    pencil = Pencil.of(model)
    there = pencil.at(omega, lossy=False)
    for block in pencil.blocks:
        matrix, tensions = np.moveaxis(block.at(there).matrix[:, 6:], -1, 0), len(block.keep)
        # scaling does not change the signs of eigenvalues (Sylvester)
        for _ in range(BALANCED):
            size = np.abs(matrix).max(-1)
            scale = 1 / np.sqrt(np.where(size > 0, size, 1.0))
            matrix = matrix * scale[:, :, None] * scale[:, None, :]
        total += (np.linalg.eigvalsh(matrix) < 0).sum(-1)
        total -= (np.diagonal(matrix, axis1=1, axis2=2)[:, tensions:] < 0).sum(-1)
    return total


def frequencies(
    model: LinearSystem, highest: float, lowest: float, progress: Progress = silent
) -> Float[np.ndarray, " mode"]:
    """Find all modes between two frequencies > 0 by bisection to the last bit, in rad/s.

    Ascending; a degenerate frequency is repeated. For a system with massive wires (violin model).
    """
    grid = np.geomspace(lowest, highest, GRID)
    counts = np.maximum.accumulate(modes_below(model, grid))
    number = np.arange(counts[0] + 1, counts[-1] + 1)
    upper = np.searchsorted(counts, number)
    low, high = grid[upper - 1], grid[upper]
    halvings = np.ceil(np.log2(np.maximum((high - low) / np.spacing(high), 1.0))) + 1
    started, done, expected, repeats = time.monotonic(), 0.0, int(halvings.sum()), 1.0

    def step(number: int) -> None:
        nonlocal done
        done = min(done + number * repeats, expected)
        progress(int(done), expected, done / max(time.monotonic() - started, 1e-9))

    while True:
        middle = (low + high) / 2
        unresolved = (middle > low) & (middle < high)
        if not unresolved.any():
            return high
        unique, where = np.unique(middle[unresolved], return_inverse=True)
        repeats = len(where) / len(unique)
        is_reached = modes_below(model, unique, step)[where] >= number[unresolved]
        high[unresolved] = np.where(is_reached, middle[unresolved], high[unresolved])
        low[unresolved] = np.where(is_reached, low[unresolved], middle[unresolved])
