"""Masses on blades far softer than their wires, in 50 digits: chains that move vertically alone, on
vertical wires.

Springs, blades and exact rods (any text on vibrations), one below the other.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tests.support.responses_mp import MP


@dataclass(frozen=True)
class Column:
    """Masses under each other, each on blades and vertical wires; all numbers of a stage together.

    Attributes
    ----------
    mass, blade, wire : (n,) sequences
        kg; N/m of all blades and of all wires of a stage.
    blade_loss, wire_loss : float
        Loss angles.
    wire_mass : (n,) sequence
        kg, of all wires of a stage; 0 for wires without mass.
    """

    mass: Any
    blade: Any
    wire: Any
    blade_loss: float = 0.0
    wire_loss: float = 0.0
    wire_mass: Any = (0.0, 0.0)

    def _rods(self, stage: int, omega: Any) -> tuple[Any, Any]:
        """Stiffness of a stage's wires at one end against the motion of that end, and of the other
        (negative)."""
        k = MP.mpf(float(self.wire[stage])) * MP.mpc(1, self.wire_loss)
        mass = MP.mpf(float(self.wire_mass[stage]))
        if not mass:
            return k, -k
        angle = omega * MP.sqrt(mass / k)
        return k * angle * MP.cot(angle), -k * angle / MP.sin(angle)

    def dynamic(self, omega: Any) -> tuple[Any, Any]:
        """Dynamic stiffness (2 n, 2 n) of tip and mass of each stage, and its column towards the
        support."""
        count = len(self.mass)
        result, pulled = MP.matrix(2 * count), MP.matrix(2 * count, 1)
        for n in range(count):
            tip, body = 2 * n, 2 * n + 1
            blade = MP.mpf(float(self.blade[n])) * MP.mpc(1, self.blade_loss)
            own, other = self._rods(n, omega)
            result[tip, tip] += blade + own
            result[tip, body] += other
            result[body, tip] += other
            result[body, body] += own - omega**2 * MP.mpf(float(self.mass[n]))
            if n:
                result[body - 2, body - 2] += blade
                result[body - 2, tip] -= blade
                result[tip, body - 2] -= blade
            else:
                pulled[tip] = -blade
        return result, pulled

    def response(self, frequency: float) -> complex:
        """Motion of the last mass for a unit motion of the support."""
        matrix, pulled = self.dynamic(2 * MP.pi * MP.mpf(frequency))
        return complex(MP.lu_solve(matrix, -pulled)[len(pulled) - 1])

    def density(self, frequency: float, temperature: float) -> float:
        """Thermal noise of the last mass, m^2/Hz: -4 k T Im(x / F) / omega (Callen and Welton,
        Phys. Rev. 83, 34 (1951))."""
        omega = 2 * MP.pi * MP.mpf(frequency)
        matrix, pulled = self.dynamic(omega)
        force = MP.matrix(len(pulled), 1)
        force[len(pulled) - 1] = MP.one
        return float(
            -4
            * MP.mpf("1.380649e-23")
            * MP.mpf(temperature)
            / omega
            * MP.im(MP.lu_solve(matrix, force)[len(pulled) - 1])
        )

    def frequency_near(self, guess: float) -> float:
        """The mode (Hz, without loss) next to a guess."""
        still = Column(self.mass, self.blade, self.wire, wire_mass=self.wire_mass)
        return float(
            MP.findroot(
                lambda f: MP.re(MP.det(still.dynamic(2 * MP.pi * f)[0])),
                (MP.mpf(guess) * (1 - MP.mpf("1e-7")), MP.mpf(guess)),
                tol=1e-60,
                verify=False,
            )
        )


def column(ratio: float, *, massive: bool, lossy: bool = True) -> tuple[dict[str, Any], Column]:
    """Two masses on vertical wires `ratio` times stiffer than the blades that they hang from: as a
    parsed design, and as springs and rods."""
    blade, radius, length, density, masses = 412.37, 2e-4, 0.4, 7800.0, (8.0, 5.0)
    losses = (1e-3, 2e-4) if lossy else (0.0, 0.0)
    wires = {
        "count": 4,
        "l": length,
        "s": 0.03,
        "t1": 0.1,
        "t2": 0.1,
        "d": 0.001,
        "material": "wire",
        "radius": radius,
        "k": float(ratio) * blade,
    }
    plate = {"count": 4, "stiffness": blade, "loss_angle": losses[0]}
    raw = {
        "design": {"name": "column"},
        "constants": {"temperature": 290.0},
        "materials": {
            "wire": {
                "youngs_modulus": 2e11,
                "poisson_ratio": 0.3,
                "density": density,
                "loss_angle": losses[1],
            }
        },
        "stage": [
            {
                "name": name,
                "body": {"mass": mass, "inertia": [0.05, 0.04, 0.06]},
                "wires": dict(wires),
                "blades": dict(plate),
            }
            for name, mass in zip(("upper", "test"), masses, strict=True)
        ],
    }
    weight = 4 * density * np.pi * radius**2 * length if massive else 0.0
    return raw, Column(
        masses, (4 * blade,) * 2, (4 * float(ratio) * blade,) * 2, *losses, (weight,) * 2
    )
