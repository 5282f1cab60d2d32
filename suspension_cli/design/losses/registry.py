"""The mechanisms of loss, in the order of their keys."""

from __future__ import annotations

from typing import Any

from suspension_cli.design.losses.bulk import Bulk
from suspension_cli.design.losses.mechanism import Mechanism
from suspension_cli.design.losses.thermoelastic import Thermoelastic
from suspension_cli.design.tables import Table

MECHANISMS: tuple[type[Mechanism], ...] = (Bulk, Thermoelastic)


def mechanisms_of(material: Any, wire: Table | None) -> tuple[Mechanism, ...]:
    """List the mechanisms that act in a material, from `materials.resolve`, and wire (or blade)."""
    found = (kind.of(material, wire) for kind in MECHANISMS)
    return tuple(one for one in found if one is not None)
