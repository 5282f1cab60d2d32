"""Designs and reference results in 50 digits and more, which share no code with the program.

The energy of a stage in 60 digits is that of the tests (`tests/support/imperfect_stage_mp.py`), as
is the solution of given matrices in 50 (`tests/support/responses_mp.py`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from suspension_cli.design import reader
from suspension_cli.design.schema import Design
from suspension_cli.linear.structure import Structure
from suspension_cli.linear.system import LinearSystem
from tests.support import imperfect_stage_mp, responses_mp, soft_blades_mp

MP = imperfect_stage_mp.MP
MASS = 5.6
INERTIA = (0.0227, 0.016, 0.016)
"""kg and kg m^2: a mirror as large as that of Figure 6 of Husman et al. (2000)."""
SHAPE = {"l": 0.28, "s": 0.005, "t1": 0.0965, "t2": 0.0965, "d": 0.001, "k": 1.227e4}
"""Wires of this mirror, m and N/m."""

compare = responses_mp.compare
column = soft_blades_mp.column


def document(
    mass: float = MASS, inertia: Sequence[float] = INERTIA, **shape: float
) -> dict[str, Any]:
    """One stage on four wires as parsed TOML; `shape` replaces values of `SHAPE`."""
    body = {"mass": float(mass), "inertia": [float(moment) for moment in inertia]}
    wires = {"count": 4, **{name: float(value) for name, value in (SHAPE | shape).items()}}
    return {
        "design": {"name": "one-stage"},
        "stage": [{"name": "test", "body": body, "wires": wires}],
    }


def design(raw: dict[str, Any]) -> Design:
    """Convert parsed TOML to a checked design."""
    return reader.convert(raw)


def stage(
    mass: float = MASS,
    inertia: Sequence[float] = INERTIA,
    shape: dict[str, float] | None = None,
    **imperfection: Any,
) -> imperfect_stage_mp.Stage:
    """Build the stage of `document` from its energy, in 60 digits."""
    return imperfect_stage_mp.Stage(mass, inertia, SHAPE | (shape or {}), **imperfection)


def omega_squared(one: imperfect_stage_mp.Stage) -> list[Any]:
    """All omega^2 of a stage in its current pose, ascending, in 60 digits.

    Its inertia must be diagonal and not rotated.
    """
    root = [MP.sqrt(one.mass)] * 3 + [MP.sqrt(one.inertia[i, i]) for i in range(3)]
    stiffness = one.stiffness()
    scaled = MP.matrix(6, 6)
    for i in range(6):
        for j in range(6):
            scaled[i, j] = (stiffness[i, j] + stiffness[j, i]) / (2 * root[i] * root[j])
    return sorted(MP.eigsy(scaled, eigvals_only=True))


def given_omega_squared(model: LinearSystem) -> Any:
    """All omega^2 of given matrices without massless coordinates, ascending, in 50 digits."""
    m = responses_mp.MP
    values = []
    for block in Structure(model).blocks:
        mass, stiffness = (
            m.matrix(matrix[np.ix_(block, block)].tolist())
            for matrix in (model.mass, model.stiffness)
        )
        inverse = m.inverse(m.cholesky(mass))
        values += [
            float(value) for value in m.eigsy(inverse * stiffness * inverse.T, eigvals_only=True)
        ]
    return np.sort(values)


class Pair:
    """Chain of two bodies on explicit wires, in 60 digits, from the definition of elastic wires.

    Parameters
    ----------
    mass : two floats
        kg, upper and lower.
    drop : two mpf
        Nominal height of each COM below what it hangs from, m.
    wires : sequence of (body, upper point, lower point, k, tension)
        `body` 0 or 1 is the lower one; points (m) and tension (N) of the nominal pose, as mpf.
    """

    def __init__(
        self,
        mass: Sequence[float],
        drop: Sequence[Any],
        wires: Sequence[tuple[int, Any, Any, Any, Any]],
    ) -> None:
        self.mass = [MP.mpf(m) for m in mass]
        self.centre = [MP.matrix([0, 0, -drop[0]]), MP.matrix([0, 0, -drop[0] - drop[1]])]
        self.turn = [MP.eye(3), MP.eye(3)]
        self.wires = []
        for body, upper, lower, k, tension in wires:
            length = imperfect_stage_mp.norm(
                self._span(body, MP.matrix(upper), MP.matrix(lower))[0]
            )
            self.wires.append((body, MP.matrix(upper), MP.matrix(lower), k, length - tension / k))

    def _span(self, body: int, upper: Any, lower: Any) -> tuple[Any, Any, Any]:
        arm = self.turn[body] * lower
        above = self.turn[0] * upper if body else upper
        start = self.centre[0] + above if body else above
        return self.centre[body] + arm - start, arm, above

    def gradient(self) -> Any:
        """Compute the gradient of the energy (12,)."""
        force, torque = (
            [MP.matrix([0, 0, m * MP.mpf(9.81)]) for m in self.mass],
            [MP.zeros(3, 1), MP.zeros(3, 1)],
        )
        for body, upper, lower, k, natural in self.wires:
            span, arm, above = self._span(body, upper, lower)
            length = imperfect_stage_mp.norm(span)
            one = k * (length - natural) / length * span
            force[body], torque[body] = (
                force[body] + one,
                torque[body] + imperfect_stage_mp.cross(arm, one),
            )
            if body:
                force[0], torque[0] = (
                    force[0] - one,
                    torque[0] - imperfect_stage_mp.cross(above, one),
                )
        return MP.matrix([*force[0], *torque[0], *force[1], *torque[1]])

    def displaced(self, step: Any) -> Pair:
        """Displace both bodies by a small step (12,)."""
        other = object.__new__(Pair)
        other.mass, other.wires = self.mass, self.wires
        other.centre = [self.centre[n] + MP.matrix(step[6 * n : 6 * n + 3]) for n in (0, 1)]
        other.turn = [
            imperfect_stage_mp.rotation(MP.matrix(step[6 * n + 3 : 6 * n + 6])) * self.turn[n]
            for n in (0, 1)
        ]
        return other

    def balanced(self) -> Pair:
        """Find the equilibrium by Newton's method."""
        pair = self
        for _ in range(20):
            columns = []
            for n in range(12):
                plus, minus = (
                    [sign * imperfect_stage_mp.STEP if i == n else MP.zero for i in range(12)]
                    for sign in (1, -1)
                )
                columns.append(
                    (pair.displaced(plus).gradient() - pair.displaced(minus).gradient())
                    / (2 * imperfect_stage_mp.STEP)
                )
            step = MP.lu_solve(
                MP.matrix([[columns[j][i] for j in range(12)] for i in range(12)]), -pair.gradient()
            )
            pair = pair.displaced(list(step))
            if max(abs(x) for x in step) < MP.mpf(10) ** -30:
                return pair
        raise AssertionError("no equilibrium")
