"""What wires are made of, end to end: cross-sections, materials and losses, clamps and temperatures.

`string` sees a wire as one spring constant; `beam` and `violin` see it as this page describes it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from suspension_cli.conventions import AVOGADRO
from suspension_cli.design import materials
from suspension_cli.design.derive import blade_material
from suspension_cli.design.expand import signs, spelled_out
from suspension_cli.design.parts import WirePart
from suspension_cli.design.scene import Array
from suspension_cli.design.schema import Design, Stage
from suspension_cli.design.sections import Stretch, stretches
from suspension_cli.design.wires import Blade, BladeSet, Clamp, EndTemperatures, Wire, WireSet


@dataclass(frozen=True)
class Losses:
    """What makes a material lossy; see `mechanics.loss` for the formulas.

    Attributes
    ----------
    angle : float
        Constant loss angle of the bulk, rad.
    table : two tuples of n numbers or None
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
    table: tuple[tuple[float, ...], tuple[float, ...]] | None
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
        G J, N m^2; the tension adds T I_p/A to it, see `polar_area`.
    mass, polar : float
        Mass and polar moment of inertia a length, kg/m and kg m.
    depth : tuple of float
        Size across the wire in the two planes (diameter; thickness and width), m.
    round : bool
    losses : Losses
    torsion_factor : float
        On GJ + T I_p/A, of a wire whose torsion is given.
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
    torsion_factor: float = 1.0

    @property
    def polar_area(self) -> float:
        """Polar second moment of area over area, I_p/A in m^2: d^2/8 of a round wire, (w^2 + t^2)/12 of a ribbon."""
        first, second = self.depth
        return first**2 / 8 if self.round else (first**2 + second**2) / 12


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
    effective : bool
        Whether the design's ends are where the wire seems to bend, its clamps being beyond.
    """

    label: str
    sections: tuple[Section, ...]
    plane: Array
    clamp: tuple[Array, Array]
    temperature: tuple[float, float]
    effective: bool = False


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


POISSON = 0.3
"""Poisson's ratio of a material that has none."""


def unsuited(design: Design, massive: bool) -> str:
    """Why wires of this design cannot be modelled as beams; "" if all can.

    Parameters
    ----------
    design : Design
    massive : bool
        Whether the model needs the wires' masses too.
    """
    for stage in design.stage:
        for number, wire in enumerate(_wires(stage), 1):
            pieces = stretches(wire, 1.0)
            name = f"wire {stage.name}.{number}"
            if not pieces:
                return f"{name} has no cross-section"
            for piece in pieces:
                if piece.material is None:
                    return f"{name} has no material"
                if massive and materials.resolve(design, piece.material).density is None:
                    return f"{name} is of {piece.material}, which has no density"
    return ""


def fibres(design: Design) -> Fibres:
    """What the wires and blades of a design are made of, if `unsuited` finds nothing.  Imperfections are left out.

    Parameters
    ----------
    design : Design

    Returns
    -------
    Fibres
        Wires and blades in the order of the scene's.
    """
    warmth = design.constants.temperature

    @cache
    def losses(name: str) -> Losses:
        return _losses(design, name)

    wire: list[Fibre] = []
    blade: list[BladeLoss] = []
    for part in spelled_out(design):
        for number, (one, table) in enumerate(zip(part.wires, _wires(part.stage), strict=True)):
            ends = table.temperature
            both = (ends.upper, ends.lower) if isinstance(ends, EndTemperatures) else (ends or warmth, ends or warmth)
            length = float(np.sqrt(one.span @ one.span))
            pieces = stretches(table, length)
            along = 1.0 if table.k is None else table.k * sum(piece.length / (losses(piece.material or "").youngs_modulus * piece.area) for piece in pieces)
            sections = tuple(_section(design, piece, losses(piece.material or ""), along) for piece in pieces)
            wire.append(Fibre(one.label, sections, _plane(one.direction), _clamp(part.stage, number, table, one), both, table.clamp == "bending-point"))
        tables = [part.stage.blades] * len(part.blades) if part.stage.blades is not None else part.stage.blade
        for one, table in zip(part.blades.values(), tables, strict=True):
            material = blade_material(table)
            blade.append(_blade(one.label, table, None if material is None else losses(material), one.loss, warmth))
    gas = design.gas
    air = None if gas is None else Gas(gas.pressure, gas.molar_mass / AVOGADRO, gas.temperature or warmth)
    return Fibres(tuple(wire), tuple(blade), air, warmth)


def _wires(stage: Stage) -> list[WireSet | Wire]:
    """The table of each wire of a stage, in their order."""
    return [stage.wires] * stage.wires.count if stage.wires is not None else [*stage.wire]


def _losses(design: Design, name: str) -> Losses:
    """Losses of a material; without heat capacity and conductivity (no thermoelastic loss) unless all that it takes is known."""
    material = materials.resolve(design, name)
    loss = material.loss
    assert material.youngs_modulus is not None and loss is not None
    thermal = (material.density, material.thermal_expansion, material.specific_heat, material.thermal_conductivity)
    warm = loss.thermoelastic is not False and None not in thermal
    table = None if loss.table is None else (tuple(loss.table.frequency), tuple(loss.table.angle))
    return Losses(
        angle=loss.angle or 0.0,
        table=table,
        surface_depth=loss.surface_depth or 0.0,
        youngs_modulus=material.youngs_modulus,
        density=material.density or 0.0,
        expansion=material.thermal_expansion or 0.0,
        modulus_slope=material.modulus_slope or 0.0,
        heat_capacity=(material.specific_heat or 0.0) if warm else 0.0,
        conductivity=(material.thermal_conductivity or 0.0) if warm else 0.0,
    )


def _section(design: Design, piece: Stretch, losses: Losses, along: float) -> Section:
    """One stretch with its stiffnesses; that of stretching times `along`, for a wire whose k is given."""
    poisson = materials.resolve(design, piece.material or "").poisson_ratio
    shear = losses.youngs_modulus / (2 * (1 + (POISSON if poisson is None else poisson)))
    first, second = piece.moments
    mass, polar = piece.bulk
    return Section(
        length=piece.length,
        area=piece.area,
        rigidity=(losses.youngs_modulus * first, losses.youngs_modulus * second),
        stretching=losses.youngs_modulus * piece.area * along,
        twisting=shear * piece.torsion,
        mass=losses.density * mass,
        polar=losses.density * polar,
        depth=piece.depth,
        round=piece.section is None,
        losses=losses,
    )


def _plane(direction: Array) -> Array:
    """The unit vector across a wire that is nearest to x (to y, where the wire runs along x)."""
    for axis in np.eye(3):
        across = axis - (axis @ direction) * direction
        size = np.sqrt(across @ across)
        if size > 1e-3:
            return across / size
    raise AssertionError("no direction is along both x and y")


def _clamp(stage: Stage, number: int, table: WireSet | Wire, wire: WirePart) -> tuple[Array, Array]:
    """Directions at both ends; those of a symmetric set are told of its first wire and mirrored for the others."""
    clamp = table.clamp if isinstance(table.clamp, Clamp) else Clamp()
    along, across = signs(table.count)[number] if isinstance(table, WireSet) else (1, 1)
    mirror = np.array([along or 1, across or 1, 1.0])

    def direction(given: tuple[float, float, float] | None) -> Array:
        if given is None:
            return wire.direction
        turned = np.array(given) * mirror
        return turned / np.sqrt(turned @ turned)

    return direction(clamp.upper), direction(clamp.lower)


def _blade(label: str, table: BladeSet | Blade, losses: Losses | None, angle: float, warmth: float) -> BladeLoss:
    """A loss angle that the blade gives itself stands for the bulk of its material."""
    if losses is not None and table.loss_angle is not None:
        losses = replace(losses, angle=table.loss_angle, table=None, surface_depth=0.0)
    thickness = table.thickness if table.geometry is None else table.geometry.thickness
    return BladeLoss(label, angle, losses, thickness or 0.0, table.temperature or warmth)
