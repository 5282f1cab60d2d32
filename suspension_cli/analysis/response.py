"""Frequency responses: solve (K + i omega C - omega^2 M) x = f, never sum modes.

Only the blocks that the asked inputs and outputs both touch are solved, each body by body
(`mechanics.elimination`), all frequencies at once; a block without loss or damping in real arithmetic.  Each response has a relative
error below 1e-12, on resonances and near zeros too (`mechanics.answers`); only within 1e-9 of a pole without loss has it what the
last digits of the model's numbers allow.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from suspension_cli.analysis import signals
from suspension_cli.analysis.signals import Signal
from suspension_cli.design.scene import Array
from suspension_cli.errors import Fault, InputError
from suspension_cli.mechanics import dispersive
from suspension_cli.mechanics.answers import Asked, answers
from suspension_cli.mechanics.condensed import prepared
from suspension_cli.mechanics.model import LinearModel

CHUNK = 1 << 17
"""Numbers (coordinates times inputs times frequencies) of a model with terms that are worked on at once."""


@dataclass(frozen=True)
class Response:
    """Responses of outputs to inputs.

    Attributes
    ----------
    frequency : (f,) array
        Hz.
    input, output : tuple of str
        Signals.
    unit : tuple of tuple of str
        Unit of each output over each input, [output][input].
    value : (f, output, input) complex array
    blocks : int
        How many blocks had to be solved.
    """

    frequency: Array
    input: tuple[str, ...]
    output: tuple[str, ...]
    unit: tuple[tuple[str, ...], ...]
    value: Any
    blocks: int


def solve(model: LinearModel, frequency: Array, inputs: list[Signal], outputs: list[Signal]) -> Response:
    """Responses of a model without batch axes.

    Parameters
    ----------
    model : LinearModel
    frequency : (f,) array
        Hz; 0 gives the static response.
    inputs : list of Signal
        Motions of the support; forces and torques on bodies.
    outputs : list of Signal
        Motions.

    Returns
    -------
    Response

    Raises
    ------
    InputError
        At a frequency that is a lossless resonance to the last bit.
    """
    rows = np.array([signals.row(signal, model) for signal in outputs])
    drives = np.array([signals.row(signal, model) for signal in inputs])
    value, count = transfer(model, 2 * np.pi * np.asarray(frequency, dtype=float), drives, [s.acts for s in inputs], rows)
    per = ["/" + into.unit.replace("N m", "(N m)") for into in inputs]
    unit = tuple(tuple(out + into for into in per) for out in (signal.unit for signal in outputs))
    return Response(np.asarray(frequency), tuple(s.text for s in inputs), tuple(s.text for s in outputs), unit, value, count)


def transfer(model: LinearModel, omega: Array, drives: Array, acts: list[bool], rows: Array) -> tuple[Any, int]:
    """Transfer matrix (f, o, i) from drives to linear forms of the coordinates, and how many blocks it took.

    Parameters
    ----------
    model : LinearModel
    omega : (f,) array
        rad/s.
    drives : (i, N) array
        Forces as generalised forces, support motions as unit vectors of the support's coordinates.
    acts : list of bool
        Which drives are forces.
    rows : (o, N) array
    """
    if model.terms:
        return _dispersive(model, omega, drives, acts, rows)
    moves = np.array([np.zeros_like(d[:6]) if act else d[:6] for d, act in zip(drives, acts, strict=True)]).T  # (6, i)
    forces = np.array([d if act else np.zeros_like(d) for d, act in zip(drives, acts, strict=True)]).T  # (N, i)
    order = None if (omega[1:] >= omega[:-1]).all() else np.argsort(omega, kind="stable")
    ascending = omega if order is None else omega[order]
    result = np.zeros((len(rows), drives.shape[0], len(omega)), dtype=complex)
    _add(result, rows[:, :6] @ moves)
    reached = rows[:, :6] @ moves != 0  # memory that nothing has reached stays untouched
    count, pulled, moved = 0, _pulled(model), moves.any(1)
    for number, group in enumerate(model.blocks):
        watched = np.flatnonzero(rows[:, group].any(1))
        if not len(watched) or not (forces[group].any() or pulled[group][:, moved].any()):
            continue
        part = prepared(model, number)
        touched = np.flatnonzero(part.driven(moves, forces))
        count += 1
        wanted = Asked(rows[np.ix_(watched, part.keep)], moves[:, touched], part.pushed(forces[:, touched]))
        for now, values, finite in answers(part, ascending, wanted):
            _demand_finite(finite, ascending[now])
            for row, value in zip(watched, values, strict=True):
                for column, i in enumerate(touched):
                    if reached[row, i]:
                        result[row, i, now] += value[column]
                    else:
                        result[row, i, now] = value[column]
        reached[np.ix_(watched, touched)] = True
    if order is not None:
        result[..., order] = result.copy()
    return np.moveaxis(result, -1, 0), count


def _dispersive(model: LinearModel, omega: Array, drives: Array, acts: list[bool], rows: Array) -> tuple[Any, int]:
    """The same for a model whose stiffness depends on frequency."""
    moves = np.array([np.zeros_like(d[:6]) if act else d[:6] for d, act in zip(drives, acts, strict=True)]).T
    forces = np.array([d if act else np.zeros_like(d) for d, act in zip(drives, acts, strict=True)]).T
    result = np.zeros((len(omega), len(rows), len(drives)), dtype=complex) + rows[:, :6] @ moves
    count = 0
    for block in dispersive.blocks(model):
        watched, pushed = rows[:, block.keep], forces[block.keep]
        if not watched.any() or not (pushed.any() or block.pulled(moves)):
            continue
        count += 1
        step = max(CHUNK // max(len(block.keep) * len(drives), 1), 64)
        for start in range(0, len(omega), step):
            now = slice(start, start + step)
            x = block.at(omega[now]).solve(moves, pushed)
            _demand_finite(np.isfinite(x).all((0, 1)), omega[now])
            result[now] += np.einsum("oc,cif->foi", watched, x)
    return result, count


def _demand_finite(finite: Any, omega: Array) -> None:
    """Raise `InputError` where a system was singular to the last bit."""
    if not finite.all():
        at = float(omega[~finite][0]) / (2 * np.pi)
        raise InputError(
            [Fault("--frequency", "is a resonance without loss, where the response is infinite", "move it, or give loss_angle or damping", f"{at!r}")]
        )


def _pulled(model: LinearModel) -> Any:
    """Which of the support's motions pull on which coordinates: (N, 6) bool."""
    full = model.stiffness if model.lossy is None else model.lossy
    return (full[:, :6] != 0) | (model.damping[:, :6] != 0) | (model.mass[:, :6] != 0)


def _add(result: Any, constant: Any) -> None:
    """Add what does not depend on frequency (o, i), where it is not 0."""
    for o, i in np.argwhere(constant != 0):
        result[o, i] += constant[o, i]
