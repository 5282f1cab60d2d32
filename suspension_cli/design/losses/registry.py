"""The mechanisms of loss, in the order of their keys."""

from __future__ import annotations

from suspension_cli.design.losses.bulk import Bulk
from suspension_cli.design.losses.mechanism import MaterialConstants, Mechanism
from suspension_cli.design.losses.thermoelastic import Thermoelastic
from suspension_cli.design.units import Table

MECHANISMS: tuple[type[Mechanism], ...] = (Bulk, Thermoelastic)


def mechanisms_of(material: MaterialConstants, wire: Table | None) -> tuple[Mechanism, ...]:
    """List the mechanisms that act in a material, from `materials.resolve`, and wire (or blade)."""
    found = (kind.of(material, wire) for kind in MECHANISMS)
    return tuple(one for one in found if one is not None)
