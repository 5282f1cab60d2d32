"""Design file format as frozen types: keys, units and bounds.

`pendsus schema` prints these types as JSON Schema; `faults.py` checks files against it. Rules
across tables are in `checks.py`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated

from msgspec import Meta

from suspension_cli.conventions import AVOGADRO, DOFS
from suspension_cli.design import foton, tables, units
from suspension_cli.design.bodies import Body
from suspension_cli.design.imperfections import Distribution as Distribution
from suspension_cli.design.imperfections import Perturbation, Tolerance
from suspension_cli.design.links import Active, BetweenBodies, Cavity, Damper, Link
from suspension_cli.design.losses import MaterialLoss
from suspension_cli.design.sensors import NoiseSpectrum, Osem, Reference, SpectralDensity
from suspension_cli.design.tables import Problems, Raw, Schema, Table, doc, given, key
from suspension_cli.design.towers import Filter, InvertedPendulum
from suspension_cli.design.wires import TALL, Blade, BladeSet, Wire, WireSet


class Header(Table, frozen=True):
    """Name and origin of the design."""

    name: units.Stem
    title: str = key("title, for tables and pictures", "")
    reference: str = key("where the design comes from", "")


class Constants(Table, frozen=True):
    """Gravity and temperature."""

    gravity: units.Acceleration | units.GravityVector = key(
        "acceleration due to gravity in m/s^2; a vector acts after the suspension was trimmed", 9.81
    )
    gravity_gradient: units.GravityGradient | units.GravityGradients = key(
        "dg_z/dz in 1/s^2 (3.1e-6 on Earth), or the symmetric 3x3 dg_i/dx_j", 0.0
    )
    wire_weight: bool = key("whether wires have weight, and inertia in all models", False)
    temperature: units.Kelvin = key("temperature in K where no other is given", 290.0)

    rules = (tables.symmetric("gravity_gradient"),)

    def check(self) -> Problems:
        """Check the direction of gravity."""
        if isinstance(self.gravity, list) and not self.gravity[2] < 0:
            remedy = "give [x, y, z] with z below 0: [0.0, 0.0, -9.81]"
            yield "gravity", "does not point down, so that nothing hangs", remedy


class Material(Table, frozen=True):
    """A material of wires or blades; defaults are those of the built-in one of the same name."""

    youngs_modulus: units.Modulus | None = key("Young's modulus in Pa")
    poisson_ratio: float | None = key("for twisting; 0.3 if not given", unit="1", gt=-1, lt=0.5)
    density: units.Density | None = None
    thermal_expansion: units.Expansion | None = None
    modulus_slope: units.ModulusSlope | None = None
    specific_heat: float | None = key("specific heat in J/(kg K)", unit="J/(kg K)", ge=1e-6, le=1e6)
    thermal_conductivity: float | None = key("in W/(m K)", unit="W/(m K)", ge=1e-6, le=1e6)
    tensile_strength: units.Strength | None = key(
        "stress in Pa at which it breaks (blades: yields)"
    )
    loss_angle: units.LossAngle | None = key("constant loss angle in rad, short for loss.angle")
    loss: MaterialLoss | None = None
    source: str = key("where the numbers come from", "")


class Gas(Table, frozen=True):
    """Residual gas around the suspension."""

    pressure: units.Pressure = key("pressure in Pa, so low that molecules do not collide")
    molar_mass: float = key("kg/mol; 0.028 is nitrogen", 0.028, unit="kg/mol", ge=1e-3, le=1.0)
    temperature: units.Kelvin | None = key("in K; default that of [constants]")

    @property
    def molecule(self) -> float:
        """Mass of a molecule, kg."""
        return self.molar_mass / AVOGADRO


class Spring(Table, frozen=True):
    """A linear spring between this body and the one it hangs from: a flexure, a cable."""

    stiffness: units.Matrix6 = key(
        "x, y, z, roll, pitch, yaw at the point, or a full 6x6: N/m, N m/rad"
    )
    at: units.Vector = key("the point, from this body's COM, m", (0.0, 0.0, 0.0))
    damping: units.Matrix6 | None = key("six elements or a full 6x6: N s/m, N m s/rad")
    preload: units.Wrench = key("force (N) and torque (N m) on this body, nominal pose", [0.0] * 6)
    loss_angle: units.LossAngle | None = key("of the stiffness, rad; default that of the material")
    material: units.MaterialName | None = key("the spring's material, for its loss")
    thickness: units.Length | None = key("of a flexure that bends, m, for its loss")
    temperature: units.Kelvin | None = key("in K, for its loss; default that of [constants]")
    active: Active = False

    rules = (tables.symmetric("stiffness", "damping"), tables.needs("thickness", "material"))

    @property
    def made_of(self) -> str | None:
        """Name of its material, if the design gives it."""
        return self.material


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

    against: units.Name = key('"support", or a stage above', "support", names="earlier stage")


class Compliance(Table, frozen=True):
    """Stiffness of the support structure, N/m and N m/rad; directions left out are rigid."""

    x: units.Stiffness | None = None
    y: units.Stiffness | None = None
    z: units.Stiffness | None = None
    roll: units.Stiffness | None = None
    pitch: units.Stiffness | None = None
    yaw: units.Stiffness | None = None


class Support(Table, frozen=True):
    """An elastic support structure between the ground and the suspension point."""

    stiffness: Compliance
    mass: units.MassOrZero = key("mass that moves with the suspension point, kg", 0.0)
    inertia: list[units.MomentOrZero] = key("at the suspension point, kg m^2", [0.0] * 3, count=3)
    damping: FrameDamping = FrameDamping()
    loss_angle: units.LossAngle = key("loss angle of the stiffness in rad", 0.0)

    rules = (tables.not_tiny("mass", "inertia"),)

    def check(self) -> Problems:
        """Check that it moves in some direction, and is damped only where it moves."""
        elastic = given(self.stiffness, *DOFS)
        if not elastic:
            remedy = "give z = ... (N/m), or leave [support] out"
            yield "stiffness", "leaves the support rigid in every direction", remedy
        for dof in DOFS if elastic else ():
            if getattr(self.damping, dof) and dof not in elastic:
                remedy = f"give support.stiffness.{dof} too"
                yield f"damping.{dof}", "damps a rigid direction", remedy


class Stage(Table, frozen=True):
    """A body and what it hangs on."""

    name: units.Name
    body: Body
    hangs_from: units.Name | None = key(
        '"support" or an earlier stage; default the stage before, or its keystone',
        names="earlier stage",
    )
    mirror: bool = key(
        "whether its motion is the default output; else that of the end of the longest chain", False
    )
    position: units.Vector | None = key(
        "nominal COM from the COM above (or support point), m, unless implied", plausible=TALL
    )
    wires: WireSet | None = None
    wire: list[Wire] = key("wires anywhere, instead of a symmetric set", [])
    blades: BladeSet | None = None
    blade: list[Blade] = key("blades for wires that name them", [])
    spring: list[Spring] = key("linear springs to the body above", [])
    inverted_pendulum: InvertedPendulum | None = None
    filter: Filter | None = None
    damping: Damping | None = None

    rules = (
        tables.excludes("wires", "wire", problem="conflicts with a symmetric set [stage.wires]"),
        tables.excludes("wires", "position", problem="a symmetric set implies the position"),
        tables.unique("blade"),
        tables.excludes("inverted_pendulum", "wires", "wire"),
        tables.needs(
            "blades", "wires", remedy="use [[stage.blade]] and name the blade in each wire"
        ),
        tables.any_of("wires", "wire", "spring", "inverted_pendulum"),
        tables.required(
            "position", when=lambda stage: not given(stage, "wires", "inverted_pendulum")
        ),
    )

    @property
    def wire_tables(self) -> list[WireSet | Wire]:
        """The symmetric set of wires, and the wires given one by one."""
        return [*([self.wires] if self.wires is not None else []), *self.wire]

    @property
    def blade_tables(self) -> list[BladeSet | Blade]:
        """The set of equal blades, and the blades given one by one."""
        return [*([self.blades] if self.blades is not None else []), *self.blade]


Hertz = Annotated[float, Meta(ge=-1e9, le=1e9)]
Root = Annotated[
    list[Hertz | Annotated[list[Hertz], doc(count=2)]],
    doc("roots in Hz, positive for the left half plane, or [re, im] for a conjugate pair"),
]


class GainAt(Table, frozen=True):
    """Magnitude of a filter at one frequency, which sets its gain."""

    frequency: units.Frequency
    magnitude: units.Number = key("|H| there, N/m (N m/rad); if negative, reverses the sign of H")


FOTON = 'a Foton string: zpk([z;z],[p;p],k,"n"), gain(k), pole(f,"n"), ... and products of these'


class DigitalFilter(Table, frozen=True):
    """A digital filter: sections of a Foton filter file, or a design with a sample rate."""

    file: str | None = key("Foton filter file (.txt) of a front end, from this file's folder")
    module: str | None = key("name of the filter module in the file: M0_DAMP_L")
    sections: list[Annotated[int, Meta(ge=1, le=10)]] = key("sections that are on: 1 is FM1", [])
    design: str | None = key(f"{FOTON}, made digital as Foton does; of a file, its sections")
    rate: float | None = key("sample rate in Hz of the design", unit="Hz", gt=0, le=1e9)
    gain: float = key("factor on the filter", 1.0, unit="1", ge=-1e12, le=1e12)
    source: str = key("where the design comes from; filled in for a file", "")

    rules = (
        tables.exactly_one("file", "design"),
        tables.needs("file", "module"),
        tables.needs("file", "sections"),
        tables.together("design", "rate"),
    )

    def check(self) -> Problems:
        """Check that a file was read."""
        if self.file is not None:
            remedy = "read the design from its file, or give design and rate"
            yield "file", "is read only with a design file, not with its text alone", remedy


def make_response(given: str | DigitalFilter) -> foton.Filter:
    """Make the filter that a key gives; raises `FotonError`."""
    if isinstance(given, str):
        return foton.parse(given)
    made = foton.parse(given.design or "gain(1)", given.rate or 0.0)
    return replace(made, gain=made.gain * given.gain)


class Loop(Table, frozen=True):
    """One local control loop from a sensor y to an actuator u = -H(f) R(f) exp(-2 pi i f T) y.

    H is a velocity damper, or gain times the product of (i f + z) over zeros z divided by that of
    (i f + p) over poles p, or a Foton string; R the response of the sensor, T a delay.
    """

    name: units.Name
    sensor: str = key("a motion of a stage: upper.x, upper.x@0,0,0.01")
    actuator: str = key("a force or torque on a stage: upper.force_x")
    reference: Reference = key(
        '"support": between body and support structure; "inertial": inertial space',
        "support",
    )
    damper: float | None = key("force per velocity, N s/m (N m s/rad)", ge=-1e12, le=1e12)
    gain: units.Number | None = key(
        "H = gain times the product of (i f + z) over that of (i f + p); N/m (N m/rad)"
        " times Hz^(number of poles - number of zeros)"
    )
    zeros: Root = []
    poles: Root = []
    filter: str | DigitalFilter | None = key(
        f"H in N/m (N m/rad) as {FOTON}; or a digital filter: sections of a Foton filter file"
    )
    gain_at: GainAt | None = key("sets the gain of zeros and poles, or of filter")
    delay: float = key("delay of the loop in s, exp(-2 pi i f delay)", 0.0, unit="s", ge=0, le=10.0)
    sensor_response: str | DigitalFilter | None = key(
        f"reading over motion of the sensor: {FOTON}; or a digital filter"
    )
    sensor_noise: SpectralDensity | NoiseSpectrum = key(
        "as motion, m/sqrt(Hz) or rad/sqrt(Hz): flat, {asd, corner} or {frequency, asd}", 0.0
    )
    actuator_noise: float = key("flat, N/sqrt(Hz) or N m/sqrt(Hz)", 0.0, ge=0, le=1e3)

    rules = (
        tables.exactly_one("damper", "gain", "filter", when=lambda loop: loop.gain_at is None),
        tables.excludes("gain_at", "damper", "gain"),
        tables.excludes(
            "filter", "zeros", "poles", problem="conflicts with filter, which has its own"
        ),
        tables.excludes(
            "damper", "zeros", "poles", problem="conflicts with damper, which has none"
        ),
    )

    def check(self) -> Problems:
        """Check that the gain can be set, and does not grow without bound."""
        for name in given(self, "filter", "sensor_response"):
            try:
                make_response(getattr(self, name))
            except foton.FotonError as error:
                yield name, error.problem, error.remedy
                return
        if self.gain_at is not None:
            size = abs(self.without_gain_at.at(self.gain_at.frequency))
            if not 0 < size < math.inf or self.gain_at.magnitude == 0:
                problem = "the gain cannot be set where the filter is 0 or infinite, or to 0"
                yield "gain_at", problem, "give another frequency or magnitude"
                return
        whole = self.controller_and_sensor.continuous
        zeros, poles = len(whole.zeros), len(whole.poles)
        if zeros <= poles or (self.damper is not None and self.sensor_response is None):
            return  # a damper acts on the velocity, which is known
        key = given(self, "filter", "sensor_response", "zeros")[0]
        what = "a filter" if self.sensor_response is None else "a filter and sensor"
        problem = f"{what} with more zeros ({zeros}) than poles ({poles}) cannot be built"
        yield key, problem, "add poles, or its gain grows with frequency without bound"

    @property
    def without_gain_at(self) -> foton.Filter:
        """The filter H before `gain_at` is applied, without sensor and delay."""
        if self.damper is not None:
            return foton.Filter(2 * math.pi * self.damper, (0j,))
        if self.filter is not None:
            return make_response(self.filter)
        gain = (1.0 if self.gain_at is not None else 0.0) if self.gain is None else self.gain
        return foton.Filter(gain, expand_roots(self.zeros), expand_roots(self.poles))

    @property
    def controller(self) -> foton.Filter:
        """The filter H, without sensor and delay."""
        bare = self.without_gain_at
        if self.gain_at is None:
            return bare
        size = abs(bare.at(self.gain_at.frequency))
        return replace(bare, gain=bare.gain * self.gain_at.magnitude / size)

    @property
    def controller_and_sensor(self) -> foton.Filter:
        """The filter from motion to force: controller and sensor, without the delay."""
        made = self.controller
        return made if self.sensor_response is None else made * make_response(self.sensor_response)


def expand_roots(given: Sequence[float | list[float]]) -> tuple[complex, ...]:
    """List roots in Hz as complex numbers; a pair [re, im] stands for both conjugates."""
    pairs = ((one, [one[0], -one[1]]) if isinstance(one, list) else ([one],) for one in given)
    return tuple(complex(*root) for pair in pairs for root in pair)


class Control(Table, frozen=True):
    """Local control."""

    loop: list[Loop] = key(min_length=1)
    osem: list[Osem] = key("sensors and coils at points of stages", [])

    rules = (tables.unique("loop", "osem"),)


class Design(Table, frozen=True):
    """A whole design file."""

    design: Header
    stage: list[Stage] = key("bodies, top to bottom", min_length=1)
    constants: Constants = Constants()
    materials: dict[str, Material] = {}
    gas: Gas | None = None
    support: Support | None = None
    control: Control | None = None
    tolerance: Tolerance | None = None
    perturbation: list[Perturbation] = []
    link: list[Link] = key("springs between any two bodies", [])
    damper: list[Damper] = key("dampers between any two bodies", [])
    cavity: list[Cavity] = key("light between two mirrors, with its pressure on them", [])
    analysis: dict[str, Raw] = key("defaults for a command's options, by their names", {})

    @property
    def is_active(self) -> bool:
        """Whether a spring, link, damper or cavity may give power to the motion."""
        springs = (spring for stage in self.stage for spring in stage.spring)
        return any(part.active for part in (*springs, *self.link, *self.damper, *self.cavity))

    @property
    def between_bodies(self) -> list[tuple[str, BetweenBodies]]:
        """All elements between two bodies, each behind the name of its kind of table."""
        kinds = ("link", "damper", "cavity")
        return [(kind, row) for kind in kinds for row in getattr(self, kind)]


def json_schema() -> Schema:
    """Make the JSON Schema of the file format."""
    return tables.json_schema(Design, "pendsus design file")
