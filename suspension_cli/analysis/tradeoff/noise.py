"""Thermal noise by every rung and method."""

from __future__ import annotations

from typing import Any

import numpy as np

from suspension_cli.analysis import thermal
from suspension_cli.analysis.tradeoff import exact
from suspension_cli.analysis.tradeoff.subject import NOISE, Subject
from suspension_cli.design.scene import Array
from suspension_cli.mechanics import dispersive
from suspension_cli.mechanics.model import LinearModel

SWEEP = 500
"""Frequencies in a batch."""
BAND = (1.0, 1000.0)
"""Hz, over which they run."""


def unsuited(subject: Subject) -> str:
    """Why there is no thermal noise to compare; empty if there is."""
    if subject.top not in ("beam", "violin"):
        return f"no rung with losses as functions of frequency holds ({subject.unsuited['beam']})"
    return "" if reference(subject).all() else "nothing dissipates"


def warmth(subject: Subject) -> set[float]:
    """Temperatures (K) of all that dissipates in the motion."""
    model = subject.model(subject.top)
    _, row = thermal.observed(model, f"{subject.last}.x")
    found = set()
    for block in dispersive.blocks(model):
        if row[block.keep].any():
            still = np.zeros((len(block.keep), len(NOISE)))
            found |= {kelvin for _, kelvin in thermal.dissipated(block.at(2 * np.pi * np.array(NOISE)), still, subject.temperature)}
    return found


def one_temperature(subject: Subject) -> str:
    """Why the imaginary part of the susceptibility does not tell the noise; empty if it does."""
    return "" if warmth(subject) <= {subject.temperature} else "not all that dissipates has the temperature of [constants]"


def reference(subject: Subject) -> Any:
    """Amplitude spectral density (f,) on the top rung: the motion under a unit force in 50 digits, then what each part dissipates in it."""
    model = subject.model(subject.top)
    _, row = thermal.observed(model, f"{subject.last}.x")
    omega = 2 * np.pi * np.array(NOISE)
    density = np.zeros(len(omega))
    for block in dispersive.blocks(model):
        force = row[block.keep]
        if not force.any():
            continue
        there = block.at(omega)
        motion = np.stack([exact.pushed(there.matrix[:, 6:, n], force) for n in range(len(omega))], axis=-1)
        for (_, warmth), lost in thermal.dissipated(there, motion, subject.temperature).items():
            density += 4 * thermal.BOLTZMANN * warmth * lost / omega
    return np.sqrt(density)


def dissipation(model: LinearModel, frequency: Array, last: str, temperature: float) -> Any:
    """From the power that each part dissipates, by cause: what `pendsus thermal` does."""
    signal, row = thermal.observed(model, f"{last}.x")
    return thermal.solve(model, frequency, row, signal, temperature).amplitude


def susceptibility(model: LinearModel, frequency: Array, last: str, temperature: float) -> Any:
    """From the imaginary part of the susceptibility; what cancels to a negative density counts as none."""
    _, row = thermal.observed(model, f"{last}.x")
    return np.sqrt(np.maximum(thermal.susceptibility(model, frequency, row, temperature), 0.0))


def method(rung: str, solve: Any) -> tuple[Any, Any]:
    """A method from a rung's model on: for the frequencies compared, and for a batch of them."""

    def once(subject: Subject) -> Any:
        return solve(subject.fresh(rung), np.array(NOISE), subject.last, subject.temperature)

    def batch(subject: Subject) -> Any:
        frequency = np.geomspace(*BAND, SWEEP)
        return lambda: solve(subject.fresh(rung), frequency, subject.last, subject.temperature)

    return once, batch
