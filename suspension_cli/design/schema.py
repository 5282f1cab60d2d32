"""The design file, as frozen types: what may be written, in which unit, within which bounds.

These types are the file format.  `pendsus schema` prints them as JSON Schema, the reader checks files
against them (`faults.py`), and what one type cannot say about another stands in `checks.py`.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from msgspec import Meta, Struct, field

from suspension_cli.design.quantities import (
    Density,
    Factor,
    Frequency,
    Hold,
    Inertia,
    Length,
    LossAngle,
    Mass,
    Matrix6,
    Modulus,
    Name,
    Poisson,
    Position,
    Rotation,
    Row3,
    Separation,
    ShapeFactor,
    Stem,
    Stiffness,
    Tension,
    Vector,
    Wrench,
)


class Table(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, omit_defaults=True):
    """A table of the file: unknown keys are faults, values never change."""


class Header(Table, frozen=True):
    """What the design is called and where it comes from."""

    name: Stem
    title: str = ""
    reference: str = ""


class Constants(Table, frozen=True):
    """Surroundings."""

    gravity: Annotated[float, Meta(gt=0, le=1e3, description="acceleration due to gravity in m/s^2")] = 9.81
    temperature: Annotated[float, Meta(gt=0, le=1e4, description="temperature in K")] = 290.0


class Material(Table, frozen=True):
    """A material of wires, blades or bodies; a built-in one of the same name lends what is left out."""

    youngs_modulus: Modulus | None = None
    poisson_ratio: Poisson | None = None
    density: Density | None = None
    loss_angle: LossAngle | None = None
    source: str = ""


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


class Section(Table, frozen=True):
    """A ribbon's rectangular cross-section: width along y, thickness along x."""

    width: Length
    thickness: Length


class WireSet(Table, frozen=True):
    """Wires symmetric in x and y, in the paper's symbols."""

    count: Literal[1, 2, 4]
    l: Annotated[Length, Meta(description="loaded length of each wire, m")]
    s: Annotated[Separation, Meta(description="half separation in x, upper and lower, m")] | None = None
    s_upper: Annotated[Separation, Meta(description="half separation in x at the upper end, m")] | None = None
    s_lower: Annotated[Separation, Meta(description="half separation in x at the lower end, m")] | None = None
    t1: Annotated[Separation, Meta(description="half separation in y at the upper end, m")] | None = None
    t2: Annotated[Separation, Meta(description="half separation in y at the lower end, m")] | None = None
    d: Annotated[Position, Meta(description="height of the lower end above the COM of this body, m")] = 0.0
    d_upper: Annotated[Position, Meta(description="depth of the upper end below the COM of the body above, m")] = 0.0
    material: Name | None = None
    radius: Annotated[Length, Meta(description="radius of a round wire, m")] | None = None
    section: Section | None = None
    k: Annotated[Stiffness, Meta(description="spring constant of one wire, N/m; default E A / l")] | None = None


class Wire(Table, frozen=True):
    """One wire anywhere: its ends in the frames of the two bodies, from their COMs (or the support point)."""

    upper: Vector
    lower: Vector
    material: Name | None = None
    radius: Length | None = None
    section: Section | None = None
    k: Stiffness | None = None
    natural_length: Annotated[Length, Meta(description="unstretched length, m")] | None = None
    tension: Annotated[Tension, Meta(description="tension in the nominal pose, N")] | None = None
    blade: Name | None = None


class BladeGeometry(Table, frozen=True):
    """A tapered cantilever blade clamped at its base, loaded at its tip."""

    length: Length
    base_width: Length
    thickness: Length
    shape_factor: ShapeFactor
    material: Name


class BladeSet(Table, frozen=True):
    """Cantilever blades on the body above (or the support) that carry a symmetric set of wires."""

    count: Literal[1, 2, 4]
    stiffness: Annotated[Stiffness, Meta(description="vertical stiffness of one blade at its tip, N/m")] | None = None
    uncoupled_frequency: Annotated[Frequency, Meta(description="frequency of this stage's mass alone on the blades, Hz")] | None = None
    geometry: BladeGeometry | None = None
    tip_mass: Annotated[float, Meta(ge=0, le=1e9, description="mass that moves with one tip, kg")] = 0.0
    lateral_stiffness: Annotated[tuple[Stiffness, Stiffness], Meta(description="stiffness of one tip along x and y, N/m; rigid if not given")] | None = None
    loss_angle: LossAngle | None = None


class Blade(Table, frozen=True):
    """One cantilever blade, for wires that name it."""

    name: Name
    at: Annotated[Vector, Meta(description="tip in the frame of the body above, m; default: the mean of its wires' upper ends")] | None = None
    stiffness: Stiffness | None = None
    uncoupled_frequency: Frequency | None = None
    geometry: BladeGeometry | None = None
    tip_mass: Annotated[float, Meta(ge=0, le=1e9, description="mass that moves with the tip, kg")] = 0.0
    lateral_stiffness: tuple[Stiffness, Stiffness] | None = None
    loss_angle: LossAngle | None = None


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
