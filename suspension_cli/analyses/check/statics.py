"""Statics of a design: tensions, stretch, sag, stress, weight of wires, height, displacements."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np

from suspension_cli.analyses.check import towers
from suspension_cli.analyses.check.columns import Column
from suspension_cli.analyses.check.light import CavityLoad, cavity_loads
from suspension_cli.analyses.check.towers import FilterLoad, LegLoad
from suspension_cli.design import materials
from suspension_cli.design.derive import gravity_strength, wire_line_densities
from suspension_cli.design.schema import Body, Design, Stage
from suspension_cli.design.sections import given_sections, thinnest
from suspension_cli.design.wires import Blade, BladeSet, Profile, Wire, WireSet
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.equilibrium.solve import Equilibrium
from suspension_cli.equilibrium.solve import solve as balance
from suspension_cli.models.string import STRING
from suspension_cli.rotations import rotation_vector
from suspension_cli.scene import links, strands
from suspension_cli.scene.links import Places
from suspension_cli.scene.scene import Scene

SAG = 0.05
"""Largest sag of a link over its length that is a small deflection."""
NOTED = 4e-3
"""Weight over tension above which `check` notes that a design leaves it out; frequencies of
pendulums change by up to a quarter of it."""


@dataclass(frozen=True)
class Stress:
    """Stress of a wire or blade.

    Attributes
    ----------
    stress : float or None
        Largest, at the thinnest section of a wire or the base of a blade, Pa; None if the geometry
        is unknown.
    strength : float or None
        Tensile strength of `material`, Pa; None if unknown.
    fraction : float or None
        Largest ratio of stress to strength of all sections.
    material : str
        Material of that section; "" if none is named.
    """

    label: str
    stress: Annotated[float | None, Column("stress_pa", "stress\nMPa", ".0f", 1e-6)]
    strength: Annotated[float | None, Column("strength_pa")]
    fraction: Annotated[float | None, Column("strength_fraction", "of strength\n%", ".3g", 100)]
    material: str

    @property
    def stage(self) -> str:
        """Name of its stage."""
        return self.label.rsplit(".", 1)[0]

    @property
    def number(self) -> str:
        """Its number or name in the stage."""
        return self.label.rsplit(".", 1)[1]


@dataclass(frozen=True)
class WireLoad(Stress):
    """Load of one wire: tension (N), elongation (m), and that over its loaded length."""

    label: Annotated[str, Column("wire", "wire")]
    tension: Annotated[float, Column("tension_n", "tension\nN", ".2f")]
    stretch: Annotated[float, Column("stretch_m", "stretch\nmm", ".3f", 1e3)]
    strain: Annotated[float, Column("stretch_fraction")]


@dataclass(frozen=True)
class BladeLoad(Stress):
    """Load of one blade: vertical force at its tip (N), and deflection of the tip (m)."""

    label: Annotated[str, Column("blade", "blade")]
    load: Annotated[float, Column("load_n", "load\nN", ".2f")]
    sag: Annotated[float, Column("sag_m", "sag\nmm", ".3f", 1e3)]


@dataclass(frozen=True)
class BodyPose:
    """Displacement (m) and rotation vector (rad) of one body from its nominal pose."""

    name: Annotated[str, Column("stage")]
    shift: Annotated[tuple[float, float, float], Column("shift_m")]
    rotation: Annotated[tuple[float, float, float], Column("rotation_rad")]


@dataclass(frozen=True)
class Lowest:
    """Lowest point of a stage: z (m) from the suspension point, and the part there."""

    name: Annotated[str, Column("stage")]
    z: Annotated[float, Column("z_m")]
    point: Annotated[str, Column("point")]


@dataclass(frozen=True)
class LinkLoad:
    """A link or damper between two bodies.

    Attributes
    ----------
    stiffness, damping : (float, float, float)
        Along x, y, z at its point, N/m and N s/m.
    length : float or None
        Of one wire of a link given by its geometry, m.
    weight : float or None
        Of all its wires, N, which the models leave out.
    sag : float or None
        Largest descent of a wire under its weight, as a small deflection, m.
    table : (float, float) or None
        Lowest and highest frequency of its table of stiffness, Hz.
    """

    label: Annotated[str, Column("label")]
    between: Annotated[tuple[str, ...], Column("between")]
    stiffness: Annotated[tuple[float, float, float], Column("stiffness")]
    damping: Annotated[tuple[float, float, float], Column("damping")]
    length: Annotated[float | None, Column("length")] = None
    weight: Annotated[float | None, Column("weight")] = None
    sag: Annotated[float | None, Column("sag")] = None
    table: Annotated[tuple[float, float] | None, Column("table")] = None

    @property
    def hangs_freely(self) -> bool:
        """Whether it sags too far for a small deflection."""
        return self.sag is not None and self.length is not None and self.sag > SAG * self.length


@dataclass(frozen=True)
class ReducedProfile:
    """Numbers of places of a measured profile of a fibre, and of its uniform sections."""

    wire: Annotated[str, Column("wire")]
    places: Annotated[int, Column("places")]
    sections: Annotated[int, Column("sections")]


@dataclass(frozen=True)
class WireWeights:
    """Weight of the wires of a design.

    Attributes
    ----------
    included : bool
        Whether the design includes it.
    total : float
        N.
    ratio, wire : float, str
        Largest weight over tension, and its wire.
    sag : float
        Largest distance of a wire from the straight line between its ends, m: w l / (8 T) for the
        part w of its weight across it (Irvine, Cable Structures, MIT Press (1981), section 1.2).
    error : float
        Error of the stiffness of straight wires: across, (W/T)^2 / 12, or along them, the largest
        decrease of a wire's stiffness k by its sag, w^2 k l / (12 T^3), over k (Ernst, Der
        Bauingenieur 40, 52 (1965)).
    """

    included: bool
    wire: str
    total: Annotated[float, Column("total_n")]
    ratio: Annotated[float, Column("largest_over_tension")]
    sag: Annotated[float, Column("sag_m")]
    error: Annotated[float, Column("error")]

    @property
    def line(self) -> str:
        """Describe the weight in a line; "" if it is left out and small."""
        if not self.included:
            if self.ratio < NOTED:
                return ""
            return (
                f"wires weigh up to {100 * self.ratio:.2g} % of their tension ({self.wire});"
                " constants.wire_weight = true includes this"
            )
        sag = f"largest sag {1e3 * self.sag:.3g} mm"
        return (
            f"wires weigh {self.total:.4g} N, up to {100 * self.ratio:.2g} % of their tension"
            f" ({self.wire}); {sag}; the error by straight wires is {100 * self.error:.1g} %"
        )


@dataclass(frozen=True)
class Statics:
    """Statics of a design; `top` is z of the highest end of a wire, m."""

    wires: tuple[WireLoad, ...]
    blades: tuple[BladeLoad, ...]
    bodies: tuple[BodyPose, ...]
    lowest: tuple[Lowest, ...]
    top: float
    residual: float
    links: tuple[LinkLoad, ...] = ()
    legs: tuple[LegLoad, ...] = ()
    filters: tuple[FilterLoad, ...] = ()
    cavities: tuple[CavityLoad, ...] = ()
    profiles: tuple[ReducedProfile, ...] = ()
    weights: WireWeights | None = None

    @property
    def height(self) -> float:
        """Height from the lowest to the highest point, m."""
        return self.top - min(stage.z for stage in self.lowest)


def solve(design: Design) -> Statics:
    """Solve for the loads of a design in the equilibrium of the string model.

    Raises
    ------
    InputError
        If it cannot balance, or a wire is slack.
    """
    scene = expand(design)
    strings = STRING.completed(scene, design)
    balanced = balance(strings)
    balanced.demand(strings)
    pose, ends = balanced.pose, _end_heights(scene, balanced)
    wires = tuple(wire_loads(design, scene, balanced))
    return Statics(
        wires=wires,
        blades=tuple(blade_loads(design, scene, balanced)),
        bodies=tuple(
            BodyPose(
                name=name,
                shift=_vector(pose.shift[n]),
                rotation=_vector(rotation_vector(pose.rotation[n] - np.eye(3))),
            )
            for n, name in enumerate(scene.bodies.name, 1)
        ),
        lowest=tuple(
            _find_lowest(stage.body, n, scene, balanced, ends[n])
            for n, stage in enumerate(design.stage, 1)
        ),
        top=max((end for heights in ends for end in heights), default=0.0),
        residual=float(balanced.residual),
        links=tuple(_links(design)),
        legs=towers.leg_loads(design, scene, balanced),
        filters=towers.filter_loads(design, scene, balanced),
        cavities=tuple(cavity_loads(design)),
        profiles=tuple(_profiles(design)),
        weights=_weigh_wires(design, scene, wires),
    )


def _profiles(design: Design) -> Iterator[ReducedProfile]:
    """Measured profiles of fibres, from top to bottom."""
    for stage in design.stage:
        for number, table in enumerate(stage.wire_tables, 1):
            if isinstance(table.profile, Profile):
                name = f"{stage.name}.{'wires' if stage.wires is not None else number}"
                places, sections = table.profile.position, given_sections(table) or ()
                yield ReducedProfile(wire=name, places=len(places), sections=len(sections))


def _links(design: Design) -> Iterator[LinkLoad]:
    """Links and dampers between bodies, in the order of the file."""
    places = Places.of(design)
    for link in design.link:
        first, second = (places.position[places.number[name]] for name in link.between)
        stiffness = links.link_stiffness(design, link, first, second)
        found = LinkLoad(
            link.name,
            tuple(link.between),
            _vector(np.diag(stiffness)),
            _vector(np.diag(links.matrix(link.damping))),
            table=link.table and (link.table.frequency[0], link.table.frequency[-1]),
        )
        if link.strands is not None:
            curve, wire = links.link_curve(link, first, second), links.wire_of(design, link.strands)
            found = replace(
                found,
                length=curve.length,
                weight=link.strands.count * curve.length * wire.weight,
                sag=strands.sag(curve, wire)[0],
            )
        yield found
    for damper in design.damper:
        damping = _vector(np.diag(links.damper_matrix(damper)))
        yield LinkLoad(damper.name, tuple(damper.between), (0.0, 0.0, 0.0), damping)


def list_wire_tables(stage: Stage) -> list[WireSet] | list[Wire]:
    """List the table of each wire of a stage."""
    return [stage.wires] * stage.wires.count if stage.wires is not None else stage.wire


def wire_loads(design: Design, scene: Scene, balanced: Equilibrium) -> Iterator[WireLoad]:
    """Loads of wires; their own weight adds to the tension at their upper ends."""
    tables = [table for stage in design.stage for table in list_wire_tables(stage)]
    wires, tension = scene.wires, balanced.tension
    weight = scene.gravity * (wires.mass[:, 0] + wires.mass[:, 1])
    above = tension + weight * -wires.span[:, 2] / wires.length
    stretch = tension / wires.stiffness
    for n, table in enumerate(tables):
        pieces = given_sections(table) or [table]
        areas = [(thinnest(piece), piece.material or table.material) for piece in pieces]
        stresses = [(float(above[n]) / area, name) for area, name in areas if area is not None]
        yield WireLoad(
            label=wires.label[n],
            tension=float(tension[n]),
            stretch=float(stretch[n]),
            strain=float(stretch[n] / wires.length[n]),
            **_largest_stress(design, stresses, table.material),
        )


def _largest_stress(
    design: Design, stresses: Sequence[tuple[float, str | None]], material: str | None
) -> dict[str, Any]:
    """Largest stress (Pa) of sections with their materials, and that nearest to breaking."""
    known = [
        (stress / strength, strength, name)
        for stress, name in stresses
        if name is not None
        and (strength := materials.resolve(design, name).tensile_strength) is not None
    ]
    largest, name = max(stresses, key=lambda pair: pair[0], default=(None, material))
    fraction, strength, name = max(known, default=(None, None, name or ""))
    return {"stress": largest, "strength": strength, "fraction": fraction, "material": name}


def blade_loads(design: Design, scene: Scene, balanced: Equilibrium) -> Iterator[BladeLoad]:
    """Loads of blades of length L, base width b and thickness h.

    The largest stress under F, at the base, is moment F L over section modulus b h^2 / 6:
    6 F L / (b h^2).
    """
    tables: list[BladeSet | Blade] = []
    for stage in design.stage:
        tables += stage.blade if stage.blades is None else [stage.blades] * stage.blades.count
    stiffness = scene.blades.stiffness[:, 2]
    loads = scene.blades.load[:, 2] - stiffness * balanced.pose.deflection[:, 2]
    for table, label, load, k in zip(
        tables, scene.blades.label, loads.tolist(), stiffness.tolist(), strict=True
    ):
        shape, stresses = table.geometry, []
        if shape is not None:
            stress = 6 * load * shape.length / (shape.base_width * shape.thickness**2)
            stresses = [(stress, shape.material)]
        stressed = _largest_stress(design, stresses, table.made_of)
        yield BladeLoad(label=label, load=load, sag=load / k, **stressed)


def _end_heights(scene: Scene, balanced: Equilibrium) -> list[list[float]]:
    """List the heights z (m) of the ends of wires on each body, the support first."""
    heights: list[list[float]] = [[] for _ in range(len(scene.bodies.name) + 1)]
    z, rotation = scene.bodies.position[:, 2] + balanced.pose.shift[:, 2], balanced.pose.rotation
    for body, points in (
        (scene.wires.upper, scene.wires.upper_point),
        (scene.wires.lower, scene.wires.lower_point),
    ):
        for n, point in zip(body.tolist(), points, strict=True):
            heights[n].append(float(z[n] + rotation[n, 2] @ point))
    return heights


def _find_lowest(
    body: Body, n: int, scene: Scene, balanced: Equilibrium, ends: list[float]
) -> Lowest:
    z = float(scene.bodies.position[n, 2] + balanced.pose.shift[n, 2])
    points = [(z, "centre of mass"), *((end, "wires") for end in ends)]
    if body.shape is not None:
        points = [(z - _half_height(body, balanced.pose.rotation[n, 2]), "body"), *points]
    lowest = min(points, key=lambda point: point[0])
    return Lowest(name=scene.bodies.name[n - 1], z=lowest[0], point=lowest[1])


def _half_height(body: Body, up: np.ndarray) -> float:
    """Half the extent (m) of a shape along a unit vector `up` in its own axes."""
    if body.shape == "box":
        return float(np.abs(up) @ np.array(body.size) / 2)
    assert body.radius is not None and body.length is not None
    along = abs(float(up["xyz".index(body.axis or "x")]))
    return body.length / 2 * along + body.radius * float(np.sqrt(max(1 - along**2, 0.0)))


def _vector(values: np.ndarray) -> tuple[float, float, float]:
    return (float(values[0]), float(values[1]), float(values[2]))


def _weigh_wires(design: Design, scene: Scene, loads: Sequence[WireLoad]) -> WireWeights | None:
    """Compute the weight of the wires; None where no density is known."""
    wires, gravity = scene.wires, gravity_strength(design)
    total = ratio = sag = softening = 0.0
    worst = ""
    tables = [table for stage in design.stage for table in list_wire_tables(stage)]
    for n, (table, load) in enumerate(zip(tables, loads, strict=True)):
        length = float(wires.length[n])
        pieces = wire_line_densities(design, table, length)
        weight = gravity * sum(piece * density for piece, density in pieces)
        total += weight
        if weight / load.tension > ratio:
            ratio, worst = weight / load.tension, load.label
        across = weight * math.hypot(*wires.span[n, :2].tolist()) / length
        sag = max(sag, across * length / (8 * load.tension))
        stiffness = float(wires.stiffness[n]) * length
        softening = max(softening, across**2 * stiffness / (12 * load.tension**3))
    if not total:
        return None
    error = max(ratio**2 / 12, softening)
    included = design.constants.wire_weight
    return WireWeights(included, worst, total=total, ratio=ratio, sag=sag, error=error)
