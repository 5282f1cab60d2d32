"""Mirror symmetries of a scene, and coordinates in which they split its matrices.

If mirroring x to -x (or y to -y) takes every body, wire, blade and spring onto one with the same numbers, motions that
are even and odd under the mirror do not couple.  A body's own coordinates are even or odd already; tips of blades
that are each other's images are combined into even and odd sums.  Elements between coordinates of different parity
are then set to exactly 0: they are rounding errors.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.conventions import PARITY_X, PARITY_Y
from suspension_cli.design.scene import Array, Scene
from suspension_cli.mechanics.pose import Layout

if TYPE_CHECKING:
    from suspension_cli.design.fibres import Fibre

ROUNDING = 1e-13
"""Relative difference of two tensions or loads that are equal but for rounding; everything given must be equal exactly."""


@dataclass(frozen=True)
class Symmetry:
    """What a scene's symmetry says about its coordinates.

    Attributes
    ----------
    basis : (N, N) array
        The named coordinates (rows) in terms of the adapted ones (columns); orthogonal.
    allowed : (N, N) bool array
        Elements of a matrix that the symmetry does not forbid.
    mirrors : tuple of str
        ``("x", "y")`` for a scene that is symmetric in both.
    """

    basis: Any
    allowed: Any
    mirrors: tuple[str, ...]

    def apply(self, matrix: Any) -> Any:
        """A symmetric matrix (..., N, N) in adapted coordinates, with exact zeros."""
        if not np.array_equal(self.basis, np.eye(len(self.basis))):
            matrix = self.basis.T @ matrix @ self.basis
            matrix = (matrix + np.swapaxes(matrix, -1, -2)) / 2
        return np.where(self.allowed, matrix, 0.0)

    def carried(self, flags: Any) -> Any:
        """A property (N,) that images share, in adapted coordinates."""
        return (np.abs(self.basis).T @ flags) > 0.5 * np.abs(self.basis).sum(0)


def symmetry(scene: Scene, numbering: Layout) -> Symmetry:
    """Find the mirror symmetries of a scene (of every scene of a batch)."""
    kin = _kin(scene)
    images = {axis: _blade_images(scene, axis, kin) for axis in (0, 1)}
    mirrors = [axis for axis in (0, 1) if images[axis] is not None]
    operators = [_operator(scene, numbering, axis, images[axis]) for axis in mirrors]
    basis, parity = _adapted_basis(numbering.size, operators)
    allowed = (parity[:, :, None] == parity[:, None, :]).all(0) if mirrors else np.ones((numbering.size,) * 2, dtype=bool)
    return Symmetry(basis, allowed, tuple("xy"[axis] for axis in mirrors))


def unsplit(numbering: Layout) -> Symmetry:
    """No symmetry: every coordinate for itself, every coupling allowed."""
    size = numbering.size
    return Symmetry(np.eye(size), np.ones((size, size), dtype=bool), ())


def _operator(scene: Scene, numbering: Layout, axis: int, image: Any) -> Array:
    """The mirror as a signed permutation matrix (N, N) of the coordinates."""
    bodies = len(scene.bodies.name) + 1
    result = np.zeros((numbering.size,) * 2)
    np.fill_diagonal(result, np.append(np.tile((PARITY_X, PARITY_Y)[axis], bodies), np.zeros(numbering.size - 6 * bodies)))
    signs = np.where(np.arange(3) == axis, -1.0, 1.0)
    for number, other in enumerate(image):
        moves = scene.blades.axes[number]
        result[numbering.blade[other, moves], numbering.blade[number, moves]] = signs[moves]
    return result


def _adapted_basis(size: int, operators: list[Array]) -> tuple[Array, Array]:
    """Common eigenvectors of commuting mirrors (columns), and their parities (mirror, column).

    A coordinate that is its own image stands for itself; others are projected on every combination of signs.
    Combined tips stand in the places of those that they are made of.
    """
    basis, parities = np.eye(size), np.zeros((size, len(operators)))
    own = np.ones(size, dtype=bool)
    for n, operator in enumerate(operators):
        parities[:, n] = np.diag(operator)
        own &= parities[:, n] != 0
    done, unit, place = own.copy(), np.eye(size), 0
    others = np.flatnonzero(~own)
    for start in others:
        if done[start]:
            continue
        for combination in itertools.product((1.0, -1.0), repeat=len(operators)):
            vector = unit[start]
            for sign, operator in zip(combination, operators, strict=True):
                vector = (vector + sign * (operator @ vector)) / 2
            done |= vector != 0
            if vector.any():
                basis[:, others[place]] = vector / np.sqrt((vector**2).sum())
                parities[others[place]] = combination
                place += 1
    return basis, parities.T


def _blade_images(scene: Scene, axis: int, kin: _Kin) -> Any:
    """The mirror image of every blade under a mirror in x (axis 0) or y (1); None unless every scene of a batch has that mirror."""
    pairs, one = _blade_pairs(scene, axis, kin)
    if not np.all(_has_mirror(scene, axis, kin, pairs, one)) or (pairs.ndim > 2 and (pairs != pairs[:1]).any()):
        return None
    first = pairs.reshape(-1, *pairs.shape[-2:])[0] if pairs.size else np.zeros((0, 1))
    return first.argmax(1)


def mirrored(scene: Scene) -> Any:
    """Which scenes of a batch map on themselves when x, or y, is mirrored: (..., 2) bool."""
    kin = _kin(scene)
    return np.stack([np.broadcast_to(_has_mirror(scene, axis, kin, *_blade_pairs(scene, axis, kin)), scene.batch) for axis in (0, 1)], axis=-1)


@dataclass(frozen=True)
class _Kin:
    """Pairs (..., b, b) of blades and (..., w, w) of wires that have the same numbers, but for where they are."""

    blades: Any
    wires: Any


def _kin(scene: Scene) -> _Kin:
    blades, wires = scene.blades, scene.wires
    plates = _same(blades.body, blades.axes.T) & _equal(blades.stiffness, blades.stiffness) & _same(blades.loss)
    plates = plates & _equal(blades.tip_mass[..., None], blades.tip_mass[..., None])
    # wires that hang from no blade match each other; others match if their blades do
    strands = _same(wires.upper, wires.lower, wires.loss) & ((wires.blade[:, None] < 0) == (wires.blade[None, :] < 0))
    strands = strands & _equal(wires.stiffness[..., None], wires.stiffness[..., None]) & _equal(wires.torsion[..., None], wires.torsion[..., None])
    strands = strands & _close(wires.tension[..., None], wires.tension[..., None]) & _close(wires.length[..., None], wires.length[..., None])
    if scene.fibres is not None:
        place = {label: n for n, label in enumerate(blades.label)}
        order = sorted(scene.fibres.blade, key=lambda blade: place[blade.label])
        plates = plates & _alike([(blade.angle, blade.losses, blade.thickness, blade.temperature) for blade in order])
        strands = strands & _alike([(fibre.sections, fibre.temperature, fibre.effective) for fibre in scene.fibres.wire])
    return _Kin(plates, strands)


def _flip(axis: int) -> Array:
    flip = np.ones(3)
    flip[axis] = -1.0
    return flip


def _blade_pairs(scene: Scene, axis: int, kin: _Kin) -> tuple[Any, Any]:
    """Pairs (..., b, b) of blades that are each other's images, and whether that is one to one."""
    blades, flip = scene.blades, _flip(axis)
    same = kin.blades & _equal(blades.tip, blades.tip * flip) & _close(blades.load, blades.load * flip)
    return same, _one_to_one(same)


def _has_mirror(scene: Scene, axis: int, kin: _Kin, blade: Any, one: Any) -> Any:
    """Whether each scene (...) maps on itself under a mirror in x (axis 0) or y (1); its blades pair as `_blade_pairs` says."""
    bodies, wires, springs, flip = scene.bodies, scene.wires, scene.springs, _flip(axis)
    odd = np.outer(flip, flip) < 0
    good = (bodies.position[..., axis] == 0).all(-1) & (bodies.inertia[..., odd] == 0).all((-2, -1))
    good = good & one
    if not np.any(good):
        return good
    same = kin.wires & _equal(wires.upper_point, wires.upper_point * flip) & _equal(wires.lower_point, wires.lower_point * flip)
    if scene.fibres is not None:
        same = same & _fibres(scene.fibres.wire, flip)
    if len(scene.blades.label):
        hung = blade[..., wires.blade[:, None], wires.blade[None, :]]
        same = same & np.where(wires.blade[:, None] >= 0, hung, True)
    good = good & _one_to_one(same)
    if not springs.label:
        return good
    six = np.array((PARITY_X, PARITY_Y)[axis], dtype=float)
    # a wrench mirrors as the motions that it works on
    same = (
        _same(springs.upper, springs.lower, springs.loss)
        & _equal(springs.lower_point, springs.lower_point * flip)
        & _equal(springs.preload, springs.preload * six)
    )
    for matrix in (springs.stiffness, springs.damping):
        flat = matrix.reshape(*matrix.shape[:-2], 36)
        same = same & _equal(flat, flat * np.outer(six, six).ravel())
    return good & _one_to_one(same)


def _fibres(fibres: tuple[Fibre, ...], flip: Array) -> Any:
    """Pairs (w, w) of wires whose clamps and planes are each other's images."""
    same = np.ones((len(fibres), len(fibres)), dtype=bool)
    for end in (0, 1):
        clamps = np.array([fibre.clamp[end] for fibre in fibres]).reshape(-1, 3)
        same = same & _close(clamps, clamps * flip)
    planes = np.array([fibre.plane for fibre in fibres]).reshape(-1, 3)
    turned = ~np.array([all(section.round for section in fibre.sections) for fibre in fibres], dtype=bool)
    return same & (_close(planes, planes * flip) | _close(planes, -planes * flip) | ~turned)


def _alike(kinds: list[Any]) -> Any:
    """Pairs (n, n) of things of one kind."""
    known: list[Any] = []
    for kind in kinds:
        if kind not in known:
            known.append(kind)
    return _same(np.array([known.index(kind) for kind in kinds], dtype=int))


def _same(*labels: Any) -> Any:
    """Pairs (n, n) whose static labels agree."""
    return np.logical_and.reduce([row[:, None] == row[None, :] for label in labels for row in np.atleast_2d(label)])


def _equal(values: Any, images: Any) -> Any:
    """Pairs (..., n, n) in which a member (..., n, c) equals the image of another exactly."""
    return (values[..., :, None, :] == images[..., None, :, :]).all(-1)


def _close(values: Any, images: Any) -> Any:
    """Pairs (..., n, n) in which a member equals the image of another but for rounding."""
    scale = np.abs(values).max((-2, -1), initial=0.0)[..., None, None, None]
    return (np.abs(values[..., :, None, :] - images[..., None, :, :]) <= ROUNDING * scale).all(-1)


def _one_to_one(same: Any) -> Any:
    """Whether each pairing (..., n, n) is a permutation."""
    return (same.sum(-1) == 1).all(-1) & (same.sum(-2) == 1).all(-1)
