"""Undamped modes of a batch of linear systems, block by block."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.linear import batches, eigenmodes, graded_eigenvalues
from suspension_cli.linear.system import LinearSystem
from suspension_cli.scene.arrays import Index

if TYPE_CHECKING:
    from jaxtyping import Float

WIDE = 1e-6
"""Fraction of the largest omega^2 below which an eigenvalue solver has errors above 1e-9: the modes
of a tower on an inverted pendulum would be off by 4e-8."""


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
    keep = np.flatnonzero(~model.massless[6:]) + 6
    condensed = np.zeros_like(model.stiffness)
    condensed[:, keep[:, None], keep] = batches.condensed_stiffness(model, keep)
    count, size = len(model.stiffness), model.size
    mass = np.broadcast_to(model.mass, model.stiffness.shape)
    nonzero = np.packbits((mass != 0) | (model.stiffness != 0), axis=-1).reshape(count, -1)
    patterns, number = np.unique(nonzero, axis=0, return_inverse=True)
    result = Spectrum(np.empty((count, len(keep))), np.zeros((count, len(keep), size - 6)))
    for n in range(len(patterns)):  # systems of one pattern have the same blocks
        members = number.ravel() == n
        undamped = np.zeros((size, size))
        one = replace(model, mass=mass[members], stiffness=model.stiffness[members])
        blocks = replace(one, damping=undamped, lossy=None, terms=()).blocks
        # condensing the tips leaves rounding errors between blocks
        found = _solve_blocks(replace(one, stiffness=condensed[members]), blocks)
        result.omega_squared[members], result.shape[members] = found
    return result


def _solve_blocks(
    model: LinearSystem, blocks: tuple[Index, ...]
) -> tuple[Float[np.ndarray, "build mode"], Float[np.ndarray, "build mode coordinate"]]:
    values, shapes = [], []
    tension = largest_from_tension(model)
    for block in blocks:
        kept = block[~model.massless[block]]
        if not len(kept):
            continue
        mass, stiffness = (part[:, kept[:, None], kept] for part in (model.mass, model.stiffness))
        squares, vectors = solve_matrices(mass, stiffness, tension)
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


def largest_from_tension(model: LinearSystem) -> Float[np.ndarray, " build"]:
    """Bound on the omega^2 of a rotation from tension alone, (rad/s)^2."""
    return graded_eigenvalues.TURNING * graded_eigenvalues.softest_translation(model)


def solve_matrices(
    mass: Float[np.ndarray, "build coordinate coordinate"],
    stiffness: Float[np.ndarray, "build coordinate coordinate"],
    tension: Float[np.ndarray, " build"],
) -> tuple[Float[np.ndarray, "build mode"], Float[np.ndarray, "build coordinate mode"]]:
    """Solve for eigenvalues and orthonormal vectors L^T v, M = L L^T.

    NaN where a matrix is not finite. Only systems with modes that are `WIDE` apart are solved again
    (`graded_eigenvalues`); for these, `tension` is `largest_from_tension`.
    """
    dynamic = batches.scaled_by_mass(mass, stiffness)
    failed = ~np.isfinite(dynamic).all((1, 2))
    dynamic[failed] = np.eye(mass.shape[-1])
    values, vectors = np.linalg.eigh(dynamic)
    size = np.abs(values)
    wide = size.min(-1) < WIDE * size.max(-1)
    if wide.any():
        resolved, shapes = graded_eigenvalues.solve(mass[wide], stiffness[wide])
        error = graded_eigenvalues.rounding(stiffness[wide], np.swapaxes(shapes, -1, -2))
        values[wide] = graded_eigenvalues.rigid(resolved, error, tension[wide])
        vectors[wide] = np.swapaxes(np.linalg.cholesky(mass[wide]), -1, -2) @ shapes
    values[failed] = np.nan
    return values, vectors


def solve_one(model: LinearSystem) -> Spectrum:
    """Solve for the modes of one system, as a batch of one."""
    mass, stiffness = model.mass[None], model.stiffness[None]
    return solve(replace(model, mass=mass, stiffness=stiffness, stretched=None))
