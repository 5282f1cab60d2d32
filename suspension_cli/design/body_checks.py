"""Checks of `body` tables: mass and inertia, or a shape, that a rigid body can have."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from suspension_cli.design.derive import body_inertia, body_mass
from suspension_cli.design.faults import fault_of
from suspension_cli.design.schema import Body
from suspension_cli.errors import Fault, format_value

LEAST_INERTIA = 1e-30
"""Smallest moment of inertia, kg m^2: that of a microgram of less than a nanometre."""
THINNEST = 1e-12
"""Smallest ratio of two moments of inertia: that of a rod a millionth as thick as long."""
LEAST_MASS, MOST_MASS = 1e-9, 1e9
"""Bounds on a mass that follows from a density, kg: those of a given mass."""


TOO_LIGHT = "is too small for its motion to be computed"
"""Message for a mass or moment of inertia that is too small but not 0."""


def check_exactly_one(path: str, given: dict[str, Any], what: str) -> Iterator[Fault]:
    """Check that exactly one of some keys is given."""
    present = [key for key, value in given.items() if value is not None]
    if len(present) != 1:
        have = (
            f"{' and '.join(present)} are both given" if present else f"none of {', '.join(given)}"
        )
        yield Fault(path, have, f"give exactly one: {what}")


def check_body(body: Body, path: str) -> Iterator[Fault]:
    """Check one `body` table."""
    found = [*_check_body_keys(body, path)]
    yield from found
    if found or body.shape is None:
        return
    mass, moments = body_mass(body), [row[n] for n, row in enumerate(body_inertia(body))]
    remedy = "check the sizes, in m"
    if not LEAST_MASS <= mass <= MOST_MASS:
        given = "mass" if body.density is None else "density"
        problem = f"the body has {mass:.3g} kg, not {LEAST_MASS:g} to {MOST_MASS:g} kg"
        yield fault_of(body, path, given, problem, remedy)
    elif min(moments) < max(LEAST_INERTIA, THINNEST * max(moments)):
        sizes = f"{min(moments):.3g} to {max(moments):.3g} kg m^2"
        problem = f"has moments of inertia of {sizes}, too small or too unequal"
        yield Fault(path, problem, remedy)


def _check_body_keys(body: Body, path: str) -> Iterator[Fault]:
    if body.shape is None:
        for key in ("axis", "radius", "inner_radius", "length", "size", "density"):
            if getattr(body, key) is not None:
                remedy = 'add shape = "cylinder" or "box"'
                yield fault_of(body, path, key, "needs a shape", remedy)
        if body.mass is None:
            yield fault_of(body, path, "mass", "missing", "give mass in kg")
        if body.inertia is None:
            remedy = "give inertia = [Ix, Iy, Iz] in kg m^2, or a shape"
            yield fault_of(body, path, "inertia", "missing", remedy)
        else:
            yield from _check_inertia(body.inertia, f"{path}.inertia")
        return
    if body.inertia is not None:
        remedy = "give either inertia or shape"
        yield fault_of(body, path, "inertia", "a shape has its own inertia", remedy)
    ways = {"mass": body.mass, "density": body.density}
    yield from check_exactly_one(path, ways, "mass in kg or density in kg/m^3")
    needed = ("radius", "length") if body.shape == "cylinder" else ("size",)
    for key in ("axis", "radius", "inner_radius", "length", "size"):
        value = getattr(body, key)
        if key in needed and value is None:
            yield fault_of(body, path, key, f"missing for a {body.shape}", "give it in m")
        if value is not None and ((body.shape == "box") != (key == "size")):
            yield fault_of(body, path, key, f"does not describe a {body.shape}", "remove it")
    if body.radius is not None and (body.inner_radius or 0.0) >= body.radius:
        problem = f"not smaller than the radius {body.radius:g} m"
        yield fault_of(body, path, "inner_radius", problem, "give a smaller hole")


def _check_inertia(inertia: list[Any], path: str) -> Iterator[Fault]:
    rows, value = [isinstance(row, list) for row in inertia], format_value(inertia)
    if any(rows) and not all(rows):
        remedy = "give three numbers or three rows of three"
        yield Fault(path, "mixes numbers and rows", remedy, value)
    elif not any(rows):
        if min(inertia) <= 0:
            problem, remedy = "moments of inertia must be positive", "give them in kg m^2"
            yield Fault(path, problem, remedy, value)
        elif min(inertia) < max(LEAST_INERTIA, THINNEST * max(inertia)):
            problem = "has one moment that is almost zero beside the others"
            yield Fault(path, problem, "give all three in kg m^2", value)
    else:
        import numpy as np

        matrix = np.array(inertia)
        if not np.allclose(matrix, matrix.T, rtol=1e-12, atol=0):
            yield Fault(path, "is not symmetric", "make element (i, j) equal to (j, i)", value)
        elif np.linalg.eigvalsh(matrix)[0] < max(LEAST_INERTIA, THINNEST * np.abs(matrix).max()):
            remedy = "check the signs of the products of inertia"
            yield Fault(path, "is not positive definite", remedy, value)
