"""Quantities that follow from one table of a design: inertia of a shape, k of a wire, stiffness of a blade."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass
from typing import Any

from suspension_cli.conventions import SUPPORT
from suspension_cli.design import materials
from suspension_cli.design.schema import Body, Design, Stage
from suspension_cli.design.sections import area, stretches
from suspension_cli.design.wires import Blade, BladeGeometry, BladeSet, Wire, WireSet

Rows = tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]


def body_mass(body: Body) -> float:
    """Mass in kg, given or from density and shape."""
    if body.mass is not None:
        return body.mass
    assert body.density is not None
    return body.density * volume(body)


def volume(body: Body) -> float:
    """Volume of a shape in m^3."""
    if body.shape == "box":
        assert body.size is not None
        return body.size[0] * body.size[1] * body.size[2]
    assert body.radius is not None and body.length is not None
    return math.pi * (body.radius**2 - (body.inner_radius or 0.0) ** 2) * body.length


def body_inertia(body: Body) -> Rows:
    """Inertia tensor about the COM in kg m^2, given or that of a homogeneous shape.

    A hollow cylinder has m (R^2 + r^2)/2 about its axis and m (3 (R^2 + r^2) + L^2)/12 across it, a box
    m (b^2 + c^2)/12 about the axis that its sides b, c are normal to (any text on mechanics).
    """
    if body.inertia is not None:
        if isinstance(body.inertia[0], list):
            return tuple(tuple(row) for row in body.inertia)  # type: ignore[return-value, arg-type]
        return _diagonal(*body.inertia)  # type: ignore[arg-type]
    mass = body_mass(body)
    if body.shape == "box":
        assert body.size is not None
        a, b, c = (side**2 for side in body.size)
        return _diagonal(mass * (b + c) / 12, mass * (a + c) / 12, mass * (a + b) / 12)
    assert body.radius is not None and body.length is not None
    radii = body.radius**2 + (body.inner_radius or 0.0) ** 2
    along, across = mass * radii / 2, mass * (3 * radii + body.length**2) / 12
    moments = [across, across, across]
    moments["xyz".index(body.axis or "x")] = along
    return _diagonal(*moments)


def _diagonal(a: float, b: float, c: float) -> Rows:
    return ((a, 0.0, 0.0), (0.0, b, 0.0), (0.0, 0.0, c))


def wire_stiffness(design: Design, wire: WireSet | Wire, length: float) -> float:
    """k = E A / l in N/m (Husman et al., equation 15), with l the loaded length in the nominal pose; of several sections in series."""
    if wire.k is not None:
        return wire.k
    if wire.sections is None:
        assert wire.material is not None
        return _modulus(design, wire.material) * area(wire.radius, wire.section) / length
    return 1.0 / sum(piece.length / (_modulus(design, piece.material or "") * piece.area) for piece in stretches(wire, length))


def _modulus(design: Design, material: str) -> float:
    modulus = materials.resolve(design, material).youngs_modulus
    assert modulus is not None
    return modulus


def blade_stiffness(design: Design, blade: BladeSet | Blade, stage_mass: float, count: int) -> float:
    """Vertical stiffness of one blade at its tip in N/m.

    Given; or (2 pi f)^2 m / count for an uncoupled frequency f of the stage's mass m on its `count` blades;
    or from the geometry.
    """
    if blade.stiffness is not None:
        return blade.stiffness
    if blade.uncoupled_frequency is not None:
        return (2 * math.pi * blade.uncoupled_frequency) ** 2 * stage_mass / count
    assert blade.geometry is not None
    return cantilever_stiffness(blade.geometry, _modulus(design, blade.geometry.material))


def gives_natural_lengths(design: Design) -> bool:
    """Whether a design gives the natural length of any wire, so that it need not balance as it is drawn."""
    return any(wire.natural_length is not None for stage in design.stage for wire in stage.wire)


def solves_pose(design: Design) -> bool:
    """Whether the pose of a design is solved for instead of being drawn: where natural lengths of wires or loads of blades are given."""
    blades = (blade for stage in design.stage for blade in (*stage.blade, *([] if stage.blades is None else [stage.blades])))
    return gives_natural_lengths(design) or any(blade.load is not None for blade in blades)


def cantilever_stiffness(blade: BladeGeometry, youngs_modulus: float) -> float:
    """k = E a h^3 / (4 alpha L^3) of a blade with base width a, thickness h, length L, shape factor alpha.

    alpha = 1 for a rectangular blade (then k = 3 E I / L^3), 1.5 for a triangular one.  Torrie, PhD thesis,
    University of Glasgow (2001), after Plissi et al., Rev. Sci. Instrum. 71, 2539 (2000).
    """
    return youngs_modulus * blade.base_width * blade.thickness**3 / (4 * blade.shape_factor * blade.length**3)


@dataclass(frozen=True)
class SetGeometry:
    """A symmetric set of wires, fully spelled out (all in m; the paper's symbols)."""

    count: int
    length: float
    s_upper: float
    s_lower: float
    t1: float
    t2: float
    d: float
    d_upper: float

    @property
    def height_squared(self) -> float:
        """Square of the vertical span of a wire in m^2; not positive if the wire is too short for its span."""
        return self.length**2 - (self.t2 - self.t1) ** 2 - (self.s_lower - self.s_upper) ** 2

    @property
    def height(self) -> Any:
        """Vertical span of a wire in m."""
        square = self.height_squared
        return cmath.sqrt(square) if isinstance(square, complex) else math.sqrt(square)


def set_geometry(wires: WireSet) -> SetGeometry:
    """The geometry of a symmetric set, defaults filled in."""
    s = wires.s or 0.0
    return SetGeometry(
        count=wires.count,
        length=wires.l,
        s_upper=s if wires.s_upper is None else wires.s_upper,
        s_lower=s if wires.s_lower is None else wires.s_lower,
        t1=wires.t1 or 0.0,
        t2=wires.t2 or 0.0,
        d=wires.d,
        d_upper=wires.d_upper,
    )


def com_offset(stage: Stage) -> tuple[float, float, float]:
    """From the COM above (or the support point) to the nominal COM of a stage, m."""
    if stage.wires is None:
        assert stage.position is not None
        return stage.position
    shape = set_geometry(stage.wires)
    return (0.0, 0.0, -(shape.d_upper + shape.height + shape.d))


def com_positions(design: Design) -> dict[str, tuple[float, float, float]]:
    """Nominal COM of every stage from the suspension point, m."""
    found = {SUPPORT: (0.0, 0.0, 0.0)}
    above = SUPPORT
    for stage in design.stage:
        x, y, z = found[stage.hangs_from or above]
        dx, dy, dz = com_offset(stage)
        found[stage.name] = (x + dx, y + dy, z + dz)
        above = stage.name
    return found


def wire_loss(design: Design, wire: WireSet | Wire, length: float) -> float:
    """Loss angle of the stretching of a wire of a loaded length (m), rad: what the design gives its material, 0 if nothing.

    Of several sections, the mean of theirs, each weighted by its share of the compliance.
    """
    if wire.sections is None:
        return 0.0 if wire.material is None else materials.constant_angle(design, wire.material)
    pieces = [piece for piece in stretches(wire, length) if piece.material is not None]
    angles = [materials.constant_angle(design, piece.material or "") for piece in pieces]
    if not any(angles):
        return 0.0
    shares = [piece.length / (_modulus(design, piece.material or "") * piece.area) for piece in pieces]
    return sum(share * angle for share, angle in zip(shares, angles, strict=True)) / sum(shares)


def blade_material(blade: BladeSet | Blade) -> str | None:
    """What a blade is made of, if the design says."""
    return blade.material if blade.geometry is None else blade.geometry.material


def blade_loss(design: Design, blade: BladeSet | Blade) -> float:
    """Loss angle of a blade, rad: given, or what the design gives its material, 0 if neither is."""
    if blade.loss_angle is not None:
        return blade.loss_angle
    material = blade_material(blade)
    return 0.0 if material is None else materials.constant_angle(design, material)
