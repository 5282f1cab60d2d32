"""Wires and blades of the design file format as frozen types."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

from suspension_cli.design.cross_sections.ribbon import Ribbon
from suspension_cli.design.cross_sections.round import Round
from suspension_cli.design.cross_sections.shape import CrossSection
from suspension_cli.design.losses.mechanism import with_keys
from suspension_cli.design.losses.registry import MECHANISMS
from suspension_cli.design.units import (
    NAMES,
    Angle,
    Direction,
    Frequency,
    Kelvin,
    Length,
    LossAngle,
    MassOrZero,
    MaterialName,
    Name,
    Position,
    Separation,
    ShapeFactor,
    Stiffness,
    Table,
    Tension,
    Torsion,
    Vector,
    doc,
    of_unit,
)

WireMaterial = Annotated[
    MaterialName,
    doc(
        f"name of a material, built in or of [materials] ({NAMES}); with a cross-section: k = E"
        " A / l"
    ),
]
Radius = Annotated[Length, doc("radius of a round wire, m")]


WireTorsion = Annotated[
    Torsion,
    doc(
        "torsional stiffness of the wire about its axis, N m/rad; default: none in the models"
        " up to string; in beam and violin that of its cross-section, material and tension,"
        " (G J + T I_p / A) / l"
    ),
]


Radii = Annotated[
    list[Length],
    doc("radius in m at the upper and at the lower end of a taper", min_length=2, max_length=2),
]
# a list: msgspec 0.22 crashes on a union of a bounded number and a tuple of them
Steps = Annotated[
    int,
    doc("number of uniform steps that approximate a taper; 16 if not given", ge=1, le=256),
]


class WireSection(Table, frozen=True):
    """A stretch of a wire: uniform, or tapered linearly from one radius to another."""

    length: (
        Annotated[
            Length,
            doc(
                "loaded length, m; the lengths sum to the wire's; one section may leave its own"
                " out and takes the rest"
            ),
        ]
        | None
    ) = None
    radius: (
        Annotated[
            Length | Radii,
            doc("radius of a round stretch, m; [upper, lower] of a tapered one"),
        ]
        | None
    ) = None
    section: Ribbon | None = None
    material: Annotated[Name, doc(f"name of a material; default the wire's ({NAMES})")] | None = (
        None
    )
    steps: Steps | None = None


Sections = Annotated[
    list[WireSection],
    doc(
        "stretches from the upper to the lower end, instead of radius and section",
        min_length=1,
        max_length=100,
    ),
]


class Clamp(Table, frozen=True):
    """Directions of the wire at its clamps, both from the upper towards the lower end."""

    upper: Direction | None = None
    lower: Direction | None = None


class EndTemperatures(Table, frozen=True):
    """Temperatures of the two ends of a wire."""

    upper: Kelvin
    lower: Kelvin


Clamped = Annotated[
    Annotated[
        Literal["wire", "bending-point"],
        doc(
            '"wire", "bending-point", or a table of directions { upper = [x, y, z], lower = [x,'
            " y, z] }"
        ),
    ]
    | Clamp,
    doc(
        'how the ends are held: "wire" (along the nominal wire), "bending-point" (the ends are'
        " the effective bending points, the clamps lie beyond), or directions"
        " { upper = [x, y, z], lower = [x, y, z] }"
    ),
]
Temperature = Annotated[
    Kelvin | EndTemperatures,
    doc("temperature in K, or { upper, lower }; default that of [constants]"),
]


class Neck(Table, frozen=True):
    """Thick ends of a fibre, equal above and below: stock, and a taper to the fibre's radius."""

    radius: Annotated[Length, doc("radius of the stock, m")]
    length: Annotated[Length, doc("length of each linear taper, m")]
    stock: Annotated[Separation, doc("length of uniform stock beyond each taper, m")] = 0.0
    steps: Steps | None = None


ProfileError = Annotated[
    float,
    of_unit(
        "1",
        "relative error that reducing the profile to uniform sections may leave",
        ge=1e-4,
        le=0.1,
    ),
]


class Profile(Table, frozen=True):
    """Diameter of a round fibre along its length, as measured."""

    file: (
        Annotated[
            str,
            doc(
                "CSV file of positions and diameters, from this file's folder; read once",
                max_length=1000,
            ),
        ]
        | None
    ) = None
    position: Annotated[
        list[Annotated[float, of_unit("m", "position in m", ge=-1e5, le=1e5)]],
        doc("positions from the upper end down, ascending, m", max_length=20000),
    ] = []
    diameter: Annotated[list[Length], doc("diameter at each position, m", max_length=20000)] = []
    error: ProfileError = 1e-3


FibreProfile = Annotated[
    Annotated[str, doc("a CSV file", max_length=1000)] | Profile,
    doc(
        "measured diameter against length instead of a radius: a CSV file from this file's"
        " folder, or { file, error } or { position, diameter, error }"
    ),
]
FibreNeck = Annotated[
    Neck, doc("thick ends of a fibre of this radius, equal above and below: { radius, length }")
]
Hinged = Annotated[
    Literal["hinged"],
    doc(
        'string model: "hinged" ends the string sqrt(E I / T) from each clamp (an'
        " approximation); beam and violin bend the wire exactly and ignore it"
    ),
]


if TYPE_CHECKING:
    _WireLosses = Table
else:
    _WireLosses = with_keys(Table, MECHANISMS, "wire")


class WireSet(_WireLosses, frozen=True):
    """Wires symmetric in x and y, in the paper's symbols: 1, 2 or 4; or any number on a ring."""

    count: Annotated[int, doc("number of wires: 1, 2 or 4; any with a ring", ge=1, le=100)]
    l: Annotated[Length, doc("loaded length of each wire, m")]
    s: Annotated[Separation, doc("half separation in x at both ends, m (four wires)")] | None = None
    s_upper: Annotated[Separation, doc("half separation in x at the upper end, m")] | None = None
    s_lower: (
        Annotated[
            Position,
            doc("half separation in x at the lower end, m; negative: wires cross"),
        ]
        | None
    ) = None
    t1: Annotated[Separation, doc("half separation in y at the upper end, m")] | None = None
    t2: (
        Annotated[
            Position,
            doc("half separation in y at the lower end, m; negative: wires cross"),
        ]
        | None
    ) = None
    ring: (
        Annotated[Separation, doc("radius of the circle of the ends, m, above and below")] | None
    ) = None
    ring_upper: Annotated[Separation, doc("radius of the circle of the upper ends, m")] | None = (
        None
    )
    ring_lower: (
        Annotated[
            Position,
            doc("radius of the circle of the lower ends, m; negative: the wires cross at the axis"),
        ]
        | None
    ) = None
    phase: Annotated[Angle, doc("angle of the first wire of a ring from x towards y, rad")] = 0.0
    d: Annotated[Position, doc("height of the lower end above the COM of this body, m")] = 0.0
    d_upper: Annotated[
        Position, doc("depth of the upper end below the COM of the body above, m")
    ] = 0.0
    material: WireMaterial | None = None
    radius: Radius | None = None
    section: Ribbon | None = None
    sections: Sections | None = None
    neck: FibreNeck | None = None
    profile: FibreProfile | None = None
    k: (
        Annotated[
            Stiffness,
            doc(
                "spring constant of one wire, N/m, instead of material and cross-section;"
                " beside them it overrides E A / l"
            ),
        ]
        | None
    ) = None
    torsion: WireTorsion | None = None
    clamp: Clamped = "wire"
    bending: Hinged | None = None
    temperature: Temperature | None = None


class Wire(_WireLosses, frozen=True):
    """One wire, its ends in the frames of the two bodies, from their COMs or the support point."""

    upper: Annotated[Vector, doc("upper end, from the COM above or the support point, m")]
    lower: Annotated[Vector, doc("lower end, from this body's COM, m")]
    material: WireMaterial | None = None
    radius: Radius | None = None
    section: Ribbon | None = None
    sections: Sections | None = None
    neck: FibreNeck | None = None
    profile: FibreProfile | None = None
    k: (
        Annotated[
            Stiffness,
            doc(
                "spring constant, N/m, as in [stage.wires]; default E A over the natural_length or,"
                " without it, the nominal span"
            ),
        ]
        | None
    ) = None
    torsion: WireTorsion | None = None
    natural_length: (
        Annotated[Length, doc("unstretched length, m; the pose is then solved for")] | None
    ) = None
    tension: (
        Annotated[Tension, doc("tension in the nominal pose, N, instead of a natural length")]
        | None
    ) = None
    blade: (
        Annotated[Name, doc(f"name of a [[stage.blade]] that carries the upper end: {NAMES}")]
        | None
    ) = None
    clamp: Clamped = "wire"
    bending: Hinged | None = None
    temperature: Temperature | None = None


CROSS_SECTIONS: tuple[type[CrossSection], ...] = (Round, Ribbon)
"""Cross-sections; each has its key in `WireSet`, `Wire` and `WireSection`."""


def cross_sections(table: WireSet | Wire | WireSection) -> list[CrossSection]:
    """List the cross-sections that a table gives; a valid one gives at most one."""
    given = ((kind, getattr(table, kind.key)) for kind in CROSS_SECTIONS)
    return [kind.read(value) for kind, value in given if value is not None]


class BladeGeometry(Table, frozen=True):
    """A tapered cantilever blade clamped at its base, loaded at its tip."""

    length: Annotated[Length, doc("length from the clamp to the tip, m")]
    base_width: Annotated[Length, doc("width at the clamp, m")]
    thickness: Annotated[Length, doc("thickness, m")]
    shape_factor: ShapeFactor
    material: MaterialName


BladeWeight = Annotated[
    Tension,
    doc(
        "load in N, tip mass included, at which the tip is at its nominal position; under"
        " another load it deflects and the pose is solved for; default: its load in the nominal"
        " pose or, if all wires of the stage have natural lengths, in the pose solved for"
    ),
]
BladeLoss = Annotated[LossAngle, doc("loss angle in rad; default that of the material, else 0")]
BladeThickness = Annotated[
    Length,
    doc("thickness of the blade in m, for its loss, where no geometry is given"),
]
BladeMaterial = Annotated[
    Name,
    doc(f"name of the blade's material, for its loss, where no geometry is given: {NAMES}"),
]
BladeTemperature = Annotated[
    Kelvin, doc("temperature of the blade in K; default that of [constants]")
]
TipStiffness = Annotated[Stiffness, doc("vertical stiffness of one blade at its tip, N/m")]
UncoupledFrequency = Annotated[
    Frequency,
    doc(
        "frequency f of this stage's mass m alone on its n blades, Hz; each has the stiffness"
        " (2 pi f)^2 m / n"
    ),
]
TipMass = Annotated[MassOrZero, doc("mass that moves with one tip, kg")]
LateralStiffness = Annotated[
    tuple[Stiffness, Stiffness], doc("stiffness of one tip along x and y, N/m; rigid if not given")
]


class BladeSet(Table, frozen=True):
    """Cantilever blades on the body above (or the support) that carry a symmetric set of wires."""

    count: Annotated[
        int,
        doc(
            "number of blades, 1, 2 or 4; each of two carries the wires on its side of y; on a"
            " ring 1, or one per wire",
            ge=1,
            le=100,
        ),
    ]
    stiffness: TipStiffness | None = None
    uncoupled_frequency: UncoupledFrequency | None = None
    geometry: BladeGeometry | None = None
    load: BladeWeight | None = None
    tip_mass: TipMass = 0.0
    lateral_stiffness: LateralStiffness | None = None
    loss_angle: BladeLoss | None = None
    material: BladeMaterial | None = None
    thickness: BladeThickness | None = None
    temperature: BladeTemperature | None = None


class Blade(Table, frozen=True):
    """One cantilever blade, for wires that name it."""

    name: Annotated[Name, doc(f"name by which wires refer to it: {NAMES}")]
    at: (
        Annotated[
            Vector,
            doc(
                "tip in the frame of the body above, m; default: the mean of its wires' upper ends"
            ),
        ]
        | None
    ) = None
    stiffness: TipStiffness | None = None
    uncoupled_frequency: UncoupledFrequency | None = None
    geometry: BladeGeometry | None = None
    load: BladeWeight | None = None
    tip_mass: TipMass = 0.0
    lateral_stiffness: LateralStiffness | None = None
    loss_angle: BladeLoss | None = None
    material: BladeMaterial | None = None
    thickness: BladeThickness | None = None
    temperature: BladeTemperature | None = None
