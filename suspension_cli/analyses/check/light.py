"""Pressure and stiffness of the light in cavities, as `check` lists them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from suspension_cli.analyses.check.columns import Column
from suspension_cli.design.links import LIGHT
from suspension_cli.design.schema import Design
from suspension_cli.models.cavity import angular_stiffness, optical_spring


@dataclass(frozen=True)
class CavityLoad:
    """Light of one cavity.

    Attributes
    ----------
    force : float
        Static force that pushes each mirror outwards, which control balances, N.
    stability : float
        g1 g2.
    soft, hard : float
        Torsional stiffness of the two combinations of angles, of pitch and of yaw alike, N m/rad.
    spring : float
        Static stiffness of the optical spring, N/m.
    pole : float or None
        Half width of the resonance, Hz; None if the design does not give it.
    """

    name: Annotated[str, Column("cavity", "cavity")]
    force: Annotated[float, Column("force_n", "force\nmN", ".4g", 1e3)]
    stability: Annotated[float, Column("g1_g2", "g1 g2", ".4g")]
    soft: Annotated[float, Column("soft_n_m_per_rad", "soft\nN m/rad", ".4g")]
    hard: Annotated[float, Column("hard_n_m_per_rad", "hard\nN m/rad", ".4g")]
    spring: Annotated[float, Column("spring_n_per_m", "spring\nN/m", ".4g")]
    pole: Annotated[float | None, Column("pole_hz", "pole\nHz", ".4g")]


def cavity_loads(design: Design) -> Iterator[CavityLoad]:
    """Compute the forces and stiffnesses of the light in all cavities of a design."""
    for cavity in design.cavity:
        soft, hard = np.linalg.eigvalsh(angular_stiffness(cavity)[2:, 2:]).tolist()
        yield CavityLoad(
            name=cavity.name,
            force=2 * cavity.power / LIGHT,
            stability=cavity.g[0] * cavity.g[1],
            soft=soft,
            hard=hard,
            spring=optical_spring(cavity)[0],
            pole=cavity.half_width if math.isfinite(cavity.half_width) else None,
        )
