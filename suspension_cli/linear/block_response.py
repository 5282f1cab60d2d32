"""Responses of one block to inputs at many frequencies, to the full precision of doubles.

Each system D v = b is solved in doubles, body by body and at all frequencies at once
(`elimination`). The residual b - D v, to twice as many digits (`residual`), gives a correction that
squares the relative error. Where it is not small, a second correction follows. Where that is not
far smaller (near a lossless pole or a zero, or where a part of the suspension resonates alone), the
system is solved again with pivoting and corrected until nothing changes.

Below the first resonance x = S s + v, with S s the static response to the support's motion s.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.linear.blocks import CondensedBlock, SupportForces
from suspension_cli.linear.double_double import DoubleDouble, two_product, two_sum
from suspension_cli.linear.residual import FINE, Equations, Loads
from suspension_cli.linear.small_matrices import dense

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Inexact

CONVERGED = 1e-20
"""Relative correction of a solution in double-double that needs no further one."""
ONCE_MORE = 1e-5
"""Relative correction up to which a second one is tried before pivoting."""
CONTRACTED = 1e-14
"""Relative second correction below which the solution has converged."""
CANCELLED = 1e-7
"""Ratio of an output to its terms below which these need more digits."""
STEPS = 6
"""Largest number of corrections; they do not converge at a lossless pole."""
TINY = np.finfo(float).tiny
CHUNK = 1 << 16
"""Unknowns (coordinates times inputs times frequencies) solved at once."""


@dataclass(frozen=True)
class Request:
    """Inputs and outputs of a block.

    Attributes
    ----------
    outputs
        Linear forms of the coordinates.
    moves, forces
        Inputs as motions of the support and forces on the coordinates.
    direct
        Response of the outputs to the support's own motion, to be added to the block's.
    """

    outputs: Float[np.ndarray, "output coordinate"]
    moves: Float[np.ndarray, "6 input"]
    forces: Float[np.ndarray, "coordinate input"]
    direct: Float[np.ndarray, "output input"]


def solve_responses(
    block: CondensedBlock, omega: Float[np.ndarray, " frequency"], request: Request
) -> Iterator[tuple[slice, list[Inexact[np.ndarray, "input _"]]]]:
    """Solve for the responses of a block in consecutive ranges of ascending frequencies (rad/s).

    Yields each range, and the responses of each output; not finite at a lossless resonance.
    """
    support_moves = request.moves.any() and len(block.resonances) > 0
    count_below = int(omega.searchsorted(block.resonances[0])) if support_moves else 0
    step = max(CHUNK // max(len(block.kept) * request.moves.shape[1], 1), 64)
    for first, last, relative in ((0, count_below, True), (count_below, len(omega), False)):
        if first == last:
            continue
        drive = block.relative if relative else block.absolute
        loads = drive.equations.loads(request.moves, request.forces)
        offset = _static_offset(block, request, relative=relative)
        for start in range(first, last, step):
            span = slice(start, min(start + step, last))
            yield span, _solve_range(block, drive, omega[span], request, loads, offset)


def _solve_range(
    block: CondensedBlock,
    drive: SupportForces,
    omega: Float[np.ndarray, " frequency"],
    request: Request,
    loads: Loads,
    offset: tuple[Inexact[np.ndarray, "output input"], Inexact[np.ndarray, "output input"]],
) -> list[Inexact[np.ndarray, "input frequency"]]:
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        factors = block.factor(omega)
        v = block.solve(factors, omega, request.moves, request.forces, drive)
        residual, limit = drive.equations.first_residual(omega, loads, v)
        correction = factors.solve(residual)
        change = _relative(correction, v)
        inaccurate, moderate = ~(change < limit), change < ONCE_MORE
        again = np.flatnonzero(np.any(inaccurate & moderate, axis=0))
        if len(again):
            high, low = two_sum(v[..., again], correction[..., again])
            second = factors.select(again).solve(
                drive.equations.residual(omega[again], loads, high, low)
            )
            v[..., again], correction[..., again] = high, low + second
            inaccurate[:, again] = ~(moderate[:, again] & (_relative(second, high) < CONTRACTED))
        outputs = [
            _evaluate_output(form, high, low, v, correction)
            for form, high, low in zip(request.outputs, *offset, strict=True)
        ]
    values = [value for value, _ in outputs]
    for _, cancelled in outputs:
        if cancelled is not None:
            inaccurate |= cancelled
    where = inaccurate.nonzero()
    if len(where[0]):
        i, f = where
        refined = _refine(block, drive.equations, omega[f], loads.select(i), v[:, i, f])
        for n, form in enumerate(request.outputs):
            values[n][where] = _evaluate_output(form, offset[0][n, i], offset[1][n, i], *refined)[0]
    return values


def _relative(
    correction: Inexact[np.ndarray, "coordinate input frequency"],
    values: Inexact[np.ndarray, "coordinate input frequency"],
) -> Float[np.ndarray, "input frequency"]:
    """Largest relative correction of any coordinate."""
    return (np.abs(correction) / np.maximum(np.abs(values), TINY)).max(0)


def _static_offset(
    block: CondensedBlock, request: Request, *, relative: bool
) -> tuple[Inexact[np.ndarray, "output input"], Inexact[np.ndarray, "output input"]]:
    """Responses when v = 0, in double-double."""
    direct = DoubleDouble.of(request.direct)
    if not relative:
        return direct.high, direct.low
    form, moves = DoubleDouble.of(request.outputs), DoubleDouble.of(request.moves)
    real = direct + (form @ DoubleDouble.of(np.real(block.static))) @ moves
    if not np.iscomplexobj(block.static):
        return real.high, real.low
    imag = (form @ DoubleDouble.of(np.imag(block.static))) @ moves
    return real.high + 1j * imag.high, real.low + 1j * imag.low


def _evaluate_output(
    form: Float[np.ndarray, " coordinate"],
    offset: Inexact[np.ndarray, " input"],
    offset_low: Inexact[np.ndarray, " input"],
    high: Inexact[np.ndarray, "coordinate *value frequency"],
    low: Inexact[np.ndarray, "coordinate *value frequency"],
) -> tuple[Inexact[np.ndarray, "*value frequency"], Bool[np.ndarray, "*value frequency"] | None]:
    """Evaluate a linear form (c,) of coordinates (c, ..., f) in double-double, plus an offset.

    Also returns a mask of where it is far smaller than its terms (None if it has one term).
    """
    columns = form.nonzero()[0]
    shifted = bool(np.any(offset)) or bool(np.any(offset_low))
    if len(columns) == 1 and form[columns[0]] == 1.0 and not shifted:
        return high[columns[0]] + low[columns[0]], None
    broadcast = (lambda a: a[:, None]) if high.ndim > 2 else (lambda a: a)
    total, low_sum = broadcast(offset), broadcast(offset_low)
    size = np.abs(total)
    for c in columns:
        if form[c] == 1.0:
            term, error = high[c], low[c]
        else:
            term, error = _scale(form[c], high[c])
            error = error + form[c] * low[c]
        total, rounding = two_sum(total, term)
        low_sum = low_sum + (rounding + error)
        size = size + np.abs(term)
    result = total + low_sum
    return result, np.abs(result) < CANCELLED * size


def _scale(
    factor: float, values: Inexact[np.ndarray, "*shape"]
) -> tuple[Inexact[np.ndarray, "*shape"], Inexact[np.ndarray, "*shape"]]:
    """Multiply real or complex values by a double: rounded products and their errors."""
    if not np.iscomplexobj(values):
        return two_product(np.asarray(factor), values)
    real, imag = (
        two_product(np.asarray(factor), part) for part in (np.real(values), np.imag(values))
    )
    return real[0] + 1j * imag[0], real[1] + 1j * imag[1]


def _refine(
    block: CondensedBlock,
    equations: Equations,
    omega: Float[np.ndarray, " system"],
    loads: Loads,
    start: Inexact[np.ndarray, "coordinate system"],
) -> tuple[Inexact[np.ndarray, "coordinate system"], Inexact[np.ndarray, "coordinate system"]]:
    """Solve systems at `omega` (rad/s), each with one of `loads`, with pivoting in double-double.

    Initial solutions (`start`) that are not finite are replaced by 0.
    """
    matrix = block.matrices(omega)
    high = np.where(np.isfinite(start).all(0), start, 0.0)
    low = np.zeros_like(high)
    active, size = np.arange(len(omega)), np.full(len(omega), np.inf)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for _ in range(STEPS):
            residual = equations.residual(
                omega[active],
                loads.select(active),
                high[:, None, active],
                low[:, None, active],
                slices=FINE,
            )
            correction = dense(matrix[..., active], residual)[:, 0]
            relative_change = (np.abs(correction) / np.maximum(np.abs(high[:, active]), TINY)).max(
                0
            )
            improves = relative_change < size
            high[:, active[~np.isfinite(correction).all(0)]] = np.nan  # singular to the last bit
            correction = np.where(improves, correction, 0.0)
            total, rounding = two_sum(high[:, active], correction)
            total, rounding = two_sum(total, low[:, active] + rounding)
            high[:, active], low[:, active] = total, rounding
            unfinished = improves & ~(relative_change < CONVERGED)
            active, size = active[unfinished], relative_change[unfinished]
            if not len(active):
                break
    return high, low
