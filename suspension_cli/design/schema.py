"""The design file, as frozen types: what may be written, in which unit, within which bounds.

These types are the file format.  `pendsus schema` prints them as JSON Schema, the reader checks files
against them (`faults.py`), and what one type cannot say about another stands in `checks.py`.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from msgspec import Meta, field

from suspension_cli.design.quantities import (
    Conductivity,
    Density,
    Expansion,
    Factor,
    Frequency,
    Hold,
    Inertia,
    Kelvin,
    Length,
    LossAngle,
    Mass,
    Matrix6,
    Modulus,
    ModulusSlope,
    MolarMass,
    Name,
    Poisson,
    Position,
    Pressure,
    Rotation,
    Row3,
    SpecificHeat,
    Stem,
    Stiffness,
    Strength,
    Table,
    Vector,
    Wrench,
)
from suspension_cli.design.wires import Blade, BladeSet, Wire, WireSet


class Header(Table, frozen=True):
    """What the design is called and where it comes from."""

    name: Stem
    title: str = ""
    reference: str = ""


class Constants(Table, frozen=True):
    """Surroundings."""

    gravity: Annotated[float, Meta(gt=0, le=1e3, description="acceleration due to gravity in m/s^2")] = 9.81
    temperature: Kelvin = 290.0


class LossTable(Table, frozen=True):
    """Loss angle against frequency: straight lines in the logarithms, constant outside."""

    frequency: Annotated[list[Frequency], Meta(min_length=1, max_length=10000, description="ascending frequencies in Hz")]
    angle: Annotated[
        list[Annotated[float, Meta(gt=0, lt=1, description="loss angle in rad, above zero")]],
        Meta(min_length=1, max_length=10000, description="loss angle in rad at each of the frequencies"),
    ]


class MaterialLoss(Table, frozen=True):
    """What makes a material lossy beyond a constant loss angle; acts where wires bend."""

    angle: Annotated[LossAngle, Meta(description="constant loss angle of the bulk in rad")] | None = None
    table: Annotated[LossTable, Meta(description="loss angle of the bulk against frequency, instead of a constant one")] | None = None
    surface_depth: Annotated[float, Meta(ge=0, le=1e5, description="dissipation depth of the surface in m")] | None = None
    thermoelastic: Annotated[bool, Meta(description="false leaves thermoelastic loss out")] | None = None


class Material(Table, frozen=True):
    """A material of wires, blades or bodies; a built-in one of the same name lends what is left out."""

    youngs_modulus: Modulus | None = None
    poisson_ratio: Poisson | None = None
    density: Density | None = None
    thermal_expansion: Expansion | None = None
    modulus_slope: ModulusSlope | None = None
    specific_heat: SpecificHeat | None = None
    thermal_conductivity: Conductivity | None = None
    tensile_strength: Strength | None = None
    loss_angle: LossAngle | None = None
    loss: MaterialLoss | None = None
    source: str = ""


class Gas(Table, frozen=True):
    """Residual gas around the suspension."""

    pressure: Pressure
    molar_mass: MolarMass = 0.028
    temperature: Annotated[Kelvin, Meta(description="temperature of the gas in K; default that of [constants]")] | None = None


class Body(Table, frozen=True):
    """A rigid body: mass and inertia, or a homogeneous shape with a mass or a density."""

    mass: Mass | None = None
    inertia: (
        Annotated[list[Inertia | Row3], Meta(min_length=3, max_length=3, description="moments of inertia about x, y, z at the COM, or a full 3x3, kg m^2")]
        | None
    ) = None
    shape: Literal["cylinder", "box"] | None = None
    axis: Literal["x", "y", "z"] | None = None
    radius: Length | None = None
    inner_radius: Length | None = None
    length: Length | None = None
    size: tuple[Length, Length, Length] | None = None
    density: Density | None = None


class Spring(Table, frozen=True):
    """A linear spring between this body and the one it hangs from: a flexure, a cable, torsion of a wire."""

    stiffness: Matrix6
    at: Annotated[Vector, Meta(description="the point, from this body's COM, m")] = (0.0, 0.0, 0.0)
    damping: Matrix6 | None = None
    preload: Annotated[Wrench, Meta(description="force (N) and torque (N m) on this body in the nominal pose")] = field(default_factory=lambda: [0.0] * 6)
    loss_angle: LossAngle | None = None


Viscous = Annotated[float, Meta(ge=0, le=1e12, description="viscous damping in N s/m or N m s/rad")]


class Damping(Table, frozen=True):
    """Viscous damping of a body's motion relative to another body (or the support), at its COM."""

    x: Viscous = 0.0
    y: Viscous = 0.0
    z: Viscous = 0.0
    roll: Viscous = 0.0
    pitch: Viscous = 0.0
    yaw: Viscous = 0.0
    against: Annotated[Name, Meta(description="support, or a stage above")] = "support"


class Compliance(Table, frozen=True):
    """Stiffness of the support structure; directions left out are rigid."""

    x: Stiffness | None = None
    y: Stiffness | None = None
    z: Stiffness | None = None
    roll: Stiffness | None = None
    pitch: Stiffness | None = None
    yaw: Stiffness | None = None


class FrameDamping(Table, frozen=True):
    """Viscous damping of the support structure against the ground."""

    x: Viscous = 0.0
    y: Viscous = 0.0
    z: Viscous = 0.0
    roll: Viscous = 0.0
    pitch: Viscous = 0.0
    yaw: Viscous = 0.0


class Support(Table, frozen=True):
    """A support structure that is not rigid: it stands on the ground, and the suspension point moves with it."""

    stiffness: Compliance
    mass: Annotated[float, Meta(ge=0, le=1e9, description="mass that moves with the suspension point, kg")] = 0.0
    inertia: Annotated[
        list[Annotated[float, Meta(ge=0, le=1e15)]],
        Meta(min_length=3, max_length=3, description="moments of inertia about x, y, z at the suspension point, kg m^2"),
    ] = field(default_factory=lambda: [0.0] * 3)
    damping: FrameDamping = FrameDamping()
    loss_angle: LossAngle = 0.0


class Stage(Table, frozen=True):
    """A body and what it hangs on."""

    name: Name
    body: Body
    hangs_from: Name | None = None
    position: Annotated[Vector, Meta(description="nominal COM from the COM above (or support point), m; implied by a symmetric set")] | None = None
    wires: WireSet | None = None
    wire: list[Wire] = field(default_factory=list)
    blades: BladeSet | None = None
    blade: list[Blade] = field(default_factory=list)
    spring: list[Spring] = field(default_factory=list)
    damping: Damping | None = None


class Perturbation(Table, frozen=True):
    """What an imperfect build did to one wire or one body."""

    wire: Annotated[str, Meta(pattern=r"^[A-Za-z][A-Za-z0-9_-]*\.[1-9][0-9]*$", description="a stage's name and a wire's number: test.1")] | None = None
    body: Name | None = None
    k_factor: Factor | None = None
    upper_offset: Vector | None = None
    lower_offset: Vector | None = None
    length_change: Annotated[Position, Meta(description="change of the unstretched length, m")] | None = None
    hold: Hold = "loaded-length"
    com_offset: Annotated[Vector, Meta(description="where the COM went, relative to the attachments, m")] | None = None
    rotation: Annotated[Rotation, Meta(description="how the mass is turned relative to the attachments, rad")] | None = None


Hertz = Annotated[float, Meta(ge=-1e9, le=1e9)]
Root = Annotated[
    list[Hertz | Annotated[list[Hertz], Meta(min_length=2, max_length=2)]],
    Meta(description="roots in Hz, positive for the left half plane, or [re, im] for a conjugate pair"),
]


class Loop(Table, frozen=True):
    """One local control loop: a sensor, an actuator, and what drives it: u = -H(f) y.

    H is a velocity damper, or gain times the product of (i f + z) over zeros z divided by that of (i f + p) over poles p.
    """

    name: Name
    sensor: Annotated[str, Meta(description="a motion: upper.x")]
    actuator: Annotated[str, Meta(description="a force or torque: upper.force_x")]
    reference: Literal["support", "inertial"] = "support"
    damper: Annotated[float, Meta(ge=-1e12, le=1e12, description="force per velocity, N s/m (N m s/rad)")] | None = None
    gain: Annotated[float, Meta(ge=-1e20, le=1e20, description="N/m (N m/rad) times Hz to the number of poles less that of zeros")] | None = None
    zeros: Root = field(default_factory=list)
    poles: Root = field(default_factory=list)
    sensor_noise: Annotated[float, Meta(ge=0, le=1e3, description="amplitude spectral density in m/sqrt(Hz) or rad/sqrt(Hz)")] = 0.0


class Control(Table, frozen=True):
    """Local control."""

    loop: Annotated[list[Loop], Meta(min_length=1)]


Spread = Annotated[float, Meta(ge=0, le=1e3)]


class Distribution(Table, frozen=True):
    """How builds scatter about the nominal value, independently of each other."""

    normal: Annotated[Spread, Meta(description="standard deviation")] | None = None
    uniform: Annotated[Spread, Meta(description="half width")] | None = None
    truncate: Annotated[Spread, Meta(description="largest deviation of a normal distribution")] | None = None


class WireTolerance(Table, frozen=True):
    """Scatter of one wire, or of every wire of a stage by itself."""

    stage: Name | None = None
    wire: Annotated[str, Meta(pattern=r"^[A-Za-z][A-Za-z0-9_-]*\.[1-9][0-9]*$")] | None = None
    k: Annotated[Distribution, Meta(description="of the spring constant, as a share of it")] | None = None
    radius: Annotated[Distribution, Meta(description="of the radius, as a share of it; k goes with its square")] | None = None
    length: Annotated[Distribution, Meta(description="of the unstretched length after trimming, m")] | None = None
    upper: Annotated[Distribution, Meta(description="of the upper attachment along x, y and z each, m")] | None = None
    lower: Annotated[Distribution, Meta(description="of the lower attachment along x, y and z each, m")] | None = None
    hold: Hold = "loaded-length"


class BodyTolerance(Table, frozen=True):
    """Scatter of one body."""

    stage: Name
    mass: Annotated[Distribution, Meta(description="as a share of the mass")] | None = None
    inertia: Annotated[Distribution, Meta(description="of each moment, as a share of it")] | None = None
    com: Annotated[Distribution, Meta(description="of the COM along x, y and z each, m")] | None = None


class BladeTolerance(Table, frozen=True):
    """Scatter of every blade of a stage by itself."""

    stage: Name
    stiffness: Annotated[Distribution, Meta(description="as a share of the stiffness")]


class Tolerance(Table, frozen=True):
    """What builds get wrong."""

    wire: list[WireTolerance] = field(default_factory=list)
    body: list[BodyTolerance] = field(default_factory=list)
    blade: list[BladeTolerance] = field(default_factory=list)


class Design(Table, frozen=True):
    """A whole design file."""

    design: Header
    stage: Annotated[list[Stage], Meta(min_length=1, description="bodies, top to bottom")]
    constants: Constants = Constants()
    materials: dict[str, Material] = field(default_factory=dict)
    gas: Gas | None = None
    support: Support | None = None
    control: Control | None = None
    tolerance: Tolerance | None = None
    perturbation: list[Perturbation] = field(default_factory=list)
    analysis: Annotated[dict[str, dict[str, Any]], Meta(description="defaults for a command's options, under the options' own names")] = field(
        default_factory=dict
    )


def json_schema() -> dict[str, Any]:
    """The file format as JSON Schema (draft 2020-12)."""
    import msgspec.json

    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "pendsus design file"} | msgspec.json.schema(Design)
