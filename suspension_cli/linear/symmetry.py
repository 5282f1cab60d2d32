"""Mirror symmetries of a scene, and coordinates that split its matrices accordingly.

If the mirror x to -x (or y to -y) maps every body onto itself, and every wire, blade, spring, ...
onto an equal one, motions even and odd under it do not couple. Which numbers of a part change sign
in a mirror is declared with its arrays (`arrays.inner`). The coordinates of a body are even or odd
already; those of blade tips that are mirror images are combined into even and odd sums. Matrix
elements between different parities are rounding errors, and are set to exactly 0.

An odd number of equal wires, blades or legs around z has one mirror, say y. But a symmetric matrix
that also has their rotation couples the n-th harmonic around z to itself alone: x and pitch (cos),
y and roll (sin), z and yaw (n = 0) are apart as if x were a mirror, too. That of the tips of blades
then acts harmonic by harmonic.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from suspension_cli.conventions import PARITY_X, PARITY_Y
from suspension_cli.elimination import connected_groups
from suspension_cli.scene.arrays import frames, inner_axes, signed
from suspension_cli.scene.pose import Layout
from suspension_cli.scene.scene import Scene, select_scenes

if TYPE_CHECKING:
    from _typeshed import DataclassInstance
    from jaxtyping import Bool, Float, Inexact, Int, Real

    from suspension_cli.scene.scene import Fibre

    Pairs = dict[str, Bool[np.ndarray, "*#batch member member"]]
    """Pairs of members of each part of a scene that map onto each other, by the part's name."""

APART = ("label", "blade", "span")
"""Fields that mirror images need not share: names, the blade of a wire, whose own image counts, and
what follows from the ends of a wire."""
ROUNDING = 1e-13
"""Relative difference up to which computed values (tensions, loads, clamps) count as equal; given
ones must equal exactly."""


ODD = (3, 5, 7)
"""Odd numbers of equal wires, blades or legs around z that are looked for."""


@dataclass(frozen=True)
class Symmetry:
    """Coordinates adapted to the mirror symmetries of a scene.

    `basis` has the named coordinates (rows) in terms of the adapted ones (columns), orthogonal;
    `allowed` marks the elements of a matrix that the symmetry allows; `mirrors` are ``("x", "y")``
    for a scene with both symmetries.
    """

    basis: Float[np.ndarray, "coordinate coordinate"]
    allowed: Bool[np.ndarray, "coordinate coordinate"]
    mirrors: tuple[str, ...]

    def apply(
        self, matrix: Inexact[np.ndarray, "*batch coordinate coordinate"]
    ) -> Inexact[np.ndarray, "*batch coordinate coordinate"]:
        """Change a symmetric matrix to adapted coordinates, with exact zeros."""
        if self.trivial and self.allowed.all():
            return matrix
        rows = columns = np.flatnonzero(matrix.any(tuple(range(matrix.ndim - 1))))
        own = matrix[..., rows[:, None], rows]
        if not self.trivial:
            columns = np.flatnonzero(self.basis[rows].any(0))
            basis = self.basis[rows[:, None], columns]
            own = basis.T @ own @ basis
            own = (own + np.swapaxes(own, -1, -2)) / 2
        result = np.zeros(matrix.shape, dtype=matrix.dtype)  # takes no memory where it stays 0
        place = columns[:, None], columns
        result[..., *place] = np.where(self.allowed[place], own, 0.0)
        return result

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
    operators = []
    mirrors = []
    size = numbering.size
    allowed = np.ones((size, size), dtype=bool)
    within: list[Bool[np.ndarray, "coordinate coordinate"]] = []
    members = _Members(scene)
    for axis in (0, 1):
        whole = _tip_operator(members, axis)
        if whole is not None:
            mirrors.append(axis)
            operators.append(_operator(scene, numbering, axis, whole))
            within.append(allowed)
            continue
        for chain in members.chains:
            own = None
            if np.all(_has_mirror(scene, axis, chain)):
                own = _tip_operator(_Members(_seen_from(scene, chain[0])), axis, chain)
            if own is not None:
                operators.append(_operator(scene, numbering, axis, own))
                within.append(_within_chain(scene, numbering, chain, axis))
    for n, inside in enumerate(within):
        # a mirror of one chain says nothing about the others
        operators[n] = np.where(inside.any(0), operators[n], np.eye(size))
    basis, parity = _adapted_basis(size, operators)
    for own, inside in zip(parity, within, strict=True):
        allowed = allowed & (~inside | (own[:, None] == own))
    return Symmetry(basis, allowed, tuple("xy"[axis] for axis in mirrors))


def _chains(scene: Scene) -> list[Int[np.ndarray, " _"]]:
    """Groups of bodies that nothing but the support joins; none if one hangs on the z axis."""
    count = len(scene.bodies.name) + 1
    joined = np.eye(count, dtype=bool)
    for name, part in scene.parts.items():
        if name != "bodies" and part.label:
            bodies = _bodies_of(part)
            for one, other in itertools.combinations(bodies.T, 2):
                joined[one, other] = True
    groups = [group + 1 for group in connected_groups((joined | joined.T)[1:, 1:])]
    return groups if len(groups) > 1 or scene.bodies.position[..., :2].any() else []


def _bodies_of(part: DataclassInstance) -> Int[np.ndarray, "member end"]:
    """Numbers of the bodies of each member of a part."""
    names = dict.fromkeys(frames(type(part)).values())
    return np.column_stack([getattr(part, name) for name in names])


def _seen_from(scene: Scene, body: int) -> Scene:
    """The scene with points on the support given from the point above (or below) a body."""
    parts: dict[str, Any] = dict(scene.parts)
    for kind, part in scene.parts.items():
        moved = {}
        for name, key in frames(type(part)).items() if kind != "bodies" else ():
            points = np.array(getattr(part, name))
            here = getattr(part, key) == 0
            aside = scene.bodies.position[..., body, :2].reshape(-1, 2)[0]
            points[..., :2] -= here[..., None] * aside
            moved[name] = points
        parts[kind] = replace(part, **moved)
    return scene.with_parts(parts)


def _within_chain(
    scene: Scene, numbering: Layout, chain: Int[np.ndarray, " body"], axis: int
) -> Bool[np.ndarray, "coordinate coordinate"]:
    """Elements of a matrix that a mirror of a chain alone concerns: its own, and to the support.

    Rotations of the support that displace the plane of the mirror along it have both parities.
    """
    own, base = np.zeros((2, numbering.size), dtype=bool)
    for body in chain:
        own[6 * body : 6 * body + 6] = True
    tips = numbering.blade[_attached(scene, "blades", chain)]
    own[tips[tips < numbering.size]] = True
    base[:6] = True
    base[[4 - axis, 5]] = (scene.bodies.position[..., chain[0], axis] == 0).all()
    return np.outer(own, own | base) | np.outer(base, own)


def no_symmetry(numbering: Layout) -> Symmetry:
    """Build the trivial symmetry: named coordinates, all couplings allowed."""
    size = numbering.size
    return Symmetry(np.eye(size), np.ones((size, size), dtype=bool), ())


def _operator(
    scene: Scene, numbering: Layout, axis: int, image: Float[np.ndarray, "blade blade"]
) -> Float[np.ndarray, "coordinate coordinate"]:
    """Build the matrix of a mirror, given that of blades."""
    bodies = len(scene.bodies.name) + 1
    result = np.zeros((numbering.size,) * 2)
    np.fill_diagonal(
        result,
        np.append(
            np.tile((PARITY_X, PARITY_Y)[axis], bodies), np.zeros(numbering.size - 6 * bodies)
        ),
    )
    for direction, sign in enumerate(np.where(np.arange(3) == axis, -1.0, 1.0)):
        moves = np.flatnonzero(scene.blades.axes[:, direction])
        if len(moves):
            rows = numbering.blade[moves, direction]
            result[rows[:, None], rows] = sign * image[moves[:, None], moves]
    return result


def _adapted_basis(
    size: int, operators: list[Float[np.ndarray, "coordinate coordinate"]]
) -> tuple[Float[np.ndarray, "coordinate coordinate"], Float[np.ndarray, "mirror coordinate"]]:
    """Find common eigenvectors of commuting mirrors (columns), and their parities (mirror, column).

    A coordinate that is its own image is kept; the others are projected on each combination of
    parities, and the projections that do not depend on earlier ones take their places.
    """
    basis = np.eye(size)
    parities = np.zeros((size, len(operators)))
    is_own_image = np.ones(size, dtype=bool)
    for n, operator in enumerate(operators):
        parities[:, n] = np.diag(operator)
        is_own_image &= np.abs(parities[:, n]) == 1
    others = np.flatnonzero(~is_own_image)
    place = 0
    within = [operator[others[:, None], others] for operator in operators]
    combinations = [*itertools.product((1.0, -1.0), repeat=len(operators))]
    projections = [np.eye(len(others))] * len(combinations)
    for n, combination in enumerate(combinations):
        for sign, operator in zip(combination, within, strict=True):
            projections[n] = (projections[n] + sign * (operator @ projections[n])) / 2
    adapted = np.zeros((len(others),) * 2)
    for start in range(len(others)):
        for combination, projection in zip(combinations, projections, strict=True):
            vector = projection[:, start]
            if not vector.any():
                continue
            known = adapted[:, :place]
            vector = vector - known @ (known.T @ vector)
            vector = np.where(np.abs(vector) > ROUNDING, vector, 0.0)
            if vector.any():
                adapted[:, place] = vector / np.sqrt((vector**2).sum())
                parities[others[place]] = combination
                place += 1
    basis[others[:, None], others] = adapted
    return basis, parities.T


def is_mirror_symmetric(scene: Scene) -> Bool[np.ndarray, "*batch 2"]:
    """Whether each scene of a batch is symmetric in x and in y."""
    return np.stack([is_symmetric_in(scene, axis) for axis in (0, 1)], axis=-1)


def is_symmetric_in(scene: Scene, axis: int) -> Bool[np.ndarray, "*batch"]:
    """Whether each scene of a batch is symmetric in x (axis 0) or y (1)."""
    possible = np.broadcast_to(_has_mirror(scene, axis), scene.batch)
    result = np.zeros(scene.batch, dtype=bool)
    if possible.any():
        some = scene if possible.all() else select_scenes(scene, possible)
        result[possible] = _mirror(_Members(some), axis)[0]
    return result


def _tip_operator(
    members: _Members, axis: int, chain: Int[np.ndarray, " body"] | None = None
) -> Float[np.ndarray, "blade blade"] | None:
    """Matrix of a mirror of x (axis 0) or y (1) for the blades, without the sign of directions.

    None unless all scenes of a batch have that symmetry (those bodies of a `chain` alone).
    """
    symmetric, images = _mirror(members, axis, chain)
    if not np.all(symmetric):
        return None
    blades = members.scene.blades
    count = len(blades.label)
    if not count:
        return np.zeros((0, 0))
    mirrored = images["blades"].reshape(-1, count, count)
    if (mirrored != mirrored[:1]).any():
        return None
    result = mirrored[0].astype(float)
    if "turned blades" not in images:
        return result
    after = images["turned blades"].reshape(-1, count, count).all(0).argmax(1)
    tip = np.real(blades.tip.reshape(-1, count, 3)[0])
    for first in range(count):
        if images["turned blades"][..., first, :].any() and not result[first].any():
            ring = [first]
            while after[ring[-1]] != first:
                ring.append(int(after[ring[-1]]))
            angle = np.arctan2(tip[ring, 1], tip[ring, 0])
            result[np.ix_(ring, ring)] = _mirrored_harmonics(angle, axis)
    return result


def _mirrored_harmonics(
    angle: Float[np.ndarray, " blade"], axis: int
) -> Float[np.ndarray, "blade blade"]:
    """Mirror functions on an odd number of places around a circle, harmonic by harmonic."""
    count = len(angle)
    result = np.full((len(angle), len(angle)), 1 / len(angle))
    for n in range(1, (count + 1) // 2):
        sign = (-1.0) ** n if axis == 0 else 1.0
        even = np.cos(n * angle)
        odd = np.sin(n * angle)
        result += 2 / count * sign * (np.outer(even, even) - np.outer(odd, odd))
    return result


def _mirror(
    members: _Members, axis: int, chain: Int[np.ndarray, " body"] | None = None
) -> tuple[Bool[np.ndarray, "*batch"], Pairs]:
    """Whether each scene is symmetric in x (axis 0) or y (1), and its members that are images.

    Members without an image may repeat around z an odd number of times instead, if the other mirror
    is one of the scene. `Pairs` has their next ones under "turned blades". With a `chain`, only its
    bodies and what is attached to them count.
    """
    scene = members.scene
    symmetric = _has_mirror(scene, axis, chain)
    if not np.any(symmetric):
        return symmetric, {}

    def lack_images(pairs: Pairs) -> Pairs:
        return {
            name: ~_has_one_image(own) & _attached(scene, name, chain)
            for name, own in pairs.items()
        }

    pairs = members.images(np.diag((PARITY_X, PARITY_Y)[axis]))
    lacking = lack_images(pairs)
    if not any(none.any() for none in lacking.values()):
        return symmetric, pairs
    orders = _orders(scene, lacking)
    other = _has_mirror(scene, 1 - axis, chain)
    if orders and other.any() and not scene.blades.axes[:, :2].any():
        images = members.images(np.diag((PARITY_X, PARITY_Y)[1 - axis]))
        for none in lack_images(images).values():
            other = other & ~none.any(-1)
        for order in orders:
            turned = members.images(rotation_about_z(2 * np.pi / order), exact=False)
            for name, own in turned.items():
                found = lacking[name] & _has_one_image(own) & other[..., None]
                lacking[name] = lacking[name] & ~found
                if name == "blades":
                    before = pairs.get("turned blades", np.zeros_like(own))
                    pairs["turned blades"] = before | (own & found[..., None])
    for none in lacking.values():
        symmetric = symmetric & ~none.any(-1)
    return symmetric, pairs


def _attached(
    scene: Scene, name: str, chain: Int[np.ndarray, " body"] | None
) -> Bool[np.ndarray, " member"]:
    """Whether each member of a part is attached to bodies of a chain; without one, all are."""
    part = scene.parts[name]
    if chain is None:
        return np.ones(len(part.label), dtype=bool)
    if name == "blades":
        wires = scene.wires.blade[np.isin(scene.wires.lower, chain)]
        return np.isin(np.arange(len(part.label)), wires)
    return np.asarray(np.isin(_bodies_of(part), chain).any(-1))


def _has_mirror(
    scene: Scene, axis: int, chain: Int[np.ndarray, " body"] | None = None
) -> Bool[np.ndarray, "*batch"]:
    """Whether bodies and gravity are symmetric in x (axis 0) or y (1)."""
    bodies = scene.bodies
    flip = np.array((PARITY_X, PARITY_Y)[axis][:3])
    place = bodies.position[..., axis]
    inertia = bodies.inertia
    if chain is not None:
        place = place[..., chain] - place[..., chain[:1]]
        inertia = inertia[..., chain - 1, :, :]
    symmetric = (place == 0).all(-1) & (inertia == inertia * np.outer(flip, flip)).all((-3, -2, -1))
    if scene.field is not None and not scene.field.has_mirror(axis):
        symmetric = np.zeros_like(symmetric)
    return symmetric


def _has_one_image(
    pairs: Bool[np.ndarray, "*batch member member"],
) -> Bool[np.ndarray, "*batch member"]:
    """Whether each member has exactly one image, and is that of exactly one."""
    return (pairs.sum(-1) == 1) & (pairs.sum(-2) == 1)


def _orders(scene: Scene, lacking: Pairs) -> list[int]:
    """Odd numbers of times that members which lack an image may repeat around z."""
    counts = set()
    for name, none in lacking.items():
        part = scene.parts[name]
        together = _equal_items(_bodies_of(part)).sum(-1)
        counts |= set(together[none.reshape(-1, len(together)).any(0)].tolist())
    return [order for order in ODD if any(count % order == 0 for count in counts)]


def rotation_about_z(angle: float) -> Float[np.ndarray, "6 6"]:
    """Matrix of a rotation about z, of displacements and of rotations."""
    cosine = np.cos(angle)
    sine = np.sin(angle)
    once = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    return np.kron(np.eye(2), once)


class _Members:
    """Members of all parts of a scene but bodies, which mirrors or rotations may map onto others.

    Attributes
    ----------
    scene
        Any batch axes.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene

    @cached_property
    def chains(self) -> list[Int[np.ndarray, " _"]]:
        """Bodies of chains that have mirrors of their own, see `_chains`."""
        return _chains(self.scene)

    @cached_property
    def _parts(self) -> dict[str, tuple[Bool[np.ndarray, "*#batch member member"], list[_Numbers]]]:
        """Pairs of members of each part that are equal but for their vectors, and these."""
        scene = self.scene
        parts = {name: part for name, part in scene.parts.items() if name != "bodies"}
        found = {name: _compare(part) for name, part in parts.items() if part.label}
        if scene.fibres is None:
            return found
        blades, springs = (
            {row.label: replace(row, label="") for row in rows}
            for rows in (scene.fibres.blade, scene.fibres.spring)
        )
        composition = {
            "wires": [(own.sections, own.effective) for own in scene.fibres.wire],
            "blades": [blades[label] for label in scene.blades.label],
            "springs": [springs.get(label) for label in scene.springs.label],
        }
        for name in found.keys() & composition.keys():
            pairs, vectors = found[name]
            if name == "wires":
                vectors = [*vectors, *_directions(scene.fibres.wire)]
            found[name] = pairs & _equal_items(composition[name]), vectors
        return found

    def images(self, operation: Real[np.ndarray, "6 6"], *, exact: bool = True) -> Pairs:
        """Pair the members that a mirror or rotation maps onto each other.

        Computed numbers, and all vectors unless `exact`, may differ by rounding.
        """
        pairs = {}
        for name, (alike, vectors) in self._parts.items():
            turned = [
                own._replace(images=_turned(own, operation), rounded=own.rounded or not exact)
                for own in vectors
            ]
            pairs[name] = _still_equal(alike, turned)
        if "blades" in pairs:
            blade = self.scene.wires.blade
            carried = pairs["blades"][..., blade[:, None], blade]
            carried = np.where(blade[:, None] >= 0, carried, True)
            pairs["wires"] = pairs["wires"] & _equal_items(blade < 0) & carried
        return pairs


class _Numbers(NamedTuple):
    """Numbers of members, and those of their images, which may differ by rounding if `rounded`."""

    values: Inexact[np.ndarray, "*#batch member *inner"]
    images: Inexact[np.ndarray, "*#batch member *inner"]
    inner: int  # number of axes of each member
    rounded: bool


def _compare(
    part: DataclassInstance,
) -> tuple[Bool[np.ndarray, "*#batch member member"], list[_Numbers]]:
    """Pair members of a part that are equal but for their vectors; also returns these."""
    kind = type(part)
    pairs = np.ones((len(_bodies_of(part)),) * 2, dtype=bool)
    scalars = []
    vectors = []
    for name, (is_vector, is_computed) in signed(kind).items():
        values = getattr(part, name)
        if name in APART:
            continue
        if not isinstance(values, np.ndarray):
            pairs = pairs & _equal_items(values)
            continue
        own = _Numbers(values, values, inner_axes(kind).get(name, values.ndim) - 1, is_computed)
        (vectors if is_vector else scalars).append(own)
    return _still_equal(pairs, scalars), vectors


def _directions(fibres: tuple[Fibre, ...]) -> Iterator[_Numbers]:
    """List the directions of the clamps of wires, and of the bending planes of wires not round.

    A plane is that of a unit vector p of either sign, and so of p p^T.
    """
    clamps = np.array([fibre.clamp for fibre in fibres]).reshape(-1, 2, 3)
    yield _Numbers(clamps, clamps, 2, rounded=True)
    is_round = np.array([all(own.round for own in fibre.sections) for fibre in fibres], dtype=bool)
    if not is_round.all():
        first = np.array([fibre.plane for fibre in fibres]).reshape(-1, 3)
        planes = np.where(is_round[:, None, None], 0.0, first[:, :, None] * first[:, None])
        yield _Numbers(planes, planes, 2, rounded=True)


def _equal_items(items: Sequence[object] | np.ndarray) -> Bool[np.ndarray, "item item"]:
    """Pair equal items: rows of an array (n, ...), or n objects."""
    if not isinstance(items, np.ndarray):
        items = np.array([items.index(item) for item in items], dtype=int)
    rows = items.reshape(len(items), math.prod(items.shape[1:]))
    return (rows[:, None] == rows).all(-1)


def _turned(
    own: _Numbers, operation: Real[np.ndarray, "6 6"]
) -> Inexact[np.ndarray, "*#batch member *inner"]:
    """Images of vectors and tensors in a mirror or rotation."""
    result = own.values
    for axis in range(-own.inner, 0):
        size = result.shape[axis]
        if size in (3, 6):
            rotation = operation[:size, :size].T
            result = (result.swapaxes(axis, -1) @ rotation).swapaxes(axis, -1)
    return result


def _still_equal(
    pairs: Bool[np.ndarray, "*#batch member member"], compared: Sequence[_Numbers]
) -> Bool[np.ndarray, "*batch member member"]:
    """Keep those of some pairs of members of which one has the numbers of the other's image.

    Numbers may differ by nothing, or by a fraction of the largest of their kind.
    """
    each = []
    for own in compared:
        count = own.values.ndim - own.inner
        shape = (*own.values.shape[:count], math.prod(own.values.shape[count:]))
        values = own.values.reshape(shape)
        limit = ROUNDING * np.abs(values).max((-2, -1), initial=0.0) if own.rounded else 0.0
        each.append((values, own.images.reshape(shape), limit))
    alone = [one for one in each if one[0].ndim == 2]
    if alone:
        values = np.concatenate([one[0] for one in alone], axis=1)
        images = np.concatenate([one[1] for one in alone], axis=1)
        limit = np.concatenate([np.full(one[0].shape[1], one[2]) for one in alone])
        pairs = pairs & (np.abs(values[:, None] - images) <= limit).all(-1)
    # those that all builds share came first: few pairs are left for the others
    others = [one for one in each if one[0].ndim > 2]
    for values, images, limit in sorted(others, key=lambda one: one[0].size):
        one, other = np.nonzero(pairs.any(tuple(range(pairs.ndim - 2))))
        equal = np.ones((*values.shape[:-2], len(one)), dtype=bool)
        for component in range(values.shape[-1]):
            own = values[..., component]
            difference = np.abs(own[..., one] - images[..., other, component])
            equal &= difference <= np.asarray(limit)[..., None]
        result = np.zeros(np.broadcast_shapes(pairs.shape, (*equal.shape[:-1], 1, 1)), dtype=bool)
        result[..., one, other] = pairs[..., one, other] & equal
        pairs = result
    return pairs
