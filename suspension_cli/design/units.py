"""Types of the values of a design file: names, lengths, masses, ... with units and bounds."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import (
    Annotated,
    Any,
    ClassVar,
    Literal,
    NamedTuple,
    Optional,
    Union,
    dataclass_transform,
    get_args,
    get_type_hints,
)

import msgspec
from msgspec import Meta, Struct

Raw = dict[str, Any]
"""Tables of a TOML file as they are read, before they are checked."""
Schema = dict[str, Any]
"""A JSON Schema, or a part of one."""
Problems = Iterator[tuple[str, str, str]]
"""Key, problem and remedy of what is wrong with a table ("" for the whole table)."""


MILLIMETRES = (("mm", 1e-3), ("um", 1e-6))


@dataclass(frozen=True)
class Plausible:
    """Range of the magnitude of plausible numbers; others are valid, but rarely meant.

    Attributes
    ----------
    high, above
        Largest plausible number, and what a larger one is: "longer than any suspension".
    units
        Other units (name, size in SI) that may have been meant.
    low, below
        Smallest plausible number, and what a smaller one is.
    serious
        Whether results are meaningless beyond the range, so that analyses warn too.
    """

    high: float
    above: str
    units: tuple[tuple[str, float], ...] = MILLIMETRES
    low: float = 0.0
    below: str = ""
    serious: bool = False

    def problem(self, size: float, unit: str) -> str:
        """Describe what is wrong with the size of a number; "" for a plausible one."""
        if self.low <= size <= self.high:
            return ""
        word, limit = (self.above, self.high) if size > self.high else (self.below, self.low)
        return f"is {word} ({f'{limit:g} {unit}'.rstrip()})"

    def remedy(self, size: float, unit: str) -> str:
        """Suggest the first unit in which the number is plausible: "did you mean mm?"."""
        good = (name for name, one in self.units if self.low <= size * one <= self.high)
        give = f"give it in {unit}" if unit else "check its unit"
        return next((f"did you mean {name}?" for name in good), give)


def doc(description: str, **bounds: Any) -> Meta:
    """Describe a value, and bound it."""
    return Meta(description=description or None, **bounds)


def of_unit(
    name: str, description: str, plausible: Plausible | None = None, names: str = "", **bounds: Any
) -> Meta:
    """Describe a number in an SI unit, or a name of a part; `unit` reads it back from the type."""
    facts = {"unit": name, "plausible": plausible, "names": names}
    return doc(description, extra={name: fact for name, fact in facts.items() if fact}, **bounds)


def unit(kind: object) -> str:
    """Read the SI unit of a type of this file; "" if it has none.

    >>> unit(Length), unit(Factor), unit(Name)
    ('m', '1', '')
    """
    found = [extra.extra for extra in getattr(kind, "__metadata__", ()) if isinstance(extra, Meta)]
    return next((extra["unit"] for extra in found if extra and "unit" in extra), "")


class _Key(NamedTuple):
    default: Any
    meta: Meta


_REQUIRED: Any = object()


def key(description: str = "", default: Any = _REQUIRED, *, unit: str = "", **bounds: Any) -> Any:
    """Declare a key of a table beside its type: description, unit, `plausible` range and bounds.

    `names` is the kind of part that it names: ``stage``, ``wire``, ... of `checks.check_names`.

    A key without a default is required, but for one whose type allows None.
    """
    return _Key(default, of_unit(unit, description, **bounds))


@dataclass_transform(kw_only_default=True, frozen_default=True, field_specifiers=(msgspec.field,))
class _Declared(msgspec.StructMeta):
    """Turns each `key` of a table into its default, and its description into a part of the type."""

    def __new__(
        cls, name: str, bases: tuple[type, ...], namespace: Raw, **options: Any
    ) -> _Declared:
        described: dict[str, Meta] = {}
        for field, hint in namespace.get("__annotations__", {}).items():
            if isinstance(namespace.get(field), _Key):
                default, described[field] = namespace.pop(field)
                if default is _REQUIRED and str(hint).endswith("| None"):
                    default = None
                if isinstance(default, list) and default:
                    default = msgspec.field(default_factory=default.copy)
                if default is not _REQUIRED:
                    namespace[field] = default
        made = super().__new__(cls, name, bases, namespace, kw_only=True, **options)
        if described:
            hints = get_type_hints(made, include_extras=True)
            for field, meta in described.items():
                members = [one for one in get_args(hints[field]) if one is not type(None)]
                optional = type(None) in get_args(hints[field])
                kind = Union[tuple(members)] if optional else hints[field]  # noqa: UP007
                kind = Annotated[kind, meta]
                made.__annotations__[field] = Optional[kind] if optional else kind  # noqa: UP045
        return made


class Table(
    Struct, metaclass=_Declared, frozen=True, forbid_unknown_fields=True, omit_defaults=True
):
    """Base of all tables of a file: immutable, and unknown keys are faults."""

    rules: ClassVar[Sequence[Callable[[Any], Problems]]] = ()
    """Rules beyond single values, of `design.rules`; those of the base count too."""

    def faults(self) -> Problems:
        """Find what breaks the rules; a table with rules of its own kind extends this."""
        for kind in reversed(type(self).__mro__):
            for rule in vars(kind).get("rules", ()):
                yield from rule(self)


def extend_table(base: type[Table], keys: Mapping[str, object]) -> Any:
    """Derive a table from another, with more keys: their types by name, not required with None."""
    optional = {name: None for name, kind in keys.items() if type(None) in get_args(kind)}
    namespace = {"__module__": base.__module__, "__annotations__": dict(keys), **optional}
    return _Declared(f"_{base.__name__}", (base,), namespace, frozen=True)


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
    float, of_unit("kg m^2", "moment or product of inertia in kg m^2", ge=-1e15, le=1e15)
]
BodySize = Annotated[
    Length,
    of_unit("m", "length in m", Plausible(10.0, "larger than any suspended body", serious=True)),
]
WireSize = Annotated[
    Length, of_unit("m", "length in m", Plausible(0.02, "thicker than any wire", serious=True))
]
OSMIUM = 22_600.0
"""Density in kg/m^3 (CRC Handbook of Chemistry and Physics); nothing is denser."""
GRAMS = (("g/cm^3", 1e3), ("g/m^3", 1e-3))
DENSITY = Plausible(OSMIUM, "denser than osmium", GRAMS, 25.0, "less dense than foam", serious=True)
Density = Annotated[float, of_unit("kg/m^3", "density in kg/m^3", DENSITY, ge=1e-3, le=1e6)]
Stiffness = Annotated[float, of_unit("N/m", "stiffness in N/m", ge=1e-12, le=1e20)]
Torsion = Annotated[float, of_unit("N m/rad", "torsional stiffness in N m/rad", ge=1e-18, le=1e15)]
Coefficient = Annotated[
    float, doc("element of a stiffness or damping matrix, SI", ge=-1e20, le=1e20)
]
Load = Annotated[float, doc("force in N or torque in N m", ge=-1e12, le=1e12)]
Tension = Annotated[float, of_unit("N", "tension in N", ge=1e-12, le=1e12)]
Frequency = Annotated[float, of_unit("Hz", "frequency in Hz", ge=1e-6, le=1e6)]
ISOLATING = Plausible(100.0, "too high to isolate from anything", (("mHz", 1e-3),))
"""Frequencies of parts that isolate, a few Hz."""
PART_SIZE = Plausible(10.0, "larger than any part of a suspension")
Kelvin = Annotated[float, of_unit("K", "temperature in K", gt=0, le=1e4)]
Expansion = Annotated[
    float,
    of_unit(
        "1/K",
        "coefficient of linear thermal expansion in 1/K",
        Plausible(1e-3, "more than twice that of any solid", (("1e-6 1/K", 1e-6),)),
        ge=-1e-2,
        le=1e-2,
    ),
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
PER_SECOND = (("cm/s^2", 1e-2), ("mm/s^2", 1e-3))
GRAVITY = Plausible(30.0, "more than on Jupiter", PER_SECOND, 1.0, "less than on the Moon")
Acceleration = Annotated[float, of_unit("m/s^2", "acceleration in m/s^2", GRAVITY, gt=0, le=1e3)]
Pull = Annotated[float, of_unit("m/s^2", "component of gravity in m/s^2", ge=-1e3, le=1e3)]
GravityVector = Annotated[
    list[Pull], doc("gravity along x, y and z in m/s^2", min_length=3, max_length=3)
]
GravityGradient = Annotated[
    float,
    of_unit(
        "1/s^2",
        "gradient of gravity in 1/s^2",
        Plausible(1e-3, "300 times that of Earth", (("eotvos", 1e-9),)),
        ge=-1.0,
        le=1.0,
    ),
]
GravityRow = Annotated[list[GravityGradient], Meta(min_length=3, max_length=3)]
PositiveLossAngle = Annotated[float, of_unit("rad", "loss angle in rad, above zero", gt=0, lt=1)]
LossAngle = Annotated[float, of_unit("rad", "loss angle in rad", ge=0, lt=1)]
Factor = Annotated[float, of_unit("1", "factor on the nominal value", ge=1e-6, le=1e6)]

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
MaterialName = Annotated[
    Name,
    doc(f"name of a material, built in or of [materials]: {NAMES}", extra={"names": "material"}),
]
WireName = Annotated[
    str,
    doc(
        "a stage's name and a wire's number: test.1",
        pattern=r"^[A-Za-z][A-Za-z0-9_-]*\.[1-9][0-9]*$",
    ),
]
