"""What wires are made of, end to end: cross-sections, materials and losses, clamps and temperatures.

`string` sees a wire as one spring constant; `beam` and `violin` see it as this page describes it.
"""

from __future__ import annotations

from dataclasses import dataclass

from suspension_cli.design.scene import Array


@dataclass(frozen=True)
class Losses:
    """What makes a material lossy; see `mechanics.loss` for the formulas.

    Attributes
    ----------
    angle : float
        Constant loss angle of the bulk, rad.
    table : tuple of two (n,) arrays or None
        Frequencies (Hz, ascending) and loss angles of the bulk instead of a constant one.
    surface_depth : float
        Dissipation depth d_s of the surface, m.
    youngs_modulus, density : float
        Pa, kg/m^3.
    expansion : float
        Linear thermal expansion, 1/K.
    modulus_slope : float
        (1/E) dE/dT, 1/K.
    heat_capacity : float
        Specific heat, J/(kg K).  0: no thermoelastic loss.
    conductivity : float
        Thermal conductivity, W/(m K).  0: no thermoelastic loss.
    """

    angle: float
    table: tuple[Array, Array] | None
    surface_depth: float
    youngs_modulus: float
    density: float
    expansion: float
    modulus_slope: float
    heat_capacity: float
    conductivity: float


@dataclass(frozen=True)
class Section:
    """A stretch of wire with one cross-section, under no load but its tension.

    Attributes
    ----------
    length : float
        Loaded, m.
    area : float
        m^2.
    rigidity : tuple of float
        E I for bending in the two principal planes, N m^2: first the plane of the thickness of a ribbon (its soft plane).
    stretching : float
        E A, N.
    twisting : float
        G J, N m^2.
    mass, polar : float
        Mass and polar moment of inertia a length, kg/m and kg m.
    depth : tuple of float
        Size across the wire in the two planes (diameter; thickness and width), m.
    round : bool
    losses : Losses
    """

    length: float
    area: float
    rigidity: tuple[float, float]
    stretching: float
    twisting: float
    mass: float
    polar: float
    depth: tuple[float, float]
    round: bool
    losses: Losses


@dataclass(frozen=True)
class Fibre:
    """One wire.

    Attributes
    ----------
    label : str
        ``test.1``.
    sections : tuple of Section
        From the upper to the lower end.
    plane : (3,) array
        Unit vector across the nominal wire: the first principal plane (direction of a ribbon's thickness).
    clamp : tuple of two (3,) arrays
        Unit vectors along which the upper and the lower end leave their clamps, both pointing down the wire.
    temperature : tuple of float
        At the upper and the lower end, K.
    """

    label: str
    sections: tuple[Section, ...]
    plane: Array
    clamp: tuple[Array, Array]
    temperature: tuple[float, float]


@dataclass(frozen=True)
class BladeLoss:
    """Loss of one blade: its material's where the geometry is known, and its temperature (K)."""

    label: str
    angle: float
    """Constant loss angle where no material is known, rad."""
    losses: Losses | None
    thickness: float
    """m; 0 where it is not known (then there is no thermoelastic loss)."""
    temperature: float


@dataclass(frozen=True)
class Gas:
    """Residual gas around everything: pressure in Pa, mass of a molecule in kg, temperature in K."""

    pressure: float
    molecule: float
    temperature: float


@dataclass(frozen=True)
class Fibres:
    """All wires and blades of a scene, in the order of `Scene.wires` and `Scene.blades`, and the gas around them."""

    wire: tuple[Fibre, ...]
    blade: tuple[BladeLoss, ...]
    gas: Gas | None
    temperature: float
    """Of everything that has none of its own, K."""
