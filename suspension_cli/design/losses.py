"""Losses of materials: keys of the design file, and the loss angles of their mechanisms.

**Bulk and surface.** The loss angle of the bulk is a constant, or a table: linear in log f and log
angle, constant beyond its ends, at the real part of a complex frequency. The surface adds d_s mu
S/V times that angle (see `cross_sections`).

**Thermoelastic loss of bending.** The loss angle is Delta Im g (`relaxation`), Delta = E T a^2/(rho
C). The coefficient a is the slope of strain against temperature at constant stress s. With the
strain s/E(T) + alpha T it is a = alpha - s E'/E^2 = alpha - u beta, u = s/E the static strain and
beta = E'/E: in a material that stiffens with temperature the loss vanishes at one tension (Cagnoli
and Willems, Phys. Rev. B 65, 174111 (2002)). Stretching and twisting drive no heat across a wire.
In a complex frequency the angle is continued analytically.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Self

from suspension_cli.design import tables, units
from suspension_cli.design.tables import Problems, Table, key

if TYPE_CHECKING:
    from suspension_cli.design.cross_sections import CrossSection, Frequencies, Spectrum


class LossTable(Table, frozen=True):
    """Loss angle by frequency: interpolated linearly in the logarithms, constant outside."""

    frequency: list[units.Frequency] = key("Hz, ascending", min_length=1, max_length=10000)
    angle: list[units.PositiveLossAngle] = key(
        "loss angle at each of them, rad", min_length=1, max_length=10000
    )

    rules = (tables.same_length("angle", "frequency"), tables.ascending("frequency"))


class MaterialLoss(Table, frozen=True):
    """Losses of a material, for the models in which wires bend."""

    angle: units.LossAngle | None = key("constant loss angle of the bulk in rad")
    table: LossTable | None = key("loss angle of the bulk by frequency, instead")
    surface_depth: units.Separation | None = key(
        "dissipation depth of the surface in m; default that of a built-in bulk loss, or 0"
    )
    thermoelastic: bool | None = key(
        "false omits thermoelastic loss, which needs expansion, density and thermal constants"
    )


class Mechanism:
    """A mechanism of loss, with the constants of one material: a frozen dataclass.

    Materials are tables `schema.Material` from `materials.resolve`, with None for what is unknown.

    Loss angles are in rad, finite at zero frequency, and add up; `omega` is in rad/s, of any shape,
    not negative, or complex (of a damped mode).
    """

    name: ClassVar[str]
    """For messages."""
    uniform: ClassVar[bool] = False
    """Whether it acts in every deformation; otherwise in bending alone."""
    cause: ClassVar[str] = ""
    """Cause under which `pendsus thermal` lists its dissipation in the bending of wires: ``clamps``
    for ``test.clamps``; "" to list it with the bending of either end."""

    @classmethod
    def check(cls, own: Any, material: Any) -> Problems:
        """Check a design's table of a material; `material` has the built-in values too."""
        del own, material
        yield from ()

    @classmethod
    def of(cls, material: Any, wire: Table | None) -> Self | None:
        """Read the constants from a material and the table of the wire (None for a blade).

        None if this mechanism does not act.
        """
        raise NotImplementedError

    def bending(
        self, shape: CrossSection, plane: int, omega: Frequencies, temperature: float
    ) -> Spectrum:
        """Loss angle of bending in one plane; with a `coefficient` a, divided by a^2."""
        raise NotImplementedError

    def stretching(self, shape: CrossSection, omega: Frequencies) -> Spectrum:
        """Loss angle of stretching, and by default of twisting; 0 unless `uniform`."""
        import numpy as np

        del shape
        return np.zeros(np.shape(omega))

    twisting = stretching

    def coefficient(self, area: float) -> tuple[float, float] | None:
        """(p, q) of a bending angle proportional to a^2, with a = p - q T at the tension T (N).

        At most one mechanism of a material has it.
        """
        del area
        return None

    @property
    def acts_unstrained(self) -> bool:
        """Whether it has a loss without static strain."""
        return True


@dataclass(frozen=True)
class Bulk(Mechanism):
    """Loss of bulk and surface."""

    name: ClassVar[str] = "bulk"
    uniform: ClassVar[bool] = True

    angle: float  # constant, of the bulk, rad
    table: tuple[tuple[float, ...], tuple[float, ...]] | None = None  # Hz and rad, instead
    surface_depth: float = 0.0  # dissipation depth d_s, m

    @classmethod
    def check(cls, own: Any, material: Any) -> Problems:
        """Check that one loss of the bulk is given."""
        if (loss := own.loss) is None:
            return
        if loss.angle is not None and own.loss_angle is not None:
            problem = "conflicts with loss_angle, which is short for it"
            yield "loss.angle", problem, "keep one of the two"
        if loss.surface_depth and material.loss.angle is None and material.loss.table is None:
            problem = "has no effect without a loss of the bulk, to which it is relative"
            yield "loss.surface_depth", problem, "give angle or table too"
        if loss.table is not None and (own.loss_angle is not None or loss.angle is not None):
            yield "loss.table", "conflicts with a constant loss angle", "keep one of the two"

    @classmethod
    def of(cls, material: Any, wire: Table | None) -> Self | None:
        """Read the constants; None for a material without bulk loss."""
        del wire
        loss = material.loss
        if loss.table is None and not loss.angle:
            return None
        table = loss.table and (tuple(loss.table.frequency), tuple(loss.table.angle))
        return cls(loss.angle or 0.0, table, loss.surface_depth or 0.0)

    def bending(
        self, shape: CrossSection, plane: int, omega: Frequencies, temperature: float
    ) -> Spectrum:
        """Loss angle of bending in one plane, rad."""
        del temperature
        return self._at(omega, shape.bending_ratio(plane))

    def stretching(self, shape: CrossSection, omega: Frequencies) -> Spectrum:
        """Loss angle of stretching, rad."""
        return self._at(omega, shape.stretching_ratio)

    def twisting(self, shape: CrossSection, omega: Frequencies) -> Spectrum:
        """Loss angle of twisting, rad."""
        return self._at(omega, shape.twisting_ratio)

    def _at(self, omega: Frequencies, ratio: float) -> Spectrum:
        """Loss angle of bulk and surface for mu S/V = `ratio` in 1/m."""
        import numpy as np

        surface = 1 + self.surface_depth * ratio
        if self.table is None:
            return (self.angle + 0.0 * np.asarray(omega)) * surface
        frequency, angle = self.table
        inside = np.clip(np.real(omega) / (2 * math.pi), frequency[0], frequency[-1])
        return np.exp(np.interp(np.log(inside), np.log(frequency), np.log(angle))) * surface


CONSTANTS = ("density", "thermal_expansion", "specific_heat", "thermal_conductivity")
"""Keys of a material that thermoelastic loss needs beside Young's modulus."""


@dataclass(frozen=True)
class Thermoelastic(Mechanism):
    """Thermoelastic loss of bending."""

    name: ClassVar[str] = "thermoelastic"

    youngs_modulus: float  # Pa
    density: float  # kg/m^3
    expansion: float  # linear thermal expansion alpha, 1/K
    modulus_slope: float  # beta = (1/E) dE/dT, 1/K
    heat_capacity: float  # specific heat, J/(kg K)
    conductivity: float  # thermal, W/(m K)

    @classmethod
    def check(cls, own: Any, material: Any) -> Problems:
        """Check that a material with ``thermoelastic = true`` has the constants."""
        missing = [key for key in CONSTANTS if getattr(material, key) is None]
        if own.loss is not None and own.loss.thermoelastic and missing:
            problem = f"has no effect without {', '.join(missing)}"
            yield "loss.thermoelastic", problem, "give what is missing, or remove it"

    @classmethod
    def of(cls, material: Any, wire: Table | None) -> Self | None:
        """Read the constants; None where one is unknown, or with ``thermoelastic = false``."""
        del wire
        constants = [getattr(material, key) for key in ("youngs_modulus", *CONSTANTS)]
        if material.loss.thermoelastic is False or None in constants:
            return None
        modulus, density, expansion, capacity, conductivity = constants
        slope = material.modulus_slope or 0.0
        return cls(modulus, density, expansion, slope, capacity, conductivity)

    def bending(
        self, shape: CrossSection, plane: int, omega: Frequencies, temperature: float
    ) -> Spectrum:
        """Loss angle over a^2, K^2; 0 for a blade of unknown thickness."""
        import numpy as np

        depth = shape.depth[plane]
        if math.isinf(depth):
            return 0.0 * (np.asarray(omega) + temperature)
        capacity = self.density * self.heat_capacity
        strength = self.youngs_modulus * temperature / capacity
        phase = np.asarray(omega) * (capacity * (depth / 2) ** 2 / self.conductivity)
        return strength * shape.relaxation(phase)

    def coefficient(self, area: float) -> tuple[float, float]:
        """a without tension, 1/K, and its decrease per tension, 1/(K N)."""
        return self.expansion, self.modulus_slope / (self.youngs_modulus * area)

    @property
    def acts_unstrained(self) -> bool:
        """Whether the material expands."""
        return self.expansion != 0


MECHANISMS: tuple[type[Mechanism], ...] = (Bulk, Thermoelastic)


def mechanisms_of(material: Any, wire: Table | None) -> tuple[Mechanism, ...]:
    """List the mechanisms that act in a material, from `materials.resolve`, and wire (or blade)."""
    found = (kind.of(material, wire) for kind in MECHANISMS)
    return tuple(one for one in found if one is not None)
