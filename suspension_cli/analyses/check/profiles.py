"""Errors by the reduction of measured profiles of fibres to uniform sections."""

from __future__ import annotations

from dataclasses import dataclass

import msgspec
import numpy as np

from suspension_cli.analyses.check.statics import Statics
from suspension_cli.design import paths
from suspension_cli.design.schema import Design
from suspension_cli.design.sections import stretches
from suspension_cli.design.wires import Profile, WireSet
from suspension_cli.elements import joined_sections
from suspension_cli.elements.dynamic_wire import TautWire
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.models import registry

FINER = 2
"""Sections per pair of places of the reference."""


@dataclass(frozen=True)
class ReducedProfile:
    """A measured profile and its sections: their numbers, and relative changes of stiffness.

    The changes are against `FINER` sections per pair of places; that in bending is the largest of
    the static stiffness (displacement and rotation of either end). `allowed` is the error that the
    design allows.
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


def solve(design: Design, statics: Statics) -> list[ReducedProfile]:
    """Compare every measured profile with its sections."""
    found: list[ReducedProfile] = []
    first = 0
    for stage in design.stage:
        for n, table in enumerate(stage.wire_tables, 1):
            own, number, is_set = table.profile, first, isinstance(table, WireSet)
            first += table.count if isinstance(table, WireSet) else 1
            if not isinstance(own, Profile):
                continue
            member = ["wires"] if is_set else ["wire", str(n)]
            keys = ["stage", stage.name, *member, "profile"]
            finer = paths.changed(design, keys, _refined)
            tension = statics.wires[number].tension
            exact, k = _stiffness(finer, number, tension)
            reduced, reduced_k = _stiffness(design, number, tension)
            scale = np.sqrt(np.diag(exact))
            found.append(
                ReducedProfile(
                    wire=f"{stage.name}.{'wires' if is_set else n}",
                    places=len(own.position),
                    sections=len(stretches(table, own.position[-1] - own.position[0])),
                    stretching_change=abs(reduced_k / k - 1),
                    bending_change=float((abs(reduced - exact) / np.outer(scale, scale)).max()),
                    allowed=own.error,
                )
            )
    return found


def _refined(profile: Profile) -> Profile:
    """The same diameters at `FINER` times as many places, to be taken without reduction."""
    places = np.arange(len(profile.position))
    between = np.linspace(0, places[-1], FINER * int(places[-1]) + 1)
    position, diameter = (
        np.interp(between, places, values).tolist()
        for values in (profile.position, profile.diameter)
    )
    return msgspec.structs.replace(profile, position=position, diameter=diameter, error=0.0)


def _stiffness(design: Design, number: int, tension: float) -> tuple[np.ndarray, float]:
    """Static stiffness of a wire in bending in one plane, and its spring constant, N/m."""
    scene = registry.BEAM.completed(expand(design), design)
    assert scene.fibres is not None
    wire = TautWire(scene.fibres.wire[number], tension, massive=False, lossy=False)
    ends = joined_sections.to_ends(wire.resting("bend-1"))[..., 0]
    return ends, float(scene.wires.stiffness[number])
