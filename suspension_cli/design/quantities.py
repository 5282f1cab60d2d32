"""The kinds of values that a design file holds: names, lengths, masses, ... with their units and bounds."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta, Struct


class Table(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, omit_defaults=True):
    """A table of the file: unknown keys are faults, values never change."""


NAMES = "letters, digits, _ and -, starting with a letter"

Name = Annotated[str, Meta(pattern=r"^[A-Za-z][A-Za-z0-9_-]*$", max_length=60, description=f"a name: {NAMES}")]
Stem = Annotated[
    str, Meta(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$", max_length=100, description="letters, digits, . _ and - (it is also the stem of the files written)")
]
Length = Annotated[float, Meta(ge=1e-9, le=1e5, description="length in m")]
Separation = Annotated[float, Meta(ge=0, le=1e5, description="length in m, zero allowed")]
Position = Annotated[float, Meta(ge=-1e5, le=1e5, description="signed length in m")]
Angle = Annotated[float, Meta(ge=-3.2, le=3.2, description="angle in rad")]
Mass = Annotated[float, Meta(ge=1e-9, le=1e9, description="mass in kg")]
Inertia = Annotated[float, Meta(ge=-1e15, le=1e15, description="moment or product of inertia in kg m^2")]
Strength = Annotated[float, Meta(ge=1.0, le=1e13, description="stress in Pa at which the material breaks (or, of blades, yields)")]
Density = Annotated[float, Meta(ge=1e-3, le=1e6, description="density in kg/m^3")]
Modulus = Annotated[float, Meta(ge=1.0, le=1e15, description="Young's modulus in Pa")]
Poisson = Annotated[float, Meta(gt=-1, lt=0.5, description="Poisson's ratio, for the twisting of wires; 0.3 if not given")]
Stiffness = Annotated[float, Meta(ge=1e-12, le=1e20, description="stiffness in N/m")]
Torsion = Annotated[float, Meta(ge=1e-18, le=1e15, description="torsional stiffness in N m/rad")]
Coefficient = Annotated[float, Meta(ge=-1e20, le=1e20, description="element of a stiffness or damping matrix, SI")]
Load = Annotated[float, Meta(ge=-1e12, le=1e12, description="force in N or torque in N m")]
Tension = Annotated[float, Meta(ge=1e-12, le=1e12, description="tension in N")]
Frequency = Annotated[float, Meta(ge=1e-6, le=1e6, description="frequency in Hz")]
Kelvin = Annotated[float, Meta(gt=0, le=1e4, description="temperature in K")]
Expansion = Annotated[float, Meta(ge=-1e-2, le=1e-2, description="coefficient of linear thermal expansion in 1/K")]
ModulusSlope = Annotated[float, Meta(ge=-1.0, le=1.0, description="relative change of Young's modulus with temperature, (1/E) dE/dT in 1/K; 0 if not given")]
SpecificHeat = Annotated[float, Meta(ge=1e-6, le=1e6, description="specific heat in J/(kg K)")]
Conductivity = Annotated[float, Meta(ge=1e-6, le=1e6, description="thermal conductivity in W/(m K)")]
Pressure = Annotated[float, Meta(ge=0, le=1e3, description="pressure in Pa, of a gas so thin that its molecules do not meet")]
MolarMass = Annotated[float, Meta(ge=1e-3, le=1.0, description="molar mass in kg/mol; 0.028 is nitrogen")]
LossAngle = Annotated[float, Meta(ge=0, lt=1, description="loss angle in rad")]
Factor = Annotated[float, Meta(ge=1e-6, le=1e6, description="factor on the nominal value")]
ShapeFactor = Annotated[float, Meta(ge=0.5, le=10, description="shape factor of a cantilever blade: 1 rectangular, 1.5 triangular")]

Component = Annotated[float, Meta(ge=-1e5, le=1e5, description="component of a direction")]
Vector = Annotated[tuple[Position, Position, Position], Meta(description="x, y, z in m")]
Direction = Annotated[
    tuple[Component, Component, Component], Meta(description="direction x, y, z from the upper towards the lower end, of any length above zero")
]
Rotation = Annotated[tuple[Angle, Angle, Angle], Meta(description="rotation vector about x, y, z in rad")]
Row3 = Annotated[list[Inertia], Meta(min_length=3, max_length=3)]
Row6 = Annotated[list[Coefficient], Meta(min_length=6, max_length=6)]
Matrix6 = Annotated[
    list[Coefficient | Row6],
    Meta(min_length=6, max_length=6, description="six diagonal elements (x, y, z, roll, pitch, yaw) or a full 6x6"),
]
Wrench = Annotated[list[Load], Meta(min_length=6, max_length=6, description="force x, y, z in N and torque roll, pitch, yaw in N m")]

Hold = Annotated[
    Literal["loaded-length", "natural-length"],
    Meta(description='"loaded-length": the wire is trimmed to its nominal tension in the nominal pose; "natural-length": its unstretched length stays'),
]
MaterialName = Annotated[Name, Meta(description=f"name of a material, built in or of [materials]: {NAMES}")]
StageName = Annotated[Name, Meta(description=f"a stage's name: {NAMES}")]
