"""Suspensions on blades far softer than their wires, in 50 digits, from the definition of their parts alone.

`Assembly` takes the points, tensions, stiffnesses and masses of a scene in its nominal pose, as numbers, and none of the program's mechanics: every wire
along u with tension T and length L adds J^T (k u u^T + T/L (1 - u u^T)) J, J the motion of its span with the coordinates, and T u . d2(span), where a
rotation t moves a point p to second order by t x (t x p) / 2 (elastic wires: Husman et al. (2000), section 4b).  `Column` is a chain that moves
vertically alone, on vertical wires: springs, blades and exact rods (any text on vibrations), one below the other.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mpmath
import numpy as np

MP = mpmath.mp.clone()
MP.dps = 50


def vector(values: Any) -> list[Any]:
    """Doubles as they stand."""
    return [MP.mpf(float(value)) for value in values]


def dot(a: Any, b: Any) -> Any:
    return sum((x * y for x, y in zip(a, b, strict=True)), MP.zero)


class Assembly:
    """The stiffness (N, N) and masses (N,) of a scene whose nominal pose is its equilibrium; blade tips move along z alone and have no mass."""

    def __init__(self, scene: Any) -> None:
        wires, blades = scene.wires, scene.blades
        self.bodies = len(scene.bodies.name) + 1
        assert (blades.axes == [False, False, True]).all()
        assert not blades.tip_mass.any()
        size = 6 * self.bodies + len(blades.label)
        self.stiffness = [[MP.zero] * size for _ in range(size)]
        for n in range(len(wires.label)):
            span = vector(wires.span[n])
            length = MP.sqrt(dot(span, span))
            along = [part / length for part in span]
            pull, k = MP.mpf(float(wires.tension[n])), MP.mpf(float(wires.stiffness[n]))
            rows: dict[int, list[Any]] = {}
            for body, point, sign in ((wires.upper[n], wires.upper_point[n], -1), (wires.lower[n], wires.lower_point[n], 1)):
                arm, base = vector(point), 6 * int(body)
                for axis in range(3):
                    rows[base + axis] = [MP.mpf(sign * (axis == i)) for i in range(3)]
                x, y, z = (sign * part for part in arm)
                rows[base + 3], rows[base + 4], rows[base + 5] = [MP.zero, -z, y], [z, MP.zero, -x], [-y, x, MP.zero]
                for i in range(3):
                    for j in range(3):
                        turned = along[i] * arm[j] + along[j] * arm[i] - (2 * dot(along, arm) if i == j else 0)
                        self.stiffness[base + 3 + i][base + 3 + j] += sign * pull * turned / 2
            blade = int(wires.blade[n])
            if blade >= 0:
                tip, base = 6 * self.bodies + blade, 6 * int(wires.upper[n]) + 3
                rows[tip] = [MP.zero, MP.zero, -MP.one]
                for i, value in enumerate((-pull * -along[1], -pull * along[0], MP.zero)):  # -T t . (z x u)
                    self.stiffness[base + i][tip] += value
                    self.stiffness[tip][base + i] += value
            stretch = {row: dot(moved, along) for row, moved in rows.items()}
            for one, moved in rows.items():
                for other, too in rows.items():
                    across = dot(moved, too) - stretch[one] * stretch[other]
                    self.stiffness[one][other] += k * stretch[one] * stretch[other] + pull / length * across
        for blade in range(len(blades.label)):
            self.stiffness[6 * self.bodies + blade][6 * self.bodies + blade] += MP.mpf(float(blades.stiffness[blade, 2]))
        self.mass = [[MP.zero] * size for _ in range(size)]
        for n in range(1, self.bodies):
            for i in range(3):
                self.mass[6 * n + i][6 * n + i] = MP.mpf(float(scene.bodies.mass[n - 1]))
                for j in range(3):
                    self.mass[6 * n + 3 + i][6 * n + 3 + j] = MP.mpf(float(scene.bodies.inertia[n - 1, i, j]))

    def responses(self, frequency: float) -> Any:
        """Motion of all bodies for unit motions of the support, (6 n, 6) doubles."""
        square = (2 * MP.pi * MP.mpf(frequency)) ** 2
        size = len(self.stiffness)
        own = MP.matrix(size - 6)
        for i in range(6, size):
            for j in range(6, size):
                own[i - 6, j - 6] = self.stiffness[i][j] - square * self.mass[i][j]
        found = np.zeros((6 * (self.bodies - 1), 6))
        for dof in range(6):
            x = MP.lu_solve(own, MP.matrix([-self.stiffness[i][dof] for i in range(6, size)]))
            found[:, dof] = [float(x[i]) for i in range(len(found))]
        return found

    def omega_squared(self) -> Any:
        """All omega^2, ascending."""
        size, last = len(self.stiffness), 6 * self.bodies
        held = MP.matrix([[self.stiffness[i][j] for j in range(6, last)] for i in range(6, last)])
        if size > last:
            across = MP.matrix([[self.stiffness[i][j] for j in range(6, last)] for i in range(last, size)])
            tips = MP.matrix([[self.stiffness[i][j] for j in range(last, size)] for i in range(last, size)])
            held = held - across.T * MP.inverse(tips) * across
        lower = MP.inverse(MP.cholesky(MP.matrix([[self.mass[i][j] for j in range(6, last)] for i in range(6, last)])))
        scaled = lower * held * lower.T
        return np.array([float(value) for value in MP.eigsy((scaled + scaled.T) / 2, eigvals_only=True)])


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
        """Stiffness of a stage's wires at one end against the motion of that end, and of the other (negative)."""
        k = MP.mpf(float(self.wire[stage])) * MP.mpc(1, self.wire_loss)
        mass = MP.mpf(float(self.wire_mass[stage]))
        if not mass:
            return k, -k
        angle = omega * MP.sqrt(mass / k)
        return k * angle * MP.cot(angle), -k * angle / MP.sin(angle)

    def dynamic(self, omega: Any) -> tuple[Any, Any]:
        """Dynamic stiffness (2 n, 2 n) of tip and mass of each stage, and its column towards the support."""
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
        """Thermal noise of the last mass, m^2/Hz: -4 k T Im(x / F) / omega (Callen and Welton, Phys. Rev. 83, 34 (1951))."""
        omega = 2 * MP.pi * MP.mpf(frequency)
        matrix, pulled = self.dynamic(omega)
        force = MP.matrix(len(pulled), 1)
        force[len(pulled) - 1] = MP.one
        return float(-4 * MP.mpf("1.380649e-23") * MP.mpf(temperature) / omega * MP.im(MP.lu_solve(matrix, force)[len(pulled) - 1]))

    def frequency_near(self, guess: float) -> float:
        """The mode (Hz, without loss) next to a guess."""
        still = Column(self.mass, self.blade, self.wire, wire_mass=self.wire_mass)
        return float(
            MP.findroot(
                lambda f: MP.re(MP.det(still.dynamic(2 * MP.pi * f)[0])), (MP.mpf(guess) * (1 - MP.mpf("1e-7")), MP.mpf(guess)), tol=1e-60, verify=False
            )
        )
