"""Tables `[[link]]` and `[[damper]]` of a design: springs and dampers between any two bodies."""

from __future__ import annotations

from typing import Annotated, Literal

from suspension_cli.conventions import DOFS
from suspension_cli.design import tables, units
from suspension_cli.design.tables import Problems, Table, doc, if_sound, key

Between = Annotated[
    list[units.Name],
    doc(
        'the two bodies: a stage first, then another stage, "support" (the suspension point) or'
        ' "ground" (beside it)',
        min_length=2,
        max_length=2,
    ),
]
At = Annotated[
    units.Vector, doc("the common point, from the COM of the first body, nominal pose, m")
]
Active = Annotated[
    bool,
    doc(
        "it may give power to the motion, as a sensor with an actuator does; otherwise negative"
        " damping and loss are refused"
    ),
]
Series = Annotated[
    list[units.Coefficient], doc("one number per frequency, at least 2", min_length=2)
]


class StiffnessTable(Table, frozen=True):
    """Complex stiffness against frequency: a CSV file, or its columns."""

    file: str | None = key(
        "CSV file, from this file's folder: frequency in Hz, then two columns per axis"
        " (one axis, or x, y, z, roll, pitch, yaw); read once"
    )
    form: Literal["real-imaginary", "modulus-loss"] = key(
        "the two columns per axis of the file: real and imaginary part, or modulus and loss"
        " angle in rad",
        "real-imaginary",
    )
    axis: units.Dof | None = key("axis of a table of one axis; the others have no stiffness")
    frequency: list[units.Frequency] = key("Hz, ascending", [])
    real: list[Series] = key("real part: for each axis a list over frequency, N/m or N m/rad", [])
    imaginary: list[Series] = key(
        "imaginary part: for each axis a list over frequency, N/m or N m/rad", []
    )
    static: list[units.Coefficient] | None = key(
        "static stiffness per axis, N/m or N m/rad; default the real part at the lowest frequency",
        min_length=1,
        max_length=6,
    )
    factor: float = key("factor on all stiffnesses of the table", 1.0, unit="1", gt=0, le=1e6)

    def _check_axes(self) -> Problems:
        """Check that each axis has one value per frequency."""
        axes, count = 6 if self.axis is None else 1, len(self.frequency)
        columns = {"real": self.real, "imaginary": self.imaginary}
        uneven = [name for name, rows in columns.items() if len(rows) != axes]
        ragged = [name for name, rows in columns.items() if any(len(row) != count for row in rows)]
        if self.file is not None:
            remedy = "read the design from its file, or give frequency, real and imaginary"
            yield "file", "is read only with a design file, not with its text alone", remedy
        elif not self.frequency:
            yield "", "has no frequencies", "give file, or frequency, real and imaginary"
        elif uneven:
            remedy = "give one list for the one axis, or remove axis"
            if axes == 6:
                remedy = f'give a list per axis, {", ".join(DOFS)}, or name the one: axis = "x"'
            yield uneven[0], f"has {len(columns[uneven[0]])} axes instead of {axes}", remedy
        elif ragged:
            problem = f"has an axis without exactly {count} values"
            yield ragged[0], problem, "give one value per frequency"

    def _check_static(self) -> Problems:
        """Check that each axis has a static stiffness."""
        static = [row[0] for row in self.real] if self.static is None else self.static
        if len(static) != len(self.real):
            problem = f"has {len(static)} numbers for {len(self.real)} axes"
            yield "static", problem, "give one per axis"
            return
        for axis, value, *rows in zip(DOFS, static, self.real, self.imaginary, strict=False):
            if value == 0 and any(map(any, rows)):
                what = f"the static stiffness along {self.axis or axis} is 0"
                remedy = "give static, or use damping for a viscous force"
                yield "static", f"{what}, but at other frequencies it is not", remedy

    rules = (tables.ascending("frequency"), _check_axes, if_sound, _check_static)


class Strands(Table, frozen=True):
    """Equal curved wires side by side that join the two bodies: a heat link, a cable."""

    to: units.Vector = key(
        "far end, from the COM of the second body (support or ground: from the suspension"
        " point), m; the near end is the link's at"
    )
    material: units.MaterialName
    diameter: units.Length = key("diameter of one wire, m")
    shape: Literal["u", "catenary", "points"] = key(
        '"u": vertical legs and a half circle below them; "catenary"; "points": straight'
        " pieces through points. The shape is that of the wire without load"
    )
    count: int = key("number of wires, which bend independently", 1, ge=1, le=1_000_000)
    length: units.Length | None = key("length of one wire, m; not with points")
    points: list[units.Vector] = key(
        "points between the ends, from the COM of the first body, m", []
    )

    rules = (
        tables.by_kind(
            "shape",
            {"u": (["length"], []), "catenary": (["length"], []), "points": ([], ["points"])},
        ),
    )


class BetweenBodies(Table, frozen=True):
    """Base of the tables of elements between any two bodies."""

    name: units.Name
    between: Between


class Link(BetweenBodies, frozen=True):
    """A spring between any two bodies at a common point: a heat link, a cable, a stop."""

    at: At = (0.0, 0.0, 0.0)
    stiffness: units.Matrix6 | None = key(
        "x, y, z, roll, pitch, yaw at the point, or a full 6x6: N/m, N m/rad"
    )
    table: StiffnessTable | None = None
    strands: Strands | None = None
    loss_angle: units.LossAngle | None = key(
        "loss angle of the stiffness in rad; default for strands: that of their"
        " material in the design"
    )
    damping: units.Matrix6 | None = key("six elements or a full 6x6: N s/m, N m s/rad")
    preload: units.Wrench = key(
        "force (N) and torque (N m) on the first body at the point in the nominal pose; the"
        " second takes the opposite",
        [0.0] * 6,
    )
    active: Active = False

    rules = (
        tables.exactly_one("stiffness", "table", "strands"),
        tables.symmetric("stiffness", "damping"),
        tables.excludes("table", "loss_angle"),
    )

    @property
    def made_of(self) -> str | None:
        """Name of the material of its strands, if it has any."""
        return None if self.strands is None else self.strands.material


class EddyCurrent(Table, frozen=True):
    """A magnet, taken as a dipole along an axis, in front of a plate or inside a tube."""

    shape: Literal["plate", "tube"] = key(
        '"plate": large, across the axis; damps along and (half as much) across it. "tube":'
        " long, around the axis; damps along it"
    )
    axis: Literal["x", "y", "z"] = key("direction of the dipole")
    conductivity: units.Conductivity = key(
        "conductivity of the conductor, at its temperature in use, S/m; copper at room"
        " temperature has 5.8e7"
    )
    thickness: units.Length = key("thickness of the plate or tube wall, m")
    gap: units.Length = key(
        "from the centre of the magnet to the plate, or the inner radius of the tube, m"
    )
    moment: float | None = key("dipole moment of one magnet, A m^2", unit="A m^2", gt=0, le=1e6)
    remanence: float | None = key(
        "remanence B_r of the magnet, T: the moment is B_r volume / mu_0", unit="T", gt=0, le=5
    )
    volume: float | None = key("volume of the magnet, m^3", unit="m^3", gt=0, le=1)
    count: int = key("number of equal magnets, far apart", 1, ge=1, le=1000)

    rules = (tables.exactly_one("moment", "remanence"), tables.together("remanence", "volume"))


class Damper(BetweenBodies, frozen=True):
    """A viscous damper between any two bodies at a common point."""

    at: At = (0.0, 0.0, 0.0)
    damping: units.Matrix6 | None = key(
        "x, y, z, roll, pitch, yaw at the point, or a full 6x6: N s/m, N m s/rad"
    )
    eddy_current: EddyCurrent | None = None
    active: Active = False

    rules = (tables.exactly_one("damping", "eddy_current"), tables.symmetric("damping"))
