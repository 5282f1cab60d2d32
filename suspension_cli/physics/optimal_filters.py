"""Filters, as zeros and poles, of regulators on observers (see `optimal_loops`)."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.design.foton import Filter
from suspension_cli.physics.modal_plants import ScaledPlant
from suspension_cli.physics.riccati_equations import RiccatiSolutions

if TYPE_CHECKING:
    from jaxtyping import Complex, Float


DIGITS = 9
"""Significant digits of zeros and poles."""


def both_of_pairs(roots: list[complex]) -> tuple[complex, ...]:
    """Both roots of each pair."""
    pairs = ((root, root.conjugate()) if root.imag else (root,) for root in roots)
    return tuple(root for pair in pairs for root in pair)


def make_filter(
    plant: ScaledPlant, solution: RiccatiSolutions, weights: tuple[float, float], roll_off: float
) -> Filter | None:
    """Make the filter of a regulator on an observer; None if it is unstable itself."""
    bound = solution.bound
    feedback = solution.x @ plant.b / weights[0]
    rise = np.eye(len(plant.a)) - solution.y @ solution.x / bound**2
    gain = np.linalg.solve(rise, solution.y @ plant.c / weights[1])
    a = plant.a + solution.x / bound**2
    a = a - np.outer(plant.b, feedback) - np.outer(gain, plant.c)
    poles = np.linalg.eigvals(a)
    if not (np.real(poles) < 0).all():
        return None
    # the poles of the roll-off, which the filter has in series, are zeros of the rest
    hertz = 1 / (2 * np.pi * plant.unit)
    corner = roll_off * np.exp(0.25j * np.pi)
    zeros = -_find_zeros(a, gain, feedback) * hertz
    off = np.minimum(np.abs(zeros - corner), np.abs(zeros - corner.conjugate()))
    zeros = zeros[np.argsort(off)[2:]]
    bare = Filter(1.0, _rounded(zeros), _rounded(-poles * hertz))
    # the gain is that of the matrices, at a frequency amid the modes
    at = hertz
    value = feedback @ np.linalg.solve(1j * np.eye(len(a)) - a, gain.astype(complex))
    low_pass = 1 / (1 + np.sqrt(2) * 1j * at / roll_off - (at / roll_off) ** 2)
    size = value * low_pass / plant.gain / bare.at(at)
    return replace(bare, gain=float(np.real(size)))


def _find_zeros(
    a: Float[np.ndarray, "state state"],
    b: Float[np.ndarray, " state"],
    c: Float[np.ndarray, " state"],
) -> Complex[np.ndarray, " zero"]:
    """Find the finite zeros of c (s - a)^-1 b: eigenvalues of a pencil."""
    from scipy.linalg import eig

    count = len(a)
    pencil = np.zeros((count + 1, count + 1))
    pencil[:count, :count] = a
    pencil[:count, count] = b
    pencil[count, :count] = c
    mass = np.diag([*np.ones(count), 0.0])
    found: Any = eig(pencil, mass, right=False, homogeneous_eigvals=True)
    over, under = found
    finite = np.argsort(-np.abs(under) / np.hypot(np.abs(over), np.abs(under)))[: count - 1]
    return over[finite] / under[finite]


def _rounded(roots: Complex[np.ndarray, " root"]) -> tuple[complex, ...]:
    """Round roots in Hz, conjugate pairs exactly conjugate."""
    rounded = [
        complex(*(float(f"{part:.{DIGITS}g}") for part in (root.real, root.imag)))
        for root in roots
        if root.imag >= 0
    ]
    return both_of_pairs(rounded)
