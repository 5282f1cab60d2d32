"""Eigenvalues of the string model by every numerical method."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.tradeoff import eigenmodes_compared, high_precision
from suspension_cli.analyses.tradeoff.comparison import Batch
from suspension_cli.analyses.tradeoff.subject import STRING, Subject
from suspension_cli.conventions import DOFS
from suspension_cli.linear import batch_modes, eigenmodes, mode_count, signals, statespace
from suspension_cli.linear.system import LinearSystem

if TYPE_CHECKING:
    from jaxtyping import Float


def reference(subject: Subject) -> eigenmodes_compared.Reference:
    """Compute the modes of the string model, with eigenvalues in 50 digits."""
    model = subject.model(STRING)
    found = eigenmodes.solve(model)
    return eigenmodes_compared.Reference(
        eigenmodes_compared.signed_frequency(high_precision.omega_squared(model)),
        eigenmodes_compared.mode_kinds(found),
        found.shape,
    )


def error(
    _: Subject, found: Float[np.ndarray, " mode"], wanted: eigenmodes_compared.Reference
) -> dict[str, float]:
    """Compute the largest relative error of the frequencies of each kind, paired by rank."""
    ours = np.sort(eigenmodes_compared.signed_frequency(found))
    off = {
        kind: [n for n, name in enumerate(wanted.kind) if name == kind and wanted.frequency[n] != 0]
        for kind in eigenmodes_compared.KINDS
    }
    return {
        kind: max((abs(ours[n] / wanted.frequency[n] - 1) for n in places), default=0.0)
        for kind, places in off.items()
    }


def by_block(subject: Subject) -> Float[np.ndarray, " mode"]:
    """Solve for omega^2 block by block, as in `pendsus modes`."""
    return eigenmodes.solve(subject.fresh(STRING)).omega_squared


def whole(subject: Subject) -> Float[np.ndarray, " mode"]:
    """Solve for omega^2 as in `by_block`, with all coordinates in one block."""
    model = subject.fresh(STRING)
    # overrides the cached property
    vars(model)["blocks"] = (np.arange(6, model.size),)
    return eigenmodes.solve(model).omega_squared


def symmetric(subject: Subject) -> Float[np.ndarray, " mode"]:
    """Solve for omega^2 as eigenvalues of M^(-1/2) K M^(-1/2), by LAPACK."""
    return np.linalg.eigvalsh(_scaled(subject.fresh(STRING)))


def unsymmetric(subject: Subject) -> Float[np.ndarray, " mode"]:
    """Solve for omega^2 as eigenvalues of M^-1 K, by LAPACK."""
    return _unsymmetric(subject.fresh(STRING))


def poles(subject: Subject) -> Float[np.ndarray, " mode"]:
    """Solve for omega^2 from the poles of the state space."""
    model = subject.fresh(STRING)
    known = signals.bodies_with_signals(model)
    inputs = [signals.parse_input(f"support.{dof}", known) for dof in DOFS]
    outputs = [signals.parse_output(f"{body}.{dof}", known) for body in model.body for dof in DOFS]
    drives, rows = (
        np.array([signals.linear_form(signal, model) for signal in group])
        for group in (inputs, outputs)
    )
    values = np.linalg.eigvals(
        statespace.assemble(model, drives, inputs, rows, outputs, undriven=True).a
    )
    squares = np.sort(-(values**2).real)
    return (squares[::2] + squares[1::2]) / 2  # each mode has two poles


def bisected(subject: Subject) -> Float[np.ndarray, " mode"]:
    """Solve for omega^2 by counting modes and bisection, as in the violin model."""
    model = subject.fresh(STRING)
    found = eigenmodes.solve(model).omega_squared
    omega, ratio = np.sqrt(found[found > 0]), eigenmodes_compared.HIGHEST
    counted = mode_count.frequencies(model, ratio * float(omega[-1]), float(omega[0]) / ratio)
    return np.concatenate([found[found <= 0], counted**2])


def _scaled(model: LinearSystem) -> Float[np.ndarray, "*batch mode mode"]:
    """Compute M^(-1/2) K M^(-1/2)."""
    _, mass, stiffness, _ = eigenmodes.condense_block(model, np.arange(6, model.size))
    inverse = np.linalg.inv(np.linalg.cholesky(mass))
    dynamic = inverse @ stiffness @ np.swapaxes(inverse, -1, -2)
    return (dynamic + np.swapaxes(dynamic, -1, -2)) / 2


def _unsymmetric(model: LinearSystem) -> Float[np.ndarray, "*batch mode"]:
    _, mass, stiffness, _ = eigenmodes.condense_block(model, np.arange(6, model.size))
    return np.linalg.eigvals(np.linalg.solve(mass, stiffness)).real


def _batch(solve: Callable[[LinearSystem], object]) -> Batch:
    """Prepare a method for string models with a batch of stiffnesses."""

    def prepared(subject: Subject) -> Callable[[], object]:
        model, factor = subject.model(STRING), eigenmodes_compared.scatter_factors()
        many = replace(model, stiffness=model.stiffness * factor[:, None, None])
        return lambda: solve(many)

    return prepared


BY_BLOCK = _batch(batch_modes.solve)
"""As in `pendsus sweep`."""
WHOLE = _batch(lambda model: np.linalg.eigh(_scaled(model)))
SYMMETRIC = _batch(lambda model: np.linalg.eigvalsh(_scaled(model)))
UNSYMMETRIC = _batch(_unsymmetric)
