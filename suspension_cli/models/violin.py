"""Linear model of a suspension whose wires bend and have mass, with all violin modes.

Each wire answers with the exact dynamic stiffness of a beam under tension with distributed mass
(`elements.dynamic_wire`); all else is as in the beam model.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from suspension_cli.design.schema import Design
from suspension_cli.linear.frequency_terms import WireTerm
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models.beam import BEAM, Beam


class Violin(Beam):
    """The violin model, valid at any frequency."""

    name = "violin"
    description = "wires bend and have mass: all violin modes"
    omits = ()
    cost = 20.0

    def refined(self, design: Design, built: Mapping[str, LinearSystem]) -> LinearSystem:
        """The system, from that of the beam model if that is `built`."""
        simpler = built.get(BEAM.name)
        if simpler is None or design.constants.wire_weight:  # the beam model then has their inertia
            return super().refined(design, built)
        return with_wire_mass(simpler)


def with_wire_mass(model: LinearSystem) -> LinearSystem:
    """Switch on the mass of wires in a linear model of bending wires."""
    terms = (
        replace(term, strand=replace(term.strand, massive=True))
        if isinstance(term, WireTerm)
        else term
        for term in model.terms
    )
    return replace(model, terms=tuple(terms))


VIOLIN = Violin()
