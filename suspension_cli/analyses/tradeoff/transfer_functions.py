"""Responses by every model and method."""

from __future__ import annotations

from typing import Any

import numpy as np

from suspension_cli.analyses.export import solve as export
from suspension_cli.analyses.tradeoff import high_precision
from suspension_cli.analyses.tradeoff.subject import STRING, Answer, Prepare, Subject
from suspension_cli.linear import eigenmodes, response, signals, small_matrices, statespace
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import registry
from suspension_cli.scene.arrays import Array, Index

SWEEP = 2000
"""Frequencies per batch."""
BAND = 2 * np.pi * np.geomspace(0.1, 1000.0, SWEEP)
"""Frequencies of a batch, rad/s."""


def reference(subject: Subject) -> Any:
    """Response of the most complete valid model in 50 digits."""
    model = subject.model(subject.top)
    return high_precision.response(model, subject.omega, *subject.forms(model))


def digits_reference(subject: Subject) -> Any:
    """Response of the string model in 50 digits."""
    model = subject.model(STRING)
    return high_precision.response(model, subject.omega, *subject.forms(model))


def chain(model: LinearSystem, omega: Array, drive: Array, row: Array) -> Any:
    """Response (f,) by elimination body by body, as in `pendsus response`."""
    return response.transfer(model, omega, drive[None], [False], row[None])[0][:, 0, 0]


def dense(model: LinearSystem, omega: Array, drive: Array, row: Array) -> Any:
    """Response (f,) by one LAPACK solve per frequency and block.

    Scaling makes pivots independent of units; that and the order from the top down preserve
    digits of long chains.
    """
    full = model.stiffness if model.lossy is None else model.lossy
    result = np.full(len(omega), row[:6] @ drive[:6], dtype=complex)
    place = {name: n for n, name in enumerate(model.body)}
    for touched in _touched(model, drive, row):
        block = np.array(
            sorted(touched, key=lambda n: place.get(model.coordinate[n].split(".", 1)[0], -1))
        )
        both = np.ix_(block, np.concatenate([np.arange(6), block]))
        dynamic = full[both][..., None] - omega**2 * model.mass[both][..., None]
        if model.damping[both].any():
            dynamic = dynamic + 1j * omega * model.damping[both][..., None]
        pushed = -np.einsum("csf,s->cf", dynamic[:, :6], drive[:6])
        result += row[block] @ small_matrices.dense(dynamic[:, 6:], pushed[:, None])[:, 0]
    return result


def _touched(model: LinearSystem, drive: Array, row: Array) -> list[Index]:
    """Blocks that the input drives and the output contains."""
    pulled = model.pulled[:, drive[:6] != 0].any(1)
    return [block for block in model.blocks if row[block].any() and pulled[block].any()]


# Methods that separate preparation from evaluation: each returns the response as a function of
# frequency, from a model and two linear forms.


def chained(model: LinearSystem, drive: Array, row: Array) -> Answer:
    """Prepare `chain`; the model itself caches the preparation."""
    return lambda omega: chain(model, omega, drive, row)


def modal(model: LinearSystem, drive: Array, row: Array) -> Answer:
    """Prepare the sum over modes, valid as far as losses do not couple modes.

    It is phi (phi . f) / (omega_m^2 + i phi K'' phi + i omega phi C phi - omega^2), over the modes
    of the driven blocks.
    """
    parts = [_modes(model, block) for block in _touched(model, drive, row)]
    poles = np.concatenate([np.zeros(0), *(values for values, _ in parts)])
    shapes = np.concatenate([np.zeros((0, model.size)), *(found for _, found in parts)])
    full = model.stiffness if model.lossy is None else model.lossy
    seen, direct = shapes @ row, row[:6] @ drive[:6]
    k, c, m = (
        -(shapes @ (matrix[:, :6] @ drive[:6])) * seen
        for matrix in (full, model.damping, model.mass)
    )
    loss, damping = (
        (shapes @ matrix * shapes).sum(-1) for matrix in (np.imag(full), model.damping)
    )

    def at(omega: Array) -> Any:
        square = omega[:, None] ** 2
        driven, stiff = (
            k - square * m if m.any() else k,
            (poles + 1j * loss if loss.any() else poles) - square,
        )
        if c.any():
            driven = driven + 1j * omega[:, None] * c
        if damping.any():
            stiff = stiff + 1j * omega[:, None] * damping
        return (driven / stiff).sum(-1) + direct

    return at


def _modes(model: LinearSystem, block: Index) -> tuple[Array, Array]:
    """omega^2 (m,) and shapes (m, N) with unit modal mass of a block."""
    kept, mass, stiffness, recover = eigenmodes.condense_block(model, block)
    inverse = np.linalg.inv(np.linalg.cholesky(mass))
    dynamic = inverse @ stiffness @ inverse.T
    values, vectors = np.linalg.eigh((dynamic + dynamic.T) / 2)
    own = vectors.T @ inverse
    shapes = np.zeros((len(values), model.size))
    shapes[:, kept] = own
    shapes[:, block[model.massless[block]]] = own @ recover.T
    return values, shapes


def state_space(model: LinearSystem, drive: Array, row: Array) -> Answer:
    """Prepare the state space C (i omega - A)^-1 B + D, with A balanced."""
    system = _system(model, drive, row)
    return lambda omega: system.at(omega / (2 * np.pi))[:, 0, 0]


def zero_pole_gain(model: LinearSystem, drive: Array, row: Array) -> Answer:
    """Prepare the product of gain, zeros and poles."""
    found = export.compute_zero_pole_gain(_system(model, drive, row))
    return lambda omega: found.at(omega / (2 * np.pi))[:, 0, 0]


def _system(model: LinearSystem, drive: Array, row: Array) -> statespace.StateSpace:
    known = signals.bodies_with_signals(model)
    into, out = (
        signals.parse_input("support.x", known),
        signals.parse_output(f"{model.body[-1]}.x", known),
    )
    return statespace.assemble(model, drive[None], [into], row[None], [out])


def with_model(level: str) -> tuple[Any, Any]:
    """Return `chain` from the design on: at `FREQUENCIES`, and for a batch of frequencies."""
    return _timed(lambda subject: registry.by_name(level).system(subject.design), chain)


def on_matrices(solve: Any) -> tuple[Any, Any]:
    """Return a method from the matrices of the string model on."""
    return _timed(lambda subject: subject.fresh(STRING), solve)


def prepared(prepare: Prepare) -> tuple[Any, Any]:
    """Return a method from the matrices on, including its preparation."""
    return on_matrices(lambda model, omega, drive, row: prepare(model, drive, row)(omega))


def kept(prepare: Prepare) -> tuple[Any, Any]:
    """Return a method that is prepared beforehand."""
    return (lambda subject: subject.prepared(prepare)(subject.omega)), (
        lambda subject: lambda: subject.prepared(prepare)(BAND)
    )


def _timed(model_of: Any, solve: Any) -> tuple[Any, Any]:
    def at(subject: Subject, omega: Array) -> Any:
        model = model_of(subject)
        return solve(model, omega, *subject.forms(model))

    return (lambda subject: at(subject, subject.omega)), (lambda subject: lambda: at(subject, BAND))
