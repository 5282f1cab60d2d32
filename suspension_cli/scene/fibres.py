"""Composition of the wires and blades of a design, for the models in which wires bend."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np

from suspension_cli.conventions import AVOGADRO
from suspension_cli.design import materials
from suspension_cli.design.derive import blade_material
from suspension_cli.design.schema import Design, Stage
from suspension_cli.design.sections import Stretch, stretches
from suspension_cli.design.wires import Blade, BladeSet, Clamp, EndTemperatures, Wire, WireSet
from suspension_cli.scene.arrays import Array
from suspension_cli.scene.composition import BladeLoss, Fibre, Fibres, Gas, Losses, Section
from suspension_cli.scene.expand import expand_stages, wire_signs
from suspension_cli.scene.parts import WirePart

POISSON = 0.3
"""Poisson's ratio of a material for which none is known."""


def explain_unsuitable(design: Design, massive: bool) -> str:
    """Explain why wires of a design cannot be modelled as beams; "" if all can.

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


def compose(design: Design) -> Fibres:
    """List the composition of the wires and blades of a design, without its imperfections.

    Parameters
    ----------
    design : Design
        One for which `explain_unsuitable` returns "".

    Returns
    -------
    Fibres
        Wires and blades in the order of the scene's.
    """
    ambient = design.constants.temperature

    @cache
    def losses(name: str) -> Losses:
        return _losses(design, name)

    wires: list[Fibre] = []
    blades: list[BladeLoss] = []
    for part in expand_stages(design):
        for number, (wire, table) in enumerate(zip(part.wires, _wires(part.stage), strict=True)):
            temperature = table.temperature or ambient
            wires.append(
                Fibre(
                    label=wire.label,
                    sections=_sections(
                        design, table, np.sqrt(wire.span @ wire.span).item(), losses
                    ),
                    plane=_plane(wire.direction),
                    clamp=_clamp(part.stage, number, table, wire),
                    temperature=(temperature.upper, temperature.lower)
                    if isinstance(temperature, EndTemperatures)
                    else (temperature, temperature),
                    effective=table.clamp == "bending-point",
                )
            )
        tables = [part.stage.blades] * len(part.blades) if part.stage.blades else part.stage.blade
        for blade, table in zip(part.blades.values(), tables, strict=True):
            material = blade_material(table)
            own = None if material is None else losses(material)
            blades.append(_blade(blade.label, table, own, blade.loss, ambient))
    gas = design.gas and Gas(
        design.gas.pressure,
        design.gas.molar_mass / AVOGADRO,
        design.gas.temperature or ambient,
    )
    return Fibres(tuple(wires), tuple(blades), gas, ambient)


def _sections(
    design: Design, table: WireSet | Wire, length: float, losses: Callable[[str], Losses]
) -> tuple[Section, ...]:
    """Sections of a wire of a loaded length (m); a given k scales their stiffness of stretching."""
    pieces = [(piece, losses(piece.material or "")) for piece in stretches(table, length)]
    compliance = sum(
        piece.length / (own.youngs_modulus * piece.shape.area) for piece, own in pieces
    )
    along = 1.0 if table.k is None else table.k * compliance
    return tuple(_section(design, piece, own, along) for piece, own in pieces)


def _wires(stage: Stage) -> list[WireSet | Wire]:
    """List the table of each wire of a stage, in order."""
    return [stage.wires] * stage.wires.count if stage.wires is not None else [*stage.wire]


def _losses(design: Design, name: str) -> Losses:
    """Look up the losses of a material.

    Heat capacity and conductivity are 0 (no thermoelastic loss) unless all constants of
    thermoelastic loss are known.
    """
    material = materials.resolve(design, name)
    loss = material.loss
    assert material.youngs_modulus is not None and loss is not None
    thermal = (
        material.density,
        material.thermal_expansion,
        material.specific_heat,
        material.thermal_conductivity,
    )
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
    """Compute the stiffnesses of one stretch of wire.

    That of stretching is multiplied by `along`, which fits it to a given k of the wire.
    """
    poisson = materials.resolve(design, piece.material or "").poisson_ratio
    shear = losses.youngs_modulus / (2 * (1 + (POISSON if poisson is None else poisson)))
    shape = piece.shape
    first, second = shape.moments
    mass, polar = shape.bulk
    return Section(
        length=piece.length,
        rigidity=(losses.youngs_modulus * first, losses.youngs_modulus * second),
        stretching=losses.youngs_modulus * shape.area * along,
        twisting=shear * shape.torsion,
        mass=losses.density * mass,
        polar=losses.density * polar,
        shape=shape,
        losses=losses,
    )


def _plane(direction: Array) -> Array:
    """Find the unit vector across a wire nearest to x (to y, where the wire runs along x)."""
    for axis in np.eye(3):
        across = axis - (axis @ direction) * direction
        size = np.sqrt(across @ across)
        if np.real(size) > 1e-3:
            return across / size
    raise AssertionError("no direction is along both x and y")


def _clamp(stage: Stage, number: int, table: WireSet | Wire, wire: WirePart) -> tuple[Array, Array]:
    """Directions in which a wire leaves its clamps.

    A symmetric set gives those of its first wire; they are mirrored for the others.
    """
    clamp = table.clamp if isinstance(table.clamp, Clamp) else Clamp()
    along, across = wire_signs(table.count)[number] if isinstance(table, WireSet) else (1, 1)
    mirror = np.array([along or 1, across or 1, 1.0])

    def direction(given: tuple[float, float, float] | None) -> Array:
        if given is None:
            return wire.direction
        turned = np.array(given) * mirror
        return turned / np.sqrt(turned @ turned)

    return direction(clamp.upper), direction(clamp.lower)


def _blade(
    label: str, table: BladeSet | Blade, losses: Losses | None, angle: float, ambient: float
) -> BladeLoss:
    """Look up the loss of a blade; its own loss angle replaces that of its material's bulk."""
    if losses is not None and table.loss_angle is not None:
        losses = replace(losses, angle=table.loss_angle, table=None, surface_depth=0.0)
    thickness = table.thickness if table.geometry is None else table.geometry.thickness
    return BladeLoss(label, angle, losses, thickness or 0.0, table.temperature or ambient)
