"""Composition of wires and blades: cross-sections, materials, losses, clamps and temperatures."""

from __future__ import annotations

from dataclasses import dataclass

from suspension_cli.design.cross_sections import CrossSection
from suspension_cli.design.materials import Mechanism
from suspension_cli.design.schema import Gas
from suspension_cli.scene.arrays import Array


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
    torsion_factor: float = 1.0  # on G J + T I_p/A, where the torsional stiffness is given
    tension_offset: float = 0.0  # of its middle from that of the wire, due to its weight, N

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
    temperature: tuple[float, float]  # at the upper and the lower end, K
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
