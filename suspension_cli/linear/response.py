"""Frequency responses: solve (K + i omega C - omega^2 M) x = f, never sum modes.

Only blocks that inputs drive and outputs sense are solved (`pencil`), at many frequencies at once,
in real arithmetic if nothing is lossy or damped. Errors are at most 1e-8 of a response; of those
below 1e-6 of what the body moves by, 1e-14 of that.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.errors import Fault, InputError
from suspension_cli.files.declared import NOT_STORED, along, in_unit
from suspension_cli.linear import signals
from suspension_cli.linear.pencil import Pencil
from suspension_cli.linear.signals import Signal
from suspension_cli.linear.system import LinearSystem

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float

CHUNK = 1 << 16
"""Unknowns (coordinates and tensions, times inputs, times frequencies) solved at once."""


@dataclass(frozen=True)
class Peaks:
    """Largest magnitude (SI) of each response, infinite at a lossless pole, and where (Hz)."""

    frequency: Float[np.ndarray, "output input"] = field(metadata=in_unit("Hz"))
    size: Float[np.ndarray, "output input"] = field(metadata=in_unit("{unit}"))


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

    frequency: Float[np.ndarray, " frequency"] = field(metadata=in_unit("Hz"))
    input: tuple[str, ...]
    output: tuple[str, ...]
    unit: tuple[tuple[str, ...], ...] = field(metadata=along("output input"))
    value: Complex[np.ndarray, "frequency output input"] = field(metadata=in_unit("{unit}"))
    blocks: int = field(default=0, metadata=NOT_STORED)
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
    moves, forces = _split_drives(drives, acts)
    pencil, direct = Pencil.of(model), rows[:, :6] @ moves
    chosen = [
        (block, np.flatnonzero(sensed), np.flatnonzero(driven))
        for block in pencil.blocks
        if (sensed := rows[:, block.keep].any(1)).any()
        and (driven := block.is_driven(moves, forces)).any()
    ]
    result = np.zeros((*direct.shape, len(omega)), dtype=complex)
    result[direct != 0] = direct[direct != 0][:, None]
    largest = max((len(block.owner) for block, _, _ in chosen), default=1)
    step = max(CHUNK // (largest * max(len(drives), 1)), 64)
    for start in range(0, len(omega) if chosen else 0, step):
        span = slice(start, start + step)
        there, reached = pencil.at(omega[span]), np.zeros(direct.shape, dtype=bool)
        for block, sensing, driving in chosen:
            pairs = np.ix_(sensing, driving)
            own = rows[sensing[:, None], block.keep], moves[:, driving]
            first = np.where(reached[pairs], 0.0, direct[pairs])
            value = block.at(there).respond(*own, forces[np.ix_(block.keep, driving)], first)
            if finite:
                _check_finite(np.asarray(np.isfinite(value).all((0, 1))), omega[span])
            again = reached[pairs][..., None]
            result[(*pairs, span)] = value + np.where(again, result[(*pairs, span)], 0.0)
            reached[pairs] = True
    return result.transpose(2, 0, 1), len(chosen)


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
