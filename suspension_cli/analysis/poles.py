"""Poles, stability margins and impulse responses of a linear system."""

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


@dataclass(frozen=True)
class Margins:
    """How far a loop is from instability, broken at its actuator with the others closed.

    Attributes
    ----------
    phase : float
        Smallest at any unity-gain frequency, degrees; inf if the gain never reaches 1.
    phase_frequency : float
        Hz; NaN if there is none.
    gain_up, gain_down : float
        Factors by which the gain may grow or shrink (of 1 + L = 0 at phase -180): inf and 0 without limit.
    distance : float
        Smallest |1 + L|.
    """

    phase: float
    phase_frequency: float
    gain_up: float
    gain_down: float
    distance: float


def margins(frequency: Array, gain: Any) -> Margins:
    """Margins of a loop gain L (f,) sampled on a fine grid; crossings are interpolated in the logarithm of frequency."""
    logf, size, angle = np.log(frequency), np.log(np.maximum(np.abs(gain), np.finfo(float).tiny)), np.unwrap(np.angle(gain))
    unity = _crossings(logf, size)
    lag = np.interp(unity, logf, angle)
    phases = np.abs(np.degrees((lag + np.pi + np.pi) % (2 * np.pi) - np.pi))
    turns = np.concatenate([_crossings(logf, angle - np.pi * k) for k in np.arange(2 * np.floor(angle.min() / (2 * np.pi)) - 1, angle.max() / np.pi + 1, 2)])
    gains = np.exp(-np.interp(turns, logf, size))
    where = int(phases.argmin()) if len(phases) else 0
    return Margins(
        phase=float(phases[where]) if len(phases) else np.inf,
        phase_frequency=float(np.exp(unity[where])) if len(phases) else np.nan,
        gain_up=float(gains[gains > 1].min(initial=np.inf)),
        gain_down=float(gains[gains < 1].max(initial=0.0)),
        distance=float(np.abs(1 + gain).min()),
    )


def _crossings(x: Array, y: Array) -> Array:
    """Where y changes sign, linearly interpolated."""
    at = np.flatnonzero(np.sign(y[:-1]) * np.sign(y[1:]) < 0)
    return x[at] - y[at] * (x[at + 1] - x[at]) / (y[at + 1] - y[at])


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
