"""Poles and impulse responses of a linear system."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.files.declared import along, in_unit
from suspension_cli.linear import statespace

if TYPE_CHECKING:
    from jaxtyping import Complex, Float

ROUNDING = 1e-10
"""Real part of a pole, relative to its modulus, that may be a rounding error."""
NAMED = 0.2
"""Fraction of a pole's participation in mechanical states above which it is named after one."""


@dataclass(frozen=True)
class Poles:
    """Poles of a linear system, one of each conjugate pair, in ascending order of modulus.

    Attributes
    ----------
    value
        rad/s.
    state
        The state that participates most in each pole.
    """

    value: Complex[np.ndarray, " pole"] = field(metadata=in_unit("rad/s"))
    state: tuple[str, ...] = field(metadata=along("pole"))

    @property
    def frequency(self) -> Float[np.ndarray, " pole"]:
        """Moduli over 2 pi, Hz."""
        return np.abs(self.value) / (2 * np.pi)

    @property
    def growth_rate(self) -> Float[np.ndarray, " pole"]:
        """Growth rates, 1/s; 0 for a stable pole."""
        return np.maximum(np.real(self.value), 0.0)

    @property
    def stable(self) -> bool:
        """Whether no pole has a growth rate."""
        return not self.growth_rate.any()

    @property
    def q(self) -> Float[np.ndarray, " pole"]:
        """Q = |p| / (-2 Re p): infinite if undamped, 1/2 if real, negative if unstable."""
        rate = np.real(self.value)
        return np.where(rate == 0, np.inf, np.abs(self.value) / np.where(rate == 0, 1.0, -2 * rate))


def solve(
    system: statespace.StateSpace,
) -> tuple[Poles, Complex[np.ndarray, "output pole"]]:
    """Compute the poles of a state space, and the outputs in each.

    Real parts that may be rounding errors are 0. A pole is named after a filter's state only if
    mechanical ones have less than `NAMED` of its participation.
    """
    eigen: Any = np.linalg.eig(system.a)
    values, right = eigen.eigenvalues.astype(complex), eigen.eigenvectors
    participation = np.abs(right * np.linalg.pinv(right).T)
    upper_half = values.imag >= 0
    order = np.argsort(np.abs(values[upper_half]), kind="stable")
    mechanical = np.array([not name.startswith("loop ") for name in system.state])[:, None]
    mechanical_fraction = (participation * mechanical).sum(0) / participation.sum(0)
    participation = np.where(mechanical | (mechanical_fraction < NAMED), participation, 0.0)
    leading = participation[:, upper_half].argmax(0)[order]
    names = tuple(system.state[n].removesuffix(" rate") for n in leading)
    values, shapes = values[upper_half][order], (system.c @ right)[:, upper_half][:, order]
    steady = np.abs(np.real(values)) <= ROUNDING * np.abs(values)
    return Poles(np.where(steady, 1j * np.imag(values), values), names), shapes


def impulse(
    system: statespace.StateSpace, time: Float[np.ndarray, " time"]
) -> Float[np.ndarray, "time output input"]:
    """Compute the response to unit impulses at evenly spaced times in s.

    A unit impulse is 1 N s, 1 m s, etc. Each sample follows from the last by exp(A dt), exact for
    any step; the direct feed-through, a delta function at 0, is omitted.
    """
    from scipy.linalg import expm

    step = expm(system.a * (time[1] - time[0])) if len(time) > 1 else np.eye(len(system.a))
    x, result = expm(system.a * time[0]) @ system.b, []
    with np.errstate(over="ignore", invalid="ignore"):  # unstable systems overflow
        for _ in time:
            result.append(system.c @ x)
            x = step @ x
    return np.array(result)
