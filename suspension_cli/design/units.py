"""Types of the values of a design file: names, lengths, masses, ... with units and bounds."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from suspension_cli.design.typed_tables import Plausible, doc

NAMES = "letters, digits, _ and -, starting with a letter"

NAME = r"^[A-Za-z][A-Za-z0-9_-]*$"
Name = Annotated[str, doc(NAMES, pattern=NAME, max_length=60)]
Stem = Annotated[
    str,
    doc(
        "letters, digits, . _ and -; stem of the files written",
        pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$",
        max_length=100,
    ),
]
Length = Annotated[float, doc("length in m", "m", ge=1e-9, le=1e5)]
Separation = Annotated[float, doc("length in m, zero allowed", "m", ge=0, le=1e5)]
Position = Annotated[float, doc("signed length in m", "m", ge=-1e5, le=1e5)]
Angle = Annotated[float, doc("angle in rad", "rad", ge=-3.2, le=3.2)]
Mass = Annotated[float, doc("mass in kg", "kg", ge=1e-9, le=1e9)]
MassOrZero = Annotated[float, doc("mass in kg, zero allowed", "kg", ge=0, le=1e9)]
MomentOrZero = Annotated[float, doc("", "kg m^2", ge=0, le=1e15)]
Inertia = Annotated[
    float, doc("moment or product of inertia in kg m^2", "kg m^2", ge=-1e15, le=1e15)
]
BodySize = Annotated[
    Length,
    doc("length in m", "m", Plausible(10.0, "larger than any suspended body", serious=True)),
]
SurfaceArea = Annotated[
    float,
    doc(
        "area in m^2",
        "m^2",
        Plausible(
            100.0, "larger than that of any suspended body", (("cm^2", 1e-4), ("mm^2", 1e-6))
        ),
        ge=1e-12,
        le=1e6,
    ),
]
WireSize = Annotated[
    Length, doc("length in m", "m", Plausible(0.02, "thicker than any wire", serious=True))
]
OSMIUM = 22_600.0
"""Density in kg/m^3 (CRC Handbook of Chemistry and Physics); nothing is denser."""
GRAMS = (("g/cm^3", 1e3), ("g/m^3", 1e-3))
DENSITY = Plausible(OSMIUM, "denser than osmium", GRAMS, 25.0, "less dense than foam", serious=True)
Density = Annotated[float, doc("density in kg/m^3", "kg/m^3", DENSITY, ge=1e-3, le=1e6)]
Stiffness = Annotated[float, doc("stiffness in N/m", "N/m", ge=1e-12, le=1e20)]
Torsion = Annotated[float, doc("torsional stiffness in N m/rad", "N m/rad", ge=1e-18, le=1e15)]
Coefficient = Annotated[
    float, doc("element of a stiffness or damping matrix, SI", ge=-1e20, le=1e20)
]
Load = Annotated[float, doc("force in N or torque in N m", ge=-1e12, le=1e12)]
Tension = Annotated[float, doc("tension in N", "N", ge=1e-12, le=1e12)]
Frequency = Annotated[float, doc("frequency in Hz", "Hz", ge=1e-6, le=1e6)]
ISOLATING = Plausible(100.0, "too high to isolate from anything", (("mHz", 1e-3),))
"""Frequencies of parts that isolate, a few Hz."""
PART_SIZE = Plausible(10.0, "larger than any part of a suspension")
IsolatingFrequency = Annotated[Frequency, doc("frequency in Hz", "Hz", ISOLATING)]
PASCALS = (("MPa", 1e6), ("GPa", 1e9))
STIFF = Plausible(
    1.3e12, "stiffer than diamond", PASCALS[::-1], 1e7, "softer than rubber", serious=True
)
STRONG = Plausible(2e11, "stronger than any material", PASCALS, 1e5, "weaker than any wire")
Modulus = Annotated[float, doc("", "Pa", STIFF, ge=1.0, le=1e15)]
Strength = Annotated[float, doc("", "Pa", STRONG, ge=1.0, le=1e13)]
Pressure = Annotated[float, doc("", "Pa", ge=0, le=1e3)]
Rigidity = Annotated[float, doc("", "N m/rad", gt=0, le=1e15)]
RigidityOrZero = Annotated[float, doc("", "N m/rad", ge=0, le=1e15)]
Quality = Annotated[float, doc("", "1", gt=0, le=1e12)]
Conductivity = Annotated[float, doc("", "S/m", ge=1e4, le=1e12)]
"""Of metals."""
Corner = Annotated[float, doc("", "Hz", gt=0, le=1e6)]
Saturation = Annotated[float, doc("", "1", gt=-0.5, lt=0.5)]
MassCoupling = Annotated[float, doc("", "kg", ge=-1e6, le=1e6)]
Number = Annotated[float, Meta(ge=-1e20, le=1e20)]
Positive = Annotated[float, Meta(gt=0, le=1e20)]
Dof = Literal["x", "y", "z", "roll", "pitch", "yaw"]
NamedDof = Literal["x", "y", "z", "roll", "pitch", "yaw", "longitudinal", "transverse", "vertical"]
Kelvin = Annotated[float, doc("temperature in K", "K", gt=0, le=1e4)]
Expansion = Annotated[
    float,
    doc(
        "linear thermal expansion in 1/K",
        "1/K",
        Plausible(1e-3, "more than twice that of any solid", (("1e-6 1/K", 1e-6),)),
        ge=-1e-2,
        le=1e-2,
    ),
]
ModulusSlope = Annotated[
    float,
    doc(
        "(1/E) dE/dT of Young's modulus E in 1/K; default 0",
        "1/K",
        ge=-1.0,
        le=1.0,
    ),
]
PoissonRatio = Annotated[
    float, doc("Poisson's ratio, for twisting; default 0.3", "1", gt=-1, lt=0.5)
]
SpecificHeat = Annotated[float, doc("specific heat in J/(kg K)", "J/(kg K)", ge=1e-6, le=1e6)]
ThermalConductivity = Annotated[
    float, doc("thermal conductivity in W/(m K)", "W/(m K)", ge=1e-6, le=1e6)
]
PER_SECOND = (("cm/s^2", 1e-2), ("mm/s^2", 1e-3))
GRAVITY = Plausible(30.0, "more than on Jupiter", PER_SECOND, 1.0, "less than on the Moon")
Acceleration = Annotated[float, doc("acceleration in m/s^2", "m/s^2", GRAVITY, gt=0, le=1e3)]
Pull = Annotated[float, doc("component of gravity in m/s^2", "m/s^2", ge=-1e3, le=1e3)]
GravityVector = Annotated[list[Pull], doc("gravity along x, y and z in m/s^2", count=3)]
GravityGradient = Annotated[
    float,
    doc(
        "gradient of gravity in 1/s^2",
        "1/s^2",
        Plausible(1e-3, "300 times that of Earth", (("eotvos", 1e-9),)),
        ge=-1.0,
        le=1.0,
    ),
]
GravityGradients = Annotated[
    list[Annotated[list[GravityGradient], doc(count=3)]],
    doc(count=3),
]
PositiveLossAngle = Annotated[float, doc("loss angle in rad, above zero", "rad", gt=0, lt=1)]
LossAngle = Annotated[float, doc("loss angle in rad", "rad", ge=0, lt=1)]
Factor = Annotated[float, doc("factor on the nominal value", "1", ge=1e-6, le=1e6)]

Component = Annotated[float, doc("component of a direction", "1", ge=-1e5, le=1e5)]
Vector = Annotated[tuple[Position, Position, Position], doc("x, y, z in m")]
Direction = Annotated[
    tuple[Component, Component, Component],
    doc("direction x, y, z from the upper towards the lower end, of any length above zero"),
]
Row3 = Annotated[list[Inertia], doc(count=3)]
Row6 = Annotated[list[Coefficient], doc(count=6)]
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
    doc("force x, y, z in N and torque roll, pitch, yaw in N m", count=6),
]

Hold = Annotated[
    Literal["loaded-length", "natural-length"],
    doc(
        '"loaded-length": the wire is trimmed to its nominal tension in the nominal pose;'
        ' "natural-length": its unstretched length stays'
    ),
]
MaterialName = Annotated[
    Name,
    doc("name of a material, built in or of [materials]", names="material"),
]
WireName = Annotated[
    str,
    doc(
        "stage and number of a wire: test.1",
        pattern=r"^[A-Za-z][A-Za-z0-9_-]*\.[1-9][0-9]*$",
    ),
]
