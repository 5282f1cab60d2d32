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


def transfer(model: LinearModel, omega: Array, drives: Array, acts: list[bool], rows: Array, *, finite: bool = True) -> tuple[Any, int]:
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
    finite : bool
        Whether to refuse a frequency at which there is no finite response; else it is NaN or infinite.
    """
    if model.terms:
        return _dispersive(model, omega, drives, acts, rows, finite=finite)
    moves, forces = _given(drives, acts)
    order = None if (omega[1:] >= omega[:-1]).all() else np.argsort(omega, kind="stable")
    ascending = omega if order is None else omega[order]
    result = np.zeros((len(rows), drives.shape[0], len(omega)), dtype=complex)
    constant = rows[:, :6] @ moves
    reached = constant != 0  # memory that nothing has reached stays untouched
    if reached.any():
        result[reached] += constant[reached][:, None]
    count = 0
    for number in _touched(model, rows, moves, forces):
        group = model.blocks[number]
        watched = np.flatnonzero(rows[:, group].any(1))
        part = prepared(model, number)
        touched = part.driven(moves, forces).nonzero()[0]
        count += 1
        wanted = Asked(rows[watched[:, None], part.keep], moves[:, touched], part.pushed(forces[:, touched]))
        for now, values, exists in answers(part, ascending, wanted):
            if finite:
                _demand_finite(exists, ascending[now])
            for row, value in zip(watched.tolist(), values, strict=True):
                for column, i in enumerate(touched.tolist()):
                    if reached[row, i]:
                        result[row, i, now] += value[column]
                    else:
                        result[row, i, now] = value[column]
        reached[watched[:, None], touched] = True
    if order is not None:
        result[..., order] = result.copy()
    return result.transpose(2, 0, 1), count


def _given(drives: Array, acts: list[bool]) -> tuple[Any, Any]:
    """Motions of the support (6, i) and forces (N, i) that some drives (i, N) are."""
    pushes = np.array(acts, dtype=bool)
    return np.where(pushes, 0.0, drives[:, :6].T), np.where(pushes, drives.T, 0.0)


def _touched(model: LinearModel, rows: Array, moves: Any, forces: Any) -> list[int]:
    """The blocks that both an output sees and an input drives."""
    seen, pushed = rows.any(0), forces.any(1)
    pushed |= model.pulled[:, moves.any(1)].any(1)
    driven = set(model.member[pushed].tolist())
    return [number for number in sorted(set(model.member[seen].tolist())) if number in driven and number >= 0]


def _dispersive(model: LinearModel, omega: Array, drives: Array, acts: list[bool], rows: Array, *, finite: bool) -> tuple[Any, int]:
    """The same for a model whose stiffness depends on frequency."""
    moves, forces = _given(drives, acts)
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
            if finite:
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
