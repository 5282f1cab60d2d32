"""Responses by LU with pivoting in 80 bits (`numpy.longdouble` on x86), from a model's own numbers.

The stiffness of stretching is kept apart as in `linear.pencil`, but all coordinates, those of the
system, are solved at once. Nothing resists when all moves together along x, y, z or by yaw, which
rounded numbers obey to their last digit only; below the modes that digit is what is left. So the
elements of each row towards its own body are taken from the others, unless they differ by more than
rounding.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from suspension_cli.linear.frequency_terms import WireTerm
from suspension_cli.linear.system import LinearSystem

IS_WIDE = np.finfo(np.longdouble).eps < 2e-19
TOGETHER = (0, 1, 2, 5)
"""x, y, z and yaw among the support's coordinates."""
ROUNDING = 4e-15


def solve(model: LinearSystem, omega: float, moves: Any, forces: Any) -> Any:
    """All coordinates (N, i) at omega (rad/s), given those of the support (6, i) and forces."""
    wide, w = np.clongdouble, np.longdouble(omega)
    owner = np.array([name.split(".")[0] for name in model.coordinate])
    own = np.array([model.body.index(n) + 1 if n in model.body else 0 for n in owner])
    whole = completed(model.soft, own, model) - w**2 * model.mass.astype(wide)
    whole += 1j * w * completed(model.damping, own, model)
    rows, compliance = [np.zeros((0, model.size), dtype=wide)], []
    for term in model.terms:
        there = term.at(np.array([omega]))
        at = np.ix_(term.columns, term.columns)
        for value, matrix in zip(
            there.functions(range(len(term.compact))), term.compact, strict=True
        ):
            whole[at] += value.astype(wide)[0] * matrix.astype(wide)
        if isinstance(term, WireTerm):
            rows.append(completed(2 * term.forms["stretch"][:, 1], None, model))
            compliance += [there.compliance.astype(wide).reshape(-1)[0]] * len(rows[-1])
    if not compliance:
        rows.append(completed(model.elongation, None, model))
        compliance = list(1 / model.k.astype(wide))
    stretch = np.concatenate(rows)
    equations = np.block([[whole[6:], stretch[:, 6:].T], [stretch, -np.diag(compliance)]])
    if not compliance:
        equations = whole[6:]
    right = -equations[:, :6] @ moves.astype(wide)
    right[: model.size - 6] += forces[6:]
    return np.concatenate([moves, lu_solve(equations[:, 6:], right)[: model.size - 6]])


def completed(matrix: Any, own: Any, model: LinearSystem) -> Any:
    """Take elements towards a row's own body (by default the lowest) from those towards others."""
    result, rigid = matrix.astype(np.clongdouble), model.rigid
    for n in range(len(matrix)):
        if own is None:
            body = max(m // 6 for m in np.flatnonzero(matrix[n]) if m < 6 * (len(model.body) + 1))
        else:
            body = own[n]
        for dof in TOGETHER if rigid is not None else ():
            terms = result[n] * rigid[:, dof].astype(np.longdouble)
            for part in (1.0, 1j):
                size = np.abs(terms.real if part == 1.0 else terms.imag)
                total = (terms.real if part == 1.0 else terms.imag).sum()
                if abs(total) <= ROUNDING * size.sum():
                    result[n, 6 * body + dof] -= part * total
    return result


def lu_solve(matrix: Any, right: Any) -> Any:
    """Solve by LU with partial pivoting, after scaling by powers of 2."""
    scale = np.ones(len(matrix), dtype=np.longdouble)
    for _ in range(3):
        scaled = scale[:, None] * matrix * scale
        size = np.abs(scaled).max(1).astype(float)
        scale *= np.exp2(-np.rint(np.log2(np.where(size > 0, size, 1.0)) / 2))
    a, b = scale[:, None] * matrix * scale, scale[:, None] * right
    for n in range(len(a)):
        pivot = n + int(np.abs(a[n:, n]).argmax())
        a[[n, pivot]], b[[n, pivot]] = a[[pivot, n]], b[[pivot, n]]
        factor = a[n + 1 :, n, None] / a[n, n]
        a[n + 1 :, n:] -= factor * a[n, n:]
        b[n + 1 :] -= factor * b[n]
    x = np.zeros_like(b)
    for n in reversed(range(len(a))):
        x[n] = (b[n] - a[n, n + 1 :] @ x[n + 1 :]) / a[n, n]
    return scale[:, None] * x
