"""Tables `[[link]]` and `[[damper]]` of a design: springs and dampers between any two bodies."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta, field

from suspension_cli.design.units import (
    Coefficient,
    Frequency,
    Length,
    LossAngle,
    MaterialName,
    Matrix6,
    Name,
    Table,
    Vector,
    Wrench,
    of_unit,
)

Between = Annotated[
    list[Name],
    Meta(
        min_length=2,
        max_length=2,
        description=(
            'the two bodies: a stage first, then another stage, "support" (the suspension point) or'
            ' "ground" (beside it)'
        ),
    ),
]
At = Annotated[
    Vector, Meta(description="the common point, from the COM of the first body, nominal pose, m")
]
Series = Annotated[list[Coefficient], Meta(min_length=2)]


class StiffnessTable(Table, frozen=True):
    """Complex stiffness against frequency: a CSV file, or its columns."""

    file: (
        Annotated[
            str,
            Meta(
                description=(
                    "CSV file, from this file's folder: frequency in Hz, then two columns per axis"
                    " (one axis, or x, y, z, roll, pitch, yaw); read once"
                )
            ),
        ]
        | None
    ) = None
    form: Annotated[
        Literal["real-imaginary", "modulus-loss"],
        Meta(
            description=(
                "the two columns per axis of the file: real and imaginary part, or modulus and loss"
                " angle in rad"
            )
        ),
    ] = "real-imaginary"
    axis: (
        Annotated[
            Literal["x", "y", "z", "roll", "pitch", "yaw"],
            Meta(description="axis of a table of one axis; the others have no stiffness"),
        ]
        | None
    ) = None
    frequency: Annotated[list[Frequency], Meta(description="Hz, ascending")] = field(
        default_factory=list
    )
    real: Annotated[
        list[Series], Meta(description="real part per axis and frequency, N/m or N m/rad")
    ] = field(default_factory=list)
    imaginary: Annotated[
        list[Series], Meta(description="imaginary part per axis and frequency, N/m or N m/rad")
    ] = field(default_factory=list)
    static: (
        Annotated[
            list[Coefficient],
            Meta(
                min_length=1,
                max_length=6,
                description=(
                    "static stiffness per axis, N/m or N m/rad; default the real part at the lowest"
                    " frequency"
                ),
            ),
        ]
        | None
    ) = None
    factor: Annotated[
        float, of_unit("1", gt=0, le=1e6, description="factor on all stiffnesses of the table")
    ] = 1.0


class Strands(Table, frozen=True):
    """Equal curved wires side by side that join the two bodies: a heat link, a cable."""

    to: Annotated[
        Vector,
        Meta(
            description=(
                "far end, from the COM of the second body (support or ground: from the suspension"
                " point), m; the near end is the link's at"
            )
        ),
    ]
    material: MaterialName
    diameter: Annotated[Length, Meta(description="diameter of one wire, m")]
    shape: Annotated[
        Literal["u", "catenary", "points"],
        Meta(
            description=(
                '"u": vertical legs and a half circle below them; "catenary"; "points": straight'
                " pieces through points. The shape is that of the wire without load"
            )
        ),
    ]
    count: Annotated[
        int, Meta(ge=1, le=1_000_000, description="number of wires, which bend independently")
    ] = 1
    length: Annotated[Length, Meta(description="length of one wire, m; not with points")] | None = (
        None
    )
    points: Annotated[
        list[Vector],
        Meta(description="points between the ends, from the COM of the first body, m"),
    ] = field(default_factory=list)


class Link(Table, frozen=True):
    """A spring between any two bodies at a common point: a heat link, a cable, a stop."""

    name: Name
    between: Between
    at: At = (0.0, 0.0, 0.0)
    stiffness: (
        Annotated[
            Matrix6,
            Meta(
                description=("x, y, z, roll, pitch, yaw at the point, or a full 6x6: N/m, N m/rad")
            ),
        ]
        | None
    ) = None
    table: StiffnessTable | None = None
    strands: Strands | None = None
    loss_angle: (
        Annotated[
            LossAngle,
            Meta(
                description=(
                    "loss angle of the stiffness in rad; default for strands: that of their"
                    " material in the design"
                )
            ),
        ]
        | None
    ) = None
    damping: (
        Annotated[Matrix6, Meta(description="six elements or a full 6x6: N s/m, N m s/rad")] | None
    ) = None
    preload: Annotated[
        Wrench,
        Meta(
            description=(
                "force (N) and torque (N m) on the first body at the point in the nominal pose; the"
                " second takes the opposite"
            )
        ),
    ] = field(default_factory=lambda: [0.0] * 6)


class EddyCurrent(Table, frozen=True):
    """A magnet, taken as a dipole along an axis, in front of a plate or inside a tube."""

    shape: Annotated[
        Literal["plate", "tube"],
        Meta(
            description=(
                '"plate": large, across the axis; damps along and (half as much) across it. "tube":'
                " long, around the axis; damps along it"
            )
        ),
    ]
    axis: Annotated[Literal["x", "y", "z"], Meta(description="direction of the dipole")]
    conductivity: Annotated[
        float,
        of_unit(
            "S/m",
            gt=0,
            le=1e13,
            description="conductivity of the conductor, at its temperature in use, S/m",
        ),
    ]
    thickness: Annotated[Length, Meta(description="thickness of the plate or tube wall, m")]
    gap: Annotated[
        Length,
        Meta(
            description=(
                "from the centre of the magnet to the plate, or the inner radius of the tube, m"
            )
        ),
    ]
    moment: (
        Annotated[
            float, of_unit("A m^2", gt=0, le=1e6, description="dipole moment of one magnet, A m^2")
        ]
        | None
    ) = None
    remanence: (
        Annotated[
            float,
            of_unit(
                "T",
                gt=0,
                le=5,
                description="remanence B_r of the magnet, T: the moment is B_r volume / mu_0",
            ),
        ]
        | None
    ) = None
    volume: (
        Annotated[float, of_unit("m^3", gt=0, le=1, description="volume of the magnet, m^3")] | None
    ) = None
    count: Annotated[int, Meta(ge=1, le=1000, description="number of equal magnets, far apart")] = 1


class Damper(Table, frozen=True):
    """A viscous damper between any two bodies at a common point; no common motion is damped."""

    name: Name
    between: Between
    at: At = (0.0, 0.0, 0.0)
    damping: (
        Annotated[
            Matrix6,
            Meta(
                description=(
                    "x, y, z, roll, pitch, yaw at the point, or a full 6x6: N s/m, N m s/rad"
                )
            ),
        ]
        | None
    ) = None
    eddy_current: EddyCurrent | None = None
