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
from suspension_cli.mechanics.condensed import Piece, prepared
from suspension_cli.mechanics.model import LinearModel
from suspension_cli.models import fidelity

SWEEP = 2000
"""Frequencies in a batch."""
BAND = (0.1, 1000.0)
"""Hz, over which they run."""


def band() -> Array:
    """The frequencies of a batch, rad/s."""
    return 2 * np.pi * np.geomspace(*BAND, SWEEP)


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
    return chain(treeless(model, row), omega, drive, row)


def treeless(model: LinearModel, row: Array) -> LinearModel:
    """A model that does not know which body hangs on which: its blocks (those that a linear form sees) are single nodes, which are solved densely."""
    bare = replace(model)
    vars(bare)["blocks"] = model.blocks  # worked out for both alike
    if model.terms:
        bare.prepared["dispersive"] = [replace(block, tree=_one_node(len(block.keep))) for block in dispersive.blocks(bare)]
        return bare
    for number, group in enumerate(bare.blocks):
        if not row[group].any():
            continue
        block = prepared(bare, number)
        own, support = (Piece(*(matrix[:, part] for matrix in (block.stiffness, block.mass, block.damping))) for part in (slice(6, None), slice(0, 6)))
        bare.prepared[number] = replace(block, tree=_one_node(len(block.keep)), own=(own,), link=(None,), support=(support,))
    return bare


def _one_node(size: int) -> elimination.Tree:
    return elimination.Tree((np.arange(size),), (-1,))


def modal_sum(model: LinearModel, omega: Array, drive: Array, row: Array) -> Any:
    """Sum over modes, phi (phi . f) / (omega_m^2 (1 + i / Q) - omega^2): right as far as damping does not couple them."""
    found = modes.solve(model)
    shapes = found.shape @ model.basis[6:, 6:]
    seen = shapes @ row[6:]
    some = seen != 0
    full = model.stiffness if model.lossy is None else model.lossy
    k, c, m = (-(shapes[some] @ (matrix[6:, :6] @ drive[:6])) * seen[some] for matrix in (full, model.damping, model.mass))
    loss = np.where(np.isfinite(found.q[some]), 1j / found.q[some], 0.0)
    poles = found.omega_squared[some] * ((1 + loss) if loss.any() else 1.0)
    square = omega[:, None] ** 2
    driven = k - square * m if m.any() else k
    if c.any():
        driven = driven + 1j * omega[:, None] * c
    return (driven / (poles - square)).sum(-1) + row[:6] @ drive[:6]


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


def on_rung(rung: str, solve: Any) -> tuple[Any, Any]:
    """A method from the design on: for the frequencies compared, and for a batch of them."""

    def once(subject: Subject) -> Any:
        model = fidelity.linear_model(subject.design, rung)
        return solve(model, subject.omega, *subject.forms(model))

    def batch(subject: Subject) -> Any:
        omega = band()

        def work() -> Any:
            model = fidelity.linear_model(subject.design, rung)
            return solve(model, omega, *subject.forms(model))

        return work

    return once, batch


def on_model(solve: Any) -> tuple[Any, Any]:
    """A method from the string rung's matrices on."""

    def once(subject: Subject) -> Any:
        model = subject.fresh("string")
        return solve(model, subject.omega, *subject.forms(model))

    def batch(subject: Subject) -> Any:
        omega = band()

        def work() -> Any:
            model = subject.fresh("string")
            return solve(model, omega, *subject.forms(model))

        return work

    return once, batch
