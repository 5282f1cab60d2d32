"""Composition of wires and blades: cross-sections, materials, losses, clamps and temperatures."""

from __future__ import annotations

from dataclasses import dataclass

from suspension_cli.design.cross_sections import CrossSection
from suspension_cli.design.losses import Mechanism
from suspension_cli.design.schema import Gas
from suspension_cli.scene.arrays import Array


@dataclass(frozen=True)
class Section:
    """A stretch of wire with a uniform cross-section.

    Attributes
    ----------
    length
        Loaded, m.
    rigidity
        E I in the two principal planes, N m^2; the first contains a ribbon's thickness (soft
        plane).
    stretching
        E A, N.
    twisting
        G J, N m^2; the tension T adds T I_p/A to it, see `polar_area`.
    mass, polar
        Mass and polar moment of inertia per length, kg/m and kg m.
    torsion_factor
        Factor on G J + T I_p/A, for a wire whose torsional stiffness is given.
    tension_offset
        Tension in its middle minus that of the wire, due to the wire's weight, N.
    """

    length: float
    rigidity: tuple[float, float]
    stretching: float
    twisting: float
    mass: float
    polar: float
    shape: CrossSection
    losses: tuple[Mechanism, ...]
    torsion_factor: float = 1.0
    tension_offset: float = 0.0

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
    """Composition of one wire.

    Attributes
    ----------
    label
        ``test.1``.
    sections
        From the upper to the lower end.
    plane : (3,) array
        Unit vector across the nominal wire in the first principal plane.
    clamp : tuple of two (3,) arrays
        Unit vectors along the wire at its upper and lower clamp, both from the upper towards the
        lower end.
    temperature
        At the upper and the lower end, K.
    effective
        Whether the given ends are the effective bending points, with the clamps beyond them.
    """

    label: str
    sections: tuple[Section, ...]
    plane: Array
    clamp: tuple[Array, Array]
    temperature: tuple[float, float]
    effective: bool = False


@dataclass(frozen=True)
class BladeLoss:
    """Loss of one blade, spring or link.

    Attributes
    ----------
    angle
        Constant loss angle where no material is known, rad.
    losses
        Of the blade's material, if known.
    thickness
        m; 0 if unknown: no thermoelastic loss.
    temperature
        K.
    shape
        Of the wires of a link, instead of a thickness.
    """

    label: str
    angle: float
    losses: tuple[Mechanism, ...] | None
    thickness: float
    temperature: float
    shape: CrossSection | None = None


@dataclass(frozen=True)
class Fibres:
    """Composition of all wires and blades of a scene, and the gas around them.

    Attributes
    ----------
    wire
        In the order of `Scene.wires`.
    blade
        In the order of `Scene.blades`.
    spring
        Springs of known material; others have the loss angle of `Scene.springs`.
    gas
        With its temperature, if there is any.
    temperature
        Where the design gives no other, K.
    """

    wire: tuple[Fibre, ...]
    blade: tuple[BladeLoss, ...]
    gas: Gas | None
    temperature: float
    spring: tuple[BladeLoss, ...] = ()
