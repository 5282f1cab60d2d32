"""Scene: every body, wire, blade and spring of a suspension as arrays.

The models `string`, `beam` and `violin` start from a scene. Its topology (which wire joins which
bodies) is fixed. Its numbers may have batch axes in front, shown as ``...`` below: a million
imperfect builds are one scene. Body 0 is the support, body n the n-th stage. Points are in the
frame of their body, from its centre of mass; in the nominal pose all frames are parallel to x, y,
z.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.design.cross_sections import CrossSection
from suspension_cli.design.materials import Mechanism
from suspension_cli.design.schema import Gas
from suspension_cli.design.wires import WireDamper
from suspension_cli.scene.arrays import Array, change_arrays, inner, inner_axes, shared

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Inexact, Int


PARTS = ("bodies", "wires", "blades", "springs", "struts", "bars")
"""Fields of a scene with an array of each kind of element."""


@dataclass(frozen=True)
class Section:
    """A stretch of wire with a uniform cross-section."""

    length: float  # loaded, m
    rigidity: tuple[float, float]  # E I in the principal planes, N m^2; a ribbon's soft one first
    stretching: float  # E A, N
    twisting: float  # G J, N m^2; the tension T adds T I_p/A to it, see `polar_area`
    mass: float  # per length, kg/m
    polar: float  # moment of inertia per length, kg m
    shape: CrossSection
    losses: tuple[Mechanism, ...]
    temperature: float  # K
    torsion_factor: float = 1.0  # on G J + T I_p/A, where the torsional stiffness is given
    tension_offset: float = 0.0  # of its middle from that of the wire, due to its weight, N
    damper: WireDamper | None = None  # at its lower end

    @property
    def round(self) -> bool:
        """Whether it is the same in all directions across the wire."""
        return self.shape.round

    @property
    def polar_area(self) -> float:
        """Polar second moment of area over area, I_p/A in m^2."""
        return self.shape.polar_area


@dataclass(frozen=True)
class Fibre:
    """Composition of one wire."""

    label: str  # ``test.1``
    sections: tuple[Section, ...]  # from the upper to the lower end
    plane: Array  # unit vector across the nominal wire in the first principal plane
    clamp: tuple[Array, Array]  # unit vectors down the wire at its upper and lower clamp
    effective: bool = False  # whether the ends are bending points, with the clamps beyond them


@dataclass(frozen=True)
class BladeLoss:
    """Loss of one blade, spring or link."""

    label: str
    angle: float  # constant loss angle where no material is known, rad
    losses: tuple[Mechanism, ...] | None  # of the material, if known
    thickness: float  # m; 0 if unknown: no thermoelastic loss
    temperature: float  # K
    shape: CrossSection | None = None  # of the wires of a link, instead of a thickness


@dataclass(frozen=True)
class Fibres:
    """Composition of all wires and blades of a scene, and the gas around them."""

    wire: tuple[Fibre, ...]  # in the order of `Scene.wires`
    blade: tuple[BladeLoss, ...]  # in the order of `Scene.blades`
    gas: Gas | None  # with its temperature
    temperature: float  # where the design gives no other, K
    spring: tuple[BladeLoss, ...] = ()  # of known material; others have the loss of the scene's


@dataclass(frozen=True)
class Bodies:
    """Rigid bodies: mass (kg), inertia about the COM (kg m^2), and the nominal place of the COM.

    The latter is from the suspension point, m; row 0 is the support.
    """

    name: tuple[str, ...]  # stages, without the support
    mass: Inexact[np.ndarray, "*batch body"] = field(metadata=inner())
    inertia: Inexact[np.ndarray, "... body 3 3"] = field(metadata=inner(3, 3))
    position: Inexact[np.ndarray, "... 1+body 3"] = field(metadata=inner(3))


@dataclass(frozen=True)
class Wires:
    """Straight elastic wires between points (m) of two bodies.

    At length L a wire pulls with ``tension + stiffness (L - length)``, N and N/m; `span` (m) is
    from its upper to its lower end in the nominal pose, and `length` the norm of that. `blade` is
    the number of the blade whose tip carries the upper end, or -1. `torsion` is the torsional
    stiffness that the design gives, N m/rad, or 0; `loss` the loss angle of stretching and of a
    given torsion, rad. `mass` has the moments m_uu, m_ul, m_ll (see `elements.weight`), kg; 0 for
    wires without weight.
    """

    label: tuple[str, ...]  # ``test.1`` and so on
    upper: Int[np.ndarray, " wire"] = field(metadata=shared(dtype=int))
    lower: Int[np.ndarray, " wire"] = field(metadata=shared(dtype=int))
    blade: Int[np.ndarray, " wire"] = field(metadata=shared(dtype=int, default=-1))
    upper_point: Inexact[np.ndarray, "... wire 3"] = field(metadata=inner(3, frame="upper"))
    lower_point: Inexact[np.ndarray, "... wire 3"] = field(metadata=inner(3, frame="lower"))
    span: Inexact[np.ndarray, "... wire 3"] = field(metadata=inner(3))
    length: Inexact[np.ndarray, "... wire"] = field(metadata=inner(computed=True))
    tension: Inexact[np.ndarray, "... wire"] = field(metadata=inner(computed=True))
    stiffness: Inexact[np.ndarray, "... wire"] = field(metadata=inner())
    torsion: Inexact[np.ndarray, "... wire"] = field(metadata=inner())
    loss: Inexact[np.ndarray, " wire"] = field(metadata=shared())
    mass: Inexact[np.ndarray, "... wire 3"] = field(metadata=inner(3))


@dataclass(frozen=True)
class Blades:
    """Cantilever blades: springs between a body (or the support) and a tip, along its axes.

    The tip moves along `axes` alone, with a stiffness in N/m (0 along the others). `tip` (m) is its
    nominal place and `load` (N) the force of the blade on it there; `tip_mass` is in kg, `loss` the
    loss angle in rad.
    """

    label: tuple[str, ...]
    body: Int[np.ndarray, " blade"] = field(metadata=shared(dtype=int))
    axes: Bool[np.ndarray, "blade 3"] = field(metadata=shared(3, dtype=bool))
    tip: Inexact[np.ndarray, "... blade 3"] = field(metadata=inner(3, frame="body"))
    stiffness: Inexact[np.ndarray, "... blade 3"] = field(metadata=inner(3))
    load: Inexact[np.ndarray, "... blade 3"] = field(metadata=inner(3, vector=True, computed=True))
    tip_mass: Inexact[np.ndarray, "... blade"] = field(metadata=inner())
    loss: Float[np.ndarray, " blade"] = field(metadata=shared())


@dataclass(frozen=True)
class Spectrum:
    """Complex stiffness of a spring against frequency (Hz, ascending), over its static stiffness.

    Linear in the logarithm of frequency, constant outside the table. Of each axis there are its
    number in `DOFS`, and real and imaginary part at each frequency. The temperature is in K.
    """

    temperature: float
    frequency: tuple[float, ...]
    axis: tuple[tuple[int, tuple[float, ...], tuple[float, ...]], ...]


@dataclass(frozen=True)
class Springs:
    """Linear springs between coincident points (m) of two bodies, in the upper one's frame.

    Stiffness and damping are in N/m, N m/rad and mixed, N s/m and so on; `preload` are force (N)
    and torque (N m) on the lower body in the nominal pose. `leg` is the length (m) of the leg whose
    flexures the spring is, or 0. The upper end of a `grounded` spring is on the ground (the upper
    body is then 0). Where a stiffness depends on frequency, it is diagonal and has a `spectrum`;
    else there is a loss angle, rad.
    """

    label: tuple[str, ...]
    upper: Int[np.ndarray, " spring"] = field(metadata=shared(dtype=int))
    lower: Int[np.ndarray, " spring"] = field(metadata=shared(dtype=int))
    upper_point: Inexact[np.ndarray, "... spring 3"] = field(metadata=inner(3, frame="upper"))
    lower_point: Inexact[np.ndarray, "... spring 3"] = field(metadata=inner(3, frame="lower"))
    stiffness: Inexact[np.ndarray, "... spring 6 6"] = field(metadata=inner(6, 6, vector=True))
    damping: Inexact[np.ndarray, "... spring 6 6"] = field(metadata=inner(6, 6, vector=True))
    preload: Inexact[np.ndarray, "... spring 6"] = field(
        metadata=inner(6, vector=True, computed=True)
    )
    leg: Inexact[np.ndarray, "... spring"] = field(metadata=inner())
    loss: Inexact[np.ndarray, " spring"] = field(metadata=shared())
    grounded: Bool[np.ndarray, " spring"] = field(metadata=shared(dtype=bool))
    spectrum: tuple[Spectrum | None, ...]


@dataclass(frozen=True)
class Bars:
    """Inertia of bars between points (m) of two bodies: legs, blades.

    A bar has the kinetic energy first v_1^2 / 2 + mixed v_1 . v_2 + second v_2^2 / 2 of the
    velocities of its ends, and so the weights g (first + mixed) and g (mixed + second) there. Its
    `inertia` are first, mixed and second, kg.
    """

    label: tuple[str, ...]
    body: Int[np.ndarray, "bar 2"] = field(metadata=shared(2, dtype=int))
    point: Inexact[np.ndarray, "... bar 2 3"] = field(metadata=inner(2, 3, frame="body"))
    inertia: Inexact[np.ndarray, "... bar 3"] = field(metadata=inner(3))

    @property
    def loads(self) -> Inexact[np.ndarray, "... bar 2"]:
        """Mass (..., bar, 2) whose weight rests on each end, kg."""
        return self.inertia[..., [0, 2]] + self.inertia[..., [1]]


@dataclass(frozen=True)
class Flex:
    """Static stiffness of wires against bending and twisting, or twisting alone.

    `upper` and `lower` are unit vectors of each wire's principal planes, in the frames of the two
    bodies, `bend` S_uu, S_ul, S_ll in each plane: moments at the ends per slope there, N m/rad;
    None for strings. `twist` is the torque per twist, N m/rad.
    """

    upper: Inexact[np.ndarray, "... wire 2 3"] = field(metadata=inner(2, 3))
    lower: Inexact[np.ndarray, "... wire 2 3"] = field(metadata=inner(2, 3))
    bend: Inexact[np.ndarray, "... wire 2 3"] | None = field(metadata=inner(2, 3))
    twist: Inexact[np.ndarray, "... wire"] = field(metadata=inner())


@dataclass(frozen=True)
class Field:
    """Acceleration due to gravity, vector + gradient r, at r from the suspension point."""

    vector: Inexact[np.ndarray, " 3"]  # m/s^2
    gradient: Inexact[np.ndarray, "3 3"]  # 1/s^2, symmetric (gravity is conservative)

    @property
    def is_uniform(self) -> bool:
        """Whether the gradient is 0."""
        return not self.gradient.any()

    def has_mirror(self, axis: int) -> bool:
        """Whether the field is its own mirror image in x (axis 0) or y (1)."""
        others = np.arange(3) != axis
        return bool(self.vector[axis] == 0 and not self.gradient[axis, others].any())


@dataclass(frozen=True)
class Scene:
    """A whole suspension.

    `struts` are legs of inverted pendulums, as wires of negative tension from the foot (upper) to
    the top (lower); `bars` the inertia and weight of legs, and of blades that couple a filter and
    its keystone. What is `added` are arrays of further elements between two bodies, by the name of
    the element: dataclasses like `Springs`, with at least `label`, and the numbers `upper` <
    `lower` of the bodies (0 for the support, and for what is fixed in space).
    """

    name: str
    gravity: float  # strength at the suspension point, m/s^2
    bodies: Bodies
    wires: Wires
    blades: Blades
    springs: Springs
    struts: Wires
    bars: Bars
    drawn: Scene | None = None  # of an imperfect scene, that without imperfections, in balance
    fibres: Fibres | None = None  # for wires that bend
    flex: Flex | None = None
    added: Mapping[str, Any] = field(default_factory=dict)
    field: Field | None = None  # gravity that is not a uniform pull along -z
    solves_pose: bool = False  # whether wires have natural lengths, so that the pose is not drawn

    @property
    def parts(self) -> dict[str, Any]:
        """Bodies, wires, blades, ... by the name of their field, and what is `added`."""
        return {name: getattr(self, name) for name in PARTS} | dict(self.added)

    def with_parts(self, parts: Mapping[str, Any]) -> Scene:
        """Replace some of its parts, by their names."""
        own = {name: part for name, part in parts.items() if name not in self.added}
        added = {name: parts.get(name, part) for name, part in self.added.items()}
        return replace(self, added=added, **own)

    def map(self, change: Callable[..., np.ndarray], *others: Scene) -> Scene:
        """Replace its arrays by functions of those of this and other scenes (`change_arrays`)."""
        parts = {
            name: change_arrays(change, part, *(other.parts[name] for other in others))
            for name, part in self.parts.items()
        }
        return self.with_parts(parts)

    @cached_property
    def batch(self) -> tuple[int, ...]:
        """Shape of the batch axes."""
        shapes = {
            getattr(part, name).shape[:-axes]
            for part in self.parts.values()
            for name, axes in inner_axes(type(part)).items()
        }
        return shapes.pop() if len(shapes) == 1 else np.broadcast_shapes(*shapes)

    @property
    def weight(self) -> Inexact[np.ndarray, "*batch"]:
        """Weight of everything that hangs, N, shape ``batch``."""
        wires = self.wires.mass.sum((-2, -1)) + self.wires.mass[..., 1].sum(-1)
        mass = self.bodies.mass.sum(-1) + self.blades.tip_mass.sum(-1) + wires
        return self.gravity * mass + self.gravity * self.bars.loads[..., 1].sum(-1)


def stack_scenes(scenes: Sequence[Scene], pick: Int[np.ndarray, " build"] | None = None) -> Scene:
    """Stack scenes into one whose first axis runs over them.

    The scenes are without batch axes, of the same topology; labels, losses and the like are those
    of the first. `pick` has the number of the scene of each member of the batch; by default each in
    turn.
    """
    order = np.arange(len(scenes)) if pick is None else pick
    drawn = [scene.drawn for scene in scenes if scene.drawn is not None]
    together = stack_scenes(drawn, pick) if len(drawn) == len(scenes) else None
    first, *others = scenes
    return replace(first.map(lambda _, *values: np.stack(values)[order], *others), drawn=together)


def select_scenes(
    scene: Scene, which: Bool[np.ndarray, "*batch"] | Int[np.ndarray, " build"] | int
) -> Scene:
    """Select scenes of a batch, along one axis: by a bool array of its shape, or by numbers."""

    def selected(axes: int, value: np.ndarray) -> np.ndarray:
        own = value.shape[: value.ndim - axes]
        if scene.batch and not own:  # the same for all
            return value
        if own == scene.batch:
            return value[which]
        return np.broadcast_to(value, scene.batch + value.shape[value.ndim - axes :])[which]

    drawn = scene.drawn
    if drawn is not None and drawn.batch:
        drawn = select_scenes(drawn, which)
    flex = scene.flex and change_arrays(selected, scene.flex)
    return replace(scene.map(selected), drawn=drawn, flex=flex)


def scale_imperfections(scene: Scene, fraction: float) -> Scene:
    """Scale the imperfections of a scene, its differences from `scene.drawn`, by a fraction (0 to
    1).
    """
    assert scene.drawn is not None
    scaled = scene.map(lambda _, new, old: old + fraction * (new - old), scene.drawn)
    length = np.sqrt((scaled.wires.span**2).sum(-1))
    return replace(scaled, wires=replace(scaled.wires, length=length))
