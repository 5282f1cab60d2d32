"""Uniform stretches of wires: sections with their defaults, tapers and profiles cut into steps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

from suspension_cli.design.cross_sections import CrossSection, taper
from suspension_cli.design.wires import Profile, Wire, WireSection, WireSet, cross_sections

STEPS = 16
"""Default number of steps of a taper."""


@dataclass(frozen=True)
class Stretch:
    """A stretch of wire.

    Attributes
    ----------
    length
        Loaded, m.
    """

    length: float
    material: str | None
    shape: CrossSection


def reduced(profile: Profile, error: float | None = None) -> list[WireSection]:
    """Reduce a profile to uniform sections, from the upper end.

    Between two places the diameter is linear. Stretches in which it changes by a fraction of at
    most sqrt(error) become one section of the same volume: mass is exact, and means of other powers
    of the radius (compliance, bending stiffness) are wrong by a third to all of `error`.

    Parameters
    ----------
    error
        Instead of that of the profile; 0: one section per pair of places.
    """
    wanted = profile.error if error is None else error
    return _reduced(tuple(profile.position), tuple(profile.diameter), wanted)


@lru_cache(maxsize=64)  # a design needs them often
def _reduced(
    position: tuple[float, ...], diameter: tuple[float, ...], wanted: float
) -> list[WireSection]:
    limit = math.sqrt(wanted)
    sections: list[WireSection] = []
    length = volume = 0.0
    low, high = math.inf, 0.0
    points = zip(position, diameter, strict=True)
    for (top, above), (bottom, below) in pairwise(points):
        # a steep stretch is divided, so that none exceeds the limit
        parts = max(1, math.ceil(abs(math.log(below / above)) / limit)) if wanted else 1
        span = (bottom - top) / parts
        for n in range(parts):
            ends = [above + (below - above) * k / parts for k in (n, n + 1)]
            low, high = min(*ends, low), max(*ends, high)
            if length and (not wanted or high > low * (1 + limit)):
                sections.append(_section(length, volume))
                length = volume = 0.0
                low, high = min(ends), max(ends)
            length += span
            volume += span * (ends[0] ** 2 + ends[0] * ends[1] + ends[1] ** 2) / 3
    return [*sections, _section(length, volume)]


def _section(length: float, volume: float) -> WireSection:
    return WireSection(length=length, radius=math.sqrt(volume / length) / 2)


def given_sections(wire: WireSet | Wire) -> Sequence[WireSection] | None:
    """Sections of a wire: given, of a fibre with necks, or of a measured profile; else None."""
    if isinstance(wire.profile, Profile):
        return reduced(wire.profile)
    if wire.neck is None:
        return wire.sections
    neck, radius = wire.neck, wire.radius
    assert radius is not None
    stock = [WireSection(length=neck.stock, radius=neck.radius)] if neck.stock else []
    return [
        *stock,
        WireSection(length=neck.length, radius=[neck.radius, radius], steps=neck.steps),
        WireSection(radius=radius),
        WireSection(length=neck.length, radius=[radius, neck.radius], steps=neck.steps),
        *stock,
    ]


def thinnest(wire: WireSet | Wire | WireSection) -> float | None:
    """Find the smallest cross-section of a wire, m^2, where stress is largest; None if unknown."""
    if not isinstance(wire, WireSection) and isinstance(wire.profile, Profile):
        return math.pi * min(wire.profile.diameter) ** 2 / 4
    given = None if isinstance(wire, WireSection) else given_sections(wire)
    tables = given or [wire]
    return min(
        (shape.least_area for table in tables for shape in cross_sections(table)), default=None
    )


def stretches(wire: WireSet | Wire, length: float) -> list[Stretch]:
    """Divide a wire of a loaded `length` (m) into uniform stretches, from its upper to lower end.

    Empty if the cross-section is unknown. Given lengths may miss `length` by 1e-6; they are scaled.
    """
    sections = given_sections(wire)
    if sections is None:
        return [Stretch(length, wire.material, shape) for shape in cross_sections(wire)]
    given = sum(piece.length or 0.0 for piece in sections)
    rest = length - given if any(piece.length is None for piece in sections) else 0.0
    scale = 1.0 if rest.real > 0 else length / given
    return [
        one
        for piece in sections
        for one in _steps(
            piece, scale * (rest if piece.length is None else piece.length), wire.material
        )
    ]


def _steps(piece: WireSection, length: float, material: str | None) -> list[Stretch]:
    name = piece.material or material
    if isinstance(piece.radius, list):
        upper, lower = piece.radius
        shapes = taper(upper, lower, STEPS if piece.steps is None else piece.steps)
    else:
        shapes = cross_sections(piece)
    return [Stretch(length / len(shapes), name, shape) for shape in shapes]
