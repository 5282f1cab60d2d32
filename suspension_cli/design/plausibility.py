"""Implausible numbers of a design: millimetres written as metres, grams as kilograms, GPa as Pa.

Such a design is valid, so these are warnings, not faults. Limits are wide: a unit that is wrong by
a factor of a thousand exceeds them, an unusual design does not. Ranges of single numbers stand
beside their keys (`units.Plausible`); here are those that depend on several numbers.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from suspension_cli.design import faults, foton
from suspension_cli.design.bodies import Body, body_mass, half_sides, second_moments, volume
from suspension_cli.design.derive import set_geometry, with_bodies_above
from suspension_cli.design.imperfections import Distribution
from suspension_cli.design.schema import Design, Stage
from suspension_cli.design.tables import Plausible, declared, keys_with
from suspension_cli.design.units import OSMIUM
from suspension_cli.errors import Fault, format_value

AIR = 1.2
"""kg/m^3; a lighter body would float."""
USUAL = 3000.0
"""kg/m^3; typical of masses of silica and steel with gaps."""
OF_SHAPE = {"g for the mass": 1e-3, "mm for the sizes": 1e9}
OF_INERTIA = {"g for the mass": 1e-3**2.5} | {
    f"{name} for the inertia": size**-1.5
    for name, size in (("g m^2", 1e-3), ("kg cm^2", 1e-4), ("kg mm^2", 1e-6), ("g mm^2", 1e-9))
}
"""Factor on the density of a body, given by its shape or its inertia, if another unit was meant."""
BEYOND = 0.5
"""Largest distance of a wire's end from a body (on posts, ears), in its largest half sides."""
INFERRED = 3.0
"""Factor on the half sides of the homogeneous box of its inertia, for a body of unknown shape."""
SERIOUS = 5.0
"""Factor on these bounds beyond which a number is an error."""


@dataclass(frozen=True)
class ImplausibleNumber(Fault):
    """An implausible number."""

    serious: bool = False
    """Whether results are then meaningless, so that analyses warn too."""

    @classmethod
    def of(cls, fault: Fault, serious: bool = False) -> ImplausibleNumber:
        """Make a fault a warning."""
        return cls(fault.key, fault.problem, fault.remedy, fault.value, serious)


def find_implausible(design: Design) -> list[ImplausibleNumber]:
    """Find implausible numbers of a design, from its tables alone."""
    found: list[Row] = [*_check_ranges(design), *_check_planes(design)]
    bodies = {stage.name: stage.body for stage in design.stage}
    for stage, above in with_bodies_above(design):
        own = [*_check_density(stage.body), *_check_attachments(stage, bodies.get(above))]
        found += [(f"stage.{stage.name}.{row[0]}", *row[1:]) for row in own]
    return [ImplausibleNumber(*row) for row in found]


Row = tuple[str, str, str, str, bool]
"""Key, problem, remedy, value as written, and whether it is serious."""


def _check_ranges(design: Design) -> Iterator[Row]:
    """Report numbers, lists with numbers and distributions outside their plausible ranges."""
    for path, table in faults.tables(design):
        for key, plausible in keys_with(type(table), "plausible"):
            value, unit = getattr(table, key), declared(type(table))[key].get("unit", "")
            if isinstance(value, Distribution):
                value = value.normal or value.uniform
            size = max(_sizes(value), default=plausible.high)
            if problem := plausible.problem(size, unit):
                remedy, shown = plausible.remedy(size, unit), format_value(value)
                yield f"{path}.{key}", problem, remedy, shown, plausible.serious


def _check_planes(design: Design) -> Iterator[Row]:
    """Report filters with poles or zeros in rad/s because their strings name no plane."""
    for loop in design.control.loop if design.control is not None else ():
        for key in ("filter", "sensor_response"):
            given = getattr(loop, key) or ""
            text = given if isinstance(given, str) else given.design or ""
            if factors := foton.find_without_plane(text):
                problem = (
                    f"{' and '.join(factors)} without a plane: in rad/s by Foton's rule, not in Hz,"
                    " with another gain at 0 Hz than 1"
                )
                bare = factors[0][:-1]
                remedy = (
                    f'write {bare}, "n") for Hz and a gain of 1, or {bare}, "s") if this is meant'
                )
                yield f"control.loop.{loop.name}.{key}", problem, remedy, format_value(text), True


def _sizes(value: Any) -> list[float]:
    """Magnitudes of a number, or of those of a list."""
    if isinstance(value, (list, tuple)):
        return [size for item in value for size in _sizes(item)]
    return [abs(value)] if isinstance(value, (int, float)) else []


def _check_density(body: Body) -> Iterator[Row]:
    """Report a body denser than osmium or less dense than air.

    Its density follows from its mass and shape. Of a body that gives moments of inertia, it is that
    of the homogeneous ellipsoid, whose half axes have the squares 5 S_i / m with the second moments
    S_i of the mass m: the most compact body of these moments, so a lower bound.
    """
    mass, moments = body_mass(body), second_moments(body)
    if min(moments) < -1e-6 * max(moments):
        problem = "one moment exceeds the sum of the other two, impossible for a rigid body"
        remedy, shown = "check the three moments, in kg m^2", format_value(body.inertia)
        yield "body.inertia", problem, remedy, shown, True
        return
    if body.density is not None or min(moments) <= 1e-6 * max(moments):
        return  # a density that is given has its own range; a plate or rod has no volume
    axes = math.prod(5 * moment / mass for moment in moments)
    density = mass / (4 * math.pi / 3 * math.sqrt(axes) if body.shape is None else volume(body))
    if AIR <= density <= OSMIUM:
        return
    key, units = ("inertia", OF_INERTIA) if body.shape is None else ("mass", OF_SHAPE)
    limit = f"denser than osmium ({OSMIUM:g})" if density > AIR else f"lighter than air ({AIR:g})"
    meant = min(units, key=lambda name: abs(math.log(units[name] * density / USUAL)))
    good = 100 <= units[meant] * density <= OSMIUM
    remedy = f"did you mean {meant}?" if good else "check mass (kg), sizes (m), inertia (kg m^2)"
    problem = f"a body of {mass:g} kg of this size has {density:.3g} kg/m^3, {limit}"
    serious = body.shape is not None or not AIR / SERIOUS <= density <= OSMIUM
    yield f"body.{key}", problem, remedy, format_value(getattr(body, key)), serious


Point = tuple[float, float, float]


def _check_attachments(stage: Stage, above: Body | None) -> Iterator[Row]:
    """Report ends of wires and springs far outside their bodies."""
    if stage.wires is not None:
        shape = set_geometry(stage.wires)
        ring = "ring" if shape.is_ring else "s"
        both = getattr(stage.wires, ring) is not None
        lower, upper = (ring if both else f"{ring}_{end}" for end in ("lower", "upper"))
        point = (max(shape.s_lower, shape.ring_lower), shape.t2, shape.d)
        keys = [f"wires.{key}" for key in (lower, "t2", "d")]
        yield from _check_point(stage.body, point, keys, "lower ends of wires lie")
        point = (max(shape.s_upper, shape.ring_upper), shape.t1, shape.d_upper)
        keys = [f"wires.{key}" for key in (upper, "t1", "d_upper")]
        yield from _check_point(above, point, keys, "upper ends of wires lie")
    for n, wire in enumerate(stage.wire, 1):
        lower, upper = ([f"wire.{n}.{end}"] * 3 for end in ("lower", "upper"))
        yield from _check_point(stage.body, wire.lower, lower, "the lower end lies")
        yield from _check_point(above, wire.upper, upper, "the upper end lies")
    for n, spring in enumerate(stage.spring, 1):
        keys = [f"spring.{n}.at"] * 3
        yield from _check_point(stage.body, spring.at, keys, "the point of the spring lies")


def _check_point(body: Body | None, point: Point, keys: list[str], what: str) -> Iterator[Row]:
    """Report the coordinate of a point of a body that lies furthest outside it."""
    if body is None:
        return
    halves = half_sides(body)
    inferred = 1.0 if body.shape is not None else INFERRED
    limits = [inferred * half + BEYOND * max(halves) for half in halves]
    far = [abs(value) / limit for value, limit in zip(point, limits, strict=True)]
    n = far.index(max(far))
    if far[n] > 1:
        about = "" if body.shape is not None else "about "
        problem = (
            f"{what} {abs(point[n]):.3g} m from the COM, far outside the body (whose half along"
            f" {'xyz'[n]} is {about}{halves[n]:.2g} m)"
        )
        remedy = Plausible(limits[n], "").remedy(abs(point[n]), "m, as the body's size")
        yield keys[n], problem, remedy, format_value(point[n]), far[n] > SERIOUS
