"""Thermal noise by every model and method."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.thermal import solve as thermal
from suspension_cli.analyses.tradeoff import high_precision
from suspension_cli.analyses.tradeoff.comparison import Batch, Once
from suspension_cli.analyses.tradeoff.subject import NOISE, Subject
from suspension_cli.linear.pencil import Pencil
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import registry
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Float

Solve = Callable[[LinearSystem, Array, Subject], np.ndarray]
"""Thermal noise (f,) of a model at frequencies (f,) in Hz."""
SWEEP = 500
"""Frequencies per batch."""
BAND = (1.0, 1000.0)
"""Range of these frequencies, Hz."""
OMEGA = 2 * np.pi * np.array(NOISE)


LOCALISED = tuple(model.name for model in registry.MODELS if model.bends_wires)
"""Models in which losses act where wires bend."""


def not_localised(level: str) -> Callable[[Subject], str]:
    """Return a function: why a model has no thermal noise; "" if it has."""
    return lambda _: "" if level in LOCALISED else "the model does not localise loss along a wire"


def unsuited(subject: Subject) -> str:
    """Return why there is no thermal noise to compare; "" if there is."""
    if subject.top not in LOCALISED:
        return f"no model that localises loss is valid: {subject.unsuited[LOCALISED[0]]}"
    return "" if reference(subject).all() else "nothing dissipates"


def temperatures(subject: Subject) -> set[float]:
    """Find the temperatures (K) of all lossy parts."""
    model = subject.model(subject.top)
    _, row = thermal.parse_motion(model, f"{subject.last}.x")
    found, pencil = set(), Pencil.of(model)
    there = pencil.at(OMEGA)
    for block in pencil.blocks:
        if row[block.keep].any():
            still = np.zeros((len(block.keep), len(NOISE)))
            powers = thermal.compute_dissipation(block.at(there), still, subject.temperature)
            found |= {kelvin for _, kelvin in powers}
    return found


def one_temperature(subject: Subject) -> str:
    """Return why the susceptibility alone does not give the noise; "" if it does."""
    common = temperatures(subject) <= {subject.temperature}
    return "" if common else "some lossy part does not have the temperature of [constants]"


def reference(subject: Subject) -> Float[np.ndarray, " frequency"]:
    """Compute the amplitude spectral density, m/sqrt(Hz), of the most complete valid model.

    It follows from the power dissipated in each part under a unit force, with motions in 50 digits.
    """
    model = subject.model(subject.top)
    _, row = thermal.parse_motion(model, f"{subject.last}.x")
    density, pencil = np.zeros(len(OMEGA)), Pencil.of(model)
    there = pencil.at(OMEGA)
    for block in pencil.blocks:
        force = row[block.keep]
        if not force.any():
            continue
        here = block.at(there)
        dynamic = np.moveaxis(here.matrix[:, 6:], -1, 0)
        motion = np.stack([high_precision.driven_motion(d, force) for d in dynamic], axis=-1)
        powers = thermal.compute_dissipation(here, motion, subject.temperature)
        for (_, kelvin), power in powers.items():
            density += 4 * thermal.BOLTZMANN * kelvin * power / OMEGA
    return np.sqrt(density)


def dissipation(
    model: LinearSystem, frequency: Float[np.ndarray, " frequency"], subject: Subject
) -> Float[np.ndarray, " frequency"]:
    """Compute the noise from the power dissipated in each part, as in `pendsus thermal`."""
    signal, row = thermal.parse_motion(model, f"{subject.last}.x")
    return thermal.solve(model, frequency, row, signal, subject.temperature).amplitude


def susceptibility(
    model: LinearSystem, frequency: Float[np.ndarray, " frequency"], subject: Subject
) -> Float[np.ndarray, " frequency"]:
    """Compute the noise from the imaginary part of the susceptibility; 0 if negative."""
    _, row = thermal.parse_motion(model, f"{subject.last}.x")
    density = thermal.compute_from_susceptibility(model, frequency, row, subject.temperature)
    return np.sqrt(np.maximum(density, 0.0))


def with_model(level: str) -> tuple[Once, Batch]:
    """Return `dissipation`, timed from the design on: at `NOISE`, and for a batch."""
    return _timed(lambda subject: registry.by_name(level).system(subject.design), dissipation)


def on_matrices(solve: Solve) -> tuple[Once, Batch]:
    """Return a method, timed from the matrices of the most complete valid model on."""
    return _timed(lambda subject: subject.fresh(subject.top), solve)


def _timed(model_of: Callable[[Subject], LinearSystem], solve: Solve) -> tuple[Once, Batch]:
    few, many = np.array(NOISE), np.geomspace(*BAND, SWEEP)
    return (lambda subject: solve(model_of(subject), few, subject)), (
        lambda subject: lambda: solve(model_of(subject), many, subject)
    )
