"""The systems of many builds, ready to be solved at any frequency."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from suspension_cli.conventions import SUPPORT
from suspension_cli.design.scene import Array
from suspension_cli.mechanics.assorted import Assorted
from suspension_cli.mechanics.model import LinearModel


@dataclass(frozen=True)
class Systems:
    """K + i omega C - omega^2 M of builds without the coordinates that have neither mass nor damping (tips of blades).

    With them LU loses digits: 4e-11 of the vertical motion of an imperfect triple at 50 Hz, without 1e-14.

    Attributes
    ----------
    keep, drop : (c,) and (m,) int arrays
        Coordinates of the model, the support's left out; bodies from the top down, blades with the stage that hangs on them.
    stiffness, mass, damping : (p, c, 6 + c) arrays
        Against the support's coordinates and their own.
    yielding, follow : (p, m, m), (p, m, 6 + c) arrays
        K_bb^-1 of the coordinates dropped, and K_bb^-1 times their stiffness against the others.
    """

    keep: Any
    drop: Any
    stiffness: Any
    mass: Any
    damping: Any
    yielding: Any
    follow: Any

    @staticmethod
    def of(model: LinearModel, which: Any, dispersive: Any = None) -> Systems:
        """The systems of some builds; of wires that bend with what depends on frequency, (p, N, N), at one frequency."""
        owner, known = [name.split(".", 1)[0] for name in model.coordinate], (SUPPORT, "frame", *model.body)
        order = np.argsort([known.index(name) for name in owner], kind="stable")[6:]
        damped = (model.damping != 0).any(-1).reshape(-1, model.size).any(0)
        light = (model.massless & ~damped)[order]
        keep, drop = order[~light], order[light]
        both = np.concatenate([np.arange(6), keep])

        def some(matrix: Any, rows: Any, columns: Any) -> Any:
            whole = np.broadcast_to(matrix, (*model.batch, model.size, model.size))
            return whole[which[:, None, None], rows[:, None], columns]

        full = model.stiffness if model.lossy is None else model.lossy

        def stiff(rows: Any, columns: Any) -> Any:
            constant = some(full, rows, columns)
            return constant if dispersive is None else constant + dispersive[:, rows[:, None], columns]

        stiffness, mass, damping = stiff(keep, both), some(model.mass, keep, both), some(model.damping, keep, both)
        yielding = solved(stiff(drop, drop), np.eye(len(drop)))
        follow = yielding @ stiff(drop, both)
        if len(drop):
            stiffness = stiffness - stiff(keep, drop) @ follow
            stiffness[..., 6:] = (stiffness[..., 6:] + np.swapaxes(stiffness[..., 6:], -1, -2)) / 2
        return Systems(keep - 6, drop - 6, stiffness, mass, damping, yielding, follow)

    def solve(self, omega: Array, moves: Any, forces: Any) -> Any:
        """Coordinates (p, f, n, i), in the model's order, for motions (p, 6, i) of the support and forces (p, n, i).

        At the same frequencies (f,) for all, or at (p, f).
        """
        dynamic = self.stiffness[:, None] - (omega**2)[..., None, None] * self.mass[:, None]
        if self.damping.any():
            dynamic = dynamic + (1j * omega)[..., None, None] * self.damping[:, None]
        pushed = forces[:, self.keep] - np.swapaxes(self.follow[..., 6:], -1, -2) @ forces[:, self.drop]
        right = pushed[:, None] - dynamic[..., :6] @ moves[:, None]
        size = len(self.keep)
        kept = solved(dynamic[..., 6:].reshape(-1, size, size), right.reshape(-1, size, right.shape[-1])).reshape(right.shape)
        result = np.empty((*right.shape[:2], size + len(self.drop), right.shape[-1]), dtype=kept.dtype)
        result[:, :, self.keep] = kept
        given = np.concatenate([np.broadcast_to(moves[:, None], (*right.shape[:2], *moves.shape[1:])), kept], axis=-2)
        result[:, :, self.drop] = (self.yielding @ forces[:, self.drop])[:, None] - self.follow[:, None] @ given
        return result


def dispersive(model: LinearModel, terms: tuple[Assorted, ...], which: Any, omega: Array, moves: Any, forces: Any) -> Any:
    """Coordinates (p, f, n, i) of some builds as `Systems.solve` gives them, where terms depend on frequency (f,)."""
    every, each = np.repeat(which, len(omega)), np.tile(omega, len(which))
    added = np.zeros((len(every), model.size, model.size), dtype=complex)
    for term in terms:
        term.add(added, each, every)
    found = Systems.of(model, every, (added + np.swapaxes(added, -1, -2)) / 2).solve(each[:, None], moves[every], forces[every])
    return found.reshape(len(which), len(omega), *found.shape[2:])


def solved(matrix: Any, right: Any) -> Any:
    """Solutions (p, n, i) of systems (p, n, n); a singular one gives NaN and does not touch the others."""
    try:
        return np.linalg.solve(matrix, right)
    except np.linalg.LinAlgError:
        if matrix.ndim == 2:
            return np.full(right.shape, np.nan)
        return np.stack([solved(m, r) for m, r in zip(matrix, np.broadcast_to(right, (len(matrix), *right.shape[-2:])), strict=True)])
