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

import mpmath

BOLTZMANN = "1.380649e-23"


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

    def susceptibility(self, frequency: float, *, massive: bool, digits: int = 50) -> Any:
        """w(L) / F."""
        with mpmath.workdps(digits):
            omega = 2 * mpmath.pi * mpmath.mpf(frequency)
            rigidity = (
                self.modulus
                * mpmath.pi
                * mpmath.mpf(self.radius) ** 4
                / 4
                * mpmath.mpc(1, self.angle)
            )
            tension, length = mpmath.mpf(self.mass) * self.gravity, mpmath.mpf(self.length)
            mu = (
                self.density * mpmath.pi * mpmath.mpf(self.radius) ** 2
                if massive
                else mpmath.mpf("1e-40")
            )
            tau, m = tension / rigidity, mu * omega**2 / rigidity
            roots = [
                sign * mpmath.sqrt((tau + branch * mpmath.sqrt(tau**2 + 4 * m)) / 2)
                for branch in (1, -1)
                for sign in (1, -1)
            ]
            # growing waves are measured from the lower end, so that none overflows
            start = [length if mpmath.re(root) > 0 else 0 for root in roots]

            def wave(n: int, order: int, z: Any) -> Any:
                return roots[n] ** order * mpmath.exp(roots[n] * (z - start[n]))

            rows = [
                [wave(n, 0, 0) for n in range(4)],
                [wave(n, 1, 0) for n in range(4)],
                [
                    rigidity * wave(n, 2, length) - self.inertia * omega**2 * wave(n, 1, length)
                    for n in range(4)
                ],
                [
                    -rigidity * wave(n, 3, length)
                    + tension * wave(n, 1, length)
                    - self.mass * omega**2 * wave(n, 0, length)
                    for n in range(4)
                ],
            ]
            amplitude = mpmath.lu_solve(mpmath.matrix(rows), mpmath.matrix([0, 0, 0, 1]))
            return sum(amplitude[n] * wave(n, 0, length) for n in range(4))

    def density_of_noise(self, frequency: float, *, massive: bool) -> float:
        """-4 k T Im(w / F) / omega, m^2/Hz."""
        with mpmath.workdps(50):
            omega = 2 * mpmath.pi * mpmath.mpf(frequency)
            return float(
                -4
                * mpmath.mpf(BOLTZMANN)
                * self.temperature
                / omega
                * mpmath.im(self.susceptibility(frequency, massive=massive))
            )
