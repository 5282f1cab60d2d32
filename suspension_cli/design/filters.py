"""Filters: bodies with blades (geometric anti-springs) that carry a keystone.

`[stage.filter]` adds a second body to a stage, its keystone, named STAGE-keystone. It follows the
stage in the list of bodies, so the next stage hangs from it. The blades are a spring between both,
stiff in all directions but the vertical. Their inertia adds the kinetic energy m_c v_f v_k of the
velocities of filter and keystone. With the mass M on the blades, the keystone follows the filter by

    z_k / z_f = (k + m_c w^2) / (k - (M - m_c) w^2)

at the angular frequency w. The isolation saturates at m_c / (M - m_c), and the frequency of the
blades is sqrt(k / (M - m_c)). Measured filters have this form, (w0^2 + beta w^2) / (w0^2 - w^2)
(compare Stochino et al., Improvement of the seismic noise attenuation performance of the Monolithic
Geometric Anti-Spring filters, Nucl. Instrum. Methods A (2007)). A magic wand, a counterweight on
the blades, makes m_c small or negative. The masses of filter and keystone include that of the
blades. Both include m_c, so a relative inertia of -m_c between the two corrects the sum.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

from suspension_cli.design import tables, units
from suspension_cli.design.tables import Problems, Table, doc, key

SUFFIX = "-keystone"
LATERAL, TILT = 1e7, 1e4
"""Default stiffness of a keystone across the vertical, N/m, and against rotation, N m/rad: far
above that of any wire."""
STEEL = 7900.0
"""Density of a keystone whose moments of inertia are not given, kg/m^3."""


class Keystone(Table, frozen=True):
    """Mass and inertia of a keystone, the part of the blades that moves with it included."""

    mass: units.Mass
    inertia: list[Annotated[float, doc("", "kg m^2", gt=0, le=1e15)]] | None = key(
        "moments of inertia about x, y, z, kg m^2; default those of a steel cylinder as"
        " high as wide",
        min_length=3,
        max_length=3,
    )


class Filter(Table, frozen=True):
    """Blades (geometric anti-springs) on this body, which carry a keystone.

    The next stage hangs from the keystone, the body STAGE-keystone; name the stage in hangs_from to
    hang from the filter's own body.
    """

    keystone: Keystone
    at: units.Vector = key(
        "COM of the keystone from this body's COM, m", (0.0, 0.0, 0.0), plausible=units.PART_SIZE
    )
    frequency: units.IsolatingFrequency | None = key(
        "vertical frequency at the working point, Hz, with the load rigid"
    )
    stiffness: units.Stiffness | None = key(
        "vertical stiffness of all blades at the working point, N/m, instead of frequency"
    )
    load: units.Tension | None = key(
        "load under which the keystone is at its nominal point, its own weight included,"
        " N; default that of the design, with vertical preloads of links"
    )
    lateral_stiffness: units.Stiffness = key(
        "stiffness of the blades against horizontal motion, N/m", LATERAL
    )
    tilt_stiffness: units.Rigidity = key("stiffness of the blades against rotation, N m/rad", TILT)
    saturation: units.Saturation | None = key(
        "fraction of the filter's vertical motion that reaches the keystone at high"
        " frequency, with the load rigid; negative if the counterweight is too heavy"
    )
    mass_coupling: units.MassCoupling | None = key(
        "inertia of the blades that couples both bodies, kg, instead of saturation"
    )
    loss_angle: units.LossAngle | None = key("loss angle of the blades' stiffness in rad")
    q: float | None = key("Q of the vertical mode, 1/loss_angle", unit="1", gt=1, le=1e12)
    modulus_slope: units.ModulusSlope = key(
        "relative change of Young's modulus of the blades with temperature, 1/K, for the"
        " shift of the working point that check reports",
        0.0,
    )
    thermal_expansion: units.Expansion = key(
        "thermal expansion of the blades in 1/K; adds to that shift", 0.0
    )

    def _check_coupling(self) -> Problems:
        """Check that the inertia of the blades is part of that of the keystone."""
        mass = self.keystone.mass
        if self.mass_coupling is not None and self.mass_coupling >= mass:
            problem = f"is not below the mass of the keystone, {mass:g} kg, which includes it"
            remedy = "add the part of the blades that moves with the keystone to its mass"
            yield "mass_coupling", problem, remedy

    rules = (
        tables.exactly_one("stiffness", "frequency"),
        tables.at_most_one("loss_angle", "q"),
        tables.at_most_one("saturation", "mass_coupling"),
        _check_coupling,
    )


@dataclass(frozen=True)
class FilterStatics:
    """Blades of a filter under their load.

    Attributes
    ----------
    load
        Weight and other vertical force on the blades under which the keystone is at its nominal
        point, with the keystone's own, N.
    stiffness
        Vertical stiffness of the blades, N/m.
    coupling
        m_c, kg.
    mass
        Inertia M - m_c against vertical motion at the load, kg.
    loss
        Loss angle, rad.
    """

    load: float
    stiffness: float
    coupling: float
    mass: float
    loss: float


def filter_statics(table: Filter, carried: float, hung: float, gravity: float) -> FilterStatics:
    """Compute the blades of a filter.

    Parameters
    ----------
    carried
        Load of the blades in the design, N: the weight of the keystone and of what hangs from it,
        and the vertical forces of preloads.
    hung
        That weight without these forces, N.
    """
    load = carried if table.load is None else table.load
    whole = (load - carried + hung) / gravity
    coupling = table.mass_coupling or 0.0
    if table.saturation is not None:
        coupling = whole * table.saturation / (1 + table.saturation)
    stiffness = table.stiffness
    if stiffness is None:
        assert table.frequency is not None
        stiffness = (2 * math.pi * table.frequency) ** 2 * (whole - coupling)
    loss = 1 / table.q if table.q is not None else table.loss_angle or 0.0
    return FilterStatics(load, stiffness, coupling, whole - coupling, loss)


def keystone_inertia(keystone: Keystone) -> list[float]:
    """Moments of inertia of a keystone about x, y, z, kg m^2.

    By default those of a steel cylinder of height 2 r: m r^2 / 2 about z and 7 m r^2 / 12 across
    (any text on mechanics).
    """
    if keystone.inertia is not None:
        return keystone.inertia
    square = (keystone.mass / (2 * math.pi * STEEL)) ** (2 / 3)
    across = 7 * keystone.mass * square / 12
    return [across, across, keystone.mass * square / 2]
