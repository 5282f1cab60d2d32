"""Modes of many builds: condensation of blade tips, scaling by the mass, stability.

All builds are eliminated together (`elimination`), in chunks that stay in the cache, with the
tensions of wires as unknowns as in `pencil`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.linear.elimination import Pattern
from suspension_cli.linear.graded_eigenvalues import RIGID
from suspension_cli.linear.pencil import Block, Equations, Pencil, order_by_body
from suspension_cli.linear.system import LinearSystem

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int

CHUNK = 512
"""Builds that are eliminated at once."""


def _static_elements(
    model: LinearSystem, owner: Int[np.ndarray, " own"]
) -> tuple[Pattern, Float[np.ndarray, "element build"]]:
    """Elements of the static equations of builds without loss.

    `owner` is the number by which each coordinate is ordered; that of tensions is 1.
    """
    own = model.stretched
    if own is not None:
        own = replace(own, soft=np.real(own.soft), stiffness=np.real(own.stiffness))
    none = np.zeros((model.size, model.size))
    static = replace(model, stretched=own, lossy=None, mass=none, damping=none, terms=())
    block = Block(Pencil(static), np.arange(6, model.size), np.zeros(6, dtype=bool))
    order = [*owner.tolist(), *[1] * (len(block.owner) - len(owner))]
    equations, functions = Equations.of(block.parts, order), []
    for part in block.parts:
        functions.append(np.zeros((len(part.source), len(model.stiffness))))
        functions[-1][0] = 1.0
    return equations.pattern, equations.elements(functions)


def condensed_stiffness(
    model: LinearSystem, keep: Int[np.ndarray, " kept"]
) -> Float[np.ndarray, "build kept kept"]:
    """Lossless static stiffness of the coordinates `keep`, which all others follow.

    Blade tips are eliminated first, then tensions: a wire's compliance adds to that of its blade.
    """
    count = len(model.stiffness)
    # owners are eliminated in descending order
    owner = np.where(np.isin(np.arange(6, model.size), keep), 0, 2)
    result = np.empty((count, len(keep), len(keep)))
    number = np.cumsum(owner == 0) - 1
    for start in range(0, count, CHUNK):
        some = slice(start, min(start + CHUNK, count))
        pattern, elements = _static_elements(model.select(some), owner)
        steps = pattern.size - len(keep)
        pattern.factor(elements, steps)
        rest = slice(pattern.start[steps], None)
        row, column = (number[place[rest]] for place in (pattern.row, pattern.column))
        whole = np.zeros((len(keep), len(keep), elements.shape[-1]))
        whole[row, column] = whole[column, row] = elements[rest]
        result[some] = np.moveaxis(whole, -1, 0)
    return result


def scaled_by_mass(
    mass: Float[np.ndarray, "build kept kept"], stiffness: Float[np.ndarray, "build kept kept"]
) -> Float[np.ndarray, "build kept kept"]:
    """Compute L^-1 K L^-T, with the lower triangular root L of M = L L^T."""
    own = np.zeros(mass.shape[-1], dtype=int)
    pattern = order_by_body(own.tobytes(), (mass != 0).any(0).tobytes())
    factors = pattern.factor(mass[:, pattern.row, pattern.column].T.copy())
    scale = np.sqrt(factors.pivots)
    result = np.moveaxis(stiffness, 0, -1).copy()
    for _ in range(2):  # rows, then columns
        factors.reduce(result)
        result *= scale[:, None]
        result = result.swapaxes(0, 1)
    result = np.moveaxis(result, -1, 0)
    return (result + result.swapaxes(-1, -2)) / 2


def grows(model: LinearSystem) -> Bool[np.ndarray, " build"]:
    """Find builds with an unstable mode: K + c M is not positive definite.

    The small c, `RIGID` times the sum of K/M, covers the rounding error of a rigid mode.
    """
    mass = np.broadcast_to(model.mass, model.stiffness.shape)
    own, inert = (np.abs(np.einsum("pnn->pn", part)[:, 6:]) for part in (model.stiffness, mass))
    scale = np.where(inert > 0, own / np.where(inert > 0, inert, 1.0), 0.0).sum(1)
    shifted = (model.stiffness + RIGID * scale[:, None, None] * mass)[:, 6:, 6:]
    owner = Pencil(model).owner[6:]
    pattern = order_by_body(owner.tobytes(), (shifted != 0).any(0).tobytes())
    with np.errstate(all="ignore"):
        factors = pattern.factor(shifted[:, pattern.row, pattern.column].T.copy())
    return np.asarray(~(np.array(factors.pivots) > 0).all(0))
