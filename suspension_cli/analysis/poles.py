"""Poles and impulse responses of a linear system."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from suspension_cli.analysis import statespace
from suspension_cli.design.scene import Array

ROUNDING = 1e-10
"""Real part of a pole, over its size, that may be a rounding error."""
NAMED = 0.2
"""Share of a pole's participation that mechanical states must have for it to be named after one of them."""


@dataclass(frozen=True)
class Poles:
    """Poles of a closed loop, one of each conjugate pair, ascending in frequency.

    Attributes
    ----------
    value : (p,) complex array
        rad/s.
    state : tuple of str
        The state that takes most part in each.
    rounding : float
        Real part, over the size, that may be a rounding error.
    """

    value: Any
    state: tuple[str, ...]
    rounding: float = 0.0

    @property
    def frequency(self) -> Array:
        """Modulus over 2 pi, Hz."""
        return np.abs(self.value) / (2 * np.pi)

    @property
    def growth_rate(self) -> Array:
        """1/s; 0 of a pole that does not grow."""
        return np.where(self.value.real > self.rounding * np.abs(self.value), self.value.real, 0.0)

    @property
    def stable(self) -> bool:
        """Whether no pole grows."""
        return not self.growth_rate.any()

    @property
    def q(self) -> Array:
        """|p| / (-2 Re p): infinite without damping, 1/2 for a real pole, negative for one that grows."""
        undamped = np.abs(self.value.real) <= self.rounding * np.abs(self.value)
        return np.where(undamped, np.inf, np.abs(self.value) / (-2 * np.where(undamped, 1.0, self.value.real)))


def poles(system: statespace.StateSpace) -> Poles:
    """Poles of a state space, and the state that each lives in (largest participation).

    A pole of which the mechanics holds a fifth is named after the mechanics, not after a filter.
    """
    found: Any = np.linalg.eig(system.a)
    values, right = found.eigenvalues.astype(complex), found.eigenvectors
    participation = np.abs(right * np.linalg.pinv(right).T)
    keep = values.imag >= 0
    order = np.argsort(np.abs(values[keep]), kind="stable")
    mechanical = np.array([not name.startswith("loop ") for name in system.state])[:, None]
    held = (participation * mechanical).sum(0) / participation.sum(0)
    participation = np.where(mechanical | (held < NAMED), participation, 0.0)
    lead = participation[:, keep].argmax(0)[order]
    return Poles(values[keep][order], tuple(system.state[n].removesuffix(" rate") for n in lead), ROUNDING)


def impulse(system: statespace.StateSpace, time: Array) -> Array:
    """Response (t, o, i) of a state space to unit impulses (1 N s, 1 m s, ...) at evenly spaced times in s.

    Steps of exp(A dt), so each sample is exact however long the step; a direct feed through is left out (it is a delta at 0).
    """
    from scipy.linalg import expm

    step = expm(system.a * (time[1] - time[0])) if len(time) > 1 else np.eye(len(system.a))
    x, result = expm(system.a * time[0]) @ system.b, []
    with np.errstate(over="ignore", invalid="ignore"):  # what grows without end
        for _ in time:
            result.append(system.c @ x)
            x = step @ x
    return np.array(result)
