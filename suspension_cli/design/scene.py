"""The scene: every body, wire, blade and spring of a suspension, spelled out as arrays.

A scene is what all general mechanics starts from.  Its topology (which wire joins which bodies) is fixed;
its numbers may carry any batch axes in front, shown as ``...`` below, so that a million imperfect builds
are one scene.  Body 0 is the support, body n the n-th stage.  Points are in the frame of their body, from
its centre of mass; at the nominal pose all frames are parallel to x, y, z.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from suspension_cli.design.fibres import Fibres

Array = NDArray[np.float64]
Index = NDArray[np.intp]


@dataclass(frozen=True)
class Bodies:
    """Rigid bodies.

    Attributes
    ----------
    name : tuple of str
        Stage names, without the support.
    mass : (..., n) array
        kg.
    inertia : (..., n, 3, 3) array
        About the COM, kg m^2.
    position : (..., n + 1, 3) array
        Nominal COM from the suspension point, m; row 0 is the support.
    """

    name: tuple[str, ...]
    mass: Array
    inertia: Array
    position: Array


@dataclass(frozen=True)
class Wires:
    """Straight elastic wires, each pulling with ``tension + stiffness (L - length)`` at length L; and against being twisted, where the design says so.

    Attributes
    ----------
    label : tuple of str
        ``test.1`` and so on.
    upper, lower : (w,) int arrays
        The bodies joined.
    blade : (w,) int array
        The blade whose tip carries the upper end, or -1.
    upper_point, lower_point : (..., w, 3) arrays
        The ends, m.
    span : (..., w, 3) array
        From upper to lower end in the nominal pose, m.
    length : (..., w) array
        Norm of `span`.
    tension : (..., w) array
        At that length, N.
    stiffness : (..., w) array
        N/m.
    torsion : (..., w) array
        Torsional stiffness that the design gives, N m/rad; 0 if it gives none.
    loss : (w,) array
        Loss angle of the stretching, and of a torsion that is given, rad.
    """

    label: tuple[str, ...]
    upper: Index
    lower: Index
    blade: Index
    upper_point: Array
    lower_point: Array
    span: Array
    length: Array
    tension: Array
    stiffness: Array
    torsion: Array
    loss: Array


@dataclass(frozen=True)
class Blades:
    """Cantilever blades: springs along the axes of their body between it and a tip.

    Attributes
    ----------
    label : tuple of str
    body : (b,) int array
        The body (or support) on which the blade is clamped.
    axes : (b, 3) bool array
        Along which axes the tip moves; the others are rigid.
    tip : (..., b, 3) array
        Nominal position of the tip, m.
    stiffness : (..., b, 3) array
        N/m (0 along rigid axes).
    load : (..., b, 3) array
        Force of the blade on its tip in the nominal pose, N.
    tip_mass : (..., b) array
        kg.
    loss : (b,) array
        Loss angle, rad.
    """

    label: tuple[str, ...]
    body: Index
    axes: NDArray[np.bool_]
    tip: Array
    stiffness: Array
    load: Array
    tip_mass: Array
    loss: Array


@dataclass(frozen=True)
class Springs:
    """Linear springs between coincident points of two bodies, in the frame of the upper one.

    Attributes
    ----------
    label : tuple of str
    upper, lower : (s,) int arrays
    upper_point, lower_point : (..., s, 3) arrays
        The point in the frame of each body, m.
    stiffness, damping : (..., s, 6, 6) arrays
        N/m, N m/rad and mixed; N s/m and so on.
    preload : (..., s, 6) array
        Force (N) and torque (N m) on the lower body in the nominal pose.
    loss : (s,) array
        Loss angle, rad.
    """

    label: tuple[str, ...]
    upper: Index
    lower: Index
    upper_point: Array
    lower_point: Array
    stiffness: Array
    damping: Array
    preload: Array
    loss: Array


@dataclass(frozen=True)
class Flex:
    """What wires add that bend and twist, or that only twist, at rest.

    Attributes
    ----------
    upper, lower : (..., w, 2, 3) arrays
        Unit vectors of each wire's principal planes, in the frames of the two bodies.
    bend : (..., w, 2, 3) array or None
        S_uu, S_ul, S_ll in each plane: moments at the ends over the slopes there, N m/rad; None for strings.
    twist : (..., w) array
        Torque over twist, N m/rad.
    """

    upper: Array
    lower: Array
    bend: Array | None
    twist: Array


@dataclass(frozen=True)
class Scene:
    """A whole suspension.

    Attributes
    ----------
    name : str
        The design's name.
    gravity : float
        m/s^2.
    bodies, wires, blades, springs
    drawn : Scene or None
        Of an imperfect scene, what it was meant to be: that balances in its nominal pose.
    fibres : Fibres or None
        What the wires are made of, where they bend (`beam`, `violin`); None for strings.
    flex : Flex or None
        How stiff they are against that.
    """

    name: str
    gravity: float
    bodies: Bodies
    wires: Wires
    blades: Blades
    springs: Springs
    drawn: Scene | None = None
    fibres: Fibres | None = None
    flex: Flex | None = None

    @cached_property
    def batch(self) -> tuple[int, ...]:
        """Shape of the batch axes."""
        inner = (
            (self.bodies, {"mass": 1, "inertia": 3, "position": 2}),
            (self.wires, {"upper_point": 2, "lower_point": 2, "span": 2, "length": 1, "tension": 1, "stiffness": 1, "torsion": 1}),
            (self.blades, {"tip": 2, "stiffness": 2, "load": 2, "tip_mass": 1}),
            (self.springs, {"upper_point": 2, "lower_point": 2, "stiffness": 3, "damping": 3, "preload": 2}),
        )
        return np.broadcast_shapes(*(getattr(part, name).shape[:-axes] for part, names in inner for name, axes in names.items()))

    @cached_property
    def kind(self) -> Any:
        """Type of the numbers: complex where a derivative is taken by a complex step."""
        groups = (self.bodies, self.wires, self.blades, self.springs)
        return np.result_type(float, self.gravity, *(v for group in groups for v in vars(group).values() if isinstance(v, np.ndarray) and v.dtype == complex))

    @property
    def weight(self) -> Array:
        """Weight of everything that hangs, N, shape ``batch``."""
        return self.gravity * (self.bodies.mass.sum(-1) + self.blades.tip_mass.sum(-1))
