"""Design file format as frozen types: keys, units and bounds.

`pendsus schema` prints these types as JSON Schema; `faults.py` checks files against it. Rules
across tables are in `checks.py`.
"""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import Meta, field

from suspension_cli.design import imperfections
from suspension_cli.design.filters import Filter
from suspension_cli.design.inverted_pendulum import InvertedPendulum
from suspension_cli.design.links import Active, BetweenBodies, Damper, Link
from suspension_cli.design.losses.mechanism import with_keys
from suspension_cli.design.losses.registry import MECHANISMS
from suspension_cli.design.units import (
    NAMES,
    Acceleration,
    Conductivity,
    Density,
    Expansion,
    Frequency,
    GravityGradient,
    GravityRow,
    GravityVector,
    Hold,
    Inertia,
    Kelvin,
    Length,
    LossAngle,
    Mass,
    MassOrZero,
    Matrix6,
    Modulus,
    ModulusSlope,
    MolarMass,
    MomentOrZero,
    Name,
    Poisson,
    Pressure,
    Raw,
    Row3,
    Schema,
    SpecificHeat,
    StageName,
    Stem,
    Stiffness,
    Strength,
    Table,
    Vector,
    WireName,
    Wrench,
    doc,
    of_unit,
)
from suspension_cli.design.wires import Blade, BladeSet, Wire, WireSet


class Header(Table, frozen=True):
    """Name and origin of the design."""

    name: Stem
    title: Annotated[str, doc("title, for tables and pictures")] = ""
    reference: Annotated[str, doc("where the design comes from")] = ""


class Constants(Table, frozen=True):
    """Gravity and temperature."""

    gravity: Annotated[
        Acceleration | GravityVector,
        doc(
            "acceleration due to gravity in m/s^2; a vector [x, y, z] with z below 0 acts after"
            " the suspension was trimmed level"
        ),
    ] = 9.81
    gravity_gradient: Annotated[
        GravityGradient | list[GravityRow],
        doc(
            "gradient of gravity in 1/s^2: dg_z/dz (3.1e-6 on Earth), or the symmetric 3x3"
            " dg_i/dx_j"
        ),
    ] = 0.0
    wire_weight: Annotated[
        bool,
        doc(
            "whether wires of known density and cross-section have weight, and inertia in all"
            " models"
        ),
    ] = False
    temperature: Annotated[Kelvin, doc("temperature in K where no other is given")] = 290.0


class MaterialLoss(with_keys(Table, MECHANISMS, "material")):
    """Losses of a material, for the models in which wires bend."""


class Material(Table, frozen=True):
    """A material of wires or blades; defaults are those of the built-in one of the same name."""

    youngs_modulus: Modulus | None = None
    poisson_ratio: Poisson | None = None
    density: Density | None = None
    thermal_expansion: Expansion | None = None
    modulus_slope: ModulusSlope | None = None
    specific_heat: SpecificHeat | None = None
    thermal_conductivity: Conductivity | None = None
    tensile_strength: Strength | None = None
    loss_angle: (
        Annotated[
            LossAngle,
            doc("constant loss angle in rad: short for angle in the table loss"),
        ]
        | None
    ) = None
    loss: MaterialLoss | None = None
    source: Annotated[str, doc("where the numbers come from")] = ""


class Gas(Table, frozen=True):
    """Residual gas around the suspension."""

    pressure: Pressure
    molar_mass: MolarMass = 0.028
    temperature: (
        Annotated[Kelvin, doc("temperature of the gas in K; default that of [constants]")] | None
    ) = None


class Body(Table, frozen=True):
    """A rigid body: mass and inertia, or a homogeneous shape with a mass or a density."""

    mass: Mass | None = None
    inertia: (
        Annotated[
            list[Inertia | Row3],
            doc(
                "moments of inertia about x, y, z at the COM, or a full 3x3, kg m^2",
                min_length=3,
                max_length=3,
            ),
        ]
        | None
    ) = None
    shape: (
        Annotated[
            Literal["cylinder", "box"],
            doc("homogeneous shape, instead of moments of inertia"),
        ]
        | None
    ) = None
    axis: Annotated[Literal["x", "y", "z"], doc("axis of a cylinder")] | None = None
    radius: Annotated[Length, doc("radius of a cylinder, m")] | None = None
    inner_radius: Annotated[Length, doc("inner radius of a hollow cylinder, m")] | None = None
    length: Annotated[Length, doc("length of a cylinder, m")] | None = None
    size: (
        Annotated[tuple[Length, Length, Length], doc("sides of a box along x, y and z, m")] | None
    ) = None
    density: Annotated[Density, doc("density of a shape in kg/m^3, instead of a mass")] | None = (
        None
    )


class Spring(Table, frozen=True):
    """A linear spring between this body and the one it hangs from: a flexure, a cable."""

    stiffness: Annotated[
        Matrix6,
        doc("x, y, z, roll, pitch, yaw at the point, or a full 6x6: N/m, N m/rad"),
    ]
    at: Annotated[Vector, doc("the point, from this body's COM, m")] = (0.0, 0.0, 0.0)
    damping: Annotated[Matrix6, doc("six elements or a full 6x6: N s/m, N m s/rad")] | None = None
    preload: Annotated[
        Wrench, doc("force (N) and torque (N m) on this body in the nominal pose")
    ] = field(default_factory=lambda: [0.0] * 6)
    loss_angle: (
        Annotated[
            LossAngle,
            doc("loss angle of the stiffness in rad; default that of the material"),
        ]
        | None
    ) = None
    material: (
        Annotated[Name, doc(f"name of the spring's material, for its loss: {NAMES}")] | None
    ) = None
    thickness: (
        Annotated[
            Length,
            doc("thickness in m of a flexure that bends, for its loss"),
        ]
        | None
    ) = None
    temperature: (
        Annotated[Kelvin, doc("temperature in K, for its loss; default that of [constants]")] | None
    ) = None
    active: Active = False


Viscous = Annotated[float, doc("viscous damping in N s/m or N m s/rad", ge=0, le=1e12)]


class FrameDamping(Table, frozen=True):
    """Viscous damping of the support structure against the ground, N s/m and N m s/rad."""

    x: Viscous = 0.0
    y: Viscous = 0.0
    z: Viscous = 0.0
    roll: Viscous = 0.0
    pitch: Viscous = 0.0
    yaw: Viscous = 0.0


class Damping(FrameDamping, frozen=True):
    """Viscous damping of a body's motion relative to another body or the support, at its COM."""

    against: Annotated[Name, doc(f'"support", or the name of a stage above: {NAMES}')] = "support"


class Compliance(Table, frozen=True):
    """Stiffness of the support structure, N/m and N m/rad; directions left out are rigid."""

    x: Stiffness | None = None
    y: Stiffness | None = None
    z: Stiffness | None = None
    roll: Stiffness | None = None
    pitch: Stiffness | None = None
    yaw: Stiffness | None = None


class Support(Table, frozen=True):
    """An elastic support structure between the ground and the suspension point."""

    stiffness: Compliance
    mass: Annotated[MassOrZero, doc("mass that moves with the suspension point, kg")] = 0.0
    inertia: Annotated[
        list[MomentOrZero],
        doc(
            "moments of inertia about x, y, z at the suspension point, kg m^2",
            min_length=3,
            max_length=3,
        ),
    ] = field(default_factory=lambda: [0.0] * 3)
    damping: FrameDamping = FrameDamping()
    loss_angle: Annotated[LossAngle, doc("loss angle of the stiffness in rad")] = 0.0


class Stage(Table, frozen=True):
    """A body and what it hangs on."""

    name: Name
    body: Body
    hangs_from: (
        Annotated[
            Name,
            doc(
                '"support" or an earlier stage, which makes a tree; default the stage before,'
                f" or the keystone of its filter ({NAMES})"
            ),
        ]
        | None
    ) = None
    mirror: Annotated[
        bool,
        doc(
            "whether this is the mirror, whose motion commands output by default; without one, the"
            " end of the longest chain, of several as long the one listed first"
        ),
    ] = False
    position: (
        Annotated[
            Vector,
            doc(
                "nominal COM from the COM above (or support point), m; implied by a symmetric"
                " set or an inverted pendulum, needed otherwise"
            ),
        ]
        | None
    ) = None
    wires: WireSet | None = None
    wire: Annotated[list[Wire], doc("wires anywhere, instead of a symmetric set")] = []
    blades: BladeSet | None = None
    blade: Annotated[list[Blade], doc("blades for wires that name them")] = []
    spring: Annotated[list[Spring], doc("linear springs to the body above")] = []
    inverted_pendulum: InvertedPendulum | None = None
    filter: Filter | None = None
    damping: Damping | None = None

    @property
    def wire_tables(self) -> list[WireSet | Wire]:
        """The symmetric set of wires, and the wires given one by one."""
        return [*([self.wires] if self.wires is not None else []), *self.wire]

    @property
    def blade_tables(self) -> list[BladeSet | Blade]:
        """The set of equal blades, and the blades given one by one."""
        return [*([self.blades] if self.blades is not None else []), *self.blade]


class _Imperfect(Table, frozen=True):
    wire: Annotated[WireName, doc("a stage's name and a wire's number: test.1")] | None = None
    body: Annotated[Name, doc(f"a stage's name, instead of a wire: {NAMES}")] | None = None
    blade: (
        Annotated[
            str,
            doc("a blade: test.blade1; for the blades of a filter its stage", max_length=80),
        ]
        | None
    ) = None
    leg: (
        Annotated[str, doc("a leg of an inverted pendulum: platform.leg1", max_length=80)] | None
    ) = None
    link: Annotated[str, doc("the name of a link", max_length=80)] | None = None


class Perturbation(imperfections.with_perturbations(_Imperfect)):
    """Imperfections of one wire, body, blade, leg or link in this build."""

    hold: Hold = "loaded-length"


Hertz = Annotated[float, Meta(ge=-1e9, le=1e9)]
Root = Annotated[
    list[Hertz | Annotated[list[Hertz], Meta(min_length=2, max_length=2)]],
    doc("roots in Hz, positive for the left half plane, or [re, im] for a conjugate pair"),
]


SpectralDensity = Annotated[float, Meta(ge=0, le=1e3)]


class GainAt(Table, frozen=True):
    """Magnitude of a filter at one frequency, which sets its gain."""

    frequency: Frequency
    magnitude: Annotated[
        float,
        doc("|H| there, N/m (N m/rad); if negative, reverses the sign of H", ge=-1e20, le=1e20),
    ]


class NoiseSpectrum(Table, frozen=True):
    """Amplitude spectral density of a sensor against frequency."""

    asd: Annotated[
        SpectralDensity | Annotated[list[SpectralDensity], Meta(min_length=2)],
        doc(
            "amplitude spectral density in m/sqrt(Hz) or rad/sqrt(Hz): that far above the"
            " corner, or one per frequency"
        ),
    ]
    corner: (
        Annotated[
            float,
            of_unit(
                "Hz",
                "Hz; the density is asd sqrt(1 + corner / f), whose square rises as 1/f below",
                gt=0,
                le=1e6,
            ),
        ]
        | None
    ) = None
    frequency: (
        Annotated[
            list[Frequency],
            doc(
                "Hz, ascending; interpolated linearly in the logarithms, constant outside",
                min_length=2,
            ),
        ]
        | None
    ) = None


FOTON = 'a Foton string: zpk([z;z],[p;p],k,"n"), gain(k), pole(f,"n"), ... and products of these'


class Loop(Table, frozen=True):
    """One local control loop from a sensor y to an actuator u = -H(f) R(f) exp(-2 pi i f T) y.

    H is a velocity damper, or gain times the product of (i f + z) over zeros z divided by that of
    (i f + p) over poles p, or a Foton string; R the response of the sensor, T a delay.
    """

    name: Name
    sensor: Annotated[str, doc("a motion of a stage: upper.x, upper.x@0,0,0.01")]
    actuator: Annotated[str, doc("a force or torque on a stage: upper.force_x")]
    reference: Annotated[
        Literal["support", "inertial"],
        doc(
            '"support": sensor and actuator act between body and support structure;'
            ' "inertial": against inertial space'
        ),
    ] = "support"
    damper: (
        Annotated[
            float,
            doc(
                "force per velocity, N s/m (N m s/rad): H = 2 pi i f times this", ge=-1e12, le=1e12
            ),
        ]
        | None
    ) = None
    gain: (
        Annotated[
            float,
            doc(
                "H = gain times the product of (i f + z) over that of (i f + p); N/m (N m/rad)"
                " times Hz^(number of poles - number of zeros)",
                ge=-1e20,
                le=1e20,
            ),
        ]
        | None
    ) = None
    zeros: Root = []
    poles: Root = []
    filter: Annotated[str, doc(f"H in N/m (N m/rad) as {FOTON}")] | None = None
    gain_at: Annotated[GainAt, doc("sets the gain of zeros and poles, or of filter")] | None = None
    delay: Annotated[
        float,
        of_unit("s", "delay of the loop in s, a factor exp(-2 pi i f delay)", ge=0, le=10.0),
    ] = 0.0
    sensor_response: Annotated[str, doc(f"reading over motion of the sensor: {FOTON}")] | None = (
        None
    )
    sensor_noise: Annotated[
        SpectralDensity | NoiseSpectrum,
        doc(
            "amplitude spectral density as motion, m/sqrt(Hz) or rad/sqrt(Hz): flat, or {asd,"
            " corner}, or {frequency, asd}"
        ),
    ] = 0.0
    actuator_noise: Annotated[
        float,
        doc("amplitude spectral density in N/sqrt(Hz) or N m/sqrt(Hz), flat", ge=0, le=1e3),
    ] = 0.0


class Control(Table, frozen=True):
    """Local control."""

    loop: Annotated[list[Loop], Meta(min_length=1)]


Spread = Annotated[float, Meta(ge=0, le=1e3)]


class Distribution(Table, frozen=True):
    """Scatter of builds about the nominal value, independent from build to build."""

    normal: Annotated[Spread, doc("standard deviation")] | None = None
    uniform: Annotated[Spread, doc("half width")] | None = None
    truncate: Annotated[Spread, doc("largest deviation of a normal distribution")] | None = None


class _WireScatter(Table, frozen=True):
    stage: Annotated[Name, doc(f"a stage's name, for each of its wires: {NAMES}")] | None = None
    wire: Annotated[WireName, doc("one wire, instead of a stage: test.1")] | None = None


class _PartScatter(Table, frozen=True):
    stage: StageName


class WireTolerance(imperfections.with_spreads(_WireScatter, "wire", Distribution)):
    """Scatter of one wire, or independently of every wire of a stage."""

    hold: Hold = "loaded-length"


class BodyTolerance(imperfections.with_spreads(_PartScatter, "body", Distribution)):
    """Scatter of one body."""


class BladeTolerance(imperfections.with_spreads(_PartScatter, "blade", Distribution)):
    """Scatter of every blade of a stage, independently; those of a filter as one spring."""


class LegTolerance(imperfections.with_spreads(_PartScatter, "leg", Distribution)):
    """Scatter of every leg of an inverted pendulum, independently."""


class _LinkScatter(Table, frozen=True):
    link: Annotated[str, doc("the name of a link", max_length=80)]


class LinkTolerance(imperfections.with_spreads(_LinkScatter, "link", Distribution)):
    """Scatter of one link."""


Limit = Annotated[float, doc("limit above zero, SI", gt=0, le=1e20)]


class Requirement(Table, frozen=True):
    """Requirement on every build, in SI units (Hz for modes)."""

    quantity: Annotated[
        str,
        doc(
            "a mode's label, coupling, STAGE static DOF (x, y, height, roll, pitch or yaw), or"
            " a response OUTPUT/INPUT:FREQUENCY",
            max_length=200,
        ),
    ]
    band: (
        Annotated[
            list[Annotated[float, Meta(ge=-1e20, le=1e20)]],
            doc("least and largest value", min_length=2, max_length=2),
        ]
        | None
    ) = None
    below: Annotated[Limit, doc("upper limit of the magnitude")] | None = None
    above: Annotated[Limit, doc("lower limit of the magnitude")] | None = None


class Tolerance(Table, frozen=True):
    """Scatter of parts from build to build, and requirements on builds."""

    wire: list[WireTolerance] = []
    body: list[BodyTolerance] = []
    blade: list[BladeTolerance] = []
    leg: list[LegTolerance] = []
    link: list[LinkTolerance] = []
    require: list[Requirement] = []


class Design(Table, frozen=True):
    """A whole design file."""

    design: Header
    stage: Annotated[list[Stage], doc("bodies, top to bottom", min_length=1)]
    constants: Constants = Constants()
    materials: dict[str, Material] = {}
    gas: Gas | None = None
    support: Support | None = None
    control: Control | None = None
    tolerance: Tolerance | None = None
    perturbation: list[Perturbation] = []
    link: Annotated[list[Link], doc("springs between any two bodies")] = []
    damper: Annotated[list[Damper], doc("dampers between any two bodies")] = []
    analysis: Annotated[
        dict[str, Raw],
        doc("defaults for a command's options, under the options' own names"),
    ] = {}

    @property
    def is_active(self) -> bool:
        """Whether a spring, link or damper may give power to the motion."""
        springs = (spring for stage in self.stage for spring in stage.spring)
        return any(part.active for part in (*springs, *self.link, *self.damper))

    @property
    def between_bodies(self) -> list[tuple[str, BetweenBodies]]:
        """All elements between two bodies, each behind the name of its kind of table."""
        lists = ((kind, getattr(self, kind)) for kind in self.__struct_fields__)
        rows = [(kind, row) for kind, rows in lists if isinstance(rows, list) for row in rows]
        return [(kind, row) for kind, row in rows if isinstance(row, BetweenBodies)]


def json_schema() -> Schema:
    """Make the JSON Schema of the file format (draft 2020-12)."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "pendsus design file",
    } | msgspec.json.schema(Design)
