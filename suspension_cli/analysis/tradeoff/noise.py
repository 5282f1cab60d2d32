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
from suspension_cli.models import fidelity

SWEEP = 500
"""Frequencies in a batch."""
BAND = (1.0, 1000.0)
"""Hz, over which they run."""


PLACED = ("beam", "violin")
"""Rungs that know where along a wire its loss sits."""


def placeless(rung: str) -> Any:
    """What tells why a rung has no thermal noise; empty if it has."""
    return lambda _: "" if rung in PLACED else "it does not know where along a wire its loss sits"


def unsuited(subject: Subject) -> str:
    """Why there is no thermal noise to compare; empty if there is."""
    if subject.top not in PLACED:
        return f"no rung that knows where loss sits holds: {subject.unsuited['beam']}"
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


def dissipation(model: LinearModel, frequency: Array, subject: Subject) -> Any:
    """From the power that each part dissipates, by cause: what `pendsus thermal` does."""
    signal, row = thermal.observed(model, f"{subject.last}.x")
    return thermal.solve(model, frequency, row, signal, subject.temperature).amplitude


def susceptibility(model: LinearModel, frequency: Array, subject: Subject) -> Any:
    """From the imaginary part of the susceptibility; what cancels to a negative density counts as none."""
    _, row = thermal.observed(model, f"{subject.last}.x")
    return np.sqrt(np.maximum(thermal.susceptibility(model, frequency, row, subject.temperature), 0.0))


def on_rung(rung: str) -> tuple[Any, Any]:
    """What `pendsus thermal` does, from the design on: at the frequencies compared, and over a band."""
    return _timed(lambda subject: fidelity.linear_model(subject.design, rung), dissipation)


def on_matrices(solve: Any) -> tuple[Any, Any]:
    """A method from the top rung's matrices on."""
    return _timed(lambda subject: subject.fresh(subject.top), solve)


def _timed(model_of: Any, solve: Any) -> tuple[Any, Any]:
    few, many = np.array(NOISE), np.geomspace(*BAND, SWEEP)
    return (lambda subject: solve(model_of(subject), few, subject)), (lambda subject: lambda: solve(model_of(subject), many, subject))
