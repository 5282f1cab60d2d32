"""Design file format as frozen types: keys, units and bounds.

`pendsus schema` prints these types as JSON Schema; `faults.py` checks files against it. Rules
across tables are in `checks.py`.
"""

from __future__ import annotations

from typing import Annotated

from suspension_cli.conventions import AVOGADRO, DOFS
from suspension_cli.design import expressions, key_rules, typed_tables, units
from suspension_cli.design.bodies import Body
from suspension_cli.design.control import Control
from suspension_cli.design.heat import Heat
from suspension_cli.design.imperfections import Distribution as Distribution
from suspension_cli.design.imperfections import Perturbation, Tolerance
from suspension_cli.design.links import Active, BetweenBodies, Cavity, Damper, Link
from suspension_cli.design.materials import Material
from suspension_cli.design.required_quantities import RequiredQuantity
from suspension_cli.design.towers import Filter, InvertedPendulum
from suspension_cli.design.typed_tables import Problems, Raw, Schema, Table, doc, given, key
from suspension_cli.design.wires import TALL, Blade, BladeSet, Wire, WireSet
from suspension_cli.errors import InputError


class Header(Table, frozen=True):
    """Name and origin of the design."""

    name: units.Stem
    title: str = key("title, for tables and pictures", "")
    reference: str = key("where the design comes from", "")
    author: str = key("who made the design, for reports", "", max_length=1000)
    notes: str = key(
        "free text for reports; an empty line begins a paragraph", "", max_length=20000
    )


class Constants(Table, frozen=True):
    """Gravity and temperature."""

    gravity: units.Acceleration | units.GravityVector = key(
        "gravity in m/s^2; a vector acts after trimming", 9.81
    )
    gravity_gradient: units.GravityGradient | units.GravityGradients = key(
        "dg_z/dz in 1/s^2 (3.1e-6 on Earth), or the symmetric 3x3 dg_i/dx_j", 0.0
    )
    wire_weight: bool = key("whether wires have weight, and inertia in all models", False)
    temperature: units.Kelvin = key("temperature in K where no other is given", 290.0)

    rules = (key_rules.symmetric("gravity_gradient"),)

    def check(self) -> Problems:
        """Check the direction of gravity."""
        if isinstance(self.gravity, list) and not self.gravity[2] < 0:
            remedy = "give [x, y, z] with z below 0: [0.0, 0.0, -9.81]"
            yield "gravity", "does not point down, so that nothing hangs", remedy


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
    preload: units.Wrench | None = key(
        "force (N) and torque (N m) on this body, nominal pose; default its share of a"
        " load on springs alone, else none"
    )
    loss_angle: units.LossAngle | None = key("of the stiffness, rad; default that of the material")
    material: units.MaterialName | None = key("the spring's material, for its loss")
    thickness: units.Length | None = key("of a flexure that bends, m, for its loss")
    temperature: units.Kelvin | None = key("in K, for its loss; default that of [constants]")
    active: Active = False

    rules = (key_rules.symmetric("stiffness", "damping"), key_rules.needs("thickness", "material"))

    @property
    def made_of(self) -> str | None:
        """Name of its material, if the design gives it."""
        return self.material


Viscous = Annotated[float, doc("viscous damping in N s/m or N m s/rad", ge=0, le=1e12)]


class FrameDamping(Table, frozen=True):
    """Viscous damping against the ground, N s/m and N m s/rad."""

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
    """Stiffness in N/m and N m/rad; directions left out are rigid."""

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

    rules = (key_rules.not_tiny("mass", "inertia"),)

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
        "whether this is the mirror, the default output; without one, the end of the longest chain",
        False,
    )
    locked: bool = key(
        "whether it and all stages above it are clamped to the support",
        False,
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
        key_rules.excludes("wires", "wire", problem="conflicts with a symmetric set [stage.wires]"),
        key_rules.excludes("wires", "position", problem="a symmetric set implies the position"),
        key_rules.unique("blade"),
        key_rules.excludes("inverted_pendulum", "wires", "wire"),
        key_rules.needs(
            "blades", "wires", remedy="use [[stage.blade]] and name the blade in each wire"
        ),
        key_rules.any_of("wires", "wire", "spring", "inverted_pendulum"),
        key_rules.required(
            "position", when=lambda stage: not given(stage, "wires", "inverted_pendulum")
        ),
    )

    @property
    def rests_on_springs(self) -> bool:
        """Whether springs alone carry it."""
        carried_otherwise = self.wire_tables or self.inverted_pendulum is not None
        return bool(self.spring) and not carried_otherwise

    @property
    def wire_tables(self) -> list[WireSet | Wire]:
        """The symmetric set of wires, and the wires given one by one."""
        return [*([self.wires] if self.wires is not None else []), *self.wire]

    @property
    def blade_tables(self) -> list[BladeSet | Blade]:
        """The set of equal blades, and the blades given one by one."""
        return [*([self.blades] if self.blades is not None else []), *self.blade]


class Tie(Table, frozen=True):
    """A parameter that follows from others."""

    name: str = key("dotted path, such as stage.test.wires.t2", max_length=200)
    equals: str = key(
        f"expression, such as '{expressions.EXAMPLE}'",
        max_length=expressions.LONGEST,
    )

    def check(self) -> Problems:
        """Check the form of the path and of the expression."""
        if not expressions.PATH.fullmatch(self.name):
            yield "name", "is not a dotted path", "write for example stage.test.wires.t2"
        try:
            expressions.terms(self.equals)
        except InputError as error:
            yield "equals", error.faults[0].problem, error.faults[0].remedy


class Design(Table, frozen=True):
    """A whole design file."""

    design: Header
    stage: list[Stage] = key("bodies, top to bottom", min_length=1)
    constants: Constants = Constants()
    materials: dict[str, Material] = {}
    gas: Gas | None = None
    heat: Heat | None = None
    support: Support | None = None
    control: Control | None = None
    tolerance: Tolerance | None = None
    perturbation: list[Perturbation] = []
    link: list[Link] = key("springs between any two bodies", [])
    damper: list[Damper] = key("dampers between any two bodies", [])
    cavity: list[Cavity] = key("light between two mirrors, with its pressure on them", [])
    requirement: list[RequiredQuantity] = key("what the design must meet", [])
    tie: list[Tie] = key("parameters that follow from others", [])
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
    return typed_tables.json_schema(Design, "pendsus design file")
