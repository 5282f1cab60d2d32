"""Compare the modes of random suspended cavities with eigenvalues of matrices of our own.

Two mirrors on springs hold an optical cavity; power, detuning, pole, curvatures, masses, dampers,
loss angles and tables of stiffness are random. The matrices are written here from the numbers of
the design: bodies at the places of their centres of mass, springs and dampers diagonal, the light
as in Sidles and Sigg (Phys. Lett. A 354, 167 (2006)) and, with two states, as in Corbitt et al.
(Phys. Rev. Lett. 98, 150802 (2007)). Nothing is shared with the program but the TOML text.

Run as `python -m tools.cavity_survey [COUNT]`: it lists each design whose modes disagree by more
than 1e-6, and says how many agree and how many were refused. A few of them are in
tests/linear/test_poles.py.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.constants import c
from scipy.optimize import brentq, linear_sum_assignment
from scipy.sparse.csgraph import connected_components

import suspension_cli as sus
from suspension_cli.errors import InputError

DOFS = ("x", "y", "z", "roll", "pitch", "yaw")
GRAVITY = 9.81
WAVELENGTH = 1064e-9
AGREES = 1e-6
"""Relative distance of poles that agree."""
REAL = 1e-8
"""Imaginary part, relative to the modulus, that may be a rounding error."""
GRID = 1500
"""Frequencies between which the frequency of an oscillation is bracketed."""


@dataclass(frozen=True)
class Table:
    """Stiffness of one axis between two bodies (-1: the support) against frequency."""

    ends: tuple[int, int]
    axis: int
    frequency: np.ndarray
    real: np.ndarray
    imaginary: np.ndarray

    def at(self, omega: float) -> complex:
        """Evaluate at a frequency in rad/s: linear in its logarithm, constant outside."""
        place = np.log(max(omega, 1e-30) / (2 * np.pi))
        known = np.log(self.frequency)
        parts = [np.interp(place, known, part) for part in (self.real, self.imaginary)]
        return complex(*parts)


@dataclass
class Cavity:
    """Numbers of one design."""

    mass: list[float]
    inertia: list[list[float]]
    stiffness: list[list[float]]
    loss: list[float]
    length: float
    radii: list[float]
    power: float
    pole: float
    detuning: float
    dampers: list[tuple[tuple[int, int], int, float]] = field(default_factory=list)
    tables: list[Table] = field(default_factory=list)

    @property
    def text(self) -> str:
        """The design file."""
        names = ("itm", "etm", "support")
        lines = ['[design]\nname = "survey"']
        for n in range(2):
            weight = [0.0, 0.0, GRAVITY * self.mass[n], 0.0, 0.0, 0.0]
            lines.append(
                f'[[stage]]\nname = "{names[n]}"\nhangs_from = "support"\n'
                f"position = [{float(n)}, 0.0, -0.5]\n"
                f"body = {{ mass = {self.mass[n]}, inertia = {self.inertia[n]} }}\n"
                f"[[stage.spring]]\nstiffness = {self.stiffness[n]}\npreload = {weight}\n"
                f"loss_angle = {self.loss[n]}"
            )
        for number, (ends, axis, rate) in enumerate(self.dampers):
            row = [0.0] * 6
            row[axis] = rate
            between = [names[end] for end in ends]
            lines.append(f'[[damper]]\nname = "d{number}"\nbetween = {between}\ndamping = {row}')
        for number, table in enumerate(self.tables):
            lines.append(
                f'[[link]]\nname = "t{number}"\nbetween = {[names[end] for end in table.ends]}\n'
                f'[link.table]\naxis = "{DOFS[table.axis]}"\n'
                f"frequency = {table.frequency.tolist()}\nreal = [{table.real.tolist()}]\n"
                f"imaginary = [{table.imaginary.tolist()}]"
            )
        lines.append(
            f'[[cavity]]\nname = "arm"\nbetween = ["itm", "etm"]\nlength = {self.length}\n'
            f"radii = {self.radii}\npower = {self.power}\npole = {self.pole}\n"
            f"detuning = {self.detuning}"
        )
        return "\n".join(lines).replace("'", '"')

    @property
    def inertias(self) -> np.ndarray:
        """Mass matrix, of both bodies."""
        bodies = [[m] * 3 + i for m, i in zip(self.mass, self.inertia, strict=True)]
        return np.diag(np.concatenate(bodies))

    @property
    def damping(self) -> np.ndarray:
        """Damping matrix."""
        result = np.zeros((12, 12))
        for ends, axis, rate in self.dampers:
            result += rate * between(ends, axis)
        return result

    def elastic(self, omega: float, share: float) -> np.ndarray:
        """Complex stiffness of springs, tables and constant light, with a share of the losses."""
        springs = [
            np.array(k) * (1 + 1j * share * phi)
            for k, phi in zip(self.stiffness, self.loss, strict=True)
        ]
        result = np.diag(np.concatenate(springs))
        for table in self.tables:
            value = table.at(omega)
            result += (value.real + 1j * share * value.imag) * between(table.ends, table.axis)
        g, h = (1 - self.length / radius for radius in self.radii)
        a, b = (1 / radius for radius in self.radii)
        unit = 2 * self.power / c * self.length / (1 - g * h)
        shape = unit * np.array(
            [
                [a * b, -a * b, b, a],
                [-a * b, a * b, -b, -a],
                [b, -b, -h, 1],
                [a, -a, 1, -g],
            ]
        )
        for shift, turn, sign in ((1, 5, 1), (2, 4, -1)):
            place = [shift, 6 + shift, turn, 6 + turn]
            signs = np.array([1, 1, sign, sign])
            result[np.ix_(place, place)] += shape * np.outer(signs, signs)
        return result

    def companion(self, omega: float, share: float) -> np.ndarray:
        """Matrix of x, v and the two states of the light, with the stiffness at a frequency."""
        gamma, delta = 2 * np.pi * self.pole, 2 * np.pi * self.detuning
        size = 26
        result = np.zeros((size, size), dtype=complex)
        masses = np.diag(self.inertias)[:, None]
        result[:12, 12:24] = np.eye(12)
        result[12:24, :12] = -self.elastic(omega, share) / masses
        result[12:24, 12:24] = -self.damping / masses
        # (p + i q)' = (-gamma + i delta) (p + i q) + i l, l the length, so that
        strength = 8 * np.pi * self.power / (WAVELENGTH * self.length)
        # p = -delta l / ((s + gamma)^2 + delta^2), and strength p is the force -K l on the length
        result[24, 24:] = [-gamma, -delta]
        result[25, 24:] = [delta, -gamma]
        result[25, [0, 6]] = [-1.0, 1.0]
        result[12, 24] = -strength / self.mass[0]
        result[18, 24] = strength / self.mass[1]
        return result

    @cached_property
    def groups(self) -> list[np.ndarray]:
        """States that couple to no others."""
        pattern = np.abs(self.companion(1.0, 1.0)) > 0
        count, label = connected_components(pattern, directed=False)
        return [np.flatnonzero(label == n) for n in range(count)]

    def eigenvalues(self, omega: float, share: float, group: np.ndarray) -> np.ndarray:
        """Eigenvalues of a group of states with the stiffness at a frequency."""
        return np.linalg.eigvals(self.companion(omega, share)[np.ix_(group, group)])

    @property
    def poles(self) -> np.ndarray:
        """All poles with Im s >= 0: those that oscillate have the stiffness at Im s."""
        return np.concatenate([self.poles_of(group) for group in self.groups])

    def poles_of(self, group: np.ndarray) -> np.ndarray:
        """Poles with Im s >= 0 of a group of states."""
        still = self.eigenvalues(0.0, 0.0, group)
        real = np.real(still[np.abs(still.imag) < REAL * np.abs(still)]) + 0j
        found: list[complex] = []
        grid = np.geomspace(1e-3, 1.5 * np.abs(self.eigenvalues(1e3, 1.0, group)).max(), GRID)
        if not self.tables:  # constant, but for the losses
            every = self.eigenvalues(1.0, 1.0, group)
            found = every[every.imag > REAL * np.abs(every)].tolist()
        else:
            for branch in self.followed(grid, group).T:
                off = branch.imag - grid
                for n in np.flatnonzero(np.sign(off[1:]) != np.sign(off[:-1])):
                    found += self.refined(branch[n], grid[n], grid[n + 1], group)
        oscillates = [s for s in found if not self.starts_real(s, group)]
        return np.append(real, np.array(oscillates, dtype=complex))

    def followed(self, grid: np.ndarray, group: np.ndarray) -> np.ndarray:
        """Eigenvalues at all frequencies, each next to the nearest before."""
        own = np.ix_(group, group)
        every = np.linalg.eigvals(np.array([self.companion(omega, 1.0)[own] for omega in grid]))
        for last, found in pairwise(every):
            apart = np.abs(last[:, None] - found) / (np.abs(found) + 1e-3)
            found[:] = found[linear_sum_assignment(apart)[1]]
        return every

    def refined(self, start: complex, low: float, high: float, group: np.ndarray) -> list[complex]:
        """The pole of one branch in an interval of frequencies."""

        def near(omega: float) -> complex:
            found = self.eigenvalues(omega, 1.0, group)
            return complex(found[np.abs(found - start).argmin()])

        def off(omega: float) -> float:
            return near(omega).imag - omega

        if off(low) * off(high) > 0:
            return []
        return [near(float(brentq(off, low, high, xtol=1e-13, rtol=1e-14)))]

    def starts_real(self, s: complex, group: np.ndarray) -> bool:
        """Whether a pole does not oscillate without losses."""
        if s.imag > abs(s.real):
            return False
        now = s
        for share in np.linspace(1, 0, 100)[1:]:
            found = self.eigenvalues(s.imag, share, group)
            now = complex(found[np.abs(found - now).argmin()])
        return abs(now.imag) < REAL * abs(now)


def between(ends: tuple[int, int], axis: int) -> np.ndarray:
    """Square of the relative motion of two bodies on one axis at their common point."""
    row = np.zeros(12)
    for end, sign in zip(ends, (1.0, -1.0), strict=True):
        if end >= 0:
            row[6 * end + axis] = sign
    return np.outer(row, row)


def draw(seed: int) -> Cavity:
    """Draw one design at random."""
    rng = np.random.default_rng(seed)

    def between_(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    mass = [between_(0.5, 100.0) for _ in range(2)]
    inertia = [[between_(0.02, 0.05) * m] * 3 for m in mass]
    stiffness = [
        [m * (2 * np.pi * between_(0.4, 1.5)) ** 2 for _ in range(2)]
        + [m * (2 * np.pi * between_(3.0, 10.0)) ** 2]
        + [i[0] * (2 * np.pi * between_(0.5, 8.0)) ** 2 for _ in range(3)]
        for m, i in zip(mass, inertia, strict=True)
    ]
    length = between_(1.0, 4e3)
    radii = [length * between_(0.6, 20.0) for _ in range(2)]
    while not 0 <= (1 - length / radii[0]) * (1 - length / radii[1]) < 0.95:
        radii = [length * between_(0.6, 20.0) for _ in range(2)]
    pole = between_(1.0, 300.0)
    result = Cavity(
        mass,
        inertia,
        stiffness,
        [float(rng.choice([0.0, between_(1e-6, 0.1)])) for _ in range(2)],
        length,
        radii,
        between_(1.0, 1e6) * length / 4e3,
        pole,
        float(rng.choice([-1.0, 1.0, 1.0])) * pole * between_(1e-4, 3.0),
    )
    for _ in range(rng.integers(0, 3)):
        ends = [(0, -1), (1, -1), (1, 0)][rng.integers(3)]
        # at the common point of both bodies only x does not turn them
        axis = 0 if ends == (1, 0) else int(rng.integers(0, 6))
        scale = (mass if axis < 3 else [i[0] for i in inertia])[max(ends)]
        result.dampers.append((ends, axis, between_(1e-3, 1e3) * scale))
    for _ in range(rng.integers(0, 3)):
        body = int(rng.integers(0, 2))
        axis = int(rng.integers(0, 6))
        low = stiffness[body][axis] * between_(1e-3, 1.0)
        steps = np.exp(rng.uniform(0.0, 1.5, 4))
        real = low * np.cumprod(np.append(1.0, steps))
        result.tables.append(
            Table(
                (body, -1),
                axis,
                np.geomspace(0.03, 100.0, 5),
                real,
                real * between_(1e-4, 0.1),
            )
        )
    return result


def found_poles(modes: sus.Modes) -> np.ndarray:
    """Poles of the listed modes, with Im s >= 0."""
    squared, rate = modes.omega_squared, -modes.decay_rate
    oscillates = squared > 0
    omega = np.sqrt(np.where(oscillates, np.maximum(squared - rate**2, 0.0), 0.0))
    still = np.where(squared < 0, modes.growth_rate, rate)
    return np.where(oscillates, rate + 1j * omega, still)


def compare(cavity: Cavity) -> str:
    """Compare the modes of one design: "" if they agree, else how they differ."""
    try:
        found = found_poles(sus.modes(sus.parse(cavity.text), fidelity="string"))
    except InputError as error:
        return f"refused: {error}"
    expected, left = cavity.poles, found.tolist()
    missing: list[complex] = []
    for s in expected.tolist():
        near = min(left, key=lambda other: abs(other - s), default=None)
        if near is not None and abs(near - s) <= AGREES * abs(s):
            left.remove(near)
        else:
            missing.append(s)
    # of a mode of an unstable equilibrium the decaying pole is not listed
    for _ in range(int((np.linalg.eigvalsh(static(cavity)) < 0).sum())):
        decaying = [s for s in missing if s.imag == 0 and s.real < 0]
        if decaying:
            missing.remove(decaying[0])
    if not missing and not left:
        return ""
    return f"missing {np.array(missing)}, not poles {np.array(left)}"


def static(cavity: Cavity) -> np.ndarray:
    """Static stiffness."""
    gamma, delta = 2 * np.pi * cavity.pole, 2 * np.pi * cavity.detuning
    strength = 8 * np.pi * cavity.power / (WAVELENGTH * cavity.length)
    spring = strength * delta / (gamma**2 + delta**2)
    return np.real(cavity.elastic(0.0, 0.0)) + spring * between((1, 0), 0)


def main(count: int = 500) -> None:
    """Compare the modes of many designs."""
    good, refused = 0, 0
    for seed in range(count):
        told = compare(draw(seed))
        good += not told
        refused += told.startswith("refused")
        if told:
            print(f"{seed}: {told}")
    print(f"{good} of {count} agree within {AGREES:g}, {refused} are refused")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
