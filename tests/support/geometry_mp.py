"""A scene of bodies, wires and blades in arithmetic of 50 digits, from its geometry: energies of
finite motions, nothing linearised but the last step.

Takes the numbers of the scene as exact and balances it anew in 50 digits; shares no code with the
assembly of matrices.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from tests.support import imperfect_stage_mp, responses_mp

MP = imperfect_stage_mp.MP
STEP = MP.mpf(10) ** -18
"""Of the central differences: their error is of order 1e-36."""


def vector(values: Any) -> Any:
    return MP.matrix([MP.mpf(float(value)) for value in values])


class Suspension:
    """Body 0 is the support; coordinates are six of every body, then the tips of the blades along
    the axes they move in."""

    def __init__(self, scene: Any) -> None:
        assert not scene.springs.label
        assert not scene.blades.tip_mass.any()
        self.scene, self.count = scene, len(scene.bodies.name) + 1
        self.centre = [vector(row) for row in scene.bodies.position]
        self.turn = [MP.eye(3) for _ in self.centre]
        self.tips = [(int(b), int(a)) for b, a in np.argwhere(scene.blades.axes)]
        self.deflection = [MP.zero for _ in self.tips]
        wires = scene.wires
        self.points = [
            (vector(u), vector(v))
            for u, v in zip(wires.upper_point, wires.lower_point, strict=True)
        ]
        self.numbers = [
            (MP.mpf(float(k)), MP.mpf(float(t)))
            for k, t in zip(wires.stiffness, wires.tension, strict=True)
        ]
        self.length = [
            imperfect_stage_mp.norm(self._ends(n, [MP.zero] * self.size)[2])
            for n in range(len(self.points))
        ]

    @property
    def size(self) -> int:
        return 6 * self.count + len(self.tips)

    def _pose(self, body: int, step: Any) -> tuple[Any, Any]:
        move = step[6 * body : 6 * body + 6]
        return self.centre[body] + MP.matrix(move[:3]), imperfect_stage_mp.rotation(
            MP.matrix(move[3:])
        ) * self.turn[body]

    def _ends(self, wire: int, step: Any) -> tuple[Any, Any, Any, Any]:
        """Arms of both ends, the span between them, and the turn of the upper body."""
        wires, (upper, lower) = self.scene.wires, self.points[wire]
        carried = upper.copy()
        for n, (blade, axis) in enumerate(self.tips):
            if blade == wires.blade[wire]:
                carried[axis] += self.deflection[n] + step[6 * self.count + n]
        (at, turn), (below, other) = (
            self._pose(wires.upper[wire], step),
            self._pose(wires.lower[wire], step),
        )
        above, under = turn * carried, other * lower
        return above, under, below + under - at - above, turn

    def pull(self, step: Any) -> Any:
        """Gradient of the energy after a finite step."""
        scene, total = self.scene, [MP.zero] * self.size
        for body in range(1, self.count):
            total[6 * body + 2] += MP.mpf(float(scene.bodies.mass[body - 1])) * MP.mpf(
                float(scene.gravity)
            )
        for n, (blade, axis) in enumerate(self.tips):
            now = self.deflection[n] + step[6 * self.count + n]
            total[6 * self.count + n] += MP.mpf(
                float(scene.blades.stiffness[blade, axis])
            ) * now - MP.mpf(float(scene.blades.load[blade, axis]))
        for wire, (k, tension) in enumerate(self.numbers):
            above, under, span, turn = self._ends(wire, step)
            length = imperfect_stage_mp.norm(span)
            force = (tension + k * (length - self.length[wire])) / length * span
            for body, arm, sign in (
                (scene.wires.lower[wire], under, 1),
                (scene.wires.upper[wire], above, -1),
            ):
                torque = imperfect_stage_mp.cross(arm, force)
                for axis in range(3):
                    total[6 * body + axis] += sign * force[axis]
                    total[6 * body + 3 + axis] += sign * torque[axis]
            for n, (blade, axis) in enumerate(self.tips):
                if blade == scene.wires.blade[wire]:
                    total[6 * self.count + n] -= sum(force[m] * turn[m, axis] for m in range(3))
        return total

    def stiffness(self) -> list[list[Any]]:
        """Rows of all coordinates but the support's, columns of all."""
        columns = []
        for n in range(self.size):
            one, two = (
                self.pull([sign * STEP if m == n else MP.zero for m in range(self.size)])
                for sign in (1, -1)
            )
            columns.append([(a - b) / (2 * STEP) for a, b in zip(one, two, strict=True)])
        return [[column[row] for column in columns] for row in range(6, self.size)]

    def settle(self) -> Suspension:
        """Newton to the equilibrium."""
        for _ in range(8):
            matrix = [row[6:] for row in self.stiffness()]
            step = [MP.zero] * 6 + [
                row[0]
                for row in responses_mp.eliminate(
                    matrix, [[-g] for g in self.pull([MP.zero] * self.size)[6:]]
                )
            ]
            for body in range(1, self.count):
                self.centre[body], self.turn[body] = self._pose(body, step)
            self.deflection = [
                q + s for q, s in zip(self.deflection, step[6 * self.count :], strict=True)
            ]
            if max(map(abs, step)) < MP.mpf(10) ** -30:
                return self
        raise AssertionError("no equilibrium")

    def mass(self) -> list[list[Any]]:
        """Without the support's rows and columns."""
        result = [[MP.zero] * (self.size - 6) for _ in range(self.size - 6)]
        for n in range(self.count - 1):
            inertia = MP.matrix(
                [[MP.mpf(float(v)) for v in row] for row in self.scene.bodies.inertia[n]]
            )
            inertia = self.turn[n + 1] * inertia * self.turn[n + 1].T
            for i in range(3):
                result[6 * n + i][6 * n + i] = MP.mpf(float(self.scene.bodies.mass[n]))
                for j in range(3):
                    result[6 * n + 3 + i][6 * n + 3 + j] = inertia[i, j]
        return result

    def carried(self, frequency: float) -> list[list[Any]]:
        """Motions of all bodies' coordinates for unit motions of the support, at the very omega
        that `response` works with."""
        if not hasattr(self, "kept"):
            self.kept = self.stiffness(), self.mass()
        stiffness, mass = self.kept
        square = MP.mpf(2 * np.pi * frequency) ** 2
        dynamic = [
            [k - square * m for k, m in zip(row[6:], heavy, strict=True)]
            for row, heavy in zip(stiffness, mass, strict=True)
        ]
        small = MP.mpf(10) ** -25  # of central differences, where a coupling is exactly 0
        dynamic = [[value if abs(value) > small else MP.zero for value in row] for row in dynamic]
        found = responses_mp.eliminate(
            dynamic,
            [[-value if abs(value) > small else MP.zero for value in row[:6]] for row in stiffness],
        )
        return found[: 6 * (self.count - 1)]
