"""Static condensation of massless coordinates.

Coordinates without inertia and damping, b, follow the others, a (with the support's), statically:

    x_b = K_bb^-1 (f_b - K_ba x_a),    (K_aa - K_ab K_bb^-1 K_ba) x_a + ... = f_a - K_ab K_bb^-1 f_b

(Guyan, AIAA J. 3, 380 (1965); exact here). Batches are condensed in doubles (`condense`); a single
system in double-double (`condense_double_double`), as a blade may be far softer than its wires.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.linear import double_double
from suspension_cli.linear.double_double import DoubleDouble
from suspension_cli.linear.small_matrices import solve_each

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Inexact, Int


@dataclass(frozen=True)
class Reduced:
    """Condensed stiffness (c, 6 + c) in double-double, towards support and kept coordinates."""

    real: DoubleDouble
    imag: DoubleDouble

    @property
    def lossy(self) -> bool:
        """Whether it has an imaginary part."""
        return bool(self.imag.high.any())

    def embedded(self, columns: slice) -> DoubleDouble:
        """Select columns as a real matrix: (c, q), or (2 c, 2 q) if lossy."""
        real, imag = self.real[:, columns], self.imag[:, columns]
        return _embedded(real, imag) if self.lossy else real


@dataclass(frozen=True)
class Condensed:
    """Condensed matrix; arrays with batch axes in front.

    Attributes
    ----------
    matrix
        K_aa - K_ab K_bb^-1 K_ba, towards further coordinates (the support's) and those kept.
    compliance
        K_bb^-1; NaN where K_bb is singular.
    follow
        K_bb^-1 K_ba: minus the motion of the massless coordinates per motion of the others.
    """

    matrix: Inexact[np.ndarray, "*batch kept _"]
    compliance: Inexact[np.ndarray, "*batch light light"]
    follow: Inexact[np.ndarray, "*batch light _"]


def condense(
    matrix: Inexact[np.ndarray, "*batch row column"], light: Bool[np.ndarray, " row"]
) -> Condensed:
    """Eliminate the coordinates `light` (n,) of matrices (..., n, q + n), in doubles.

    Two springs of 1 and 3 N/m in series:

    >>> condense(np.array([[3.0, -3.0], [-3.0, 4.0]]), np.array([False, True])).matrix
    array([[0.75]])
    """
    extra = matrix.shape[-1] - matrix.shape[-2]
    kept, massless = np.flatnonzero(~light), np.flatnonzero(light)
    columns = np.concatenate([np.arange(extra), extra + kept])
    block = matrix[..., massless[:, None], extra + massless]
    compliance = solve_each(block, np.eye(len(massless)))
    follow = compliance @ matrix[..., massless[:, None], columns]
    result = matrix[..., kept[:, None], columns]
    if len(massless):
        result = result - matrix[..., kept[:, None], extra + massless] @ follow
        square = result[..., extra:]
        result[..., extra:] = (square + np.swapaxes(square, -1, -2)) / 2
    return Condensed(result, compliance, follow)


def change_basis(
    full: Inexact[np.ndarray, "row 6+row"],
    low: Inexact[np.ndarray, "row 6+row"],
    basis: Float[np.ndarray, "6+row 6+row"],
) -> tuple[Inexact[np.ndarray, "row 6+row"], Inexact[np.ndarray, "row 6+row"]]:
    """Change rows of a matrix and their low parts to new coordinates.

    Old coordinates = basis @ new.
    """
    transposed, new_basis = DoubleDouble.of(basis[6:, 6:].T), DoubleDouble.of(basis)
    real, imag = (
        transposed @ DoubleDouble(*parts) @ new_basis
        for parts in ((np.real(full), np.real(low)), (np.imag(full), np.imag(low)))
    )
    return (
        (real.high + 1j * imag.high, real.low + 1j * imag.low)
        if np.iscomplexobj(full)
        else (real.high, real.low)
    )


def _embedded(real: DoubleDouble, imag: DoubleDouble) -> DoubleDouble:
    """Write A + i B as the real matrix ((A, -B), (B, A))."""
    high = np.block([[real.high, -imag.high], [imag.high, real.high]])
    return DoubleDouble(high, np.block([[real.low, -imag.low], [imag.low, real.low]]))


def condense_double_double(
    full: Inexact[np.ndarray, "row 6+row"],
    low: Inexact[np.ndarray, "row 6+row"],
    light: Bool[np.ndarray, " row"],
) -> tuple[Reduced, Inexact[np.ndarray, "light _"]]:
    """Eliminate the coordinates `light` (n,) of rows of a stiffness (n, 6 + n) in double-double.

    Above a blade much softer than its wires nearly all of their stiffness cancels. Returns K_aa -
    K_ab K_bb^-1 K_ba (c, 6 + c), and in doubles K_bb^-1 K_ba (m, 6 + c).
    """

    def part(
        rows: Int[np.ndarray, " row"], columns: Int[np.ndarray, " column"]
    ) -> tuple[DoubleDouble, DoubleDouble]:
        where = np.ix_(rows, columns)
        return DoubleDouble(np.real(full)[where], np.real(low)[where]), DoubleDouble(
            np.imag(full)[where], np.imag(low)[where]
        )

    kept_rows, columns = (
        np.flatnonzero(~light),
        np.concatenate([np.arange(6), 6 + np.flatnonzero(~light)]),
    )
    massless, massless_columns = np.flatnonzero(light), 6 + np.flatnonzero(light)
    kept = part(kept_rows, columns)
    if not len(massless):
        return Reduced(*kept), np.zeros((0, len(columns)))
    (real, imag), count = part(massless, columns), len(massless)
    if not np.imag(full).any() and not np.imag(low).any():
        follow = double_double.solve(part(massless, massless_columns)[0], real)
        lossless = kept[0] - part(kept_rows, massless_columns)[0] @ follow
        return Reduced(lossless, kept[1]), follow.value
    follow = double_double.solve(
        _embedded(*part(massless, massless_columns)), DoubleDouble.concatenated([real, imag])
    )
    subtracted = _embedded(*part(kept_rows, massless_columns)) @ follow
    result = Reduced(kept[0] - subtracted[: len(kept_rows)], kept[1] - subtracted[len(kept_rows) :])
    return result, follow.value[:count] + 1j * follow.value[
        count:
    ] if result.lossy else follow.value[:count]


def rounded(
    stiffness: Reduced,
) -> tuple[Inexact[np.ndarray, "kept 6+kept"], Inexact[np.ndarray, "kept 6+kept"]]:
    """Round the stiffness to exactly symmetric doubles; also return its low parts."""
    parts = []
    for part in (stiffness.real, stiffness.imag):
        high = part.high.copy()
        high[:, 6:] = (high[:, 6:] + high[:, 6:].T) / 2
        parts.append((high, (part - DoubleDouble.of(high)).value))
    (real, low), (imag, imag_low) = parts
    return (real + 1j * imag, low + 1j * imag_low) if stiffness.lossy else (real, low)


def static_response(
    stiffness: Reduced, rigid: Float[np.ndarray, "kept 6"], free: Bool[np.ndarray, " 6"]
) -> Inexact[np.ndarray, "kept 6"]:
    """Compute the static response S = -K^-1 K_s to motions of the support.

    It is the `rigid` motion where that causes no force (`free`); otherwise solved in
    double-double, not finite where K is singular.
    """
    count = len(stiffness.real.high)
    solution = -double_double.solve(
        stiffness.embedded(slice(6, None)), stiffness.embedded(slice(0, 6))
    ).value
    result = solution[:count, :6] + 1j * solution[count:, :6] if stiffness.lossy else solution
    result[:, free] = rigid[:, free]
    return result


def residual_coupling(
    matrix: Inexact[np.ndarray, "kept 6+kept"],
    low: Inexact[np.ndarray, "kept 6+kept"],
    static: Inexact[np.ndarray, "kept 6"],
) -> tuple[Inexact[np.ndarray, "kept 6"], Inexact[np.ndarray, "kept 6"]]:
    """Compute A_s + A S in double-double, A with its low part."""
    complete = Reduced(
        DoubleDouble(np.real(matrix), np.real(low)), DoubleDouble(np.imag(matrix), np.imag(low))
    )
    of, towards = slice(6, None), slice(0, 6)
    real = complete.real[:, towards] + complete.real[:, of] @ DoubleDouble.of(np.real(static))
    if not (np.iscomplexobj(matrix) or np.iscomplexobj(static)):
        return real.high, real.low
    imag = complete.imag[:, towards] + complete.imag[:, of] @ DoubleDouble.of(np.real(static))
    real = real - complete.imag[:, of] @ DoubleDouble.of(np.imag(static))
    imag = imag + complete.real[:, of] @ DoubleDouble.of(np.imag(static))
    return real.high + 1j * imag.high, real.low + 1j * imag.low


def resonances(
    stiffness: Float[np.ndarray, "kept 6+kept"], mass: Float[np.ndarray, "kept 6+kept"]
) -> Float[np.ndarray, " mode"]:
    """Undamped resonances, ascending, in rad/s; 0 for rigid or unstable modes."""
    heavy = (mass[:, 6:] != 0).any(1)
    positions = np.flatnonzero(heavy)
    reduced = condense(stiffness[:, 6:], ~heavy).matrix
    root = np.linalg.inv(np.linalg.cholesky(mass[np.ix_(positions, positions + 6)]))
    dynamic = root @ reduced @ root.T
    return np.sqrt(np.maximum(np.linalg.eigvalsh((dynamic + dynamic.T) / 2), 0.0))
