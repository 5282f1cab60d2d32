"""Types of the values of a design file: names, lengths, masses, ... with units and bounds."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from msgspec import Meta, Struct


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

Name = Annotated[
    str, Meta(pattern=r"^[A-Za-z][A-Za-z0-9_-]*$", max_length=60, description=f"a name: {NAMES}")
]
Stem = Annotated[
    str,
    Meta(
        pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$",
        max_length=100,
        description="letters, digits, . _ and - (it is also the stem of the files written)",
    ),
]
Length = Annotated[float, of_unit("m", ge=1e-9, le=1e5, description="length in m")]
Separation = Annotated[float, of_unit("m", ge=0, le=1e5, description="length in m, zero allowed")]
Position = Annotated[float, of_unit("m", ge=-1e5, le=1e5, description="signed length in m")]
Angle = Annotated[float, of_unit("rad", ge=-3.2, le=3.2, description="angle in rad")]
Mass = Annotated[float, of_unit("kg", ge=1e-9, le=1e9, description="mass in kg")]
MassOrZero = Annotated[float, of_unit("kg", ge=0, le=1e9, description="mass in kg, zero allowed")]
MomentOrZero = Annotated[float, of_unit("kg m^2", "", ge=0, le=1e15)]
Inertia = Annotated[
    float,
    of_unit("kg m^2", ge=-1e15, le=1e15, description="moment or product of inertia in kg m^2"),
]
Strength = Annotated[
    float,
    of_unit(
        "Pa",
        ge=1.0,
        le=1e13,
        description="stress in Pa at which the material breaks (or, of blades, yields)",
    ),
]
Density = Annotated[float, of_unit("kg/m^3", ge=1e-3, le=1e6, description="density in kg/m^3")]
Modulus = Annotated[float, of_unit("Pa", ge=1.0, le=1e15, description="Young's modulus in Pa")]
Poisson = Annotated[
    float,
    of_unit(
        "1",
        gt=-1,
        lt=0.5,
        description="Poisson's ratio, for the twisting of wires; 0.3 if not given",
    ),
]
Stiffness = Annotated[float, of_unit("N/m", ge=1e-12, le=1e20, description="stiffness in N/m")]
Torsion = Annotated[
    float, of_unit("N m/rad", ge=1e-18, le=1e15, description="torsional stiffness in N m/rad")
]
Coefficient = Annotated[
    float, Meta(ge=-1e20, le=1e20, description="element of a stiffness or damping matrix, SI")
]
Load = Annotated[float, Meta(ge=-1e12, le=1e12, description="force in N or torque in N m")]
Tension = Annotated[float, of_unit("N", ge=1e-12, le=1e12, description="tension in N")]
Frequency = Annotated[float, of_unit("Hz", ge=1e-6, le=1e6, description="frequency in Hz")]
Kelvin = Annotated[float, of_unit("K", gt=0, le=1e4, description="temperature in K")]
Expansion = Annotated[
    float,
    of_unit("1/K", ge=-1e-2, le=1e-2, description="coefficient of linear thermal expansion in 1/K"),
]
ModulusSlope = Annotated[
    float,
    of_unit(
        "1/K",
        ge=-1.0,
        le=1.0,
        description=(
            "relative change of Young's modulus with temperature, (1/E) dE/dT in 1/K; 0 if not"
            " given"
        ),
    ),
]
SpecificHeat = Annotated[
    float, of_unit("J/(kg K)", ge=1e-6, le=1e6, description="specific heat in J/(kg K)")
]
Conductivity = Annotated[
    float, of_unit("W/(m K)", ge=1e-6, le=1e6, description="thermal conductivity in W/(m K)")
]
Pressure = Annotated[
    float,
    of_unit(
        "Pa",
        ge=0,
        le=1e3,
        description="pressure in Pa, of a gas so dilute that its molecules do not collide",
    ),
]
MolarMass = Annotated[
    float, of_unit("kg/mol", ge=1e-3, le=1.0, description="molar mass in kg/mol; 0.028 is nitrogen")
]
Acceleration = Annotated[float, of_unit("m/s^2", gt=0, le=1e3, description="acceleration in m/s^2")]
Pull = Annotated[
    float, of_unit("m/s^2", ge=-1e3, le=1e3, description="component of gravity in m/s^2")
]
GravityVector = Annotated[
    list[Pull], Meta(min_length=3, max_length=3, description="gravity along x, y and z in m/s^2")
]
GravityGradient = Annotated[
    float, of_unit("1/s^2", ge=-1.0, le=1.0, description="gradient of gravity in 1/s^2")
]
GravityRow = Annotated[list[GravityGradient], Meta(min_length=3, max_length=3)]
PositiveLossAngle = Annotated[
    float, of_unit("rad", gt=0, lt=1, description="loss angle in rad, above zero")
]
LossAngle = Annotated[float, of_unit("rad", ge=0, lt=1, description="loss angle in rad")]
Factor = Annotated[float, of_unit("1", ge=1e-6, le=1e6, description="factor on the nominal value")]
ShapeFactor = Annotated[
    float,
    of_unit(
        "1",
        ge=0.5,
        le=10,
        description="shape factor of a cantilever blade: 1 rectangular, 1.5 triangular",
    ),
]

Component = Annotated[float, of_unit("1", ge=-1e5, le=1e5, description="component of a direction")]
Vector = Annotated[tuple[Position, Position, Position], Meta(description="x, y, z in m")]
Direction = Annotated[
    tuple[Component, Component, Component],
    Meta(
        description=(
            "direction x, y, z from the upper towards the lower end, of any length above zero"
        )
    ),
]
Row3 = Annotated[list[Inertia], Meta(min_length=3, max_length=3)]
Row6 = Annotated[list[Coefficient], Meta(min_length=6, max_length=6)]
Matrix6 = Annotated[
    list[Coefficient | Row6],
    Meta(
        min_length=6,
        max_length=6,
        description="six diagonal elements (x, y, z, roll, pitch, yaw) or a full 6x6",
    ),
]
Wrench = Annotated[
    list[Load],
    Meta(
        min_length=6,
        max_length=6,
        description="force x, y, z in N and torque roll, pitch, yaw in N m",
    ),
]

Hold = Annotated[
    Literal["loaded-length", "natural-length"],
    Meta(
        description=(
            '"loaded-length": the wire is trimmed to its nominal tension in the nominal pose;'
            ' "natural-length": its unstretched length stays'
        )
    ),
]
MaterialName = Annotated[
    Name, Meta(description=f"name of a material, built in or of [materials]: {NAMES}")
]
WireName = Annotated[
    str,
    Meta(
        pattern=r"^[A-Za-z][A-Za-z0-9_-]*\.[1-9][0-9]*$",
        description="a stage's name and a wire's number: test.1",
    ),
]
StageName = Annotated[Name, Meta(description=f"a stage's name: {NAMES}")]
