"""Imperfections of builds: the table from which files, random builds and sweeps take them.

To add one of a wire or body, add a row to `IMPERFECTIONS` and, in `scene.applied_imperfections`,
the function (for a wire, the argument) of its name.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Optional

from msgspec import Meta

from suspension_cli.design import key_rules, units
from suspension_cli.design.typed_tables import (
    Plausible,
    Problems,
    Table,
    doc,
    extend_table,
    facts,
    given,
    key,
)

AXES = ("x", "y", "z")
Part = Literal["wire", "body", "blade", "leg", "link"]
PARTS: tuple[Part, ...] = ("wire", "body", "blade", "leg", "link")
"""Parts of a build that have imperfections; blades are those of wires and of filters."""


LARGE_SHIFT = Plausible(0.02, "larger than in any real build")
LARGE_TURN = Plausible(
    0.1, "larger than in any real build", (("degrees", math.pi / 180), ("mrad", 1e-3))
)
LARGE_FRACTION = Plausible(0.5, "a larger fraction than in any real build", (("%", 1e-2),))
"""Also of tolerances."""
Shift = Annotated[units.Position, doc("signed length in m", "m", LARGE_SHIFT)]
Turn = Annotated[units.Angle, doc("angle in rad", "rad", LARGE_TURN)]


@dataclass(frozen=True)
class Imperfection:
    """A quantity in which one part of a build differs from the design."""

    name: str  # key of `[[perturbation]]`, and name in `scene.applied_imperfections`
    part: Part
    kind: object  # type of a number, with its unit and bounds: `Factor` for a relative error
    quantity: str  # that the factor multiplies, or that the number gives
    spread: str = ""  # key of `[[tolerance.wire]]` and so on; "" if it does not scatter
    sweep: str = ""  # short name for `pendsus xcouple`; "" if none
    vector: bool = False  # whether there are three numbers, for x, y and z
    perturbation: bool = True  # whether `[[perturbation]]` takes it

    def __reduce__(self) -> tuple[Callable[..., object], tuple[str, str]]:
        """Pickle by name, as types with bounds cannot be pickled."""
        return named, (self.part, self.name)

    @property
    def unit(self) -> str:
        """SI unit; ``1`` for a factor."""
        return facts(self.kind)["unit"]

    @property
    def plausible(self) -> Plausible:
        """Range of plausible deviations."""
        return {"1": LARGE_FRACTION, "m": LARGE_SHIFT, "rad": LARGE_TURN}[self.unit]

    @property
    def relative(self) -> bool:
        """Whether it is a factor on a quantity."""
        return self.unit == "1"

    @property
    def neutral(self) -> float:
        """Value that changes nothing: 1 for a factor, else 0."""
        return 1.0 if self.relative else 0.0

    def help(self, axes: str) -> str:
        """Describe its value, for the `axes` that are given."""
        if self.relative:
            return f"factor on {self.quantity}"
        along = " about " if self.unit == "rad" else " along "
        return f"{self.quantity}{(along + axes) * self.vector}, {self.unit}"


def _of(part: Part, *rows: tuple[Any, ...]) -> tuple[Imperfection, ...]:
    return tuple(Imperfection(name, part, *others) for name, *others in rows)


INERTIA = "the body's moments of inertia"
RADIUS = "the wire's radius (the spring constant goes with its square)"
COM = "offset of the body's COM relative to the attachments"
LENGTH = "change of the wire's unstretched length, after trimming"
TURNED = "rotation vector of the mass relative to the attachments"
IMPERFECTIONS = (
    *_of(
        "wire",
        ("k_factor", units.Factor, "the wire's spring constant", "k", "k"),
        ("radius_factor", units.Factor, RADIUS, "radius", "", False, False),
        ("length_change", Shift, LENGTH, "length", "length"),
        ("upper_offset", Shift, "offset of the wire's upper end", "upper", "offset", True),
        ("lower_offset", Shift, "offset of the wire's lower end", "lower", "lower_offset", True),
    ),
    *_of(
        "body",
        ("mass_factor", units.Factor, "the body's mass", "mass", "mass", False, False),
        ("inertia_factor", units.Factor, INERTIA, "inertia", "inertia", True, False),
        ("com_offset", Shift, COM, "com", "com", True),
        ("rotation", Turn, TURNED, "", "", True),
    ),
    *_of("blade", ("stiffness_factor", units.Factor, "the blade's stiffness", "stiffness")),
    *_of(
        "leg",
        ("stiffness_factor", units.Factor, "the stiffness of the leg's flexures", "stiffness"),
        ("length_change", Shift, "change of the leg's unloaded length", "length"),
    ),
    *_of("link", ("stiffness_factor", units.Factor, "the link's stiffness", "stiffness")),
)
SHARED = {
    "length_change": "change of the unstretched length of a wire (after trimming) or leg, m",
    "stiffness_factor": "factor on the stiffness of blades, flexures of a leg, or a link",
}
"""Descriptions of the keys of `[[perturbation]]` that several parts have."""


def named(part: str, name: str) -> Imperfection:
    """Find an imperfection by its part and name."""
    return next(item for item in IMPERFECTIONS if (item.part, item.name) == (part, name))


def swept() -> dict[str, tuple[Imperfection, int | None]]:
    """Map the short names of sweeps to imperfections and axes.

    The axis is 0, 1 or 2 for x, y or z (``offset``, ``offset_y``, ``offset_z``), and None for one
    number, also for one factor on all axes.
    """
    found: dict[str, tuple[Imperfection, int | None]] = {}
    for item in [item for item in IMPERFECTIONS if item.sweep]:
        each = item.vector and not item.relative
        axes = enumerate(("", "_y", "_z")) if each else [(None, "")]
        found |= {item.sweep + suffix: (item, axis) for axis, suffix in axes}
    return found


def perturbed(part: str) -> tuple[Imperfection, ...]:
    """List the imperfections that `[[perturbation]]` takes for a part."""
    return tuple(item for item in IMPERFECTIONS if item.perturbation and item.part == part)


def perturbed_part(item: Table) -> tuple[str, str]:
    """Part of a `[[perturbation]]`: its kind and its name."""
    return next((part, getattr(item, part)) for part in PARTS if getattr(item, part) is not None)


def scattered(part: str) -> tuple[Imperfection, ...]:
    """List the imperfections that `[tolerance]` takes for a part."""
    return tuple(item for item in IMPERFECTIONS if item.spread and item.part == part)


def _with_perturbations(base: type[Table]) -> type:
    """Derive a table of the file from `base`, with a key per imperfection of any part."""
    keys: dict[str, Any] = {}
    for item in (item for part in PARTS for item in perturbed(part)):
        kind: Any = tuple[item.kind, item.kind, item.kind] if item.vector else item.kind
        text = SHARED[item.name] if item.name in keys else item.help("x, y, z")
        described: Any = Annotated[kind, doc(text)]
        keys[item.name] = described | None
    return extend_table(base, keys)


class _Imperfect(Table, frozen=True):
    wire: units.WireName | None = key("stage and number of a wire: test.1", names="wire")
    body: units.Name | None = key("a stage's name, instead of a wire", names="stage")
    blade: str | None = key(
        "a blade, test.blade1; a filter's: its stage", max_length=80, names="blade"
    )
    leg: str | None = key("a leg: ip.leg1", max_length=80, names="leg")
    link: str | None = key("the name of a link", max_length=80, names="link")


class Perturbation(_with_perturbations(_Imperfect)):
    """Imperfections of one wire, body, blade, leg or link in this build."""

    hold: units.Hold = "loaded-length"

    rules = (key_rules.exactly_one(*PARTS),)

    def check(self) -> Problems:
        """Check that the part can change in this way."""
        part, _ = perturbed_part(self)
        known = [row.name for row in perturbed(part)]
        every = dict.fromkeys(row.name for one in PARTS for row in perturbed(one))
        for name in given(self, *every):
            if name not in known:
                yield name, f"is not for a {part}", f"known here: {', '.join(known)}"
        if not given(self, *known):
            yield "", "changes nothing", f"give {' or '.join(known)}"


Spread = Annotated[float, Meta(ge=0, le=1e3)]


class Distribution(Table, frozen=True):
    """Scatter of builds about the nominal value, independent from build to build."""

    normal: Spread | None = key("standard deviation")
    uniform: Spread | None = key("half width")
    truncate: float | None = key("largest deviation of a normal distribution", gt=0, le=1e3)

    rules = (key_rules.exactly_one("normal", "uniform"), key_rules.needs("truncate", "normal"))


def _with_spreads(base: type[Table], part: str) -> type:
    """Derive a table of the file from `base`, with a distribution per imperfection of a part."""
    keys: dict[str, Any] = {}
    rows = scattered(part)
    if part in ("body", "blade", "leg"):
        whole = "stage" if part == "body" else f"stage with {part}s"
        keys["stage"] = Annotated[units.Name, doc("a stage's name", names=whole)]
    for item in rows:
        each = " (each axis)" * item.vector
        text = f"relative error of {item.quantity}" if item.relative else item.help("x, y and z")
        unit = item.unit.removeprefix("1")
        kind: Any = Annotated[Distribution, doc(text + each, unit, item.plausible)]
        # a table without its only quantity would say nothing
        keys[item.spread] = kind if len(rows) == 1 else Optional[kind]  # noqa: UP045
    return extend_table(base, keys)


class _WireScatter(Table, frozen=True):
    stage: units.Name | None = key("a stage, for each of its wires", names="stage with wires")
    wire: units.WireName | None = key("one wire: test.1", names="wire")


class WireTolerance(_with_spreads(_WireScatter, "wire")):
    """Scatter of one wire, or independently of every wire of a stage."""

    hold: units.Hold = "loaded-length"

    rules = (
        key_rules.exactly_one("stage", "wire"),
        key_rules.any_of(*(row.spread for row in scattered("wire"))),
    )


class BodyTolerance(_with_spreads(Table, "body")):
    """Scatter of one body."""

    rules = (key_rules.any_of(*(row.spread for row in scattered("body"))),)


class BladeTolerance(_with_spreads(Table, "blade")):
    """Scatter of every blade of a stage, independently; those of a filter as one spring."""


class LegTolerance(_with_spreads(Table, "leg")):
    """Scatter of every leg of an inverted pendulum, independently."""


class _LinkScatter(Table, frozen=True):
    link: str = key("the name of a link", max_length=80, names="link")


class LinkTolerance(_with_spreads(_LinkScatter, "link")):
    """Scatter of one link."""


Limit = Annotated[float, doc("limit above zero, SI", gt=0, le=1e20)]


class Requirement(Table, frozen=True):
    """Requirement on every build, in SI units (Hz for modes)."""

    quantity: str = key(
        "name of a quantity, such as 'test static pitch'",
        max_length=200,
    )
    band: list[units.Number] | None = key("least and largest value", count=2)
    below: Limit | None = key("upper limit of the magnitude")
    above: Limit | None = key("lower limit of the magnitude")

    rules = (key_rules.exactly_one("band", "below", "above"), key_rules.ascending("band"))


class Tolerance(Table, frozen=True):
    """Scatter of parts from build to build, and requirements on builds."""

    wire: list[WireTolerance] = []
    body: list[BodyTolerance] = []
    blade: list[BladeTolerance] = []
    leg: list[LegTolerance] = []
    link: list[LinkTolerance] = []
    require: list[Requirement] = []

    rules = (key_rules.any_of(*PARTS),)
