"""Suspensions on blades far softer than their wires, in 50 digits, from the definition of their
parts alone.

`Assembly` takes the points, tensions, stiffnesses and masses of a scene in its nominal pose, as
numbers, and none of the program's mechanics: every wire along u with tension T and length L adds
J^T (k u u^T + T/L (1 - u u^T)) J, J the motion of its span with the coordinates, and T u .
d2(span), where a rotation t moves a point p to second order by t x (t x p) / 2 (elastic wires:
Husman et al. (2000), section 4b). `Column` is a chain that moves vertically alone, on vertical
wires: springs, blades and exact rods (any text on vibrations), one below the other.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tests.support.responses_mp import MP, eliminate


def vector(values: Any) -> list[Any]:
    """Doubles as they stand."""
    return [MP.mpf(float(value)) for value in values]


def dot(a: Any, b: Any) -> Any:
    return sum((x * y for x, y in zip(a, b, strict=True)), MP.zero)


class Assembly:
    """The stiffness and masses (N, N) of a scene whose nominal pose is its equilibrium; blade tips
    move along z alone."""

    def __init__(self, scene: Any) -> None:
        blades = scene.blades
        self.bodies = len(scene.bodies.name) + 1
        assert (blades.axes == [False, False, True]).all()
        size = 6 * self.bodies + len(blades.label)
        self.stiffness = [[MP.zero] * size for _ in range(size)]
        self.mass = [[MP.zero] * size for _ in range(size)]
        for n in range(len(scene.wires.label)):
            self._hang(scene.wires, n)
        for n in range(len(blades.label)):
            tip = 6 * self.bodies + n
            self.stiffness[tip][tip] += MP.mpf(float(blades.stiffness[n, 2]))
            self._load(scene, n)
        for n in range(1, self.bodies):
            for i in range(3):
                self.mass[6 * n + i][6 * n + i] += MP.mpf(float(scene.bodies.mass[n - 1]))
                for j in range(3):
                    self.mass[6 * n + 3 + i][6 * n + 3 + j] += MP.mpf(
                        float(scene.bodies.inertia[n - 1, i, j])
                    )

    def _pulled(self, body: int, point: Any, force: Any) -> dict[int, list[Any]]:
        """How a point of a body moves; and what turning the body costs by a force (the energy's
        slope) on it."""
        arm, base, rows = vector(point), 6 * body, {}
        for axis in range(3):
            rows[base + axis] = [MP.mpf(axis == i) for i in range(3)]
        x, y, z = arm
        rows[base + 3], rows[base + 4], rows[base + 5] = (
            [MP.zero, -z, y],
            [z, MP.zero, -x],
            [-y, x, MP.zero],
        )
        for i in range(3):
            for j in range(3):
                turned = (
                    force[i] * arm[j] + force[j] * arm[i] - (2 * dot(force, arm) if i == j else 0)
                )
                self.stiffness[base + 3 + i][base + 3 + j] += turned / 2
        return rows

    def _hang(self, wires: Any, n: int) -> None:
        span = vector(wires.span[n])
        length = MP.sqrt(dot(span, span))
        along = [part / length for part in span]
        pull, k = MP.mpf(float(wires.tension[n])), MP.mpf(float(wires.stiffness[n]))
        upper = self._pulled(
            int(wires.upper[n]), wires.upper_point[n], [-pull * part for part in along]
        )
        rows = {row: [-part for part in moved] for row, moved in upper.items()}
        rows |= self._pulled(
            int(wires.lower[n]), wires.lower_point[n], [pull * part for part in along]
        )
        blade = int(wires.blade[n])
        if blade >= 0:
            tip, base = 6 * self.bodies + blade, 6 * int(wires.upper[n]) + 3
            rows[tip] = [MP.zero, MP.zero, -MP.one]
            # -T u . (t x z) = T t . (u x z)
            for i, value in enumerate((pull * along[1], -pull * along[0])):
                self.stiffness[base + i][tip] += value
                self.stiffness[tip][base + i] += value
        stretch = {row: dot(moved, along) for row, moved in rows.items()}
        for one, moved in rows.items():
            for other, too in rows.items():
                across = dot(moved, too) - stretch[one] * stretch[other]
                self.stiffness[one][other] += (
                    k * stretch[one] * stretch[other] + pull / length * across
                )

    def _load(self, scene: Any, blade: int) -> None:
        """A mass on the tip of a blade, and its weight."""
        mass = MP.mpf(float(scene.blades.tip_mass[blade]))
        if not mass:
            return
        rows = self._pulled(
            int(scene.blades.body[blade]),
            scene.blades.tip[blade],
            [MP.zero, MP.zero, mass * MP.mpf(float(scene.gravity))],
        )
        rows[6 * self.bodies + blade] = [MP.zero, MP.zero, MP.one]
        for one, moved in rows.items():
            for other, too in rows.items():
                self.mass[one][other] += mass * dot(moved, too)

    def responses(self, frequency: float) -> Any:
        """Motion of all bodies for unit motions of the support, (6 n, 6) doubles."""
        square = (2 * MP.pi * MP.mpf(frequency)) ** 2
        rows = [
            [k - square * m for k, m in zip(*pair, strict=True)]
            for pair in zip(self.stiffness[6:], self.mass[6:], strict=True)
        ]
        moved = eliminate(
            [row[6:] for row in rows], [[-value for value in row[:6]] for row in rows]
        )
        return np.array([[float(value) for value in row] for row in moved[: 6 * (self.bodies - 1)]])

    def omega_squared(self) -> Any:
        """All omega^2, ascending; tips without mass follow."""
        heavy = [n for n in range(6, len(self.mass)) if self.mass[n][n]]
        light = [n for n in range(6, len(self.mass)) if not self.mass[n][n]]

        def part(matrix: Any, rows: list[int], columns: list[int]) -> Any:
            return MP.matrix([[matrix[i][j] for j in columns] for i in rows])

        left = part(self.stiffness, heavy, heavy)
        if light:
            across = part(self.stiffness, light, heavy)
            left = left - across.T * MP.inverse(part(self.stiffness, light, light)) * across
        lower = MP.inverse(MP.cholesky(part(self.mass, heavy, heavy)))
        scaled = lower * left * lower.T
        return np.array(
            [float(value) for value in MP.eigsy((scaled + scaled.T) / 2, eigvals_only=True)]
        )


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
