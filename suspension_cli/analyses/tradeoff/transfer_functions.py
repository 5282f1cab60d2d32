"""Responses by every model and method."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import cycle
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.export import solve as export
from suspension_cli.analyses.tradeoff import high_precision
from suspension_cli.analyses.tradeoff.comparison import Batch, Once
from suspension_cli.analyses.tradeoff.subject import STRING, Answer, Prepare, Subject
from suspension_cli.linear import response, signals, statespace
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import registry
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Complex, Float, Inexact

Solve = Callable[[LinearSystem, Array, Array, Array], np.ndarray]
"""Response (f,) of a model at omega (f,), rad/s, from the linear forms (N,) of input and output."""

SWEEP = 2000
"""Frequencies per batch."""
BAND = 2 * np.pi * np.geomspace(0.1, 1000.0, SWEEP)
"""Frequencies of a batch, rad/s."""
GRIDS = 5
"""Grids that are taken in turns, so that nothing is kept from the grid before."""
CHUNK = 2048
"""Frequencies of the plain methods that fit into the cache."""


def reference(subject: Subject, level: str) -> Complex[np.ndarray, " frequency"]:
    """Solve for the response of a model in 50 digits."""
    model = subject.model(level)
    return high_precision.response(model, subject.omega, *subject.forms(model))


def chain(
    model: LinearSystem,
    omega: Float[np.ndarray, " frequency"],
    drive: Float[np.ndarray, " coordinate"],
    row: Float[np.ndarray, " coordinate"],
) -> Complex[np.ndarray, " frequency"]:
    """Solve for the response by elimination body by body, as in `pendsus response`."""
    return response.transfer(model, omega, drive[None], [False], row[None])[0][:, 0, 0]


def chained(model: LinearSystem, drive: Array, row: Array) -> Answer:
    """Prepare `chain`; the model itself caches the preparation."""
    return lambda omega: chain(model, omega, drive, row)


@dataclass(frozen=True)
class Condensed:
    """Plain equations of a driven block without its massless coordinates.

    Matrices are scaled by powers of 2, such that they do not depend on units. `push` is the
    force of the support's motion (stiffness, damping and mass parts), `row` the output as a
    linear form of the coordinates, `direct` the output while these do not move.
    """

    stiffness: Inexact[np.ndarray, "coordinate coordinate"]
    mass: Float[np.ndarray, "coordinate coordinate"]
    damping: Float[np.ndarray, "coordinate coordinate"]
    push: Inexact[np.ndarray, "3 coordinate"]
    row: Inexact[np.ndarray, " coordinate"]
    direct: complex

    def right_side(
        self, omega: Float[np.ndarray, " frequency"]
    ) -> Inexact[np.ndarray, "coordinate _"]:
        """Compute the force on the coordinates at omega in rad/s."""
        k, c, m = self.push[..., None]
        result = m * omega**2 - k if m.any() else -k
        return result - 1j * omega * c if c.any() else result


def condense(model: LinearSystem, drive: Array, row: Array) -> list[Condensed]:
    """Condense all blocks that the input drives and the output contains, in double precision.

    Bodies are ordered from the top down, so that elimination from the last coordinate up loses no
    digits in long chains.
    """
    full = model.stiffness if model.lossy is None else model.lossy
    place = {name: n for n, name in enumerate(model.body)}
    pulled = np.any(model.pulled[:, drive[:6] != 0], axis=1)
    result = []
    for touched in model.blocks:
        if not (row[touched].any() and pulled[touched].any()):
            continue
        block = np.array(
            sorted(touched, key=lambda n: place.get(model.coordinate[n].split(".", 1)[0], -1))
        )
        light = model.massless[block] & ~(model.damping[block] != 0).any(1)
        kept, tips = block[~light], block[light]
        columns = np.concatenate([np.arange(6), kept])
        stiffness, form, direct = full[np.ix_(kept, columns)], row[kept], 0.0
        if len(tips):
            follow = -np.linalg.solve(full[np.ix_(tips, tips)], full[np.ix_(tips, columns)])
            stiffness = stiffness + full[np.ix_(kept, tips)] @ follow
            form = form + row[tips] @ follow[:, 6:]
            direct = row[tips] @ follow[:, :6] @ drive[:6]
        if not np.imag(stiffness).any():
            stiffness, form, direct = np.real(stiffness), np.real(form), np.real(direct)
        mass, damping = (matrix[np.ix_(kept, columns)] for matrix in (model.mass, model.damping))
        scale = np.exp2(-np.rint(np.log2(np.abs(np.diag(stiffness[:, 6:]))) / 2))
        k, c, m = (
            scale[:, None] * matrix * np.concatenate([np.ones(6), scale])
            for matrix in (stiffness, damping, mass)
        )
        push = np.stack([matrix[:, :6] @ drive[:6] for matrix in (k, c, m)])
        result.append(Condensed(k[:, 6:], m[:, 6:], c[:, 6:], push, form * scale, complex(direct)))
    return result


def dense(model: LinearSystem, drive: Array, row: Array) -> Answer:
    """Prepare one LAPACK solve per frequency and block, with pivoting."""
    return _by_block(model, drive, row, _solve_dense)


def eliminated(model: LinearSystem, drive: Array, row: Array) -> Answer:
    """Prepare the decomposition L D L^T without pivoting, each step for all frequencies at once."""
    return _by_block(model, drive, row, _eliminate)


def _by_block(
    model: LinearSystem, drive: Array, row: Array, solve: Callable[[Condensed, Array], np.ndarray]
) -> Answer:
    blocks = condense(model, drive, row)
    direct = row[:6] @ drive[:6] + sum(block.direct for block in blocks)
    return _in_chunks(direct, lambda omega: sum(solve(block, omega) for block in blocks))


def _in_chunks(
    direct: Inexact[np.ndarray, ""], indirect: Callable[[Array], np.ndarray | float]
) -> Answer:
    """Return the sum of both parts of a response, the second for some frequencies at a time."""

    def at(omega: Array) -> np.ndarray:
        result = np.full(len(omega), direct, dtype=complex)
        for start in range(0, len(omega), CHUNK):
            span = slice(start, start + CHUNK)
            result[span] += indirect(omega[span])
        return result

    return at


def _solve_dense(
    block: Condensed, omega: Float[np.ndarray, " frequency"]
) -> Inexact[np.ndarray, " frequency"]:
    square = omega[:, None, None] ** 2
    dynamic = block.stiffness - square * block.mass
    if block.damping.any():
        dynamic = dynamic + 1j * omega[:, None, None] * block.damping
    right = np.broadcast_to(block.right_side(omega).T[..., None], (*dynamic.shape[:2], 1))
    return np.linalg.solve(dynamic, right)[..., 0] @ block.row


def _eliminate(
    block: Condensed, omega: Float[np.ndarray, " frequency"]
) -> Inexact[np.ndarray, " frequency"]:
    square, size = omega**2, len(block.row)
    left: dict[tuple[int, int], np.ndarray] = {}
    coupled = (block.stiffness != 0) | (block.mass != 0) | (block.damping != 0)
    for i, j in np.argwhere(np.tril(coupled)).tolist():
        left[i, j] = block.stiffness[i, j] - square * block.mass[i, j]
        if block.damping[i, j]:
            left[i, j] = left[i, j] + 1j * omega * block.damping[i, j]
    right: list[np.ndarray] = list(block.right_side(omega))
    driven = (block.push != 0).any(0).tolist()
    rows: list[list[int]] = []
    for last in range(size - 1, -1, -1):
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            inverse = 1.0 / left[last, last]
            left[last, last] = inverse
            above = [n for n in range(last) if (last, n) in left]
            for place, n in enumerate(above):
                element = left[last, n]
                ratio = element * inverse
                for other in above[: place + 1]:
                    change = ratio * (element if other == n else left[last, other])
                    left[n, other] = left[n, other] - change if (n, other) in left else -change
                if driven[last]:
                    right[n] = right[n] - ratio * right[last]
                    driven[n] = True
            rows.append(above)
    moved: list[np.ndarray] = []
    result = np.zeros(1)
    for n, above in enumerate(reversed(rows)):
        value = right[n] if driven[n] else 0.0
        for other in above:
            value = value - left[n, other] * moved[other]
        moved.append(value * left[n, n])
        if block.row[n]:
            result = result + block.row[n] * moved[n]
    return result


def modal(model: LinearSystem, drive: Array, row: Array) -> Answer:
    """Prepare the sum over modes, valid as far as losses do not couple modes.

    It is phi (phi . f) / (omega_m^2 + i phi K'' phi + i omega phi C phi - omega^2), over the modes
    of the driven blocks.
    """
    direct, modes = row[:6] @ drive[:6], []
    for block in condense(model, drive, row):
        direct += block.direct
        inverse = np.linalg.inv(np.linalg.cholesky(block.mass))
        dynamic = inverse @ np.real(block.stiffness) @ inverse.T
        poles, vectors = np.linalg.eigh((dynamic + dynamic.T) / 2)
        shapes = vectors.T @ inverse
        seen = shapes @ block.row
        loss, damping = (
            (shapes @ matrix * shapes).sum(-1)
            for matrix in (np.imag(block.stiffness), block.damping)
        )
        k, c, m = seen * (block.push @ shapes.T)
        modes += zip(-k, -c, m, poles + 1j * loss if loss.any() else poles, damping, strict=True)

    def total(omega: Array) -> np.ndarray | float:
        square, result = omega**2, 0.0
        for k, c, m, pole, damping in modes:
            stiff, driven = pole - square, k
            if damping:
                stiff = stiff + 1j * omega * damping
            if m:
                driven = driven + square * m
            if c:
                driven = driven + 1j * omega * c
            result = result + driven / stiff
        return result

    return _in_chunks(direct, total)


def state_space(model: LinearSystem, drive: Array, row: Array) -> Answer:
    """Prepare the state space C (i omega - A)^-1 B + D, with A balanced."""
    system = _system(model, drive, row)
    return lambda omega: system.at(omega / (2 * np.pi))[:, 0, 0]


def zero_pole_gain(model: LinearSystem, drive: Array, row: Array) -> Answer:
    """Prepare the product of gain, zeros and poles."""
    found = export.compute_zero_pole_gain(_system(model, drive, row))
    return lambda omega: found.at(omega / (2 * np.pi))[:, 0, 0]


METHODS: dict[str, Prepare] = {
    "chain": chained,
    "dense": dense,
    "LDLᵀ": eliminated,
    "modal sum": modal,
    "state space": state_space,
    "zpk": zero_pole_gain,
}
"""Methods by name; the first is that of `pendsus response`."""


def _system(model: LinearSystem, drive: Array, row: Array) -> statespace.StateSpace:
    known = signals.bodies_with_signals(model)
    into = signals.parse_input("support.x", known)
    out = signals.parse_output(f"{model.body[-1]}.x", known)
    return statespace.assemble(model, drive[None], [into], row[None], [out])


def with_model(level: str) -> tuple[Once, Batch]:
    """Return `chain` from the design on: at `FREQUENCIES`, and for a batch of frequencies."""
    return _timed(lambda subject: registry.by_name(level).system(subject.design), chain)


def on_matrices(solve: Solve) -> tuple[Once, Batch]:
    """Return a method from the matrices of the string model on."""
    return _timed(lambda subject: subject.fresh(STRING), solve)


def prepared(prepare: Prepare) -> tuple[Once, Batch]:
    """Return a method from the matrices on, including its preparation."""
    return on_matrices(lambda model, omega, drive, row: prepare(model, drive, row)(omega))


def kept(prepare: Prepare) -> tuple[Once, Batch]:
    """Return a method that is prepared beforehand; batches have another grid each time."""

    def batch(subject: Subject) -> Callable[[], object]:
        answer = subject.prepared(prepare)
        grids = cycle([BAND * (1 + 1e-6 * n) for n in range(1, GRIDS + 1)])
        return lambda: answer(next(grids))

    return (lambda subject: subject.prepared(prepare)(subject.omega)), batch


def _timed(model_of: Callable[[Subject], LinearSystem], solve: Solve) -> tuple[Once, Batch]:
    def at(subject: Subject, omega: Array) -> np.ndarray:
        model = model_of(subject)
        return solve(model, omega, *subject.forms(model))

    return (lambda subject: at(subject, subject.omega)), (lambda subject: lambda: at(subject, BAND))
