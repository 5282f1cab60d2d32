"""Responses in arithmetic of 50 digits, and how much the last digit of a model's numbers changes
them.

The numbers of a model are not all independent: moving everything together along x, y, z or by yaw
costs nothing, so in every row the elements towards the row's own body follow from those towards all
others. In double precision they obey that to their last digit only, and at 0.01 Hz some responses
are made of what is left after the first nine digits have cancelled. So here those elements are
taken from the others, in 50 digits; all else, roll and pitch of the support among it, is taken from
the model's matrices as they stand. `completed` spells it out. By yaw of all, a force that rounding
of the pose left unbalanced turns too: no more than the model's residual is taken for rounding.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mpmath
import numpy as np

from suspension_cli.linear import response, signals
from suspension_cli.linear.system import LinearSystem
from suspension_cli.linear.wire_term import WireTerm

MP: Any = mpmath.mp.clone()
MP.dps = 50
TOGETHER = (0, 1, 2, 5)
"""x, y, z and yaw among the support's coordinates."""
ROUNDING = 4e-15
"""Share of the sizes of its terms up to which a sum counts as 0."""


def eliminate(matrix: list[list[Any]], right: list[list[Any]]) -> list[list[Any]]:
    """Solve linear systems by elimination with partial pivoting; overwrites both arguments."""
    size = len(matrix)
    for n in range(size):
        pivot = max(range(n, size), key=lambda row: abs(complex(matrix[row][n])))
        for rows in (matrix, right):
            rows[n], rows[pivot] = rows[pivot], rows[n]
        beyond = [j for j in range(n + 1, size) if matrix[n][j]]
        driven = [j for j, value in enumerate(right[n]) if value]
        for row in range(n + 1, size):
            if matrix[row][n]:
                factor = matrix[row][n] / matrix[n][n]
                for j in beyond:
                    matrix[row][j] -= factor * matrix[n][j]
                for j in driven:
                    right[row][j] -= factor * right[n][j]
    for n in reversed(range(size)):
        beyond = [j for j in range(n + 1, size) if matrix[n][j]]
        for j in range(len(right[n])):
            value = right[n][j]
            for m in beyond:
                if right[m][j]:
                    value -= matrix[n][m] * right[m][j]
            right[n][j] = value / matrix[n][n] if value else value
    return right


@dataclass(frozen=True)
class Compared:
    """A response against the exact one, all (f, o, i).

    Attributes
    ----------
    exact : complex array
        Rounded to double precision at the end.
    error : array
        |found - exact| / |exact|, the difference taken in 50 digits; where exact is 0, found must
        be 0 too and this is 0.
    condition : array
        |y|^T (|K| + omega |C| + omega^2 |M|) |x| / |H| + |c| |x| / |H| for H = c x, D x = b, D y =
        c: what relative errors of 1 in every
        element of K, C, M and c (each alone) would do to H, to first order (Higham 2002,
        section 7.2). None unless requested.
    """

    exact: Any
    error: Any
    condition: Any = None


def compare(
    model: LinearSystem,
    frequency: Any,
    inputs: list[Any],
    outputs: list[Any],
    condition: bool = False,
) -> Compared:
    """`response.solve` against LU with partial pivoting in 50 digits, tips without mass included;
    by choice with the condition."""
    omega = 2 * np.pi * np.asarray(frequency, dtype=float)
    drives, rows = (
        np.array([signals.linear_form(signal, model) for signal in group])
        for group in (inputs, outputs)
    )
    acts = [signal.acts for signal in inputs]
    found, _ = response.transfer(model, omega, drives, acts, rows)
    parts = [_at(model, w, drives, acts, rows, found[n], condition) for n, w in enumerate(omega)]
    values, errors, conditions = zip(*parts, strict=True)
    return Compared(np.array(values), np.array(errors), np.array(conditions) if condition else None)


def completed(matrix: Any, model: LinearSystem) -> list[list[Any]]:
    """A matrix in 50 digits whose rows feel nothing when everything moves together, where they
    should: K_r,own = -sum of K_r,m R_m."""
    result = [[MP.mpf(float(value)) if value else MP.zero for value in row] for row in matrix]
    motion = model.rigid
    masses = np.diag(model.mass)[6 : 6 * len(model.body) + 6 : 6]
    unbalanced = float(10.0 * model.residual * masses.sum())
    follows: set[tuple[int, int]] = set()
    for r in range(6, model.size):
        name = model.coordinate[r].split(".")[0]
        own = 6 * (model.body.index(name) + 1) if name in model.body else 0
        for dof in TOGETHER:
            terms = [
                result[r][m] * MP.mpf(float(motion[m, dof]))
                for m in range(model.size)
                if motion[m, dof] and m != own + dof
            ]
            total, here = -sum(terms, MP.zero), result[r][own + dof]
            size = sum(map(abs, terms), MP.zero) + abs(here)
            if abs(total - here) <= ROUNDING * size + (unbalanced if dof == 5 else 0.0):
                result[r][own + dof] = total
                follows.add((r, own + dof))
    for r, c in follows:
        if c >= 6 and (c, r) not in follows:
            result[c][r] = result[r][c]
    return result


_KEPT: dict[int, Any] = {}


def elongation(form: Any, model: LinearSystem) -> dict[int, Any]:
    """A wire's elongation in 50 digits, by coordinate: 0 when everything moves together."""
    result = {int(n): MP.mpf(float(form[n])) for n in np.flatnonzero(form)}
    lowest = max(n // 6 for n in result if n < 6 * (len(model.body) + 1))
    for dof in TOGETHER:
        terms = [value * MP.mpf(float(model.rigid[n, dof])) for n, value in result.items()]
        if abs(sum(terms, MP.zero)) <= ROUNDING * sum(map(abs, terms), MP.zero):
            own = 6 * lowest + dof
            result[own] = result.get(own, MP.zero) - sum(terms, MP.zero)
    return result


def _matrices(model: LinearSystem) -> Any:
    """Stiffness of wires that keep their lengths, its imaginary part, damping and mass, and all
    elongations, in 50 digits; computed once a model (which is kept, so that its id stays its
    own)."""
    if id(model) not in _KEPT:
        mass = [[MP.mpf(float(value)) if value else MP.zero for value in row] for row in model.mass]
        parts = [completed(part, model) for part in (model.soft.real, np.imag(model.soft))]
        forms = [elongation(form, model) for form in model.elongation]
        _KEPT[id(model)] = model, (*parts, completed(model.damping, model), mass), forms
    return _KEPT[id(model)][1:]


def _at(
    model: LinearSystem,
    omega: float,
    drives: Any,
    acts: list[bool],
    rows: Any,
    found: Any,
    condition: bool,
) -> tuple[Any, Any, Any]:
    dynamic = _dynamic_at(model, omega)
    given = [
        [MP.zero if act else MP.mpf(float(v)) for v in drive[:6]]
        for drive, act in zip(drives, acts, strict=True)
    ]
    size = model.size - 6
    right: list[list[Any]] = [[] for _ in range(size)]
    for n in range(size):
        for drive, act, moved in zip(drives, acts, given, strict=True):
            value = MP.mpf(float(drive[6 + n])) if act else MP.zero
            right[n].append(
                value
                - sum((a * s for a, s in zip(dynamic[6 + n][:6], moved, strict=True) if s), MP.zero)
            )
        if condition:  # D is symmetric, so that D y = c gives it
            right[n] += [MP.mpf(float(row[6 + n])) for row in rows]
    solved = eliminate([row[6:] for row in dynamic[6:]], right)
    k, exact, error = len(drives), np.zeros(found.shape, dtype=complex), np.zeros(found.shape)
    whole = [[moved[n] for moved in given] for n in range(6)] + [row[:k] for row in solved]
    for o, row in enumerate(rows):
        for i in range(k):
            value = sum((MP.mpf(float(c)) * whole[n][i] for n, c in enumerate(row) if c), MP.zero)
            exact[o, i] = complex(value)
            # taken in 50 digits; its size in doubles
            difference = abs(complex(MP.mpc(complex(found[o, i])) - value))
            error[o, i] = (
                difference / abs(exact[o, i]) if value else (0.0 if found[o, i] == 0 else np.inf)
            )
    if not condition:
        return exact, error, None
    x, y = (
        abs(np.array([[complex(v) for v in row] for row in part]))
        for part in (whole, [row[k:] for row in solved])
    )
    full = model.complete
    size = abs(full.real) + abs(full.imag) + omega * abs(model.damping) + omega**2 * abs(model.mass)
    moved = y.T @ size[6:] @ x + abs(rows) @ x
    return exact, error, moved / np.where(exact == 0, 1.0, abs(exact))


def _dynamic_at(model: LinearSystem, omega: float) -> list[list[Any]]:
    """Dynamic stiffness with all terms of the frequency."""
    matrices, forms = _matrices(model)
    dynamic, k = _dynamic(*matrices, MP.mpf(float(omega))), np.array(model.k, dtype=complex)
    for term in model.terms:
        there = term.at(np.array([omega]))
        values = there.functions(range(len(term.compact)))
        for value, matrix in zip(values, term.compact, strict=True):
            factor = MP.mpc(complex(value[0]))
            for i, j in zip(*np.nonzero(matrix), strict=True):
                at = term.columns[i], term.columns[j]
                if model.allowed[at]:
                    dynamic[at[0]][at[1]] += factor * MP.mpf(float(matrix[i, j]))
        if isinstance(term, WireTerm):
            k[term.number] = 1 / complex(np.ravel(there.compliance)[0])
    for own, form in zip(k.tolist(), forms, strict=True):
        factor = MP.mpc(own) if own.imag else MP.mpf(own.real)
        for i, one in form.items():
            for j, other in form.items():
                if model.allowed[i, j]:
                    dynamic[i][j] += factor * one * other
    return dynamic


def _dynamic(stiffness: Any, loss: Any, damping: Any, mass: Any, w: Any) -> list[list[Any]]:
    """K + i w C - w^2 M."""

    def element(k: Any, h: Any, c: Any, m: Any) -> Any:
        real, imag = k - w * w * m if m else k, h + w * c
        return MP.mpc(real, imag) if imag else real

    return [
        [element(*values) for values in zip(*parts, strict=True)]
        for parts in zip(stiffness, loss, damping, mass, strict=True)
    ]
