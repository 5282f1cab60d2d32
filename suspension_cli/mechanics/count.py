"""How many modes lie below a frequency: the theorem of Wittrick and Williams, Q. J. Mech. Appl. Math. 24, 263 (1971).

Where wires have mass, the dynamic stiffness Z(omega) is no polynomial and its determinant has poles, so no search for zeros can know that
it has found all.  But the number of modes below omega is

    J(omega) = J_0(omega) + s(Z(omega)),

J_0 the resonances of all wires with both ends held, and s the number of negative eigenvalues of Z.  It is a whole number that only grows:
bisection finds each mode, near-degenerate pairs and modes that move no body included.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from suspension_cli.design.scene import Array
from suspension_cli.mechanics import dispersive
from suspension_cli.mechanics.dispersion import WireTerm
from suspension_cli.mechanics.model import LinearModel

GRID = 256
"""Frequencies at which the count is taken first."""
CHUNK = 256
"""Frequencies worked on at once."""


Progress = Callable[[int, int, float], None]
"""Called with (steps done, steps in all, steps per second)."""


def silent(_done: int, _all: int, _rate: float) -> None:
    """No progress is shown."""


def modes_below(model: LinearModel, omega: Array, step: Callable[[int], None] = lambda _: None) -> Any:
    """J (f,) at frequencies (f,), rad/s above 0; `step` is called with the number of frequencies done since its last call."""
    total = np.zeros(len(omega), dtype=int)
    for start in range(0, len(omega), CHUNK):
        now = slice(start, start + CHUNK)
        total[now] = _below(model, omega[now])
        step(len(omega[now]))
    return total


def _below(model: LinearModel, omega: Array) -> Any:
    total = np.zeros(len(omega), dtype=int)
    for term in model.terms:
        if isinstance(term, WireTerm):
            total += len(term.forms["twist"]) * term.strand.resonances_below(omega)
    for block in dispersive.blocks(model):
        matrix = np.moveaxis(block.at(omega, lossy=False).matrix[:, 6:], -1, 0)
        count = len(block.keep)
        size = dispersive.sizes(np.diagonal(matrix, axis1=-2, axis2=-1), np.abs(matrix[:, count:, :count]))
        total += (np.linalg.eigvalsh(matrix / (size[:, :, None] * size[:, None, :])) < 0).sum(-1)  # signs survive scaling (Sylvester)
        total -= (np.diagonal(matrix[:, count:, count:], axis1=-2, axis2=-1) < 0).sum(-1)
    return total


def frequencies(model: LinearModel, highest: float, lowest: float, progress: Progress = silent) -> Array:
    """All modes between two frequencies, ascending, each as often as it is degenerate: (m,) in rad/s.

    Bisected until no number lies between.

    Parameters
    ----------
    model : LinearModel
        On `violin`.
    highest, lowest : float
        rad/s, above 0.
    progress : callable
        Called with (steps done, steps in all, steps per second).
    """
    grid = np.geomspace(lowest, highest, GRID)
    counts = np.maximum.accumulate(modes_below(model, grid))
    number = np.arange(counts[0] + 1, counts[-1] + 1)
    above = np.searchsorted(counts, number)
    low, high = grid[above - 1], grid[above]
    halvings = np.ceil(np.log2(np.maximum((high - low) / np.spacing(high), 1.0))) + 1
    began, done, expected, share = time.monotonic(), 0.0, int(halvings.sum()), 1.0

    def step(number: int) -> None:
        nonlocal done
        done = min(done + number * share, expected)
        progress(int(done), expected, done / max(time.monotonic() - began, 1e-9))

    while True:
        middle = (low + high) / 2
        open_ = (middle > low) & (middle < high)
        if not open_.any():
            return high
        unique, where = np.unique(middle[open_], return_inverse=True)
        share = len(where) / len(unique)
        passed = modes_below(model, unique, step)[where] >= number[open_]
        high[open_] = np.where(passed, middle[open_], high[open_])
        low[open_] = np.where(passed, low[open_], middle[open_])
