"""Frequency responses: solve (K + i omega C - omega^2 M) x = f, never sum modes.

>>> from suspension_cli.design import reader
>>> from suspension_cli.models import registry
>>> model = registry.BEAM.system(reader.parse(reader.template("single", "single")))
>>> motions = [signals.parse(text, "", ("support", "test")) for text in ("support.x", "test.x")]
>>> found = solve(model, np.array([0.0, 10.0]), motions[:1], motions[1:])
>>> np.abs(found.value[:, 0, 0]).round(4)
array([1.   , 0.009])

Only blocks that inputs drive and outputs sense are solved (`pencil`), at many frequencies at once,
in real arithmetic if nothing is lossy or damped. Errors are at most 1e-8 of a response; of those
below 1e-6 of what the body moves by, 1e-14 of that.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.conventions import BUILDS_AT_ONCE
from suspension_cli.elimination import as_slice
from suspension_cli.errors import InputError
from suspension_cli.files.declared import NOT_STORED, along, in_unit
from suspension_cli.linear import signals
from suspension_cli.linear.pencil import FREQUENCIES, Block, Pencil
from suspension_cli.linear.signals import Signal
from suspension_cli.linear.solver import Solvable, Solver
from suspension_cli.linear.structure import Structure
from suspension_cli.linear.system import LinearSystem

if TYPE_CHECKING:
    from jaxtyping import Complex, Float, Inexact, Int


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
    """

    frequency: Float[np.ndarray, " frequency"] = field(metadata=in_unit("Hz"))
    input: tuple[str, ...]
    output: tuple[str, ...]
    unit: tuple[tuple[str, ...], ...] = field(metadata=along("output input"))
    value: Complex[np.ndarray, "frequency output input"] = field(metadata=in_unit("{unit}"))
    blocks: int = field(default=0, metadata=NOT_STORED)
    closed_loop: bool = False


def solve(
    system: Solvable,
    frequency: Float[np.ndarray, " frequency"],
    inputs: list[Signal],
    outputs: list[Signal],
) -> Response:
    """Solve for the responses of a system without batch axes, at frequencies in Hz; 0 is static.

    Inputs are motions of the support, or forces and torques on bodies. Raises `InputError` at a
    frequency that equals a lossless resonance to the last bit.
    """
    solver = Solver.of(system)
    frequency = np.asarray(frequency, dtype=float)
    rows = np.array([signals.linear_form(signal, solver.system) for signal in outputs])
    drives = np.array([signals.linear_form(signal, solver.system) for signal in inputs])
    acts = [signal.acts for signal in inputs]
    ground = [signal.is_ground for signal in inputs]
    value, count = transfer(solver, 2 * np.pi * frequency, drives, acts, rows, ground=ground)
    return Response(
        frequency=frequency,
        input=tuple(signal.text for signal in inputs),
        output=tuple(signal.text for signal in outputs),
        unit=units(inputs, outputs),
        value=value,
        blocks=count,
    )


def units(inputs: list[Signal], outputs: list[Signal]) -> tuple[tuple[str, ...], ...]:
    """Units of each output over each input, [output][input]."""
    per_input = ["/" + into.unit.replace("N m", "(N m)") for into in inputs]
    return tuple(tuple(out.unit + per for per in per_input) for out in outputs)


def transfer(
    system: Solvable,
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
    solver = Solver.of(system)
    if ground is not None and any(ground):
        return _transfer_with_ground(solver, omega, drives, acts, rows, ground, finite=finite)
    moves = np.where(acts, 0.0, drives[:, :6].T)
    forces = np.where(acts, drives.T, 0.0)
    chosen = _choose(solver.blocks, moves, forces, rows)
    result = np.empty((len(omega), len(rows), len(drives)), dtype=complex)
    for start in range(0, len(omega), FREQUENCIES):
        span = slice(start, start + FREQUENCIES)
        value = _respond(
            solver.pencil, chosen, omega[span], rows[..., None], moves[..., None], forces[..., None]
        )
        result[span] = np.moveaxis(value, -1, 0)
        if finite:
            _demand_finite(result[span], omega[span])
    return result, len(chosen)


def _transfer_with_ground(
    solver: Solver,
    omega: Float[np.ndarray, " frequency"],
    drives: Float[np.ndarray, "input coordinate"],
    acts: list[bool],
    rows: Float[np.ndarray, "output coordinate"],
    ground: list[bool],
    *,
    finite: bool,
) -> tuple[Complex[np.ndarray, "frequency output input"], int]:
    """Solve for the transfer matrix from inputs some of which are motions of the ground."""
    result = np.zeros((len(omega), len(rows), len(drives)), dtype=complex)
    count = 0
    of_support = np.arange(solver.system.size) < 6
    at_rest = np.where(of_support, 0.0, rows)
    of_ground = np.array(ground)
    for driven, sensed, inputs in (
        (solver, rows, np.flatnonzero(~of_ground)),
        (solver.driven_by_ground, at_rest, np.flatnonzero(of_ground)),
    ):
        if len(inputs):
            own = [acts[n] for n in inputs]
            result[..., inputs], blocks = transfer(
                driven, omega, drives[inputs], own, sensed, finite=finite
            )
            count += blocks
    return result, count


def _demand_finite(
    value: Complex[np.ndarray, "frequency output input"], omega: Float[np.ndarray, " frequency"]
) -> None:
    """Raise `InputError` at a resonance without loss."""
    good = np.isfinite(value).all((1, 2))
    if not good.all():
        raise InputError.of(
            "--frequency",
            "is a resonance without loss, where the response is infinite",
            "move it, or give the design a loss_angle or damping",
            f"{float(omega[~good][0]) / (2 * np.pi)!r}",
        )


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
    for start in range(0, count, BUILDS_AT_ONCE):
        stop = min(start + BUILDS_AT_ONCE, count)
        build, frequency = np.divmod(np.arange(start, stop), len(omega))
        here: Any = as_slice(which[build]) if len(omega) == 1 else which[build]
        at = omega[frequency]
        pencil = Pencil(Structure(model.select(here).at(at)), at)
        sensed, moved, pushed = (np.moveaxis(part[here], 0, -1) for part in (rows, moves, forces))
        chosen = _choose(pencil.make_blocks(), moved, pushed, sensed)
        value = _respond(pencil, chosen, at, sensed, moved, pushed)
        result[start : start + len(at)] = np.moveaxis(value, -1, 0)
    return result.reshape(len(which), len(omega), *result.shape[1:])


def _choose(
    blocks: list[Block],
    moves: Float[np.ndarray, "6 input *#system"],
    forces: Float[np.ndarray, "coordinate input *#system"],
    rows: Float[np.ndarray, "output coordinate *#system"],
) -> list[Block]:
    """Choose the blocks that inputs drive and outputs sense."""
    return [
        block
        for block in blocks
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
    there = pencil.at(omega)
    direct = np.einsum("ocs,cis->ois", rows[:, :6], moves)
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
