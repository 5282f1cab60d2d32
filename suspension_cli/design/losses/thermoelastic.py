"""Thermoelastic loss of bending.

The loss angle is Delta Im g (`cross_sections.relaxation`), Delta = E T a^2/(rho C). The coefficient
a is the slope of strain against temperature at constant stress s. With the strain s/E(T) + alpha T
it is a = alpha - s E'/E^2 = alpha - u beta, u = s/E the static strain and beta = E'/E: in a
material that stiffens with temperature the loss vanishes at one tension (Cagnoli and Willems, Phys.
Rev. B 65, 174111 (2002)). Stretching and twisting drive no heat across a wire. In a complex
frequency the angle is continued analytically.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self

from suspension_cli.design.losses.mechanism import Mechanism
from suspension_cli.design.tables import Problems, Table, doc

if TYPE_CHECKING:
    from suspension_cli.design.cross_sections.shape import CrossSection, Frequencies, Spectrum


CONSTANTS = ("density", "thermal_expansion", "specific_heat", "thermal_conductivity")
"""Keys of a material that thermoelastic loss needs beside Young's modulus."""


@dataclass(frozen=True)
class Thermoelastic(Mechanism):
    """Thermoelastic loss of bending.

    Attributes
    ----------
    youngs_modulus, density
        Pa, kg/m^3.
    expansion
        Linear thermal expansion alpha, 1/K.
    modulus_slope
        beta = (1/E) dE/dT, 1/K.
    heat_capacity
        Specific heat, J/(kg K).
    conductivity
        Thermal conductivity, W/(m K).
    """

    name: ClassVar[str] = "thermoelastic"
    keys: ClassVar[dict[str, Any]] = {
        "thermoelastic": Annotated[
            bool,
            doc(
                "false omits thermoelastic loss, which needs density, expansion, specific"
                " heat and conductivity (the slope of the modulus may be missing)"
            ),
        ]
    }

    youngs_modulus: float
    density: float
    expansion: float
    modulus_slope: float
    heat_capacity: float
    conductivity: float

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
        if depth <= 0:
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
