"""Undamped modes of a batch of linear systems, block by block."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.linear import eigenmodes, graded_eigenvalues
from suspension_cli.linear.system import LinearSystem
from suspension_cli.scene.arrays import Index

if TYPE_CHECKING:
    from jaxtyping import Float


@dataclass(frozen=True)
class Spectrum:
    """Modes of a batch of p systems, each in ascending order of omega^2.

    Attributes
    ----------
    omega_squared
        (rad/s)^2; negative for an unstable mode, exactly 0 for a rigid one.
    shape
        L^T v with the mass matrix M = L L^T: rows are orthonormal, and where M is diagonal their
        squares are fractions of the kinetic energy. 0 for coordinates without inertia.
    """

    omega_squared: Float[np.ndarray, "build mode"]
    shape: Float[np.ndarray, "build mode coordinate"]


def solve(model: LinearSystem) -> Spectrum:
    """Solve for the undamped modes of a batch with one axis, each independent of the others."""
    condensed = model
    if model.separated is not None:
        from suspension_cli.linear import compiled  # takes half a second

        condensed = compiled.without_tips(model)
    count, size = len(model.stiffness), model.size
    mass = np.broadcast_to(model.mass, model.stiffness.shape)
    nonzero = np.packbits((mass != 0) | (model.stiffness != 0), axis=-1).reshape(count, -1)
    patterns, number = np.unique(nonzero, axis=0, return_inverse=True)
    rank = int((~model.massless[6:]).sum())
    result = Spectrum(np.empty((count, rank)), np.zeros((count, rank, size - 6)))
    for n in range(len(patterns)):  # systems of one pattern have the same blocks
        members = number.ravel() == n
        part = replace(
            model,
            mass=mass[members],
            stiffness=model.stiffness[members],
            damping=np.zeros((size, size)),
            lossy=None,
            separated=None,
        )
        # condensing the tips leaves rounding errors between blocks; those of `part` ignore them
        own = replace(part, stiffness=condensed.stiffness[members])
        result.omega_squared[members], result.shape[members] = _solve_blocks(
            own, part.blocks, loops=model.separated is not None
        )
    return result


def _solve_blocks(
    model: LinearSystem, blocks: tuple[Index, ...], *, loops: bool
) -> tuple[Float[np.ndarray, "build mode"], Float[np.ndarray, "build mode coordinate"]]:
    values, shapes = [], []
    tension = graded_eigenvalues.TURNING * graded_eigenvalues.softest_translation(model)
    for block in blocks:
        kept, mass, stiffness, _ = eigenmodes.condense_block(model, block)
        if not len(kept):
            continue
        squares, vectors = graded_eigenvalues.solve_batch(mass, stiffness, tension, loops=loops)
        close = np.diff(squares, axis=-1) <= eigenmodes.DEGENERATE * np.abs(squares[:, 1:])
        for n in np.flatnonzero(close.any(-1)):
            vectors[n] = eigenmodes.localise(squares[n], vectors[n])
        full = np.zeros((len(squares), squares.shape[1], model.size))
        full[..., kept] = np.swapaxes(vectors, -1, -2)
        values.append(squares)
        shapes.append(full)
    omega_squared = np.concatenate(values, axis=1)
    order = np.argsort(omega_squared, axis=1, kind="stable")
    shape = np.concatenate(shapes, axis=1) @ model.basis.T
    return np.take_along_axis(omega_squared, order, 1), np.take_along_axis(
        shape, order[..., None], 1
    )[..., 6:]


def solve_one(model: LinearSystem) -> Spectrum:
    """Solve for the modes of one system, as a batch of one."""
    return solve(replace(model, mass=model.mass[None], stiffness=model.stiffness[None]))
