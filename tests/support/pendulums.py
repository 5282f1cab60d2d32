"""A mass on one wire from the wire's own equation, in many digits: an independent derivation for
the tests of thermal noise.

    EI w'''' - T w'' - mu omega^2 w = 0,    w(0) = w'(0) = 0,

and at z = L a body whose COM the wire ends in, of mass m and moment of inertia I, pushed on by F:

    EI w'' = I omega^2 w',    -EI w''' + T w' - m omega^2 w = F.

I -> 0 leaves the end free to turn, I -> infinity clamps it (Gonzalez and Saulson, J. Acoust. Soc.
Am. 96, 207 (1994)).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from tests.support import beam_mp

BOLTZMANN = 1.380649e-23


@dataclass(frozen=True)
class Pendulum:
    """Mass (kg), moment of inertia (kg m^2), length (m), Young's modulus (Pa), radius (m), density
    (kg/m^3), loss angle, temperature (K)."""

    mass: float = 2.0
    inertia: float = 1e-9
    length: float = 0.5
    modulus: float = 2e11
    radius: float = 1e-4
    density: float = 7800.0
    angle: float = 1e-3
    temperature: float = 290.0
    gravity: float = 9.81

    @property
    def rigidity(self) -> float:
        """EI, N m^2."""
        return self.modulus * math.pi * self.radius**4 / 4

    @property
    def tension(self) -> float:
        """N."""
        return self.mass * self.gravity

    def raw(self, **material: Any) -> dict[str, Any]:
        """The design as parsed TOML."""
        wire = {
            "youngs_modulus": self.modulus,
            "poisson_ratio": 0.3,
            "density": self.density,
            "loss_angle": self.angle,
            **material,
        }
        inertia = [self.inertia] * 3
        return {
            "design": {"name": "one"},
            "constants": {"gravity": self.gravity, "temperature": self.temperature},
            "materials": {"wire": wire},
            "stage": [
                {
                    "name": "test",
                    "body": {"mass": self.mass, "inertia": inertia},
                    "wires": {
                        "count": 1,
                        "l": self.length,
                        "material": "wire",
                        "radius": self.radius,
                    },
                }
            ],
        }

    def susceptibility(self, frequency: float, *, massive: bool) -> Any:
        """w(L) / F."""
        rigidity, omega = self.rigidity * (1 + 1j * self.angle), 2 * math.pi * frequency
        mass = self.density * math.pi * self.radius**2 if massive else 0.0
        wire = rigidity, self.tension, mass, self.length, omega
        held = beam_mp.bent(*wire)[2:, 2:]
        with beam_mp.exact(beam_mp.digits_for(*wire)):
            for n, inertia in enumerate((self.mass, self.inertia)):
                held[n, n] -= beam_mp.number(inertia) * beam_mp.number(omega) ** 2
            return (held**-1)[0, 0]

    def density_of_noise(self, frequency: float, *, massive: bool) -> float:
        """-4 k T Im(w / F) / omega, m^2/Hz."""
        found = float(self.susceptibility(frequency, massive=massive).imag)
        return -4 * BOLTZMANN * self.temperature / (2 * math.pi * frequency) * found
