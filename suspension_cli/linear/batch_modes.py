"""Undamped modes of one linear system or of many, block by block.

>>> from suspension_cli.design import reader
>>> from suspension_cli.models import registry
>>> model = registry.BEAM.system(reader.parse(reader.template("single", "single")))
>>> solve(model).omega_squared[:3].round(1)  # (rad/s)^2
array([35.3, 35.3, 96.6])

With blade tips without mass and the tensions t of wires among the unknowns (see `pencil`; R^T R is
the stiffness from their stretching), a mode x is

    ( K + s M   R^T ) (x)                   (M x)
    (    R      -1  ) (t) = (omega^2 + s) (  0  ),

so with M = L L^T the eigenvalues of L^T (K + s M)^-1 L are 1 / (omega^2 + s), the largest for the
softest modes. Wires a million times stiffer than the tension makes them across cost these nothing.
The stationary value of the energies in each shape (Rayleigh quotient; Parlett, The Symmetric
Eigenvalue Problem, chapter 1) then gives omega^2 of soft and stiff modes to rounding.

Systems of a batch are solved plainly where that is as good: with coordinates without mass
condensed, omega^2 are the eigenvalues of L^-1 K L^-T. Their errors are rounding errors of the
largest one (Parlett, chapter 4), so all modes are exact to `PLAIN` where the smallest is large
enough; other systems are solved as above.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.elimination import (
    Positions,
    as_slice,
    by_body,
    connected_groups,
    solve_each,
)
from suspension_cli.linear.structure import Structure
from suspension_cli.linear.system import LinearSystem
from suspension_cli.scene.arrays import Index

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int

RIGID = 64 * np.finfo(float).eps
"""Fraction of its terms below which omega^2 is a rounding error and the mode rigid."""
SHIFT = 0.7
"""(rad/s)^2: s, that of slow pendulums, so that rigid modes are no exception."""
STILL = 1e-12
"""(rad/s)^2, a period of two months, below which a mode is rigid."""
PLAIN = 1e-10
"""Largest relative error of omega^2 from rounding, estimated, of plainly solved systems."""
CHUNK = 128
"""Systems that are solved at once, so that their matrices stay in the cache."""
ALIKE = 1e-12
"""Relative difference of omega^2 that may be a rounding error: the order of such modes is that of
the coordinates that move most."""
DEGENERATE = 1e-9
"""Relative difference of omega^2 below which modes of one block count as degenerate."""
CLEAR = 1e-10
"""Least eigenvalue of a stiffness scaled to a unit diagonal that is no rounding error by far."""


@dataclass(frozen=True)
class Spectrum:
    """Modes of one system or of many, each in ascending order of omega^2.

    Attributes
    ----------
    omega_squared
        (rad/s)^2; negative for an unstable mode, exactly 0 for a rigid one.
    shape
        L^T x with the mass matrix M = L L^T: rows are orthonormal, and where M is diagonal their
        squares are fractions of the kinetic energy. 0 for coordinates without inertia.
    motion
        Shapes x of unit modal mass in the system's own coordinates.
    block
        Number of the block of each mode.
    """

    omega_squared: Float[np.ndarray, "*build mode"]
    shape: Float[np.ndarray, "*build mode coordinate"]
    motion: Float[np.ndarray, "*build mode own"]
    block: Int[np.ndarray, "*build mode"]


def solve(model: LinearSystem, blocks: tuple[Index, ...] | None = None) -> Spectrum:
    """Solve for the undamped modes of a system, or of a batch with one axis.

    The `blocks` of a system may be given, if they are known.
    """
    if not model.batch:
        known = Structure(model).blocks if blocks is None else blocks
        return _solve_blocks(model, known)
    (count,) = model.batch
    size = model.size
    modes = int((~model.massless[6:]).sum())
    result = Spectrum(
        np.empty((count, modes)),
        np.zeros((count, modes, size - 6)),
        np.zeros((count, modes, size)),
        np.zeros((count, modes), dtype=np.intp),
    )
    for start in range(0, count, CHUNK):
        some = _select(model, slice(start, start + CHUNK))
        here = {name: values[start : start + CHUNK] for name, values in vars(result).items()}
        for own_blocks, same in _alike(some):
            all_alike = len(same) == len(here["block"])
            found = _solve_blocks(some if all_alike else some.select(same), own_blocks)
            for name, values in vars(found).items():
                here[name][same] = values
    return result


def _alike(model: LinearSystem) -> list[tuple[tuple[Index, ...], Int[np.ndarray, " build"]]]:
    """Group systems of a batch by the pattern of their matrices, which have the same blocks."""
    (count,) = model.batch
    if not count:
        return []
    nonzero = np.broadcast_to(model.mass != 0, (count, model.size, model.size))
    nonzero = np.asarray(nonzero | (model.stiffness != 0))
    groups: list[Index] = [np.arange(count)]
    if (nonzero != nonzero[0]).any():
        packed = np.packbits(nonzero, axis=-1).reshape(count, -1)
        _, number = np.unique(packed, axis=0, return_inverse=True)
        groups = [np.flatnonzero(number.ravel() == n) for n in range(number.max() + 1)]
    found = []
    for same in groups:
        connected = connected_groups(nonzero[same[0], 6:, 6:])
        found.append((tuple(6 + group for group in connected), same))
    return found


def _select(model: LinearSystem, members: slice) -> LinearSystem:
    """Undamped systems of some builds, with the builds first in memory, too."""
    undamped = np.zeros((model.size, model.size))
    mass = np.broadcast_to(model.mass, (*model.batch, *undamped.shape))
    some = replace(model, mass=mass, damping=undamped, terms=()).select(members).lossless
    return replace(some, mass=np.ascontiguousarray(some.mass), soft=np.ascontiguousarray(some.soft))


def _solve_blocks(model: LinearSystem, blocks: tuple[Index, ...]) -> Spectrum:
    parts: list[tuple[np.ndarray, ...]] = []
    is_named = np.array_equal(model.basis, np.eye(model.size))  # each coordinate of the system
    for number, block in enumerate(blocks):
        heavy = block[~model.massless[block]]
        if not len(heavy):
            continue
        squared, vectors, own = _solve_together(model, block)
        shape = np.zeros((*squared.shape, model.size))
        motion = np.zeros((*squared.shape, model.size))
        shape[..., heavy] = np.swapaxes(vectors, -1, -2)
        motion[..., block] = np.swapaxes(own, -1, -2)
        if not is_named:
            shape = shape @ model.basis.T
        parts.append((squared, shape, motion, np.full(squared.shape, number)))
    if len(parts) == 1:
        [(squared, shape, motion, number)] = parts
    else:
        squared = np.concatenate([part[0] for part in parts], axis=-1)
        shape = np.concatenate([part[1] for part in parts], axis=-2)
        motion = np.concatenate([part[2] for part in parts], axis=-2)
        number = np.concatenate([part[3] for part in parts], axis=-1)
    if len(parts) > 1 or (np.diff(squared) <= ALIKE * np.abs(squared[..., 1:])).any():
        order = _order(squared, shape)
        squared = np.take_along_axis(squared, order, -1)
        number = np.take_along_axis(number, order, -1)
        shape = np.take_along_axis(shape, order[..., None], -2)
        motion = np.take_along_axis(motion, order[..., None], -2)
    return Spectrum(squared, shape[..., 6:], motion, number)


def _order(
    squared: Float[np.ndarray, "*build mode"], shape: Float[np.ndarray, "*build mode coordinate"]
) -> Int[np.ndarray, "*build mode"]:
    """Ascending order of modes; of equal ones that of the coordinates that move most."""
    size = np.abs(shape)
    lead = (size >= size.max(-1, keepdims=True) - DEGENERATE).argmax(-1)
    order = np.argsort(lead, axis=-1, kind="stable")
    return np.take_along_axis(order, ascending(np.take_along_axis(squared, order, -1)), -1)


Block = tuple[
    "Float[np.ndarray, '*build mode']",
    "Float[np.ndarray, '*build heavy mode']",
    "Float[np.ndarray, '*build own mode']",
]
"""omega^2 of a block, its vectors L^T x and shapes x."""


def _solve_together(model: LinearSystem, block: Index) -> Block:
    """Solve one block of a system, or of a batch: plainly where that is as good."""
    if not model.batch:
        return solve_block(model, block)
    found, good = solve_plainly(model, block)
    if not good.all():
        others = np.flatnonzero(~good)
        for whole, part in zip(found, solve_block(model.select(others), block), strict=True):
            whole[others] = part
    return found


def solve_plainly(model: LinearSystem, block: Index) -> tuple[Block, Bool[np.ndarray, " build"]]:
    """Solve one block of a batch by the eigenvalues of L^-1 K L^-T.

    Also returns which results are good: exact to `PLAIN`, of modes that are apart.
    """
    light = model.massless[block]
    heavy, tips = (as_slice(block[kind]) for kind in (~light, light))
    whole = _part(model.stiffness, heavy, heavy)
    mass = np.broadcast_to(_part(model.mass, heavy, heavy), whole.shape)
    coupling = _part(model.stiffness, tips, heavy)
    soft = _part(model.stiffness, tips, tips)
    known = (np.isfinite(part).all((-2, -1)) for part in (whole, mass, coupling, soft))
    finite = np.asarray(np.logical_and.reduce([*known]))
    if not finite.all():
        whole, mass, coupling, soft = (
            np.where(finite[:, None, None], part, np.eye(*part.shape[-2:]))
            for part in (whole, mass, coupling, soft)
        )
    follow = -solve_each(soft, coupling)
    condensed = whole + np.swapaxes(coupling, -1, -2) @ follow if light.any() else whole
    inverse = _inverse_root(mass)
    transposed = np.swapaxes(inverse, -1, -2)
    matrix = inverse @ condensed @ transposed
    squared, vectors = np.linalg.eigh((matrix + np.swapaxes(matrix, -1, -2)) / 2)
    largest = ((inverse @ whole) * inverse).sum((-2, -1))  # trace: before tips were condensed
    error = np.finfo(float).eps * largest
    apart = np.diff(squared, axis=-1) > DEGENERATE * np.abs(squared[..., 1:])
    good = finite & apart.all(-1) & (np.abs(squared).min(-1) * PLAIN > error)
    shape = np.zeros((*squared.shape[:-1], len(block), squared.shape[-1]))
    moved = transposed @ vectors
    shape[..., ~light, :] = moved
    shape[..., light, :] = follow @ moved
    return (squared, vectors, shape), good


def _part(
    matrix: Float[np.ndarray, "*build row column"], rows: Positions, columns: Positions
) -> Float[np.ndarray, "*build some other"]:
    """Some rows and columns of matrices; a view if both are slices."""
    return matrix[..., rows, :][..., columns]


def _inverse_root(
    mass: Float[np.ndarray, "build heavy heavy"],
) -> Float[np.ndarray, "build heavy heavy"]:
    """L^-1 of mass matrices L L^T, of which most elements are 0."""
    result = np.zeros_like(mass)
    groups = connected_groups((mass != 0).any(0))
    alone = np.array([group[0] for group in groups if len(group) == 1], dtype=int)
    result[:, alone, alone] = 1 / np.sqrt(mass[:, alone, alone])
    for size in {len(group) for group in groups} - {1}:
        own = np.array([group for group in groups if len(group) == size])
        here = slice(None), own[:, :, None], own[:, None, :]
        result[here] = np.linalg.inv(np.linalg.cholesky(mass[here]))
    return result


def solve_block(
    model: LinearSystem, block: Index
) -> tuple[
    Float[np.ndarray, "*build mode"],
    Float[np.ndarray, "*build heavy mode"],
    Float[np.ndarray, "*build own mode"],
]:
    """Solve one block: omega^2, and the vectors L^T x and shapes x of the modes."""
    # with no more rows than needed: redundant wires that are nearly rigid have indefinite tensions
    form = model.elongation[..., block] * np.sqrt(np.real(model.k))[..., None]
    form = np.broadcast_to(form, (*model.batch, *form.shape[-2:]))
    form = np.asarray(np.linalg.qr(form, mode="r"))
    soft = np.real(model.soft)[..., block[:, None], block]
    own = len(block)
    wires = form.shape[-2]
    mass = model.mass[..., block[:, None], block]
    matrix = np.zeros((*soft.shape[:-2], own + wires, own + wires))
    matrix[..., :own, :own] = soft + SHIFT * mass
    matrix[..., own:, :own] = form
    matrix[..., :own, own:] = np.swapaxes(form, -1, -2)
    matrix[..., own:, own:] = -np.eye(wires)
    good = np.isfinite(matrix).all((-2, -1))
    matrix[~good] = np.eye(own + wires)
    size = np.abs(matrix).max(-1)
    # powers of 2: pivots do not depend on units, and scaling does not round
    scale = np.exp2(-np.rint(np.log2(np.where(size > 0, size, 1.0)) / 2))[..., None]
    heavy = np.flatnonzero(~model.massless[block])
    load = np.zeros((*matrix.shape[:-1], len(heavy)))
    load[..., heavy, :] = np.linalg.cholesky(mass[..., heavy[:, None], heavy])
    moved = scale * solve_each(matrix * scale * np.swapaxes(scale, -1, -2), scale * load)
    flexible = np.swapaxes(load, -1, -2) @ moved
    inverse, vectors = np.linalg.eigh((flexible + np.swapaxes(flexible, -1, -2)) / 2)

    def evaluate() -> tuple[np.ndarray, np.ndarray]:
        x = (moved @ vectors / inverse[..., None, :])[..., :own, :]
        x = x / np.sqrt((x * (mass @ x)).sum(-2, keepdims=True))
        tension = form @ x
        squared = (x * (soft @ x)).sum(-2) + (tension**2).sum(-2)
        terms = (np.abs(x) * (np.abs(soft) @ np.abs(x))).sum(-2)
        terms += (np.abs(tension) * (np.abs(form) @ np.abs(x))).sum(-2)
        rigid = np.abs(squared) < np.maximum(RIGID * terms, STILL)
        return np.where(rigid, 0.0, squared), x

    squared, x = evaluate()
    order = np.argsort(squared, axis=-1, kind="stable")
    squared, inverse = (np.take_along_axis(each, order, -1) for each in (squared, inverse))
    vectors, x = (np.take_along_axis(each, order[..., None, :], -1) for each in (vectors, x))
    apart = np.diff(squared, axis=-1) > DEGENERATE * np.abs(squared[..., 1:])
    close = np.asarray(~apart.all(-1))
    if close.any():
        for n in np.ndindex(close.shape):
            if close[n]:
                vectors[n] = localise(squared[n], vectors[n])
        x = evaluate()[1]
    squared[~good] = np.nan
    return squared, vectors, x


def ascending(values: Float[np.ndarray, "*build mode"]) -> Int[np.ndarray, "*build mode"]:
    """Order of values, in which those that differ by rounding errors keep their order."""
    order = np.argsort(values, axis=-1, kind="stable")
    size = np.take_along_axis(values, order, -1)
    apart = np.diff(size, axis=-1, prepend=-np.inf) > ALIKE * np.abs(size)
    group = np.empty_like(order)
    np.put_along_axis(group, order, np.cumsum(apart, axis=-1), -1)
    return np.argsort(group, axis=-1, kind="stable")


def localise(
    values: Float[np.ndarray, " mode"], vectors: Float[np.ndarray, "coordinate mode"]
) -> Float[np.ndarray, "coordinate mode"]:
    """Rotate each degenerate group of modes to the basis that moves as few coordinates as possible.

    In turn each mode takes the coordinate in which the group moves most, and the remaining modes
    leave it at rest, which does not depend on rounding. `values` are omega^2, ascending; the
    columns of `vectors` are orthonormal.
    """
    result = vectors.copy()
    start = 0
    while start < len(values):
        stop = start + 1
        while stop < len(values) and values[stop] - values[start] <= DEGENERATE * abs(values[stop]):
            stop += 1
        for first in range(start, stop - 1):
            group = result[:, first:stop]
            size = (group**2).sum(1)
            row = group[int(np.flatnonzero(size >= size.max() * (1 - 1e-9))[0])]
            rotation = np.linalg.qr(np.column_stack([row, np.eye(len(row))]))[0]
            result[:, first:stop] = group @ rotation
        start = stop
    return result


def is_clearly_stable(
    model: LinearSystem, softening: Float[np.ndarray, " coordinate"] | float = 0.0
) -> bool:
    """Whether all modes of a system without batch axes are stable, by far more than rounding.

    Less a `softening` of each coordinate (N/m, N m/rad), the stiffness scaled to a unit diagonal
    then has no eigenvalue below `CLEAR`: the Cholesky factorisation of that less `CLEAR` exists,
    whose rounding errors are far smaller (Higham, Accuracy and Stability of Numerical Algorithms,
    theorem 10.7). The mass has to have one, too. The terms do not count. Rigid modes are not
    clearly stable.
    """
    stiffness = (model.stiffness - np.diag(softening + np.zeros(model.size)))[6:, 6:]
    own = np.diag(model.stiffness)[6:]
    if not (own > 0).all():
        return False
    root = np.sqrt(own)
    scaled = stiffness / (root[:, None] * root)
    heavy = 6 + np.flatnonzero(~model.massless[6:])
    try:
        np.linalg.cholesky(scaled - CLEAR * np.eye(len(own)))
        np.linalg.cholesky(model.mass[heavy[:, None], heavy])
    except np.linalg.LinAlgError:
        return False
    return True


def grows(model: LinearSystem) -> Bool[np.ndarray, " build"]:
    """Find builds with an unstable mode: K + c M is not positive definite.

    The small c, `RIGID` times the sum of K/M, covers the rounding error of a rigid mode.
    """
    shape = *model.batch, model.size, model.size
    stiffness, mass = (np.broadcast_to(part, shape) for part in (model.stiffness, model.mass))
    own, inert = (np.abs(np.einsum("pnn->pn", part)[:, 6:]) for part in (stiffness, mass))
    scale = np.where(inert > 0, own / np.where(inert > 0, inert, 1.0), 0.0).sum(1)
    shifted = (stiffness + RIGID * scale[:, None, None] * mass)[:, 6:, 6:]
    owner = model.owner[6:]
    pattern = by_body(owner, (shifted != 0).any(0))
    with np.errstate(all="ignore"):
        factors = pattern.factor(shifted[:, pattern.row, pattern.column].T.copy())
    return np.asarray(~(np.array(factors.pivots) > 0).all(0))
