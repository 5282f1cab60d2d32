"""Builds of a scene in one pose each, as arrays with the builds as last axis.

A scene has batch axes in front and components last: points of wires are (..., wire, 3). Here the
same arrays have components first and builds last, (3, wire, build); what all builds share has one
build, (3, wire, 1).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from suspension_cli.elements.resting import resistance_of_wires, wire_resistance
from suspension_cli.elements.vectors import Matrix, Scalar, Vector, dot, product, times
from suspension_cli.rotations import turn_by
from suspension_cli.scene.arrays import change_arrays, inner_axes
from suspension_cli.scene.pose import Layout, Pose
from suspension_cli.scene.scene import Flex, Scene, Wires

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact, Int

    Rows = slice | np.ndarray
    Numbers = tuple[int, ...]


def builds_last(
    value: Inexact[np.ndarray, "*batch element *inner"],
    inner: int,
    batch: tuple[int, ...],
    rows: Rows = slice(None),
) -> Inexact[np.ndarray, "*inner element build"]:
    """Move the batch axes of an array behind all others, as one axis of the builds `rows`.

    `inner` is the number of its other axes. An array without batch axes gets one of length 1.

    >>> builds_last(np.zeros((7, 4, 3)), 2, (7,)).shape
    (3, 4, 7)
    """
    if value.ndim == inner:
        flat = value[None]
    else:
        own = value.shape[value.ndim - inner :]
        flat = np.broadcast_to(value, (*batch, *own)).reshape(math.prod(batch), *own)[rows]
    return np.ascontiguousarray(flat.transpose(*range(2, flat.ndim), 1, 0))


def batch_first(
    value: Inexact[np.ndarray, "*inner element build"], batch: tuple[int, ...]
) -> Inexact[np.ndarray, "*batch element *inner"]:
    """Undo `builds_last`: batch axes in front, components last."""
    last = value.ndim - 1
    flat = value.transpose(last, last - 1, *range(last - 1))
    if len(flat) < math.prod(batch):
        return np.broadcast_to(flat[0], (*batch, *flat.shape[1:]))
    return flat.reshape(*batch, *flat.shape[1:])


class Ends(NamedTuple):
    """Bodies that elements of a kind join, and the blades at whose tips their upper ends are.

    -1 is for a lower end that is fixed in space, and for no blade.
    """

    upper: Numbers
    lower: Numbers
    blade: Numbers

    @classmethod
    def of(
        cls,
        upper: Int[np.ndarray, " element"],
        lower: Int[np.ndarray, " element"] | None = None,
        blade: Int[np.ndarray, " element"] | None = None,
    ) -> Ends:
        """Ends on the given bodies, by default fixed in space, and blades."""
        none = np.full(len(upper), -1)
        each = (upper, none if lower is None else lower, none if blade is None else blade)
        return cls(*(tuple(numbers.tolist()) for numbers in each))


@lru_cache(maxsize=1024)
def sums(
    *numbers: Numbers, partly: bool = False
) -> tuple[Int[np.ndarray, "number group"], Float[np.ndarray, "group element"]]:
    """Group elements by the numbers of their bodies or blades.

    Those with a -1 are in no group, unless `partly`.
    Also returns the matrix of ones that sums over the elements of each group.
    """
    known, group = np.unique(np.array(numbers), axis=1, return_inverse=True)
    kept = np.flatnonzero((known >= 0).all(0) | partly)
    return known[:, kept], (group.ravel() == kept[:, None]).astype(float)


@dataclass(frozen=True)
class SceneArrays:
    """Builds of one scene, with the axes of its parts as in this module.

    `flex` is that of wires that resist bending or twisting, else None. If `follows`, the resistance
    of wires with `fibres` is that at their tension in a pose, not that of `flex`.
    """

    scene: Scene  # labels, bodies that are joined, and gravity
    numbering: Layout
    count: int  # of builds
    parts: Mapping[str, Any]  # as `Scene.parts`; those that every scene has are attributes too
    flex: Flex | None
    follows: bool = False

    bodies = property(lambda self: self.parts["bodies"])
    wires = property(lambda self: self.parts["wires"])
    struts = property(lambda self: self.parts["struts"])
    blades = property(lambda self: self.parts["blades"])
    springs = property(lambda self: self.parts["springs"])
    bars = property(lambda self: self.parts["bars"])

    @classmethod
    def of(
        cls,
        scene: Scene,
        numbering: Layout,
        rows: Rows = slice(None),
        count: int | None = None,
    ) -> SceneArrays:
        """The builds `rows` of a scene (`count` of them, if not all)."""

        def last(inner: int, value: np.ndarray) -> np.ndarray:
            return builds_last(value, inner, scene.batch, rows)

        parts = {name: change_arrays(last, part) for name, part in scene.parts.items()}
        flex = wire_resistance(scene)
        total = math.prod(scene.batch) if count is None else count
        return cls(scene, numbering, total, parts, flex and change_arrays(last, flex))

    def select(self, which: Int[np.ndarray, " build"]) -> SceneArrays:
        """Some of the builds."""

        def some(_: int, value: np.ndarray) -> np.ndarray:
            return value if value.shape[-1] == 1 else value[..., which]

        parts = {name: change_arrays(some, part) for name, part in self.parts.items()}
        flex = self.flex and change_arrays(some, self.flex)
        return replace(self, count=len(which), parts=parts, flex=flex)

    @cached_property
    def dtype(self) -> np.dtype:
        """Type of number of all arrays."""
        parts = self.parts.values()
        arrays = (getattr(part, name) for part in parts for name in inner_axes(type(part)))
        return np.result_type(float, *(array.dtype for array in arrays))


@dataclass(frozen=True)
class Attached:
    """Elements between points of two bodies, with arms from the COMs along global axes, m."""

    ends: Ends
    upper_arm: Vector
    lower_arm: Vector


@dataclass(frozen=True)
class Line(Attached):
    """Straight lines between points of two bodies, in a pose."""

    direction: Vector  # unit vector from the upper to the lower end
    length: Scalar  # m
    elongation: Scalar  # from the nominal length, m
    tension: Scalar  # N


@dataclass(frozen=True)
class Configuration:
    """Builds in one pose each, as in `Pose`.

    A `tension` of wires is in place of that in the pose: for their geometric stiffness, and for
    their resistance to bending where that follows.
    """

    arrays: SceneArrays
    shift: Vector  # (3, 1 + body, build)
    turn: Matrix  # (3, 3, 1 + body, build)
    deflection: Vector  # (3, blade, build)
    tension: Scalar | None = None

    @classmethod
    def of(
        cls, arrays: SceneArrays, pose: Pose, batch: tuple[int, ...], rows: Rows = slice(None)
    ) -> Configuration:
        """Builds in poses, of which those of all builds have the batch axes `batch`."""
        shapes = inner_axes(Pose)
        parts = (
            builds_last(getattr(pose, item.name), shapes[item.name], batch, rows)
            for item in fields(pose)
        )
        whole = (np.broadcast_to(part, (*part.shape[:-1], arrays.count)) for part in parts)
        return cls(arrays, *whole)

    def select(self, which: Int[np.ndarray, " build"]) -> Configuration:
        """Some of the builds."""
        parts = (part[..., which] for part in (self.shift, self.turn, self.deflection))
        tension = None if self.tension is None else self.tension[:, which]
        return Configuration(self.arrays.select(which), *parts, tension=tension)

    @cached_property
    def place(self) -> Vector:
        """COMs of the support and all bodies from the suspension point, m."""
        return self.arrays.bodies.position + self.shift

    def turn_of(self, body: Numbers) -> Matrix:
        """Rotations of bodies minus the unit matrix."""
        return self.turn.take(body, axis=2)

    def arms(
        self, body: Numbers, point: Vector, blade: Numbers | None = None
    ) -> tuple[Vector, Vector]:
        """Vectors from the COMs of bodies to points (or tips of blades), and their changes."""
        turn = self.turn_of(body)
        moved = 0.0
        if max(blade or (), default=-1) >= 0:
            none = np.zeros_like(self.deflection[:, :1])
            moved = np.concatenate([self.deflection, none], axis=1)[:, list(blade or ())]
            point = point + moved
        change = times(turn, point)
        return point + change, change + moved

    @cached_property
    def wires(self) -> Line:
        """All wires."""
        return self._lines(self.arrays.wires)

    @cached_property
    def struts(self) -> Line:
        """All struts."""
        return self._lines(self.arrays.struts)

    @cached_property
    def flex(self) -> Flex | None:
        """Resistance of the wires to bending and twisting."""
        fibres = self.arrays.scene.fibres
        flex = self.arrays.flex
        wires = self.arrays.wires
        if not self.arrays.follows or fibres is None or flex is None or flex.bend is None:
            return flex
        length = self.wires.length
        tension = self.wires.tension if self.tension is None else self.tension
        torsion = np.broadcast_to(wires.torsion, length.shape)
        bend, twist = resistance_of_wires(fibres.wire, length, tension, torsion)
        return replace(flex, bend=bend, twist=twist)

    def displaced(self, step: Inexact[np.ndarray, "coordinate build"]) -> Configuration:
        """Move by finite steps in all coordinates: translations add, rotations multiply."""
        bodies = self.shift.shape[1]
        motion = step[: 6 * bodies].reshape(bodies, 6, -1).swapaxes(0, 1)
        turn = turn_by(motion[3:])
        return Configuration(
            self.arrays,
            self.shift + motion[:3],
            turn + self.turn + product(turn, self.turn),
            self.deflection + self.tip_motion(step)[:, :-1],
        )

    def tip_motion(self, step: Inexact[np.ndarray, "coordinate build"]) -> Vector:
        """Deflection of each blade by a step in all coordinates, and 0 for none (-1), m."""
        tips = self.arrays.numbering.blade
        padded = np.concatenate([step, np.zeros_like(step[:1])])
        return padded[np.concatenate([tips, np.full((1, 3), len(step))]).T]

    def _lines(self, wires: Wires) -> Line:
        ends = Ends.of(wires.upper, wires.lower, wires.blade)
        upper_arm, up = self.arms(ends.upper, wires.upper_point, ends.blade)
        lower_arm, low = self.arms(ends.lower, wires.lower_point)
        # from displacements alone, so that nothing cancels
        change = self.shift[:, wires.lower] - self.shift[:, wires.upper] + (low - up)
        span = wires.span + change
        length = np.sqrt(dot(span, span))
        elongation = dot(change, span + wires.span) / (length + wires.length)
        tension = wires.tension + wires.stiffness * elongation
        direction = span / length
        return Line(ends, upper_arm, lower_arm, direction, length, elongation, tension)


def configuration(scene: Scene, numbering: Layout, pose: Pose) -> Configuration:
    """A scene in a pose; either may have the batch axes."""
    batch = batch_of(scene, pose)
    arrays = SceneArrays.of(scene, numbering, count=math.prod(batch))
    return Configuration.of(arrays, pose, batch)


def batch_of(scene: Scene, pose: Pose) -> tuple[int, ...]:
    """Batch axes of a scene in a pose."""
    return np.broadcast_shapes(scene.batch, pose.shift.shape[:-2])
