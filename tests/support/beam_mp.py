"""Beams under tension and rods in arithmetic of as many digits as it takes: the ordinary solutions
along the full length, ends first.

    EI w'''' - T w'' - mu omega^2 w = 0:    w = a cosh(alpha x) + b sinh(alpha x)/alpha + c cos(beta
    x) + d sin(beta x)/beta,    0 < x < L.

Shares no code with the package; quantities are exact doubles, real or complex.
"""

from __future__ import annotations

import mpmath
import numpy as np

MP = mpmath.mp.clone()
DIGITS = 60
ALIKE = [[1, 0, -1, 0], [0, -1, 0, 1], [1, 0, 1, 0], [0, 1, 0, 1]]
"""(w1, w1', w2, w2') of (W_s, T_s, W_a, T_a)."""


def number(value):
    """The very double, exactly."""
    value = complex(value)
    return MP.mpc(value.real, value.imag) if value.imag else MP.mpf(value.real)


def exact(digits=DIGITS):
    return MP.workdps(digits)


class Bent:
    """A beam at one frequency; call within `exact(digits_for(...))`."""

    def __init__(self, rigidity, tension, mass, length, omega):
        self.rigidity, self.tension, self.length = number(rigidity), number(tension), number(length)
        tau, m = self.tension / self.rigidity, number(mass) * omega**2 / self.rigidity
        root = MP.sqrt(tau**2 + 4 * m)
        self.alpha, self.beta = MP.sqrt((tau + root) / 2), MP.sqrt(2 * m / (tau + root))

    def basis(self, x):
        """w, w', w'' and w''' of the four solutions."""
        a, b = self.alpha, self.beta
        ch, sh = (MP.cosh(a * x), MP.sinh(a * x) / a) if a else (MP.one, x)
        c, s = (MP.cos(b * x), MP.sin(b * x) / b) if b else (MP.one, x)
        p, n = a * a, -b * b
        return [
            [ch, sh, c, s],
            [p * sh, ch, n * s, c],
            [p * ch, p * sh, n * c, n * s],
            [p * p * sh, p * ch, n * n * s, n * c],
        ]

    def ends(self):
        top, bottom = self.basis(MP.zero), self.basis(self.length)
        return MP.matrix([top[0], top[1], bottom[0], bottom[1]])

    def stiffness(self):
        """(4, 4) on w1, w1', w2, w2': shear T w' - EI w''' and moment EI w'' that the ends have to
        be held with."""
        rows = []
        for at, sign in ((MP.zero, -1), (self.length, 1)):
            _, one, two, three = self.basis(at)
            rows.append(
                [
                    sign * (self.tension * slope - self.rigidity * jerk)
                    for slope, jerk in zip(one, three, strict=True)
                ]
            )
            rows.append([sign * self.rigidity * bend for bend in two])
        return MP.matrix(rows) * self.ends() ** -1

    def carried(self):
        """(4, 4): w, w', shear and moment at the lower end from those at the upper end."""

        def states(x):
            w, one, two, three = self.basis(x)
            shear = [
                self.tension * slope - self.rigidity * jerk
                for slope, jerk in zip(one, three, strict=True)
            ]
            return MP.matrix([w, one, shear, [self.rigidity * bend for bend in two]])

        return states(self.length) * states(MP.zero) ** -1

    def squared(self, ends, order, start, stop):
        """Integral of the square of the modulus of a derivative of w, summed over products of
        exponentials."""
        f = self.ends() ** -1 * MP.matrix([number(value) for value in ends])
        terms = []
        for even, odd, wave in ((f[0], f[1], self.alpha), (f[2], f[3], 1j * self.beta)):
            terms += [
                (sign * wave, (even + sign * odd / wave) / 2 * (sign * wave) ** order)
                for sign in (1, -1)
            ]
        total = MP.zero
        for one, a in terms:
            for other, b in terms:
                s = one + MP.conj(other)
                total += (
                    a
                    * MP.conj(b)
                    * ((MP.exp(s * stop) - MP.exp(s * start)) / s if s else stop - start)
                )
        return total.real


def digits_for(rigidity, tension, mass, length, omega):
    """cosh and sinh of alpha L agree in 2 alpha L / ln 10 digits; stiff slow wires lose a few
    powers of (alpha L)^2."""
    square = abs(tension / rigidity) + np.sqrt(abs(mass / rigidity)) * abs(omega)
    turns = float(np.sqrt(square) * length)
    return int(DIGITS + 0.9 * turns + (6 * abs(np.log10(turns)) if turns > 0 else 0))


def bent(rigidity, tension, mass, length, omega, *, nudge=0):
    """Exact stiffness (4, 4) on w1, w1', w2, w2', at (1 + nudge) times a frequency."""
    with exact(digits_for(rigidity, tension, mass, length, omega)):
        return Bent(
            rigidity, tension, mass, length, number(omega) * (1 + MP.mpf(nudge))
        ).stiffness()


def even_odd(matrix):
    """A stiffness on w1, w1', w2, w2' on (W_s, T_s, W_a, T_a)."""
    with exact(4 * DIGITS):
        form = MP.matrix(ALIKE)
        return form.T * matrix * form


def doubles(matrix):
    return np.array(
        [[complex(matrix[i, j]) for j in range(matrix.cols)] for i in range(matrix.rows)]
    )


class Strained:
    """A rod S u'' + mu omega^2 u = 0 at one frequency; call within `exact()`."""

    def __init__(self, rigidity, mass, length, omega):
        self.rigidity, self.length = number(rigidity), number(length)
        self.wave = MP.sqrt(number(mass) * omega**2 / self.rigidity)

    def sine(self, x):
        return MP.sin(self.wave * x) / self.wave if self.wave else x

    def stiffness(self):
        """(2, 2) on u1, u2."""
        far, cos = self.sine(self.length), MP.cos(self.wave * self.length)
        return self.rigidity / far * MP.matrix([[cos, -1], [-1, cos]])


def transferred(sections, tension, omega):
    """Stiffness (4, 4) on w1, w1', w2, w2' of sections (EI, mass, length) one below the other, and
    the determinant that is 0 where the held whole resonates: by the product of their transfer
    matrices."""
    digits = 2 * DIGITS + sum(
        digits_for(rigidity, tension, mass, length, omega) - DIGITS
        for rigidity, mass, length in sections
    )
    with exact(digits):
        whole = MP.eye(4)
        for rigidity, mass, length in sections:
            whole = Bent(rigidity, tension, mass, length, number(omega)).carried() * whole
        moved, pulled = whole[:2, :2], whole[:2, 2:]
        inverse = pulled**-1
        result = MP.zeros(4)
        result[:2, :2], result[:2, 2:] = inverse * moved, -inverse
        result[2:, :2], result[2:, 2:] = (
            whole[2:, :2] - whole[2:, 2:] * inverse * moved,
            whole[2:, 2:] * inverse,
        )
        return result, MP.det(pulled)


def to_ends(even_odd):
    """A stiffness (4, 4, f) on even and odd motion, transformed to the two ends."""
    back = np.linalg.inv(np.array(ALIKE, dtype=float))
    return np.einsum("ki,klf,lj->ijf", back, even_odd, back)
