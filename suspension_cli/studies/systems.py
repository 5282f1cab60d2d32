"""The systems of many builds, ready to be solved at any frequency."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from suspension_cli.conventions import FRAME, SUPPORT
from suspension_cli.linear.small_matrices import solve_each
from suspension_cli.linear.static_condensation import condense
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models.batch_terms import BatchTerm
from suspension_cli.scene.arrays import Array


@dataclass(frozen=True)
class Systems:
    """K + i omega C - omega^2 M of builds, massless undamped coordinates (blade tips) eliminated.

    Otherwise LU loses digits: the error of the vertical motion of an imperfect triple at 50 Hz is
    4e-11 with them and 1e-14 without.

    Attributes
    ----------
    keep, drop : (c,) and (m,) int arrays
        Coordinates of the model without the support's; bodies from the top down, blades with the
        stage that hangs on them.
    stiffness, mass, damping : (p, c, 6 + c) arrays
        With respect to the support's coordinates and their own.
    yielding, follow : (p, m, m), (p, m, 6 + c) arrays
        K_bb^-1 of the eliminated coordinates b, and K_bb^-1 times their stiffness against the rest.
    """

    keep: Any
    drop: Any
    stiffness: Any
    mass: Any
    damping: Any
    yielding: Any
    follow: Any

    @staticmethod
    def of(model: LinearSystem, which: Any, dispersive: Any = None) -> Systems:
        """The systems of some builds, with an added stiffness (p, N, N) if wires are dispersive."""
        owner, known = (
            [name.split(".", 1)[0] for name in model.coordinate],
            (SUPPORT, FRAME, *model.body),
        )
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
            return (
                constant if dispersive is None else constant + dispersive[:, rows[:, None], columns]
            )

        mass, damping = some(model.mass, keep, both), some(model.damping, keep, both)
        found = condense(stiff(order, np.concatenate([np.arange(6), order])), light)
        return Systems(
            keep - 6, drop - 6, found.matrix, mass, damping, found.compliance, found.follow
        )

    def solve(self, omega: Array, moves: Any, forces: Any) -> Any:
        """Coordinates (p, f, n, i), in the model's order, for motions (p, 6, i) of the support and
        forces (p, n, i).

        The frequencies are (f,) for all builds, or (p, f).
        """
        dynamic = self.stiffness[:, None] - (omega**2)[..., None, None] * self.mass[:, None]
        if self.damping.any():
            dynamic = dynamic + (1j * omega)[..., None, None] * self.damping[:, None]
        pushed = (
            forces[:, self.keep] - np.swapaxes(self.follow[..., 6:], -1, -2) @ forces[:, self.drop]
        )
        right = pushed[:, None] - dynamic[..., :6] @ moves[:, None]
        size = len(self.keep)
        kept = solve_each(
            dynamic[..., 6:].reshape(-1, size, size), right.reshape(-1, size, right.shape[-1])
        ).reshape(right.shape)
        result = np.empty(
            (*right.shape[:2], size + len(self.drop), right.shape[-1]), dtype=kept.dtype
        )
        result[:, :, self.keep] = kept
        given = np.concatenate(
            [np.broadcast_to(moves[:, None], (*right.shape[:2], *moves.shape[1:])), kept], axis=-2
        )
        result[:, :, self.drop] = (self.yielding @ forces[:, self.drop])[:, None] - self.follow[
            :, None
        ] @ given
        return result


def dispersive(
    model: LinearSystem,
    terms: tuple[BatchTerm, ...],
    which: Any,
    omega: Array,
    moves: Any,
    forces: Any,
) -> Any:
    """Coordinates (p, f, n, i) of builds with frequency-dependent terms, see `Systems.solve`."""
    every, each = np.repeat(which, len(omega)), np.tile(omega, len(which))
    added = np.zeros((len(every), model.size, model.size), dtype=complex)
    for term in terms:
        term.add(added, each, every)
    found = Systems.of(model, every, (added + np.swapaxes(added, -1, -2)) / 2).solve(
        each[:, None], moves[every], forces[every]
    )
    return found.reshape(len(which), len(omega), *found.shape[2:])
