"""Mirror symmetries of a scene, and coordinates that split its matrices accordingly.

If the mirror x to -x (or y to -y) maps every body, wire, blade and spring onto an equal one,
motions even and odd under it do not couple. The coordinates of a body are even or odd already;
those of blade tips that are mirror images are combined into even and odd sums. Matrix elements
between different parities are rounding errors, and are set to exactly 0.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.conventions import PARITY_X, PARITY_Y
from suspension_cli.scene.pose import Layout
from suspension_cli.scene.scene import Scene

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Inexact, Int

    from suspension_cli.scene.composition import Fibre

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
    equal = _equal_parts(scene)
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


def _blade_images(scene: Scene, axis: int, equal: _EqualParts) -> Int[np.ndarray, " blade"] | None:
    """Number of each blade's image in a mirror of x (axis 0) or y (1).

    None unless all scenes of a batch have that symmetry.
    """
    pairs, one_to_one = _blade_pairs(scene, axis, equal)
    if not np.all(_has_mirror(scene, axis, equal, pairs, one_to_one)) or (
        pairs.ndim > 2 and (pairs != pairs[:1]).any()
    ):
        return None
    first = pairs.reshape(-1, *pairs.shape[-2:])[0] if pairs.size else np.zeros((0, 1))
    return first.argmax(1)


def is_mirror_symmetric(scene: Scene) -> Bool[np.ndarray, "*batch 2"]:
    """Whether each scene of a batch is symmetric in x and in y."""
    equal = _equal_parts(scene)
    return np.stack(
        [
            np.broadcast_to(
                _has_mirror(scene, axis, equal, *_blade_pairs(scene, axis, equal)), scene.batch
            )
            for axis in (0, 1)
        ],
        axis=-1,
    )


@dataclass(frozen=True)
class _EqualParts:
    """Pairs of blades and of wires that are equal but for position."""

    blades: Bool[np.ndarray, "*#batch blade blade"]
    wires: Bool[np.ndarray, "*#batch wire wire"]


def _equal_parts(scene: Scene) -> _EqualParts:
    blades, wires = scene.blades, scene.wires
    blade_pairs = (
        _equal_labels(blades.body, blades.axes.T)
        & _equal(blades.stiffness, blades.stiffness)
        & _equal_labels(blades.loss)
        & _equal(blades.tip_mass[..., None], blades.tip_mass[..., None])
    )
    # wires without blade may match each other; wires on blades only if their blades match
    wire_pairs = (
        _equal_labels(wires.upper, wires.lower, wires.loss, wires.blade < 0)
        & _equal(wires.stiffness[..., None], wires.stiffness[..., None])
        & _equal(wires.torsion[..., None], wires.torsion[..., None])
        & _equal(wires.mass, wires.mass)
        & _close(wires.tension[..., None], wires.tension[..., None])
        & _close(wires.length[..., None], wires.length[..., None])
    )
    if scene.fibres is not None:
        place = {label: n for n, label in enumerate(blades.label)}
        order = sorted(scene.fibres.blade, key=lambda blade: place[blade.label])
        blade_pairs = blade_pairs & _equal_items(
            [(blade.angle, blade.losses, blade.thickness, blade.temperature) for blade in order]
        )
        wire_pairs = wire_pairs & _equal_items(
            [(fibre.sections, fibre.temperature, fibre.effective) for fibre in scene.fibres.wire]
        )
    return _EqualParts(blade_pairs, wire_pairs)


def _mirror_signs(axis: int) -> Float[np.ndarray, " 3"]:
    flip = np.ones(3)
    flip[axis] = -1.0
    return flip


def _blade_pairs(
    scene: Scene, axis: int, equal: _EqualParts
) -> tuple[Bool[np.ndarray, "*batch blade blade"], Bool[np.ndarray, "*batch"]]:
    """Pair blades that are mirror images; also whether that is one to one."""
    blades, flip = scene.blades, _mirror_signs(axis)
    pairs = (
        equal.blades
        & _equal(blades.tip, blades.tip * flip)
        & _close(blades.load, blades.load * flip)
    )
    return pairs, _one_to_one(pairs)


def _has_mirror(
    scene: Scene,
    axis: int,
    equal: _EqualParts,
    blade_pairs: Bool[np.ndarray, "*#batch blade blade"],
    one_to_one: Bool[np.ndarray, "*#batch"],
) -> Bool[np.ndarray, "*batch"]:
    """Whether each scene is symmetric in x (axis 0) or y (1), given its `_blade_pairs`."""
    bodies, wires, springs, flip = scene.bodies, scene.wires, scene.springs, _mirror_signs(axis)
    odd = np.outer(flip, flip) < 0
    symmetric = (bodies.position[..., axis] == 0).all(-1) & (bodies.inertia[..., odd] == 0).all(
        (-2, -1)
    )
    symmetric = symmetric & one_to_one
    if scene.field is not None and not scene.field.has_mirror(axis):
        symmetric = symmetric & False
    if not np.any(symmetric):
        return symmetric
    pairs = (
        equal.wires
        & _equal(wires.upper_point, wires.upper_point * flip)
        & _equal(wires.lower_point, wires.lower_point * flip)
    )
    if scene.fibres is not None:
        pairs = pairs & _wire_images(scene.fibres.wire, flip)
    if len(scene.blades.label):
        blades_match = blade_pairs[..., wires.blade[:, None], wires.blade[None, :]]
        pairs = pairs & np.where(wires.blade[:, None] >= 0, blades_match, True)
    symmetric = symmetric & _one_to_one(pairs) & _towers_have_mirror(scene, flip)
    if not springs.label:
        return symmetric
    parity = np.array((PARITY_X, PARITY_Y)[axis], dtype=float)
    # forces and torques mirror like the motions that they act along
    pairs = (
        _equal_labels(springs.upper, springs.lower, springs.loss, springs.grounded)
        & _equal_items(list(springs.spectrum))
        & _equal(springs.lower_point, springs.lower_point * flip)
        & _equal(springs.preload, springs.preload * parity)
    )
    if scene.fibres is not None and scene.fibres.spring:
        losses = {own.label: replace(own, label="") for own in scene.fibres.spring}
        pairs = pairs & _equal_items([losses.get(label) for label in springs.label])
    for matrix in (springs.stiffness, springs.damping):
        flat = matrix.reshape(*matrix.shape[:-2], 36)
        pairs = pairs & _equal(flat, flat * np.outer(parity, parity).ravel())
    return symmetric & _one_to_one(pairs)


def _towers_have_mirror(scene: Scene, flip: Float[np.ndarray, " 3"]) -> Any:
    """Whether the struts and bars of each scene are symmetric under a mirror."""
    struts, bars = scene.struts, scene.bars
    result: Any = np.True_
    if struts.label:
        pairs = (
            _equal_labels(struts.upper, struts.lower)
            & _equal(struts.upper_point, struts.upper_point * flip)
            & _equal(struts.lower_point, struts.lower_point * flip)
            & _equal(struts.stiffness[..., None], struts.stiffness[..., None])
            & _close(struts.tension[..., None], struts.tension[..., None])
        )
        result = result & _one_to_one(pairs)
    if bars.label:
        pairs = _equal_labels(bars.body.T) & _equal(bars.inertia, bars.inertia)
        for end in (0, 1):
            point = bars.point[..., end, :]
            pairs = pairs & _equal(point, point * flip)
        result = result & _one_to_one(pairs)
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


def _equal_items(kinds: list[Any]) -> Bool[np.ndarray, "item item"]:
    """Pair equal items."""
    known: list[Any] = []
    for kind in kinds:
        if kind not in known:
            known.append(kind)
    return _equal_labels(np.array([known.index(kind) for kind in kinds], dtype=int))


def _equal_labels(*labels: Any) -> Bool[np.ndarray, "item item"]:
    """Pair items with equal labels, each (n,) or (k, n)."""
    return np.logical_and.reduce(
        [row[:, None] == row[None, :] for label in labels for row in np.atleast_2d(label)]
    )


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


def _one_to_one(same: Bool[np.ndarray, "*batch item item"]) -> Bool[np.ndarray, "*batch"]:
    """Whether each pairing is a permutation."""
    return (same.sum(-1) == 1).all(-1) & (same.sum(-2) == 1).all(-1)
