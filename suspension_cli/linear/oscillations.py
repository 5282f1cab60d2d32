"""Poles of a system whose stiffness depends on the frequency of oscillation.

>>> def poles_at(omega: float, share: float) -> Poles:
...     return np.array([1j * np.sqrt(4 + 0.2j * share * omega)]), np.ones((1, 1))
>>> find_oscillations(poles_at)[0].round(3)
array([-0.1+2.002j])

Loss angles and tables of stiffness are known for oscillations alone: a pole s has the stiffness at
omega = Im s. With the stiffness at any fixed omega the system is an ordinary one, whose poles
s_j(omega) are eigenvalues of a matrix, none of which can be missed. Those of the system are where

    Im s_j(omega) = omega.

So the number of eigenvalues with Im s_j > omega, an integer, changes at each of them. Its changes
on a grid of omega are bisected (as the count of Wittrick and Williams is for wires with mass, see
`roots`). Two poles escape only if both are between two neighbours of the grid and the count rises
at one: where a stiffness changes by more than the square of the frequency, within `DECADE`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from jaxtyping import Complex

    Poles = tuple[Complex[np.ndarray, " pole"], Complex[np.ndarray, "pole coordinate"]]
    PolesAt = Callable[[float, float], Poles]
    """The poles with Im s > 0 and their shapes, with the stiffness at omega (rad/s) and a fraction
    of its losses."""

DECADE = 32
"""Frequencies per decade at which poles are counted."""
PROBES = np.geomspace(1e-5, 1e6, 67)
"""Frequencies (rad/s) of a first look at how far the poles are spread."""
CLOSE = 1e-3
"""Relative width of an interval from which on its pole is found by iteration."""
STEPS = 20
"""Most steps of this iteration."""
SETTLED = 1e-9
"""Relative step at which it ends: steps shrink by much, as losses change little with frequency."""
RESOLVED = 1e-14
"""Relative width of an interval that is not divided further."""
SHARES = np.linspace(1.0, 0.0, 17)
"""Fractions of the losses with which a strongly damped pole is followed to that without loss."""
REAL = 1e-9
"""Imaginary part of a pole, relative to its modulus, that may be a rounding error."""


@dataclass(frozen=True)
class _Counted:
    """The poles with the stiffness at one frequency."""

    omega: float
    value: Complex[np.ndarray, " pole"]
    motion: Complex[np.ndarray, "pole coordinate"]

    @property
    def above(self) -> int:
        """Number of poles that oscillate faster."""
        return int((np.imag(self.value) > self.omega).sum())

    def nearest(self, number: int) -> list[int]:
        """Poles whose frequencies of oscillation are nearest."""
        return np.argsort(np.abs(np.imag(self.value) - self.omega))[:number].tolist()


def find_oscillations(poles_at: PolesAt) -> Poles:
    """Find the poles that oscillate, with their shapes, from those at fixed frequencies."""

    def count(omega: float) -> _Counted:
        return _Counted(omega, *poles_at(omega, 1.0))

    spread = np.concatenate([np.imag(poles_at(omega, 1.0)[0]) for omega in PROBES])
    size = len(count(1.0).motion.T)
    if not len(spread):
        return np.zeros(0, dtype=complex), np.zeros((0, size), dtype=complex)
    low = 0.9 * float(spread.min())
    high = 1.1 * float(spread.max())
    low = max(low, PROBES[0] * min(high, 1.0))
    decades = max(np.log10(high / low), 0.1)
    grid = [count(omega) for omega in np.geomspace(low, high, int(DECADE * decades) + 2)]
    left = list(pairwise(grid))
    values: list[complex] = []
    motions: list[Complex[np.ndarray, " coordinate"]] = []
    while left:
        first, last = left.pop()
        changes = abs(first.above - last.above)
        if not changes:
            continue
        width = (last.omega - first.omega) / last.omega
        poles = [(complex(last.value[n]), last.motion[n]) for n in last.nearest(changes)]
        if RESOLVED < width <= CLOSE and changes == 1:
            poles = settle(poles_at, *poles[0])
            poles = [one for one in poles if first.omega <= one[0].imag <= last.omega]
        if width > CLOSE or len(poles) < changes or (changes > 1 and width > RESOLVED):
            middle = count((first.omega + last.omega) / 2)
            left += [(first, middle), (middle, last)]
            continue
        for value, motion in poles:
            if not _starts_real(poles_at, value.imag, value):
                values.append(value)
                motions.append(motion)
    order = np.argsort(np.abs(values), kind="stable")
    return np.array(values, dtype=complex)[order], np.array(motions).reshape(-1, size)[order]


def settle(
    poles_at: PolesAt, value: complex, motion: Complex[np.ndarray, " coordinate"]
) -> list[tuple[complex, Complex[np.ndarray, " coordinate"]]]:
    """Iterate to the pole near a value with the stiffness at its own frequency.

    Returns none, or one.
    """
    for _ in range(STEPS):
        last = value
        found, shapes = poles_at(last.imag, 1.0)
        if not len(found):
            break
        best = int(np.abs(found - last).argmin())
        value = complex(found[best])
        motion = shapes[best]
        if abs(value - last) <= SETTLED * abs(value):
            return [(value, motion)]
    return []


def _starts_real(poles_at: PolesAt, omega: float, value: complex) -> bool:
    """Whether a pole oscillates only because losses act on it: it is real without them."""
    if abs(value.real) < value.imag:
        return False
    for share in SHARES[1:]:
        found, _ = poles_at(omega, share)
        if not len(found):
            return True
        near = complex(found[np.abs(found - value).argmin()])
        if abs(near - value) > abs(value.imag) + abs(value) / len(SHARES):
            return True  # it has left the poles that oscillate
        value = near
    return value.imag <= REAL * abs(value)
