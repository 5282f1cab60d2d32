"""Types of the values of a design file: names, lengths, masses, ... with units and bounds."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from msgspec import Meta, Struct

Raw = dict[str, Any]
"""Tables of a TOML file as they are read, before they are checked."""
Schema = dict[str, Any]
"""A JSON Schema, or a part of one."""


def doc(description: str, **bounds: Any) -> Meta:
    """Describe a value, and bound it."""
    return Meta(description=description, **bounds)


def of_unit(name: str, description: str, **bounds: Any) -> Meta:
    """Describe a number in an SI unit; `unit` reads it back from the type."""
    return Meta(description=description or None, extra={"unit": name}, **bounds)


def unit(kind: object) -> str:
    """Read the SI unit of a type of this file; "" if it has none.

    >>> unit(Length), unit(Factor), unit(Name)
    ('m', '1', '')
    """
    found = [extra.extra for extra in getattr(kind, "__metadata__", ()) if isinstance(extra, Meta)]
    return next((extra["unit"] for extra in found if extra and "unit" in extra), "")


class Table(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, omit_defaults=True):
    """Base of all tables of a file: immutable, and unknown keys are faults."""


NAMES = "letters, digits, _ and -, starting with a letter"

Name = Annotated[str, doc(f"a name: {NAMES}", pattern=r"^[A-Za-z][A-Za-z0-9_-]*$", max_length=60)]
Stem = Annotated[
    str,
    doc(
        "letters, digits, . _ and - (it is also the stem of the files written)",
        pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$",
        max_length=100,
    ),
]
Length = Annotated[float, of_unit("m", "length in m", ge=1e-9, le=1e5)]
Separation = Annotated[float, of_unit("m", "length in m, zero allowed", ge=0, le=1e5)]
Position = Annotated[float, of_unit("m", "signed length in m", ge=-1e5, le=1e5)]
Angle = Annotated[float, of_unit("rad", "angle in rad", ge=-3.2, le=3.2)]
Mass = Annotated[float, of_unit("kg", "mass in kg", ge=1e-9, le=1e9)]
MassOrZero = Annotated[float, of_unit("kg", "mass in kg, zero allowed", ge=0, le=1e9)]
MomentOrZero = Annotated[float, of_unit("kg m^2", "", ge=0, le=1e15)]
Inertia = Annotated[
    float,
    of_unit("kg m^2", "moment or product of inertia in kg m^2", ge=-1e15, le=1e15),
]
Strength = Annotated[
    float,
    of_unit(
        "Pa", "stress in Pa at which the material breaks (or, of blades, yields)", ge=1.0, le=1e13
    ),
]
Density = Annotated[float, of_unit("kg/m^3", "density in kg/m^3", ge=1e-3, le=1e6)]
Modulus = Annotated[float, of_unit("Pa", "Young's modulus in Pa", ge=1.0, le=1e15)]
Poisson = Annotated[
    float,
    of_unit("1", "Poisson's ratio, for the twisting of wires; 0.3 if not given", gt=-1, lt=0.5),
]
Stiffness = Annotated[float, of_unit("N/m", "stiffness in N/m", ge=1e-12, le=1e20)]
Torsion = Annotated[float, of_unit("N m/rad", "torsional stiffness in N m/rad", ge=1e-18, le=1e15)]
Coefficient = Annotated[
    float, doc("element of a stiffness or damping matrix, SI", ge=-1e20, le=1e20)
]
Load = Annotated[float, doc("force in N or torque in N m", ge=-1e12, le=1e12)]
Tension = Annotated[float, of_unit("N", "tension in N", ge=1e-12, le=1e12)]
Frequency = Annotated[float, of_unit("Hz", "frequency in Hz", ge=1e-6, le=1e6)]
Kelvin = Annotated[float, of_unit("K", "temperature in K", gt=0, le=1e4)]
Expansion = Annotated[
    float,
    of_unit("1/K", "coefficient of linear thermal expansion in 1/K", ge=-1e-2, le=1e-2),
]
ModulusSlope = Annotated[
    float,
    of_unit(
        "1/K",
        "relative change of Young's modulus with temperature, (1/E) dE/dT in 1/K; 0 if not given",
        ge=-1.0,
        le=1.0,
    ),
]
SpecificHeat = Annotated[float, of_unit("J/(kg K)", "specific heat in J/(kg K)", ge=1e-6, le=1e6)]
Conductivity = Annotated[
    float, of_unit("W/(m K)", "thermal conductivity in W/(m K)", ge=1e-6, le=1e6)
]
Pressure = Annotated[
    float,
    of_unit(
        "Pa", "pressure in Pa, of a gas so dilute that its molecules do not collide", ge=0, le=1e3
    ),
]
MolarMass = Annotated[
    float, of_unit("kg/mol", "molar mass in kg/mol; 0.028 is nitrogen", ge=1e-3, le=1.0)
]
Acceleration = Annotated[float, of_unit("m/s^2", "acceleration in m/s^2", gt=0, le=1e3)]
Pull = Annotated[float, of_unit("m/s^2", "component of gravity in m/s^2", ge=-1e3, le=1e3)]
GravityVector = Annotated[
    list[Pull], doc("gravity along x, y and z in m/s^2", min_length=3, max_length=3)
]
GravityGradient = Annotated[
    float, of_unit("1/s^2", "gradient of gravity in 1/s^2", ge=-1.0, le=1.0)
]
GravityRow = Annotated[list[GravityGradient], Meta(min_length=3, max_length=3)]
PositiveLossAngle = Annotated[float, of_unit("rad", "loss angle in rad, above zero", gt=0, lt=1)]
LossAngle = Annotated[float, of_unit("rad", "loss angle in rad", ge=0, lt=1)]
Factor = Annotated[float, of_unit("1", "factor on the nominal value", ge=1e-6, le=1e6)]
ShapeFactor = Annotated[
    float,
    of_unit(
        "1", "shape factor of a cantilever blade: 1 rectangular, 1.5 triangular", ge=0.5, le=10
    ),
]

Component = Annotated[float, of_unit("1", "component of a direction", ge=-1e5, le=1e5)]
Vector = Annotated[tuple[Position, Position, Position], doc("x, y, z in m")]
Direction = Annotated[
    tuple[Component, Component, Component],
    doc("direction x, y, z from the upper towards the lower end, of any length above zero"),
]
Row3 = Annotated[list[Inertia], Meta(min_length=3, max_length=3)]
Row6 = Annotated[list[Coefficient], Meta(min_length=6, max_length=6)]
Matrix6 = Annotated[
    list[Coefficient | Row6],
    doc(
        "six diagonal elements (x, y, z, roll, pitch, yaw) or a full 6x6",
        min_length=6,
        max_length=6,
    ),
]
Wrench = Annotated[
    list[Load],
    doc("force x, y, z in N and torque roll, pitch, yaw in N m", min_length=6, max_length=6),
]

Hold = Annotated[
    Literal["loaded-length", "natural-length"],
    doc(
        '"loaded-length": the wire is trimmed to its nominal tension in the nominal pose;'
        ' "natural-length": its unstretched length stays'
    ),
]
MaterialName = Annotated[Name, doc(f"name of a material, built in or of [materials]: {NAMES}")]
WireName = Annotated[
    str,
    doc(
        "a stage's name and a wire's number: test.1",
        pattern=r"^[A-Za-z][A-Za-z0-9_-]*\.[1-9][0-9]*$",
    ),
]
StageName = Annotated[Name, doc(f"a stage's name: {NAMES}")]
