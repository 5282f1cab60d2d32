"""Frequency responses: solve (K + i omega C - omega^2 M) x = f, never sum modes.

Only blocks that inputs drive and outputs sense are solved (`pencil`), at many frequencies at once,
in real arithmetic if nothing is lossy or damped. Errors are at most 1e-8 of a response; of those
below 1e-6 of what the body moves by, 1e-14 of that.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.elimination import as_slice
from suspension_cli.errors import InputError
from suspension_cli.files.declared import NOT_STORED, along, in_unit
from suspension_cli.linear import signals
from suspension_cli.linear.pencil import Block, Pencil
from suspension_cli.linear.signals import Signal
from suspension_cli.linear.system import LinearSystem

if TYPE_CHECKING:
    from jaxtyping import Complex, Float, Inexact, Int

CHUNK = 1 << 16
"""Unknowns (coordinates and tensions, times inputs, times frequencies) solved at once."""
BUILDS = 512
"""Builds, times frequencies, solved at once."""


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
    fine_frequency, fine
        Values at more frequencies, which resolve resonances, for pictures; None without these.
    """

    frequency: Float[np.ndarray, " frequency"] = field(metadata=in_unit("Hz"))
    input: tuple[str, ...]
    output: tuple[str, ...]
    unit: tuple[tuple[str, ...], ...] = field(metadata=along("output input"))
    value: Complex[np.ndarray, "frequency output input"] = field(metadata=in_unit("{unit}"))
    blocks: int = field(default=0, metadata=NOT_STORED)
    closed_loop: bool = False
    largest: Peaks | None = None
    fine_frequency: Float[np.ndarray, " fine_frequency"] | None = field(
        default=None, metadata=in_unit("Hz")
    )
    fine: Complex[np.ndarray, "fine_frequency output input"] | None = field(
        default=None, metadata=in_unit("{unit}")
    )


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
    omega, acts = 2 * np.pi * np.asarray(frequency, dtype=float), [s.acts for s in inputs]
    ground = [s.is_ground for s in inputs]
    value, count = transfer(model, omega, drives, acts, rows, ground=ground)
    into, out = (tuple(signal.text for signal in group) for group in (inputs, outputs))
    return Response(np.asarray(frequency), into, out, units(inputs, outputs), value, count)


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

    `omega` in rad/s. Drives that `acts` marks are generalised forces; others are unit vectors of
    the support's coordinates, or of the ground's (`ground`). Raises `InputError` where a response
    is not finite, if asked. Also returns the number of blocks solved.
    """
    if ground is not None and any(ground):
        result, count = np.zeros((len(omega), len(rows), len(drives)), dtype=complex), 0
        at_rest = np.where(np.arange(model.size) < 6, 0.0, rows)  # the support
        for system, sensed, moved in (
            (model, rows, np.flatnonzero(~np.array(ground))),
            (model.driven_by_ground, at_rest, np.flatnonzero(ground)),
        ):
            if len(moved):
                own = drives[moved], [acts[n] for n in moved]
                result[..., moved], blocks = transfer(system, omega, *own, sensed, finite=finite)
                count += blocks
        return result, count
    moves, forces = np.where(acts, 0.0, drives[:, :6].T), np.where(acts, drives.T, 0.0)
    pencil = Pencil.of(model)
    chosen = _choose(pencil, moves, forces, rows)
    result = np.empty((len(omega), len(rows), len(drives)), dtype=complex)
    largest = max((len(block.owner) for block in chosen), default=1)
    step = max(CHUNK // (largest * max(len(drives), 1)), 64)
    for start in range(0, len(omega), step):
        span = slice(start, start + step)
        own = (part[..., None] for part in (rows, moves, forces))
        result[span] = np.moveaxis(_respond(pencil, chosen, omega[span], *own), -1, 0)
        good = np.isfinite(result[span]).all((1, 2))
        if finite and not good.all():
            raise InputError.of(
                "--frequency",
                "is a resonance without loss, where the response is infinite",
                "move it, or give the design a loss_angle or damping",
                f"{float(omega[span][~good][0]) / (2 * np.pi)!r}",
            )
    return result, len(chosen)


def transfer_builds(
    model: LinearSystem,
    which: Int[np.ndarray, " build"],
    omega: Float[np.ndarray, " frequency"],
    moves: Float[np.ndarray, "every 6 input"],
    forces: Float[np.ndarray, "every coordinate input"],
    rows: Float[np.ndarray, "every output coordinate"],
) -> Inexact[np.ndarray, "build frequency output input"]:
    """Solve for the responses of builds `which` of a batch to motions of the support and forces.

    `moves`, `forces` and `rows` are those of all builds, which are solved in chunks that stay in
    the cache.
    """
    count = len(which) * len(omega)
    result = np.empty((count, rows.shape[1], moves.shape[2]), dtype=complex)
    for start in range(0, count, BUILDS):
        build, frequency = np.divmod(np.arange(start, min(start + BUILDS, count)), len(omega))
        here: Any = as_slice(which[build]) if len(omega) == 1 else which[build]
        w = omega[frequency]
        pencil = Pencil(model.select(here).at(w), w)
        own = [np.moveaxis(part[here], 0, -1) for part in (rows, moves, forces)]
        chosen = _choose(pencil, own[1], own[2], own[0])
        value = _respond(pencil, chosen, w, *own)
        result[start : start + len(w)] = np.moveaxis(value, -1, 0)
    return result.reshape(len(which), len(omega), *result.shape[1:])


def _choose(
    pencil: Pencil,
    moves: Float[np.ndarray, "6 input *#system"],
    forces: Float[np.ndarray, "coordinate input *#system"],
    rows: Float[np.ndarray, "output coordinate *#system"],
) -> list[Block]:
    """Choose the blocks that inputs drive and outputs sense."""
    return [
        block
        for block in pencil.blocks
        if rows[:, block.keep].any() and block.is_driven(moves, forces).any()
    ]


def _respond(
    pencil: Pencil,
    chosen: list[Block],
    omega: Float[np.ndarray, " system"],
    rows: Float[np.ndarray, "output coordinate #system"],
    moves: Float[np.ndarray, "6 input #system"],
    forces: Float[np.ndarray, "coordinate input #system"],
) -> Inexact[np.ndarray, "output input system"]:
    """Sum the responses of blocks and those of outputs to the support's own motion."""
    direct, there = np.einsum("ocs,cis->ois", rows[:, :6], moves), pencil.at(omega)
    result = np.broadcast_to(direct, (*direct.shape[:2], len(omega))).astype(complex)
    reached = np.zeros(direct.shape[:2], dtype=bool)
    for block in chosen:
        sensing = np.flatnonzero(rows[:, block.keep].any((1, 2)))
        driving = np.flatnonzero(block.is_driven(moves, forces))
        pairs = np.ix_(sensing, driving)
        # below the modes the support's own motion cancels digits of the relative one: once
        first = np.where(reached[pairs][..., None], 0.0, direct[pairs])
        value = block.at(there).respond(
            rows[sensing][:, block.keep], moves[:, driving], forces[block.keep][:, driving], first
        )
        again = reached[pairs][..., None]
        result[pairs] = value + np.where(again, result[pairs], 0.0)
        reached[pairs] = True
    return result
