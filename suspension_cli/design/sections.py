"""Uniform stretches of wires: sections with their defaults filled in, tapers cut into steps."""

from __future__ import annotations

from dataclasses import dataclass

from suspension_cli.design.cross_sections.round import Round
from suspension_cli.design.cross_sections.shape import CrossSection
from suspension_cli.design.wires import Wire, WireSection, WireSet, cross_sections

STEPS = 16
"""Number of steps of a taper for which the design gives none."""


@dataclass(frozen=True)
class Stretch:
    """A stretch of wire.

    Attributes
    ----------
    length : float
        Loaded, m.
    material : str or None
    shape : CrossSection
    """

    length: float
    material: str | None
    shape: CrossSection


def thinnest(wire: WireSet | Wire | WireSection) -> float | None:
    """Find the smallest cross-section of a wire, m^2, where stress is largest; None if unknown."""
    tables = getattr(wire, "sections", None) or [wire]
    return min(
        (shape.least_area for table in tables for shape in cross_sections(table)),
        key=lambda area: area.real,  # it may carry complex steps
        default=None,
    )


def stretches(wire: WireSet | Wire, length: float) -> list[Stretch]:
    """Divide a wire of a loaded `length` (m) into uniform stretches, from its upper to lower end.

    There are none if the cross-section is not given. Lengths given by the design may miss `length`
    by 1e-6 and are scaled to sum to it.
    """
    if wire.sections is None:
        return [Stretch(length, wire.material, shape) for shape in cross_sections(wire)]
    given = sum(piece.length or 0.0 for piece in wire.sections)
    rest = length - given if any(piece.length is None for piece in wire.sections) else 0.0
    scale = 1.0 if rest.real > 0 else length / given
    return [
        one
        for piece in wire.sections
        for one in _steps(
            piece, scale * (rest if piece.length is None else piece.length), wire.material
        )
    ]


def _steps(piece: WireSection, length: float, material: str | None) -> list[Stretch]:
    """Divide one section of a design into uniform stretches."""
    name = piece.material or material
    if isinstance(piece.radius, list):
        shapes = Round.read(piece.radius).steps(STEPS if piece.steps is None else piece.steps)
    else:
        shapes = cross_sections(piece)
    return [Stretch(length / len(shapes), name, shape) for shape in shapes]
