"""Tables `[[link]]` and `[[damper]]` of a design: springs and dampers between any two bodies."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Literal

from msgspec import field

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
    doc,
    of_unit,
)
from suspension_cli.errors import Fault

Between = Annotated[
    list[Name],
    doc(
        'the two bodies: a stage first, then another stage, "support" (the suspension point) or'
        ' "ground" (beside it)',
        min_length=2,
        max_length=2,
    ),
]
At = Annotated[Vector, doc("the common point, from the COM of the first body, nominal pose, m")]
Active = Annotated[
    bool,
    doc(
        "it may give power to the motion, as a sensor with an actuator does; otherwise negative"
        " damping and loss are refused"
    ),
]
Series = Annotated[list[Coefficient], doc("one number per frequency, at least 2", min_length=2)]


class StiffnessTable(Table, frozen=True):
    """Complex stiffness against frequency: a CSV file, or its columns."""

    file: (
        Annotated[
            str,
            doc(
                "CSV file, from this file's folder: frequency in Hz, then two columns per axis"
                " (one axis, or x, y, z, roll, pitch, yaw); read once"
            ),
        ]
        | None
    ) = None
    form: Annotated[
        Literal["real-imaginary", "modulus-loss"],
        doc(
            "the two columns per axis of the file: real and imaginary part, or modulus and loss"
            " angle in rad"
        ),
    ] = "real-imaginary"
    axis: (
        Annotated[
            Literal["x", "y", "z", "roll", "pitch", "yaw"],
            doc("axis of a table of one axis; the others have no stiffness"),
        ]
        | None
    ) = None
    frequency: Annotated[list[Frequency], doc("Hz, ascending")] = []
    real: Annotated[
        list[Series], doc("real part: for each axis a list over frequency, N/m or N m/rad")
    ] = []
    imaginary: Annotated[
        list[Series], doc("imaginary part: for each axis a list over frequency, N/m or N m/rad")
    ] = []
    static: (
        Annotated[
            list[Coefficient],
            doc(
                "static stiffness per axis, N/m or N m/rad; default the real part at the lowest"
                " frequency",
                min_length=1,
                max_length=6,
            ),
        ]
        | None
    ) = None
    factor: Annotated[
        float, of_unit("1", "factor on all stiffnesses of the table", gt=0, le=1e6)
    ] = 1.0


class Strands(Table, frozen=True):
    """Equal curved wires side by side that join the two bodies: a heat link, a cable."""

    to: Annotated[
        Vector,
        doc(
            "far end, from the COM of the second body (support or ground: from the suspension"
            " point), m; the near end is the link's at"
        ),
    ]
    material: MaterialName
    diameter: Annotated[Length, doc("diameter of one wire, m")]
    shape: Annotated[
        Literal["u", "catenary", "points"],
        doc(
            '"u": vertical legs and a half circle below them; "catenary"; "points": straight'
            " pieces through points. The shape is that of the wire without load"
        ),
    ]
    count: Annotated[int, doc("number of wires, which bend independently", ge=1, le=1_000_000)] = 1
    length: Annotated[Length, doc("length of one wire, m; not with points")] | None = None
    points: Annotated[
        list[Vector],
        doc("points between the ends, from the COM of the first body, m"),
    ] = []


class BetweenBodies(Table, frozen=True):
    """Base of the tables of elements between any two bodies."""

    name: Name
    between: Between

    def faults(self, path: str) -> Iterator[Fault]:
        """Check the element beyond single values, and the names of it and of its bodies."""
        del path
        yield from ()


class Link(BetweenBodies, frozen=True):
    """A spring between any two bodies at a common point: a heat link, a cable, a stop."""

    at: At = (0.0, 0.0, 0.0)
    stiffness: (
        Annotated[
            Matrix6,
            doc("x, y, z, roll, pitch, yaw at the point, or a full 6x6: N/m, N m/rad"),
        ]
        | None
    ) = None
    table: StiffnessTable | None = None
    strands: Strands | None = None
    loss_angle: (
        Annotated[
            LossAngle,
            doc(
                "loss angle of the stiffness in rad; default for strands: that of their"
                " material in the design"
            ),
        ]
        | None
    ) = None
    damping: Annotated[Matrix6, doc("six elements or a full 6x6: N s/m, N m s/rad")] | None = None
    preload: Annotated[
        Wrench,
        doc(
            "force (N) and torque (N m) on the first body at the point in the nominal pose; the"
            " second takes the opposite"
        ),
    ] = field(default_factory=lambda: [0.0] * 6)
    active: Active = False


class EddyCurrent(Table, frozen=True):
    """A magnet, taken as a dipole along an axis, in front of a plate or inside a tube."""

    shape: Annotated[
        Literal["plate", "tube"],
        doc(
            '"plate": large, across the axis; damps along and (half as much) across it. "tube":'
            " long, around the axis; damps along it"
        ),
    ]
    axis: Annotated[Literal["x", "y", "z"], doc("direction of the dipole")]
    conductivity: Annotated[
        float,
        of_unit(
            "S/m", "conductivity of the conductor, at its temperature in use, S/m", gt=0, le=1e13
        ),
    ]
    thickness: Annotated[Length, doc("thickness of the plate or tube wall, m")]
    gap: Annotated[
        Length,
        doc("from the centre of the magnet to the plate, or the inner radius of the tube, m"),
    ]
    moment: (
        Annotated[float, of_unit("A m^2", "dipole moment of one magnet, A m^2", gt=0, le=1e6)]
        | None
    ) = None
    remanence: (
        Annotated[
            float,
            of_unit(
                "T", "remanence B_r of the magnet, T: the moment is B_r volume / mu_0", gt=0, le=5
            ),
        ]
        | None
    ) = None
    volume: Annotated[float, of_unit("m^3", "volume of the magnet, m^3", gt=0, le=1)] | None = None
    count: Annotated[int, doc("number of equal magnets, far apart", ge=1, le=1000)] = 1


class Damper(BetweenBodies, frozen=True):
    """A viscous damper between any two bodies at a common point."""

    at: At = (0.0, 0.0, 0.0)
    damping: (
        Annotated[
            Matrix6,
            doc("x, y, z, roll, pitch, yaw at the point, or a full 6x6: N s/m, N m s/rad"),
        ]
        | None
    ) = None
    eddy_current: EddyCurrent | None = None
    active: Active = False
