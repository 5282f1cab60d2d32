"""One stage on four wires, one of them imperfect, in arithmetic of 60 digits: straight wires,
nothing linearised but the last step.

Written from the definitions of the design file alone; shares no code with the package.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mpmath

MP = mpmath.mp.clone()
MP.dps = 60
STEP = MP.mpf(10) ** -20
"""Of the central differences: their error is of order 1e-40."""
SIGNS = [(1, 1), (1, -1), (-1, 1), (-1, -1)]


@dataclass(frozen=True)
class Wire:
    upper: Any
    lower: Any
    k: Any
    natural: Any


def numbers(values: Any) -> Any:
    return MP.matrix([MP.mpf(value) for value in values])


def norm(vector: Any) -> Any:
    return MP.sqrt(sum(x * x for x in vector))


def cross(a: Any, b: Any) -> Any:
    return MP.matrix(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )


def rotation(vector: Any) -> Any:
    """The matrix that turns by a rotation vector (Rodrigues)."""
    angle = norm(vector)
    if angle == 0:
        return MP.eye(3)
    u = [x / angle for x in vector]
    skew = MP.matrix([[0, -u[2], u[1]], [u[2], 0, -u[0]], [-u[1], u[0], 0]])
    return MP.eye(3) + skew * MP.sin(angle) + skew * skew * (1 - MP.cos(angle))


class Stage:
    """A body of mass m and principal inertia on a symmetric set of wires (l, s, t1, t2, d, k), one
    of which is imperfect.

    The wires are made for `mass`; the body weighs `load` times as much, and its moments of inertia
    are `inertias` times those given.
    """

    def __init__(
        self,
        mass,
        inertia,
        shape,
        *,
        wire=0,
        k=1,
        offset=(0, 0, 0),
        lower_offset=(0, 0, 0),
        length=0,
        com=(0, 0, 0),
        load=1,
        inertias=1,
        hold="loaded-length",
    ):
        self.mass, self.inertia, self.gravity = (
            MP.mpf(mass),
            MP.mpf(inertias) * MP.diag([MP.mpf(i) for i in inertia]),
            MP.mpf(9.81),
        )
        l, s, t1, t2, d, nominal = (
            MP.mpf(shape[name]) for name in ("l", "s", "t1", "t2", "d", "k")
        )
        drop = MP.sqrt(l**2 - (t2 - t1) ** 2)
        tension = self.mass * self.gravity / 4 * l / drop
        centre = MP.matrix([0, 0, -drop - d])
        self.wires = []
        for n, (a, b) in enumerate(SIGNS):
            upper, point, own, natural = (
                MP.matrix([a * s, b * t1, 0]),
                MP.matrix([a * s, b * t2, d]),
                nominal,
                l - tension / nominal,
            )
            if n == wire:
                upper, point, own = (
                    upper + numbers(offset),
                    point + numbers(lower_offset),
                    nominal * MP.mpf(k),
                )
                if hold == "loaded-length":
                    natural = norm(centre + point - upper) - tension / own
                natural += MP.mpf(length)
            self.wires.append(Wire(upper, point - numbers(com), own, natural))
        self.centre = centre + numbers(com)
        self.turn = MP.eye(3)
        self.mass *= MP.mpf(load)

    def pull(self, step=(0,) * 6, support=0):
        """Gradient of the energy after a small step from the pose, with the support lifted."""
        # lists: matrices of mpmath take several times as long
        turn = (rotation(step[3:]) * self.turn).tolist()
        at = [place + moved for place, moved in zip(self.centre, step[:3], strict=True)]
        total = [MP.zero, MP.zero, self.mass * self.gravity, MP.zero, MP.zero, MP.zero]
        for wire in self.wires:
            lower = list(wire.lower)
            arm = [sum(a * b for a, b in zip(row, lower, strict=True)) for row in turn]
            x, y, z = (a + b - c for a, b, c in zip(at, arm, wire.upper, strict=True))
            z -= support
            length = norm((x, y, z))
            share = wire.k * (length - wire.natural) / length
            x, y, z = share * x, share * y, share * z
            pulled = (
                x,
                y,
                z,
                arm[1] * z - arm[2] * y,
                arm[2] * x - arm[0] * z,
                arm[0] * y - arm[1] * x,
            )
            total = [a + b for a, b in zip(total, pulled, strict=True)]
        return MP.matrix(total)

    def slope(self, n):
        plus, minus = ([sign * STEP if i == n else MP.zero for i in range(6)] for sign in (1, -1))
        return (self.pull(plus) - self.pull(minus)) / (2 * STEP)

    def stiffness(self):
        columns = [self.slope(n) for n in range(6)]
        return MP.matrix([[columns[j][i] for j in range(6)] for i in range(6)])

    def settle(self):
        """Newton to the equilibrium."""
        for _ in range(30):
            step = MP.lu_solve(self.stiffness(), -self.pull())
            self.centre, self.turn = self.centre + step[:3], rotation(step[3:]) * self.turn
            if max(abs(x) for x in step) < MP.mpf(10) ** -30:
                return self
        raise AssertionError("no equilibrium")

    def response(self, frequency, point):
        """Motion (x, y, z) of a point of the body for unit vertical motion of the support."""
        inertia = self.turn * self.inertia * self.turn.T
        square = (2 * MP.pi * MP.mpf(frequency)) ** 2
        dynamic = self.stiffness()
        for i in range(3):
            dynamic[i, i] -= square * self.mass
            for j in range(3):
                dynamic[3 + i, 3 + j] -= square * inertia[i, j]
        drive = (self.pull(support=STEP) - self.pull(support=-STEP)) / (2 * STEP)
        q = MP.lu_solve(dynamic, -drive)
        return q[:3] + cross(q[3:], self.turn * numbers(point))


def ratio(mass, inertia, shape, frequency=50.0, point=(0.0, 0.0, -0.001), **imperfection):
    """x over z of the point for vertical motion of the support."""
    moved = Stage(mass, inertia, shape, **imperfection).settle().response(frequency, point)
    return moved[0] / moved[2]
