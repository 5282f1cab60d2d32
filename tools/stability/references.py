"""Designs, and answers in arithmetic of 50 digits and more that share no code with the program.

The energy of a stage in 60 digits is that of the tests (`tests/precise.py`), as is the solution of given matrices in 50 (`tests/exact.py`).
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).parent.parent.parent
sys.path.insert(0, str(ROOT / "tests"))

import exact  # noqa: E402
import precise  # noqa: E402
import stiff  # noqa: E402

from suspension_cli.design import reader  # noqa: E402
from suspension_cli.design.schema import Design  # noqa: E402
from suspension_cli.mechanics.model import LinearModel  # noqa: E402

MP = precise.MP
MASS = 5.6
INERTIA = (0.0227, 0.016, 0.016)
"""kg and kg m^2: a mirror of the size of that of Figure 6 of Husman et al. (2000)."""
SHAPE = {"l": 0.28, "s": 0.005, "t1": 0.0965, "t2": 0.0965, "d": 0.001, "k": 1.227e4}
"""Its wires: m and N/m."""

compare = exact.compare
column = stiff.column


def document(mass: float = MASS, inertia: Sequence[float] = INERTIA, **shape: float) -> dict[str, Any]:
    """One stage on four wires, as the parsed TOML; `shape` replaces what is in `SHAPE`."""
    body = {"mass": float(mass), "inertia": [float(moment) for moment in inertia]}
    wires = {"count": 4, **{name: float(value) for name, value in (SHAPE | shape).items()}}
    return {"design": {"name": "one-stage"}, "stage": [{"name": "test", "body": body, "wires": wires}]}


def design(raw: dict[str, Any]) -> Design:
    """A checked design."""
    return reader.convert(raw)


def stage(mass: float = MASS, inertia: Sequence[float] = INERTIA, shape: dict[str, float] | None = None, **imperfection: Any) -> precise.Stage:
    """The same stage from its energy, in 60 digits."""
    return precise.Stage(mass, inertia, SHAPE | (shape or {}), **imperfection)


def omega_squared(one: precise.Stage) -> list[Any]:
    """All omega^2 of a stage in the pose in which it is, ascending, in 60 digits; its inertia must be diagonal and not turned."""
    root = [MP.sqrt(one.mass)] * 3 + [MP.sqrt(one.inertia[i, i]) for i in range(3)]
    stiffness = one.stiffness()
    scaled = MP.matrix(6, 6)
    for i in range(6):
        for j in range(6):
            scaled[i, j] = (stiffness[i, j] + stiffness[j, i]) / (2 * root[i] * root[j])
    return sorted(MP.eigsy(scaled, eigvals_only=True))


def given_omega_squared(model: LinearModel) -> Any:
    """All omega^2 of given matrices (no massless coordinates) in 50 digits, ascending, rounded at the end."""
    m = exact.MP
    values = []
    for block in model.blocks:
        mass, stiffness = (m.matrix(matrix[np.ix_(block, block)].tolist()) for matrix in (model.mass, model.stiffness))
        inverse = m.inverse(m.cholesky(mass))
        values += [float(value) for value in m.eigsy(inverse * stiffness * inverse.T, eigvals_only=True)]
    return np.sort(values)


class Pair:
    """Two bodies in a chain on explicit wires, in 60 digits: pose and balance from the definition of elastic wires alone.

    Parameters
    ----------
    mass : two floats
        kg, upper and lower.
    drop : two mpf
        Nominal height of each COM below what it hangs from, m.
    wires : sequence of (body, upper point, lower point, k, tension)
        `body` 0 or 1 is the lower one; points (m) and tension (N) of the nominal pose, as mpf.
    """

    def __init__(self, mass: Sequence[float], drop: Sequence[Any], wires: Sequence[tuple[int, Any, Any, Any, Any]]) -> None:
        self.mass = [MP.mpf(m) for m in mass]
        self.centre = [MP.matrix([0, 0, -drop[0]]), MP.matrix([0, 0, -drop[0] - drop[1]])]
        self.turn = [MP.eye(3), MP.eye(3)]
        self.wires = []
        for body, upper, lower, k, tension in wires:
            length = precise.norm(self._span(body, MP.matrix(upper), MP.matrix(lower))[0])
            self.wires.append((body, MP.matrix(upper), MP.matrix(lower), k, length - tension / k))

    def _span(self, body: int, upper: Any, lower: Any) -> tuple[Any, Any, Any]:
        arm = self.turn[body] * lower
        above = self.turn[0] * upper if body else upper
        start = self.centre[0] + above if body else above
        return self.centre[body] + arm - start, arm, above

    def pull(self) -> Any:
        """Gradient of the energy (12,)."""
        force, torque = [MP.matrix([0, 0, m * MP.mpf(9.81)]) for m in self.mass], [MP.zeros(3, 1), MP.zeros(3, 1)]
        for body, upper, lower, k, natural in self.wires:
            span, arm, above = self._span(body, upper, lower)
            length = precise.norm(span)
            one = k * (length - natural) / length * span
            force[body], torque[body] = force[body] + one, torque[body] + precise.cross(arm, one)
            if body:
                force[0], torque[0] = force[0] - one, torque[0] - precise.cross(above, one)
        return MP.matrix([*force[0], *torque[0], *force[1], *torque[1]])

    def moved(self, step: Any) -> Pair:
        """After a small step (12,)."""
        other = object.__new__(Pair)
        other.mass, other.wires = self.mass, self.wires
        other.centre = [self.centre[n] + MP.matrix(step[6 * n : 6 * n + 3]) for n in (0, 1)]
        other.turn = [precise.rotation(MP.matrix(step[6 * n + 3 : 6 * n + 6])) * self.turn[n] for n in (0, 1)]
        return other

    def settled(self) -> Pair:
        """Newton to the equilibrium."""
        pair = self
        for _ in range(20):
            columns = []
            for n in range(12):
                plus, minus = ([sign * precise.STEP if i == n else MP.zero for i in range(12)] for sign in (1, -1))
                columns.append((pair.moved(plus).pull() - pair.moved(minus).pull()) / (2 * precise.STEP))
            step = MP.lu_solve(MP.matrix([[columns[j][i] for j in range(12)] for i in range(12)]), -pair.pull())
            pair = pair.moved(list(step))
            if max(abs(x) for x in step) < MP.mpf(10) ** -30:
                return pair
        raise AssertionError("no equilibrium")
