"""Modes of many models at once, block by block, with the shapes by which they are followed from one design to the next."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from suspension_cli.analysis import graded, modes
from suspension_cli.design.scene import Array
from suspension_cli.mechanics.model import LinearModel


@dataclass(frozen=True)
class Spectrum:
    """Modes of a batch of models, each in ascending order of omega^2.

    Attributes
    ----------
    omega_squared : (p, m) array
        (rad/s)^2; negative for an unstable mode, exactly 0 for a rigid one.
    shape : (p, m, N - 6) array
        L^T v for the mass matrix M = L L^T: rows are orthonormal, and squares are shares of kinetic energy where M is diagonal.
        0 for coordinates without inertia.
    """

    omega_squared: Array
    shape: Array


def solve(model: LinearModel) -> Spectrum:
    """Modes of a batch with one axis; what a model gets does not depend on the others.

    Parameters
    ----------
    model : LinearModel
        Damping and loss do not count.
    """
    count, size = len(model.stiffness), model.size
    mass = np.broadcast_to(model.mass, model.stiffness.shape)
    joined = np.packbits((mass != 0) | (model.stiffness != 0), axis=-1).reshape(count, -1)
    kinds, which = np.unique(joined, axis=0, return_inverse=True)
    rank = int((~model.massless[6:]).sum())
    result = Spectrum(np.empty((count, rank)), np.zeros((count, rank, size - 6)))
    for kind in range(len(kinds)):  # models of one pattern have the same blocks
        here = which.ravel() == kind
        some = replace(model, mass=mass[here], stiffness=model.stiffness[here], damping=np.zeros((size, size)), lossy=None)
        result.omega_squared[here], result.shape[here] = _of_one_pattern(some)
    return result


def _of_one_pattern(model: LinearModel) -> tuple[Array, Array]:
    values, shapes = [], []
    tension = graded.TURNING * graded.hanging(model)
    for block in model.blocks:
        kept, mass, stiffness, _ = modes.condensed(model, block)
        if not len(kept):
            continue
        squares, vectors = graded.quickly(mass, stiffness, tension)
        close = np.diff(squares, axis=-1) <= modes.DEGENERATE * np.abs(squares[:, 1:])
        for n in np.flatnonzero(close.any(-1)):
            vectors[n] = modes.localised(squares[n], vectors[n])
        whole = np.zeros((len(squares), squares.shape[1], model.size))
        whole[..., kept] = np.swapaxes(vectors, -1, -2)
        values.append(squares)
        shapes.append(whole)
    found = np.concatenate(values, axis=1)
    order = np.argsort(found, axis=1, kind="stable")
    named = np.concatenate(shapes, axis=1) @ model.basis.T
    return np.take_along_axis(found, order, 1), np.take_along_axis(named, order[..., None], 1)[..., 6:]


def of_one(model: LinearModel) -> Spectrum:
    """Modes of a model without batch axes, as a batch of one."""
    return solve(replace(model, mass=model.mass[None], stiffness=model.stiffness[None]))


def matched(before: Any, after: Any) -> tuple[Any, Any]:
    """Which mode each mode becomes: the assignment of most overlap.

    Parameters
    ----------
    before, after : (m, c) arrays
        Shapes as `Spectrum` has them, of two designs.

    Returns
    -------
    choice : (m,) int array
        For each mode of the first design one of the second.
    overlap : (m,) array
        Squares of their scalar products: 1 for the same shape.
    """
    overlap = (np.asarray(before, dtype=float) @ np.asarray(after, dtype=float).T) ** 2
    choice = overlap.argmax(1)
    if len(np.unique(choice)) < len(choice):
        from scipy.optimize import linear_sum_assignment

        choice = linear_sum_assignment(overlap, maximize=True)[1]
    return choice, overlap[np.arange(len(choice)), choice]
