"""Eigenvalues of the string rung's matrices by every method: what arithmetic alone costs."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from suspension_cli.analysis import modes, signals, spectrum, statespace
from suspension_cli.analysis.tradeoff import eigen, exact
from suspension_cli.analysis.tradeoff.subject import Subject
from suspension_cli.conventions import DOFS
from suspension_cli.design.scene import Array
from suspension_cli.mechanics import count
from suspension_cli.mechanics.model import LinearModel


def reference(subject: Subject) -> eigen.Reference:
    """The eigenvalues of the string rung's matrices in 50 digits, and the kinds of its modes in the same order."""
    model = subject.model("string")
    found = modes.solve(model)
    return eigen.Reference(eigen.signed(exact.omega_squared(model)), eigen.kinds(found), found.shape)


def error(_: Subject, found: Array, wanted: eigen.Reference) -> dict[str, float]:
    """Largest relative error of a frequency of each kind; frequencies are so near to the true ones that rank pairs them."""
    ours = np.sort(eigen.signed(found))
    off = {kind: [n for n, name in enumerate(wanted.kind) if name == kind and wanted.frequency[n] != 0] for kind in eigen.KINDS}
    return {kind: max((abs(ours[n] / wanted.frequency[n] - 1) for n in places), default=0.0) for kind, places in off.items()}


def by_block(subject: Subject) -> Array:
    """Block by block, soft modes by themselves: what `pendsus modes` does."""
    return modes.solve(subject.fresh("string")).omega_squared


def whole(subject: Subject) -> Array:
    """The same with all coordinates in one matrix."""
    model = subject.fresh("string")
    vars(model)["blocks"] = (np.arange(6, model.size),)  # in the place where the cached property keeps them
    return modes.solve(model).omega_squared


def symmetric(subject: Subject) -> Array:
    """Eigenvalues alone, of M^(-1/2) K M^(-1/2) in one matrix."""
    return _symmetric(subject.fresh("string"))


def unsymmetric(subject: Subject) -> Array:
    """Eigenvalues of M^-1 K, as eig(M, K) gives them."""
    return _unsymmetric(subject.fresh("string"))


def poles(subject: Subject) -> Array:
    """Eigenvalues of the matrix A of the state space, squared."""
    model = subject.fresh("string")
    known = signals.bodies(model)
    inputs = [signals.drive(f"support.{dof}", known) for dof in DOFS]
    outputs = [signals.motion(f"{body}.{dof}", known) for body in model.body for dof in DOFS]
    drives, rows = (np.array([signals.row(signal, model) for signal in group]) for group in (inputs, outputs))
    values = np.linalg.eigvals(statespace.assemble(model, drives, inputs, rows, outputs, undriven=True).a)
    squares = np.sort(-(values**2).real)
    return (squares[::2] + squares[1::2]) / 2  # each mode has two poles


def bisected(subject: Subject) -> Array:
    """Counted and bisected, as for wires with mass."""
    model = subject.fresh("string")
    found = modes.solve(model).omega_squared
    omega = np.sqrt(found[found > 0])
    return np.concatenate([found[found <= 0], count.frequencies(model, eigen.HIGHEST * float(omega[-1]), float(omega[0]) / eigen.HIGHEST) ** 2])


def _scaled(model: LinearModel) -> Any:
    """M^(-1/2) K M^(-1/2)."""
    _, mass, stiffness, _ = modes.condensed(model, np.arange(6, model.size))
    inverse = np.linalg.inv(np.linalg.cholesky(mass))
    dynamic = inverse @ stiffness @ np.swapaxes(inverse, -1, -2)
    return (dynamic + np.swapaxes(dynamic, -1, -2)) / 2


def _symmetric(model: LinearModel) -> Any:
    return np.linalg.eigvalsh(_scaled(model))


def _unsymmetric(model: LinearModel) -> Any:
    _, mass, stiffness, _ = modes.condensed(model, np.arange(6, model.size))
    return np.linalg.eigvals(np.linalg.solve(mass, stiffness)).real


def _many(subject: Subject) -> LinearModel:
    """The string model with a batch of stiffnesses."""
    model = subject.model("string")
    return replace(model, stiffness=model.stiffness * eigen.scattered()[:, None, None])


def batch(solve: Any) -> Any:
    """What solves many at once."""

    def prepared(subject: Subject) -> Any:
        model = _many(subject)
        return lambda: solve(model)

    return prepared


BY_BLOCK, WHOLE, SYMMETRIC, UNSYMMETRIC = map(batch, (spectrum.solve, lambda model: np.linalg.eigh(_scaled(model)), _symmetric, _unsymmetric))
"""The same on arrays; `pendsus sweep` does the first."""
