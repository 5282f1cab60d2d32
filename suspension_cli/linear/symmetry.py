"""Mirror symmetries of a scene, and coordinates that split its matrices accordingly.

If the mirror x to -x (or y to -y) maps every body onto itself, and every wire, blade, spring, ...
onto an equal one, motions even and odd under it do not couple. Which numbers of a part change sign
in a mirror is declared with its arrays (`arrays.inner`). The coordinates of a body are even or odd
already; those of blade tips that are mirror images are combined into even and odd sums. Matrix
elements between different parities are rounding errors, and are set to exactly 0.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.conventions import PARITY_X, PARITY_Y
from suspension_cli.scene.arrays import inner_axes, signed
from suspension_cli.scene.pose import Layout
from suspension_cli.scene.scene import Scene

if TYPE_CHECKING:
    from _typeshed import DataclassInstance
    from jaxtyping import Bool, Float, Inexact, Int

    from suspension_cli.scene.composition import Fibre

    Pairs = dict[str, Bool[np.ndarray, "*#batch member member"]]
    """Pairs of members of each part of a scene that map onto each other, by the part's name."""

APART = ("label", "blade", "span")
"""Fields that mirror images need not share: names, the blade of a wire, whose own image counts, and
what follows from the ends of a wire."""
ROUNDING = 1e-13
"""Relative difference up to which computed values (tensions, loads, clamps) count as equal; given
ones must equal exactly."""


@dataclass(frozen=True)
class Symmetry:
    """Coordinates adapted to the mirror symmetries of a scene.

    Attributes
    ----------
    basis
        The named coordinates (rows) in terms of the adapted ones (columns); orthogonal.
    allowed
        Elements of a matrix that the symmetry allows.
    mirrors
        ``("x", "y")`` for a scene with both symmetries.
    """

    basis: Float[np.ndarray, "coordinate coordinate"]
    allowed: Bool[np.ndarray, "coordinate coordinate"]
    mirrors: tuple[str, ...]

    def apply(
        self, matrix: Inexact[np.ndarray, "*batch coordinate coordinate"]
    ) -> Inexact[np.ndarray, "*batch coordinate coordinate"]:
        """Change a symmetric matrix to adapted coordinates, with exact zeros."""
        if not self.trivial:
            matrix = self.basis.T @ matrix @ self.basis
            matrix = (matrix + np.swapaxes(matrix, -1, -2)) / 2
        return matrix if self.allowed.all() else np.where(self.allowed, matrix, 0.0)

    def forms(
        self, form: Inexact[np.ndarray, "*batch coordinate"]
    ) -> Inexact[np.ndarray, "*batch coordinate"]:
        """Change linear forms to adapted coordinates."""
        return form if self.trivial else form @ self.basis

    @cached_property
    def trivial(self) -> bool:
        """Whether the adapted coordinates are the scene's."""
        return np.array_equal(self.basis, np.eye(len(self.basis)))

    def adapt_flags(
        self, flags: Bool[np.ndarray, " coordinate"]
    ) -> Bool[np.ndarray, " coordinate"]:
        """Change flags that mirror images share to adapted coordinates."""
        return (np.abs(self.basis).T @ flags) > 0.5 * np.abs(self.basis).sum(0)


def find_symmetry(scene: Scene, numbering: Layout) -> Symmetry:
    """Find the mirror symmetries of a scene, or those common to a batch of scenes."""
    equal = _equal_members(scene)
    images = {axis: _blade_images(scene, axis, equal) for axis in (0, 1)}
    operators = [
        _operator(scene, numbering, axis, image)
        for axis, image in images.items()
        if image is not None
    ]
    mirrors = [axis for axis in (0, 1) if images[axis] is not None]
    basis, parity = _adapted_basis(numbering.size, operators)
    allowed = (
        (parity[:, :, None] == parity[:, None, :]).all(0)
        if mirrors
        else np.ones((numbering.size,) * 2, dtype=bool)
    )
    return Symmetry(basis, allowed, tuple("xy"[axis] for axis in mirrors))


def no_symmetry(numbering: Layout) -> Symmetry:
    """Build the trivial symmetry: named coordinates, all couplings allowed."""
    size = numbering.size
    return Symmetry(np.eye(size), np.ones((size, size), dtype=bool), ())


def _operator(
    scene: Scene, numbering: Layout, axis: int, image: Int[np.ndarray, " blade"]
) -> Float[np.ndarray, "coordinate coordinate"]:
    """Build the signed permutation matrix of a mirror."""
    bodies = len(scene.bodies.name) + 1
    result = np.zeros((numbering.size,) * 2)
    np.fill_diagonal(
        result,
        np.append(
            np.tile((PARITY_X, PARITY_Y)[axis], bodies), np.zeros(numbering.size - 6 * bodies)
        ),
    )
    signs = np.where(np.arange(3) == axis, -1.0, 1.0)
    for number, other in enumerate(image):
        moves = scene.blades.axes[number]
        result[numbering.blade[other, moves], numbering.blade[number, moves]] = signs[moves]
    return result


def _adapted_basis(
    size: int, operators: list[Float[np.ndarray, "coordinate coordinate"]]
) -> tuple[Float[np.ndarray, "coordinate coordinate"], Float[np.ndarray, "mirror coordinate"]]:
    """Find common eigenvectors of commuting mirrors (columns), and their parities (mirror, column).

    A coordinate that is its own image is kept; the others are projected on each combination of
    parities, and the results take their places.
    """
    basis, parities = np.eye(size), np.zeros((size, len(operators)))
    is_own_image = np.ones(size, dtype=bool)
    for n, operator in enumerate(operators):
        parities[:, n] = np.diag(operator)
        is_own_image &= parities[:, n] != 0
    covered, identity, place = is_own_image.copy(), np.eye(size), 0
    others = np.flatnonzero(~is_own_image)
    for start in others:
        if covered[start]:
            continue
        for combination in itertools.product((1.0, -1.0), repeat=len(operators)):
            vector = identity[start]
            for sign, operator in zip(combination, operators, strict=True):
                vector = (vector + sign * (operator @ vector)) / 2
            covered |= vector != 0
            if vector.any():
                basis[:, others[place]] = vector / np.sqrt((vector**2).sum())
                parities[others[place]] = combination
                place += 1
    return basis, parities.T


def is_mirror_symmetric(scene: Scene) -> Bool[np.ndarray, "*batch 2"]:
    """Whether each scene of a batch is symmetric in x and in y."""
    equal = _equal_members(scene)
    found = [np.broadcast_to(_mirror(scene, axis, equal)[0], scene.batch) for axis in (0, 1)]
    return np.stack(found, axis=-1)


def _blade_images(scene: Scene, axis: int, equal: Pairs) -> Int[np.ndarray, " blade"] | None:
    """Number of each blade's image in a mirror of x (axis 0) or y (1).

    None unless all scenes of a batch have that symmetry.
    """
    symmetric, images = _mirror(scene, axis, equal)
    if not np.all(symmetric):
        return None
    pairs = images.get("blades", np.zeros((0, 1), dtype=bool))
    first = pairs.any(tuple(range(pairs.ndim - 2)))
    return None if (pairs != first).any() else first.argmax(1)


def _mirror(scene: Scene, axis: int, equal: Pairs) -> tuple[Bool[np.ndarray, "*batch"], Pairs]:
    """Whether each scene is symmetric in x (axis 0) or y (1), and its members that are images."""
    bodies, flip = scene.bodies, _signs((3,), axis)
    symmetric = (bodies.position[..., axis] == 0).all(-1) & (
        bodies.inertia == bodies.inertia * np.outer(flip, flip)
    ).all((-3, -2, -1))
    if scene.field is not None and not scene.field.has_mirror(axis):
        symmetric = symmetric & False
    if not np.any(symmetric):
        return symmetric, {}
    pairs = {name: own & _alike(scene.parts[name], axis) for name, own in equal.items()}
    if scene.fibres is not None and "wires" in pairs:
        pairs["wires"] = pairs["wires"] & _wire_images(scene.fibres.wire, flip)
    if "blades" in pairs:
        blade = scene.wires.blade
        carried = np.where(blade[:, None] >= 0, pairs["blades"][..., blade[:, None], blade], True)
        pairs["wires"] = pairs["wires"] & _equal_items(blade < 0) & carried
    for own in pairs.values():
        symmetric = symmetric & (own.sum(-1) == 1).all(-1) & (own.sum(-2) == 1).all(-1)
    return symmetric, pairs


def _equal_members(scene: Scene) -> Pairs:
    """Pair members of all parts but bodies that are equal but for vectors."""
    parts = {name: part for name, part in scene.parts.items() if name != "bodies" and part.label}
    pairs = {name: _alike(part) for name, part in parts.items()}
    if scene.fibres is not None:
        blades, springs = (
            {row.label: replace(row, label="") for row in rows}
            for rows in (scene.fibres.blade, scene.fibres.spring)
        )
        composition = {
            "wires": [(own.sections, own.temperature, own.effective) for own in scene.fibres.wire],
            "blades": [blades[label] for label in scene.blades.label],
            "springs": [springs.get(label) for label in scene.springs.label],
        }
        for name in pairs.keys() & composition.keys():
            pairs[name] = pairs[name] & _equal_items(composition[name])
    return pairs


def _alike(
    part: DataclassInstance, axis: int | None = None
) -> Bool[np.ndarray, "*#batch member member"]:
    """Pair members of a part whose vectors are images in a mirror.

    Without an axis, those that are equal in all else. Computed numbers may differ by rounding.
    """
    kind, pairs = type(part), np.ones((1, 1), dtype=bool)
    for name, (is_vector, is_computed) in signed(kind).items():
        values, own = getattr(part, name), inner_axes(kind).get(name)
        if name in APART or is_vector != (axis is not None):
            continue
        if own is None:
            pairs = pairs & _equal_items(values)
            continue
        shape = values.shape[values.ndim - own + 1 :]
        flat = values.reshape(*values.shape[: values.ndim - len(shape)], math.prod(shape))
        images = flat if axis is None else flat * _signs(shape, axis).ravel()
        pairs = pairs & (_close if is_computed else _equal)(flat, images)
    return pairs


def _signs(shape: tuple[int, ...], axis: int) -> Float[np.ndarray, "*shape"]:
    """Sign that each component of a vector or tensor of a shape gets in a mirror."""
    result, parity = np.ones(()), np.array((PARITY_X, PARITY_Y)[axis], dtype=float)
    for size in shape:
        result = np.multiply.outer(result, parity[:size] if size in (3, 6) else np.ones(size))
    return result


def _wire_images(
    fibres: tuple[Fibre, ...], flip: Float[np.ndarray, " 3"]
) -> Bool[np.ndarray, "wire wire"]:
    """Pair wires whose clamps and bending planes are mirror images."""
    pairs = np.ones((len(fibres), len(fibres)), dtype=bool)
    for end in (0, 1):
        clamps = np.array([fibre.clamp[end] for fibre in fibres]).reshape(-1, 3)
        pairs = pairs & _close(clamps, clamps * flip)
    planes = np.array([fibre.plane for fibre in fibres]).reshape(-1, 3)
    has_plane = ~np.array(
        [all(section.round for section in fibre.sections) for fibre in fibres], dtype=bool
    )
    return pairs & (_close(planes, planes * flip) | _close(planes, -planes * flip) | ~has_plane)


def _equal_items(items: Sequence[object] | np.ndarray) -> Bool[np.ndarray, "item item"]:
    """Pair equal items: rows of an array (n, ...), or n objects."""
    if not isinstance(items, np.ndarray):
        items = np.array([items.index(item) for item in items], dtype=int)
    rows = items.reshape(len(items), math.prod(items.shape[1:]))
    return (rows[:, None] == rows).all(-1)


def _equal(
    values: Inexact[np.ndarray, "*batch item component"],
    images: Inexact[np.ndarray, "*batch item component"],
) -> Bool[np.ndarray, "*batch item item"]:
    """Pair items that equal the image of another exactly."""
    return (values[..., :, None, :] == images[..., None, :, :]).all(-1)


def _close(
    values: Inexact[np.ndarray, "*batch item component"],
    images: Inexact[np.ndarray, "*batch item component"],
) -> Bool[np.ndarray, "*batch item item"]:
    """Pair items that equal the image of another but for rounding."""
    scale = np.abs(values).max((-2, -1), initial=0.0)[..., None, None, None]
    return (np.abs(values[..., :, None, :] - images[..., None, :, :]) <= ROUNDING * scale).all(-1)
