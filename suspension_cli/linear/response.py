"""Frequency responses: solve (K + i omega C - omega^2 M) x = f, never sum modes.

Only blocks that inputs drive and outputs sense are solved, each body by body (`elimination`) at all
frequencies at once, in real arithmetic if nothing is lossy or damped. With constant matrices each
response is accurate to the last bit or two, also on resonances and near zeros (`block_response`).
Within a relative 1e-9 of a lossless pole it depends on the last digits of the model's numbers.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.errors import Fault, InputError
from suspension_cli.linear import frequency_dependent, signals
from suspension_cli.linear.block_response import Request, solve_responses
from suspension_cli.linear.blocks import condense_block
from suspension_cli.linear.signals import Signal
from suspension_cli.linear.system import LinearSystem

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float

CHUNK = 1 << 17
"""Unknowns (coordinates times inputs times frequencies) solved at once with terms in frequency."""


@dataclass(frozen=True)
class Peaks:
    """Largest magnitude (SI) of each response, infinite at a lossless pole, and where (Hz)."""

    frequency: Float[np.ndarray, "output input"]
    size: Float[np.ndarray, "output input"]


@dataclass(frozen=True)
class Response:
    """Responses of outputs to inputs.

    Attributes
    ----------
    frequency
        Hz.
    unit
        Unit of each output over each input, [output][input].
    blocks
        Number of blocks solved.
    closed_loop
        Whether the loops of the design's local control are closed.
    largest
        Peaks within the band, also between the frequencies; None if not searched.
    """

    frequency: Float[np.ndarray, " frequency"]
    input: tuple[str, ...]
    output: tuple[str, ...]
    unit: tuple[tuple[str, ...], ...]
    value: Complex[np.ndarray, "frequency output input"]
    blocks: int
    closed_loop: bool = False
    largest: Peaks | None = None


def solve(
    model: LinearSystem,
    frequency: Float[np.ndarray, " frequency"],
    inputs: list[Signal],
    outputs: list[Signal],
) -> Response:
    """Solve for the responses of a system without batch axes, at frequencies in Hz; 0 is static.

    Inputs are motions of the support, or forces and torques on bodies. Raises `InputError` at a
    frequency that equals a lossless resonance to the last bit.
    """
    rows = np.array([signals.linear_form(signal, model) for signal in outputs])
    drives = np.array([signals.linear_form(signal, model) for signal in inputs])
    value, count = transfer(
        model,
        2 * np.pi * np.asarray(frequency, dtype=float),
        drives,
        [s.acts for s in inputs],
        rows,
        ground=[s.is_ground for s in inputs],
    )
    unit = units(inputs, outputs)
    return Response(
        np.asarray(frequency),
        tuple(s.text for s in inputs),
        tuple(s.text for s in outputs),
        unit,
        value,
        count,
    )


def units(inputs: list[Signal], outputs: list[Signal]) -> tuple[tuple[str, ...], ...]:
    """Units of each output over each input, [output][input]."""
    per = ["/" + into.unit.replace("N m", "(N m)") for into in inputs]
    return tuple(tuple(out + into for into in per) for out in (signal.unit for signal in outputs))


def transfer(
    model: LinearSystem,
    omega: Float[np.ndarray, " frequency"],
    drives: Float[np.ndarray, "input coordinate"],
    acts: list[bool],
    rows: Float[np.ndarray, "output coordinate"],
    *,
    finite: bool = True,
    ground: list[bool] | None = None,
) -> tuple[Complex[np.ndarray, "frequency output input"], int]:
    """Solve for the transfer matrix from drives to linear forms of the coordinates (`rows`).

    Also returns the number of blocks solved. `omega` in rad/s. Drives that `acts` marks are
    generalised forces; others are unit vectors of the support's coordinates, or of the ground's
    (`ground`). If `finite`, raises `InputError` where a response is not finite.
    """
    if ground is not None and any(ground):
        return _with_ground(model, omega, drives, acts, rows, ground, finite=finite)
    if model.terms:
        return _solve_frequency_dependent(model, omega, drives, acts, rows, finite=finite)
    moves, forces = _split_drives(drives, acts)
    order = None if (omega[1:] >= omega[:-1]).all() else np.argsort(omega, kind="stable")
    ascending = omega if order is None else omega[order]
    result = np.zeros((len(rows), drives.shape[0], len(omega)), dtype=complex)
    direct = rows[:, :6] @ moves
    reached = np.zeros(direct.shape, dtype=bool)  # unwritten elements of `result` cost no memory
    count = 0
    for number in _solved_blocks(model, rows, moves, forces):
        group = model.blocks[number]
        sensing = np.flatnonzero(rows[:, group].any(1))
        block = condense_block(model, number)
        driving = block.is_driven(moves, forces).nonzero()[0]
        count += 1
        pairs = np.ix_(sensing, driving)
        request = Request(
            rows[sensing[:, None], block.kept],
            moves[:, driving],
            block.reduce_forces(forces[:, driving]),
            np.where(reached[pairs], 0.0, direct[pairs]),
        )
        for span, values in solve_responses(block, ascending, request):
            if finite:
                exists = np.logical_and.reduce([np.isfinite(value).all(0) for value in values])
                _check_finite(exists, ascending[span])
            for row, value in zip(sensing.tolist(), values, strict=True):
                for column, i in enumerate(driving.tolist()):
                    if reached[row, i]:
                        result[row, i, span] += value[column]
                    else:
                        result[row, i, span] = value[column]
        reached[pairs] = True
    unreached = ~reached & (direct != 0)
    if unreached.any():
        result[unreached] += direct[unreached][:, None]
    if order is not None:
        result[..., order] = result.copy()
    return result.transpose(2, 0, 1), count


def _with_ground(
    model: LinearSystem,
    omega: Float[np.ndarray, " frequency"],
    drives: Float[np.ndarray, "input coordinate"],
    acts: list[bool],
    rows: Float[np.ndarray, "output coordinate"],
    ground: list[bool],
    *,
    finite: bool,
) -> tuple[Complex[np.ndarray, "frequency output input"], int]:
    """Solve for the responses to motions of the ground, and to other drives."""
    result = np.zeros((len(omega), len(rows), len(drives)), dtype=complex)
    at_rest = rows.copy()
    at_rest[:, :6] = 0.0  # the support
    count = 0
    for system, moves, seen in (
        (model, ~np.array(ground), rows),
        (model.driven_by_ground, np.array(ground), at_rest),
    ):
        which = np.flatnonzero(moves)
        if len(which):
            some = [acts[n] for n in which]
            result[..., which], blocks = transfer(
                system, omega, drives[which], some, seen, finite=finite
            )
            count += blocks
    return result, count


def _split_drives(
    drives: Float[np.ndarray, "input coordinate"], acts: list[bool]
) -> tuple[Float[np.ndarray, "6 input"], Float[np.ndarray, "coordinate input"]]:
    """Split drives into motions of the support and forces."""
    pushes = np.array(acts, dtype=bool)
    return np.where(pushes, 0.0, drives[:, :6].T), np.where(pushes, drives.T, 0.0)


def _solved_blocks(
    model: LinearSystem,
    rows: Float[np.ndarray, "output coordinate"],
    moves: Float[np.ndarray, "6 input"],
    forces: Float[np.ndarray, "coordinate input"],
) -> list[int]:
    """List the blocks that an input drives and an output senses."""
    sensed, driven = rows.any(0), forces.any(1)
    driven |= model.pulled[:, moves.any(1)].any(1)
    driven_blocks = set(model.member[driven].tolist())
    return [
        number
        for number in sorted(set(model.member[sensed].tolist()))
        if number in driven_blocks and number >= 0
    ]


def _solve_frequency_dependent(
    model: LinearSystem,
    omega: Float[np.ndarray, " frequency"],
    drives: Float[np.ndarray, "input coordinate"],
    acts: list[bool],
    rows: Float[np.ndarray, "output coordinate"],
    *,
    finite: bool,
) -> tuple[Complex[np.ndarray, "frequency output input"], int]:
    """Solve for the transfer matrix of a system whose stiffness depends on frequency."""
    moves, forces = _split_drives(drives, acts)
    result = np.zeros((len(omega), len(rows), len(drives)), dtype=complex) + rows[:, :6] @ moves
    count = 0
    for block in frequency_dependent.build_blocks(model):
        sensed, pushes = rows[:, block.keep], forces[block.keep]
        if not sensed.any() or not (pushes.any() or block.pulled(moves)):
            continue
        count += 1
        step = max(CHUNK // max(len(block.keep) * len(drives), 1), 64)
        for start in range(0, len(omega), step):
            span = slice(start, start + step)
            x = block.at(omega[span]).solve(moves, pushes)
            if finite:
                _check_finite(np.all(np.isfinite(x), axis=(0, 1)), omega[span])
            result[span] += np.einsum("oc,cif->foi", sensed, x)
    return result, count


def _check_finite(
    finite: Bool[np.ndarray, " frequency"], omega: Float[np.ndarray, " frequency"]
) -> None:
    """Raise `InputError` at the first frequency whose system is singular to the last bit."""
    if not finite.all():
        at = float(omega[~finite][0]) / (2 * np.pi)
        raise InputError(
            [
                Fault(
                    "--frequency",
                    "is a resonance without loss, where the response is infinite",
                    "move it, or give the design a loss_angle or damping",
                    f"{at!r}",
                )
            ]
        )
