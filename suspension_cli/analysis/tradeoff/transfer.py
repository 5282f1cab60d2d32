"""Responses by every rung and method."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from suspension_cli.analysis import export, modes, response, signals, statespace
from suspension_cli.analysis.tradeoff import exact
from suspension_cli.analysis.tradeoff.subject import Subject
from suspension_cli.design.scene import Array
from suspension_cli.mechanics import dispersive, elimination
from suspension_cli.mechanics.model import LinearModel
from suspension_cli.models import fidelity

SWEEP = 2000
"""Frequencies in a batch."""
BAND = (0.1, 1000.0)
"""Hz, over which they run."""


def reference(subject: Subject) -> Any:
    """The response on the top rung, its matrices solved in 50 digits."""
    model = subject.model(subject.top)
    return exact.response(model, subject.omega, *subject.forms(model))


def digits_reference(subject: Subject) -> Any:
    """The response of the string rung's matrices in 50 digits."""
    model = subject.model("string")
    return exact.response(model, subject.omega, *subject.forms(model))


def chain(model: LinearModel, omega: Array, drive: Array, row: Array) -> Any:
    """Eliminated body by body: what `pendsus response` does."""
    return response.transfer(model, omega, drive[None], [False], row[None])[0][:, 0, 0]


def dense(model: LinearModel, omega: Array, drive: Array, row: Array) -> Any:
    """One LAPACK solve a frequency on each block that is touched."""
    result = np.full(len(omega), row[:6] @ drive[:6], dtype=complex)
    for block in dispersive.blocks(model):
        seen, moves = row[block.keep], drive[:6, None]
        if seen.any() and block.pulled(moves):
            one_node = elimination.Tree((np.arange(len(block.keep)),), (-1,))
            result += seen @ replace(block, tree=one_node).at(omega).solve(moves, np.zeros((len(block.keep), 1)))[:, 0]
    return result


def modal_sum(model: LinearModel, omega: Array, drive: Array, row: Array) -> Any:
    """Sum over modes, phi (phi . f) / (omega_m^2 + i phi K'' phi + i omega phi C phi - omega^2): right as far as losses do not couple them."""
    found = modes.solve(model)
    shapes = found.shape @ model.basis[6:, 6:]
    seen = shapes @ row[6:]
    shapes, poles, seen = (values[seen != 0] for values in (shapes, found.omega_squared, seen))
    full = model.stiffness if model.lossy is None else model.lossy
    k, c, m = (-(shapes @ (matrix[6:, :6] @ drive[:6])) * seen for matrix in (full, model.damping, model.mass))
    loss, damping = ((shapes @ matrix[6:, 6:] * shapes).sum(-1) for matrix in (np.imag(full), model.damping))
    square = omega[:, None] ** 2
    driven, stiff = k - square * m if m.any() else k, (poles + 1j * loss if loss.any() else poles) - square
    if c.any():
        driven = driven + 1j * omega[:, None] * c
    if damping.any():
        stiff = stiff + 1j * omega[:, None] * damping
    return (driven / stiff).sum(-1) + row[:6] @ drive[:6]


def state_space(model: LinearModel, omega: Array, drive: Array, row: Array) -> Any:
    """C (i omega - A)^-1 B + D, A balanced."""
    return _system(model, drive, row).at(omega / (2 * np.pi))[:, 0, 0]


def zeros_and_poles(model: LinearModel, omega: Array, drive: Array, row: Array) -> Any:
    """Gain times the product over zeros and poles."""
    return export.zero_pole_gain(_system(model, drive, row)).at(omega / (2 * np.pi))[:, 0, 0]


def _system(model: LinearModel, drive: Array, row: Array) -> statespace.StateSpace:
    known = signals.bodies(model)
    into, out = signals.drive("support.x", known), signals.motion(f"{model.body[-1]}.x", known)
    return statespace.assemble(model, drive[None], [into], row[None], [out])


def on_rung(rung: str) -> tuple[Any, Any]:
    """What `pendsus response` does, from the design on: at the frequencies compared, and over a band."""
    return _timed(lambda subject: fidelity.linear_model(subject.design, rung), chain)


def on_matrices(solve: Any) -> tuple[Any, Any]:
    """A method from the string rung's matrices on."""
    return _timed(lambda subject: subject.fresh("string"), solve)


def on_kept_model(solve: Any) -> tuple[Any, Any]:
    """The same when the model has answered before and kept what it prepared."""
    return _timed(lambda subject: subject.model("string"), solve)


def _timed(model_of: Any, solve: Any) -> tuple[Any, Any]:
    def at(subject: Subject, omega: Array) -> Any:
        model = model_of(subject)
        return solve(model, omega, *subject.forms(model))

    omega = 2 * np.pi * np.geomspace(*BAND, SWEEP)
    return (lambda subject: at(subject, subject.omega)), (lambda subject: lambda: at(subject, omega))
