"""Measured profiles of fibres beside the uniform sections to which they are reduced."""

from __future__ import annotations

from dataclasses import dataclass

from suspension_cli.design.profiles import reduced, tapers
from suspension_cli.design.schema import Design
from suspension_cli.design.wires import Profile, WireSection, WireSet, cross_sections


@dataclass(frozen=True)
class ReducedProfile:
    """A measured profile and its sections.

    Attributes
    ----------
    places, sections
        Their numbers.
    stretching_change, bending_change
        Relative changes of the compliance, the integral along the fibre of 1/(pi r^2) or
        4/(pi r^4).
    allowed
        The error that the design allows.
    """

    wire: str
    places: int
    sections: int
    stretching_change: float
    bending_change: float
    allowed: float

    @property
    def line(self) -> str:
        """Describe the reduction in a line."""
        worst = max(self.stretching_change, self.bending_change)
        verdict = "within" if worst <= self.allowed else "ABOVE"
        return (
            f"profile of {self.wire}: {self.places} places in {self.sections} sections; stretching"
            f" changes by {self.stretching_change:.0e}, bending by {self.bending_change:.0e},"
            f" {verdict} the {self.allowed:g} allowed"
        )


def solve(design: Design) -> list[ReducedProfile]:
    """Compare every measured profile with its sections."""
    found: list[ReducedProfile] = []
    for stage in design.stage:
        for number, table in enumerate(stage.wire_tables, 1):
            own = table.profile
            if not isinstance(own, Profile):
                continue
            name = "wires" if isinstance(table, WireSet) else number
            sections = reduced(own)
            pairs = zip(_compliances(tapers(own)), _compliances(sections), strict=True)
            changes = [abs(exact / coarse - 1) for exact, coarse in pairs]
            places = len(own.position)
            label = f"{stage.name}.{name}"
            found.append(ReducedProfile(label, places, len(sections), *changes, own.error))
    return found


def _compliances(pieces: list[WireSection]) -> tuple[float, float]:
    """Integrals of 1/A and 1/I along tapered or uniform pieces, 1/m and 1/m^3."""
    shapes = [(piece.length or 0.0, *cross_sections(piece)) for piece in pieces]
    return (
        sum(length / shape.area for length, shape in shapes),
        sum(length / shape.moments[0] for length, shape in shapes),
    )
